"""Changes of the shape as a whole: scaling, and missing parts."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import trimesh
from scipy.sparse.csgraph import dijkstra

from perturb.perturbation import (
    Parameters,
    Perturbation,
    PerturbationError,
    Perturbed,
    edge_graph,
    without_faces,
)


@dataclass(frozen=True)
class Scaling(Perturbation):
    """All coordinates are multiplied by `amount`, a factor above 0; a factor of 1 is the identity.

    Source: paper section 6.6, Figure 14. Nothing is left to chance.
    """

    amount: float = 1.5
    unit: str = "factor"

    name: ClassVar[str] = "scaling"
    neutral: ClassVar[float] = 1.0
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("factor",)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_number("amount", positive=True)

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        with np.errstate(over="ignore"):  # an overflow is an unusable result, and refused as one
            vertices = self.amount * np.asarray(mesh.vertices)
        scaled = trimesh.Trimesh(vertices, mesh.faces.copy(), process=False)
        return self._finish(mesh, scaled, np.arange(len(vertices)))


@dataclass(frozen=True)
class MissingParts(Perturbation):
    """A part is cut off: its vertices, all faces that touch them, and vertices that lose their last face.

    amount : the share of vertices in the part, 0 to below 1; round(amount * n) of them.
    shape : geodesic_ball, the vertices nearest to a random one along the edges (those on other components
        come last, by straight distance); plane, the vertices farthest in a random direction.

    What is left is left as it is, even if it falls into several components; `applied` counts them.
    Source: paper section 6.2, Figure 8, which does not say how much is missing.
    """

    amount: float = 0.1
    unit: str = "share_of_vertices"
    shape: str = "geodesic_ball"

    name: ClassVar[str] = "missing_parts"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": ("share_of_vertices",),
        "shape": ("geodesic_ball", "plane"),
    }

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_number("amount", most=1)
        if self.amount == 1:
            raise PerturbationError("missing_parts: amount is 1, which leaves nothing; it must be below 1")

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """`centre`: the vertex in the middle of the ball; or `direction` (3,): a unit vector."""
        if self.shape == "geodesic_ball":
            return {"centre": int(rng.choice(np.unique(mesh.faces)))}
        direction = rng.standard_normal(3)
        return {"direction": direction / np.linalg.norm(direction)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        vertices = np.asarray(mesh.vertices)
        if self.shape == "geodesic_ball":
            centre = parameters["centre"]
            along_surface = dijkstra(edge_graph(mesh).tocsr(), indices=centre)
            straight = np.linalg.norm(vertices - vertices[centre], axis=1)
            order = np.lexsort((straight, along_surface))
        else:
            order = np.argsort(-vertices @ parameters["direction"], kind="stable")
        part = np.zeros(len(vertices), dtype=bool)
        part[order[: round(self.amount * len(vertices))]] = True
        dropped = part[mesh.faces].any(axis=1)
        rest, counterpart = without_faces(mesh, dropped)
        return self._finish(
            mesh,
            rest,
            counterpart,
            vertices_removed=int(np.count_nonzero(counterpart < 0)),
            triangles_removed=int(np.count_nonzero(dropped)),
        )
