"""Floaters: specks of surface that hover near the shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._drawing import draw
from perturb._normals import is_degenerate
from perturb.meshes import LENGTHS, as_trimesh, vertex_normals
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh

_CORNERS = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(8)  # a tetrahedron with edges of 1
_FACES = np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])  # wound so that normals point outwards


@dataclass(frozen=True)
class Floaters(Perturbation):
    """Add small regular tetrahedra that float near the surface, as in scans with reflections or dust.

    Parameters
    ----------
    amount : float
        How many specks, relative to the vertices or as a number, depending on `unit`.
    unit : str
        "share_of_vertices": 0 to 1; ``round(amount * n)`` of the n vertices with faces get a speck. "count": a number
        of specks.
    distance : float
        From the vertex to the centre of its speck, in mean edge lengths.
    size : float
        The edges of the specks, in mean edge lengths, above 0.

    Notes
    -----
    The vertices are drawn uniformly and without replacement. A speck lies in a random direction from its vertex, on the
    side to which the vertex normal (`perturb.vertex_normals`) points, and is rotated at random; it may come to lie
    inside another part of the shape. Original vertices keep their indices, those of the specks follow, and no original
    vertex has its counterpart on a speck.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> perturbed = perturb.Floaters(amount=3, unit="count")(sphere, np.random.default_rng(0))
    >>> perturbed.applied["components_before"], perturbed.applied["components_after"]
    (1, 4)
    >>> perturbed.mesh.is_watertight
    True
    """

    amount: float = 0.01
    unit: str = "share_of_vertices"
    distance: float = 3.0
    size: float = 1.0

    name: ClassVar[str] = "floaters"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_vertices", "count")}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.unit == "share_of_vertices":
            self.check_number("amount", maximum=1)
        else:
            self.check_number("amount", whole=True)
        self.check_number("distance")
        self.check_number("size", positive=True)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `vertices` (k,), `directions` (k, 3), unit vectors, and `rotations` (k, 3, 3)."""
        from scipy.spatial.transform import Rotation

        used = np.unique(mesh.faces)
        count = round(self.amount * len(used)) if self.unit == "share_of_vertices" else int(self.amount)
        vertices = draw(self, used, count, rng, "vertices with faces")
        directions = rng.standard_normal((count, 3))
        quaternions = rng.standard_normal((count, 4))
        return {
            "vertices": vertices,
            "directions": directions / np.linalg.norm(directions, axis=1, keepdims=True),
            "rotations": Rotation.from_quat(quaternions).as_matrix() if count else np.empty((0, 3, 3)),
        }

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        at, directions = parameters["vertices"], parameters["directions"]
        inwards = (vertex_normals(mesh)[at] * directions).sum(axis=1) < 0
        edge = LENGTHS["mean_edge_length"](mesh)
        centres = np.asarray(mesh.vertices)[at] + self.distance * edge * np.where(inwards[:, None], -1, 1) * directions
        corners = (centres[:, None] + self.size * edge * (_CORNERS @ parameters["rotations"])).reshape(-1, 3)
        faces = (_FACES + 4 * np.arange(len(at))[:, None, None]).reshape(-1, 3)
        if is_degenerate(corners, faces).any():
            raise PerturbationError(
                f"floaters: specks of size {self.size * edge:.3g} are lost in the rounding of coordinates of up to "
                f"{np.abs(mesh.vertices).max():.3g}; choose a larger size, or move the mesh to the origin"
            )
        n_vertices = len(mesh.vertices)
        return self.finish(
            mesh,
            as_trimesh(np.concatenate([mesh.vertices, corners]), np.concatenate([mesh.faces, faces + n_vertices])),
            np.arange(n_vertices),
            specks=len(at),
            vertices_added=len(corners),
        )
