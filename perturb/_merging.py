"""Merging vertices of a mesh into others."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from perturb._normals import has_repeated_corner
from perturb.meshes import as_trimesh

if TYPE_CHECKING:
    import trimesh


def merge_vertices(
    vertices: np.ndarray, faces: np.ndarray, into: np.ndarray
) -> tuple[trimesh.Trimesh, np.ndarray, int]:
    """Merge each vertex into another one, and remove the faces of which two corners become the same vertex.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    into : (n,) int array
        The vertex into which each vertex is merged, or the vertex itself. A vertex that others are merged into remains.

    Returns
    -------
    mesh : trimesh.Trimesh
        The remaining vertices and faces, in their previous order. Vertices that already had no face are kept.
    counterpart : (n,) int array
        The index of each vertex, or of the one into which it was merged; -1 if that one lost its last face.
    n_collapsed : int
        The number of removed faces.
    """
    merged = into[faces]
    collapsed = has_repeated_corner(merged) & ~has_repeated_corner(faces)
    kept = np.ones(len(vertices), dtype=bool)
    kept[faces] = False
    kept[merged[~collapsed]] = True
    index = np.where(kept, np.cumsum(kept) - 1, -1)
    return as_trimesh(vertices[kept], index[merged[~collapsed]]), index[into], int(np.count_nonzero(collapsed))
