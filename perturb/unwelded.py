"""Unwelded faces: triangles that lie next to each other but share no vertices."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._drawing import OnShareOfFaces
from perturb.meshes import as_trimesh
from perturb.perturbation import Parameters, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Unwelded(OnShareOfFaces):
    """Cut faces loose: each gets vertices of its own, at the same positions; at 1 the mesh is a triangle soup.

    Parameters
    ----------
    amount : float
        The share of faces that are cut loose, 0 to 1.
    unit : str
        "share_of_faces".

    Notes
    -----
    Faces are drawn uniformly and without replacement. Files whose format has no indices, such as STL, contain such
    meshes, and so do exports that split vertices at seams of textures or normals. The counterpart of a vertex is the
    vertex itself, which remains a corner of its faces that are not loose; if all of them are loose, of the first.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> soup = perturb.Unwelded(amount=1)(sphere, np.random.default_rng(0))
    >>> soup.applied["components_after"], len(soup.mesh.vertices) == 3 * len(sphere.faces)
    (1280, True)
    >>> bool((soup.mesh.triangles == sphere.triangles).all())
    True
    """

    name: ClassVar[str] = "unwelded"

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        faces, n_vertices = np.array(mesh.faces), len(mesh.vertices)
        loose = np.zeros(len(faces), dtype=bool)
        loose[parameters["faces"]] = True
        used, first = np.unique(faces[loose], return_index=True)
        # Corners that keep their vertex, because no other face has it.
        own = np.zeros(3 * np.count_nonzero(loose), dtype=bool)
        own[first[~np.isin(used, faces[~loose])]] = True
        corners = faces[loose].ravel()
        copied = corners[~own]
        corners[~own] = n_vertices + np.arange(len(copied))
        faces[loose] = corners.reshape(-1, 3)
        if loose.any() and len(copied) == 0:
            raise PerturbationError(
                "unwelded: none of the faces that were drawn shares a vertex with another one: they are loose already"
            )
        return self.finish(
            mesh,
            as_trimesh(np.concatenate([mesh.vertices, np.asarray(mesh.vertices)[copied]]), faces),
            np.arange(n_vertices),
            faces_cut_loose=int(np.count_nonzero(loose)),
            vertices_added=len(copied),
        )
