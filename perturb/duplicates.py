"""Duplicate faces: triangles that occur twice."""

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
class Duplicates(OnShareOfFaces):
    """Write faces twice, with the same three vertices.

    Parameters
    ----------
    amount : float
        The share of faces that are written twice, 0 to 1.
    unit : str
        "share_of_faces".
    winding : str
        "same": the second copy is wound like the first. "opposite": the other way, as in two-sided meshes.

    Notes
    -----
    Faces are drawn uniformly and without replacement; their copies follow all other faces. Vertices are unchanged.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> two_sided = perturb.Duplicates(amount=1, winding="opposite")(sphere, np.random.default_rng(0))
    >>> len(sphere.faces), len(two_sided.mesh.faces)
    (1280, 2560)
    """

    winding: str = "same"

    name: ClassVar[str] = "duplicates"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {**OnShareOfFaces.choices, "winding": ("same", "opposite")}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        copies = np.asarray(mesh.faces)[parameters["faces"]]
        if self.winding == "opposite":
            copies = copies[:, ::-1]
        return self.finish(
            mesh,
            as_trimesh(mesh.vertices, np.concatenate([mesh.faces, copies])),
            np.arange(len(mesh.vertices)),
            faces_duplicated=len(copies),
        )
