"""Noise on the vertices, along their normals."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import trimesh

from perturb.perturbation import LENGTHS, Parameters, Perturbation, PerturbationError, Perturbed, moved


@dataclass(frozen=True)
class NormalNoise(Perturbation):
    """Every vertex moves along its angle-weighted normal by a random signed length.

    amount : the standard deviation (gaussian) or the largest length (uniform, in ±amount), in `unit`.
    unit : mean_edge_length (Table 2's reading) or bounding_box_diagonal (Figure 9).

    Vertices that have no normal (no face, or only degenerate ones) stay where they are.
    Source: paper section 6.3, which leaves the unit of Table 2's levels open.
    """

    amount: float = 0.34
    unit: str = "mean_edge_length"
    distribution: str = "gaussian"

    name: ClassVar[str] = "normal_noise"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": tuple(LENGTHS),
        "distribution": ("gaussian", "uniform"),
    }

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """`lengths` (n,): signed lengths as multiples of amount."""
        n = len(mesh.vertices)
        gaussian = self.distribution == "gaussian"
        return {"lengths": rng.standard_normal(n) if gaussian else rng.uniform(-1.0, 1.0, n)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        scale = self.amount * LENGTHS[self.unit](mesh)
        displacement = scale * parameters["lengths"][:, None] * _vertex_normals(mesh)
        length = np.linalg.norm(displacement, axis=1)
        return self._finish(
            mesh,
            *moved(mesh, displacement),
            absolute_amount=float(scale),
            vertices_moved=int(np.count_nonzero(length)),
            largest_displacement=float(length.max()),
        )


@dataclass(frozen=True)
class ShotNoise(Perturbation):
    """Some vertices become spikes: they move by a fixed height along or against their angle-weighted normal.

    amount : the share of vertices that become spikes, 0 to 1; round(amount * n) of them do.
    height : how far a spike moves, in `height_unit`: mean_edge_length (Table 2's reading) or
        bounding_box_diagonal (Figure 10, where the share is fixed and the height is swept).

    Source: paper section 6.4.
    """

    amount: float = 0.06
    unit: str = "share_of_vertices"
    height: float = 1.0
    height_unit: str = "mean_edge_length"

    name: ClassVar[str] = "shot_noise"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_vertices",), "height_unit": tuple(LENGTHS)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_number("amount", most=1)
        self._check_number("height")

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """`vertices` (k,): the spikes; `signs` (k,): 1.0 outwards, -1.0 inwards."""
        count = round(self.amount * len(mesh.vertices))
        movable = np.flatnonzero(_vertex_normals(mesh).any(axis=1))
        if count > len(movable):
            raise PerturbationError(
                f"shot_noise: {count} spikes are asked for, but only {len(movable)} of {len(mesh.vertices)} "
                "vertices have a normal; lower the amount, or clean the mesh"
            )
        return {
            "vertices": rng.choice(movable, count, replace=False),
            "signs": rng.choice([-1.0, 1.0], count),
        }

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        spikes = parameters["vertices"]
        height = self.height * LENGTHS[self.height_unit](mesh)
        displacement = np.zeros((len(mesh.vertices), 3))
        displacement[spikes] = height * parameters["signs"][:, None] * _vertex_normals(mesh)[spikes]
        return self._finish(
            mesh,
            *moved(mesh, displacement),
            absolute_height=float(height),
            vertices_moved=int(np.count_nonzero(displacement.any(axis=1))),
        )


def _vertex_normals(mesh: trimesh.Trimesh) -> np.ndarray:
    """(n, 3) unit normals, weighted by the angles of the corners; zero where a vertex has none.

    Weights by angle, and not by area, do not depend on how the surface is cut into triangles
    (Thürmer and Wüthrich 1998, doi:10.1080/10867651.1998.10487487).
    """
    # At unit size, because trimesh takes small cross products for degenerate faces on an absolute scale.
    vertices = (np.asarray(mesh.vertices) - mesh.bounds[0]) / mesh.extents.max()
    return trimesh.Trimesh(vertices, mesh.faces, process=False).vertex_normals
