"""Parts of the shape cut off."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb.meshes import edge_graph, random_direction, size_exponent, without_faces
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class MissingParts(Perturbation):
    """Cut off a part: its vertices, all faces that touch them, and vertices that lose their last face.

    Parameters
    ----------
    amount : float
        The share of vertices in the part, at least 0 and below 1; the part has ``round(amount * n)`` vertices.
    unit : str
        "share_of_vertices".
    shape : str
        "geodesic_ball": the vertices nearest to a random vertex along the edges; those on other components come last,
        by distance in space. "plane": the vertices that are farthest in a random direction.

    Notes
    -----
    The remainder is not processed further, even if it falls into several components; `Perturbed.applied` counts them.

    References
    ----------
    Paper, section 6.2 and Figure 8, which do not specify how much is missing.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> perturbed = perturb.MissingParts(amount=0.25)(sphere, np.random.default_rng(0))
    >>> int((perturbed.counterpart == -1).sum()), round(0.25 * len(sphere.vertices))
    (160, 160)
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
        self.check_number("amount", maximum=1)
        if self.amount == 1:
            raise PerturbationError("missing_parts: amount is 1, which removes everything; it must be below 1")

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `centre`, the vertex at the centre of the ball, or `direction` (3,), a unit vector."""
        if self.shape == "geodesic_ball":
            return {"centre": int(rng.choice(np.unique(mesh.faces)))}
        return {"direction": random_direction(rng)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        n_vertices = len(mesh.vertices)
        part = np.zeros(n_vertices, dtype=bool)
        part[self._removal_order(mesh, parameters)[: round(self.amount * n_vertices)]] = True
        dropped = np.asarray(part[mesh.faces].any(axis=1))
        rest, counterpart = without_faces(mesh, dropped)
        return self.finish(
            mesh,
            rest,
            counterpart,
            vertices_removed=int(np.count_nonzero(counterpart < 0)),
            triangles_removed=int(np.count_nonzero(dropped)),
        )

    def _removal_order(self, mesh: trimesh.Trimesh, parameters: Parameters) -> np.ndarray:
        """(n,) the vertices in the order in which a growing part takes them."""
        from scipy.sparse.csgraph import dijkstra

        vertices = np.asarray(mesh.vertices)
        if self.shape == "plane":
            return np.argsort(-vertices @ parameters["direction"], kind="stable")
        centre = parameters["centre"]
        along_edges = dijkstra(edge_graph(mesh).tocsr(), indices=centre)
        in_space = np.linalg.norm(np.ldexp(vertices - vertices[centre], -size_exponent(mesh)), axis=1)
        return np.lexsort((in_space, along_edges))
