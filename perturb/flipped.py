"""Flipped faces: triangles that are wound the other way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._drawing import draw
from perturb.meshes import as_trimesh
from perturb.perturbation import Parameters, Perturbation, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Flipped(Perturbation):
    """Turn faces over: their corners are listed in reverse order, so their normals point to the other side.

    Parameters
    ----------
    amount : float
        The share of faces that are turned over, 0 to 1.
    unit : str
        "share_of_faces".

    Notes
    -----
    Faces are drawn uniformly and without replacement. The surface as a set of points is unchanged: a method that does
    not depend on windings yields the same result.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> flipped = perturb.Flipped(amount=0.1)(sphere, np.random.default_rng(0))
    >>> flipped.applied["faces_flipped"], flipped.mesh.is_winding_consistent
    (128, False)
    """

    amount: float = 0.1
    unit: str = "share_of_faces"

    name: ClassVar[str] = "flipped"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_faces",)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=1)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `faces` (k,), those that are turned over."""
        n_faces = len(mesh.faces)
        return {"faces": draw(self, np.arange(n_faces), round(self.amount * n_faces), rng, "faces")}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        faces, drawn = np.array(mesh.faces), parameters["faces"]
        faces[drawn] = faces[drawn, ::-1]
        return self.finish(
            mesh, as_trimesh(mesh.vertices, faces), np.arange(len(mesh.vertices)), faces_flipped=len(drawn)
        )
