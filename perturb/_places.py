"""Random places on a surface."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from perturb.meshes import LENGTHS
from perturb.perturbation import PerturbationError

if TYPE_CHECKING:
    import trimesh


def draw_places(mesh: trimesh.Trimesh, count: int, rng: np.random.Generator, name: str) -> np.ndarray:
    """(count,) different vertices, all parts of the surface being equally likely, whatever its triangles are.

    Raises
    ------
    PerturbationError
        If fewer vertices have a face with an area; ``name`` is that of the perturbation.
    """
    area = vertex_areas(mesh)
    available = int(np.count_nonzero(area))
    if count > available:
        raise PerturbationError(
            f"{name}: {count} places were requested, but only {available} vertices have a face with an area; lower the "
            "number of places"
        )
    return rng.choice(len(area), count, replace=False, p=area / area.sum())


def vertex_areas(mesh: trimesh.Trimesh) -> np.ndarray:
    """(n,) the area of the faces at each vertex, relative to the square of the bounding-box diagonal."""
    from trimesh.triangles import area

    corners = (np.asarray(mesh.vertices) - mesh.bounds[0])[mesh.faces] / LENGTHS["bounding_box_diagonal"](mesh)
    return np.bincount(np.ravel(mesh.faces), np.repeat(area(corners), 3), minlength=len(mesh.vertices))
