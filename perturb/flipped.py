"""Flipped faces: triangles that are wound the other way."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._drawing import OnShareOfFaces
from perturb.meshes import as_trimesh
from perturb.perturbation import Parameters, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Flipped(OnShareOfFaces):
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

    name: ClassVar[str] = "flipped"

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        faces, drawn = np.array(mesh.faces), parameters["faces"]
        faces[drawn] = faces[drawn, ::-1]
        return self.finish(
            mesh, as_trimesh(mesh.vertices, faces), np.arange(len(mesh.vertices)), faces_flipped=len(drawn)
        )
