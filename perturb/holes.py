"""Holes in the surface."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._drawing import draw
from perturb.meshes import without_faces
from perturb.perturbation import Parameters, Perturbation, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Holes(Perturbation):
    """Remove random triangles, and the vertices that thereby lose their last triangle.

    Parameters
    ----------
    amount : float
        How many triangles, which share of them, or how many 1-rings, depending on `unit`.
    unit : str
        "triangles": a number of triangles (how Table 2 is read here). "share_of_triangles": 0 to 1 (Figure 12).
        "one_rings": a number of vertices of which all triangles are removed (another reading of section 6.5).

    Notes
    -----
    Triangles and vertices are drawn uniformly and without replacement. 1-rings may overlap.

    References
    ----------
    Paper, section 6.5.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> perturbed = perturb.Holes(amount=0.2, unit="share_of_triangles")(sphere, np.random.default_rng(0))
    >>> len(sphere.faces), len(perturbed.mesh.faces)
    (1280, 1024)
    """

    amount: float = 58
    unit: str = "triangles"

    name: ClassVar[str] = "holes"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("triangles", "share_of_triangles", "one_rings")}

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.unit == "share_of_triangles":
            self.check_number("amount", maximum=1)
        else:
            self.check_number("amount", whole=True)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `triangles` (k,), the faces to remove, or `vertices` (k,), the centres of the 1-rings to remove."""
        if self.unit == "one_rings":
            return {"vertices": draw(self, np.unique(mesh.faces), int(self.amount), rng, "vertices with faces")}
        n_faces = len(mesh.faces)
        count = round(self.amount * n_faces) if self.unit == "share_of_triangles" else int(self.amount)
        return {"triangles": draw(self, np.arange(n_faces), count, rng, "triangles")}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        dropped = triangles_of(mesh, parameters)
        rest, counterpart = without_faces(mesh, dropped)
        return self.finish(
            mesh,
            rest,
            counterpart,
            triangles_removed=int(np.count_nonzero(dropped)),
            vertices_removed=int(np.count_nonzero(counterpart < 0)),
        )


def triangles_of(mesh: trimesh.Trimesh, parameters: Parameters) -> np.ndarray:
    """(m,) bool: the `triangles` that were drawn, or all triangles at the `vertices` that were drawn."""
    if "vertices" in parameters:
        return np.asarray(np.isin(mesh.faces, parameters["vertices"]).any(axis=1))
    drawn = np.zeros(len(mesh.faces), dtype=bool)
    drawn[parameters["triangles"]] = True
    return drawn
