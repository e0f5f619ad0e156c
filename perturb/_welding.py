"""Vertices that coincide: MeshLab merges them, which would join parts of a mesh that are not connected."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    import pymeshlab

SPARSE = 0.1  # components smaller than this share of the mesh are moved together
LATTICE_SPACING = 4.0  # box sizes; more than the diagonal of a box, plus its size


def count_coincident(vertices: np.ndarray, faces: np.ndarray) -> int:
    """Return how many vertices with faces would vanish if those at the same position were merged."""
    used = vertices[np.unique(faces)]
    return len(used) - len(np.unique(used, axis=0))


def separate_coincident(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(n, 3) the vertices; those at the same position as an earlier one are moved by a few units of rounding.

    MeshLab merges vertices whose coordinates are equal to the last digit, and no others.
    """
    if count_coincident(vertices, faces) == 0:
        return vertices
    _, position = np.unique(vertices, axis=0, return_inverse=True)
    order = np.argsort(position.ravel(), kind="stable")
    first = np.flatnonzero(np.diff(position.ravel()[order], prepend=-1))
    rank = np.empty(len(vertices), dtype=np.int64)
    rank[order] = np.arange(len(order)) - np.repeat(first, np.diff(first, append=len(order)))
    separated = vertices.copy()
    separated[:, 0] += 4 * rank * np.spacing(np.abs(vertices).max())
    return separated


def weld(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return (n, 3) the vertices, and (m, 3) the faces with the first vertex at each position as a corner."""
    _, first, position = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    return vertices, first[position.ravel()][faces]


def mesh_with_parts(vertices: np.ndarray, faces: np.ndarray, part: np.ndarray) -> pymeshlab.Mesh:
    """Make a mesh for pymeshlab's filters, with the part (n,) of its vertices as scalar of each face.

    The filters let the faces that replace a face inherit its scalar.
    """
    import pymeshlab

    return pymeshlab.Mesh(vertices, faces, f_scalar_array=part[faces[:, 0]].astype(float))


def result_with_parts(mesh: pymeshlab.Mesh) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the vertices and faces of such a mesh after filters, and the part of each vertex."""
    mesh.compact()
    faces = mesh.face_matrix().astype(np.int64)
    part = np.zeros(mesh.vertex_number(), dtype=np.int64)
    part[faces] = mesh.face_scalar_array().astype(np.int64)[:, None]
    return mesh.vertex_matrix(), faces, part


def find_parts(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(n,) the component of each vertex, if components have to be kept apart or moved together; else 0 throughout.

    That is so if vertices coincide, or if the components are much smaller than the distances between them.
    """
    from heatwalk.laplacian import vertex_components

    part = vertex_components(len(vertices), faces)
    sparse = _largest_size(vertices, faces, part) < SPARSE * np.ptp(vertices[faces], axis=(0, 1)).max()
    return part if sparse or count_coincident(vertices, faces) > 0 else np.zeros_like(part)


def _lowest_corners(vertices: np.ndarray, faces: np.ndarray, part: np.ndarray) -> np.ndarray:
    """(k, 3) the lowest coordinates in each of k parts; infinite for one without faces."""
    used = np.unique(faces)
    low = np.full((part.max() + 1, 3), np.inf)
    np.minimum.at(low, part[used], vertices[used])
    return low


def _largest_size(vertices: np.ndarray, faces: np.ndarray, part: np.ndarray) -> float:
    used = np.unique(faces)
    return float((vertices[used] - _lowest_corners(vertices, faces, part)[part[used]]).max())


class Packing:
    """Moves each part of a mesh into a box of its own, all of them close together; leaves a mesh of one part as it is.

    Filters that search in space then take no time for the gaps between the parts, and find nothing of another part.
    """

    def __init__(self, vertices: np.ndarray, faces: np.ndarray, part: np.ndarray) -> None:
        self._is_identity = part.max() == 0
        self._low = _lowest_corners(vertices, faces, part)
        self._size = _largest_size(vertices, faces, part)

    def pack(self, vertices: np.ndarray, part: np.ndarray) -> np.ndarray:
        """(k, 3) where vertices (k, 3) of parts (k,) go."""
        if self._is_identity:
            return vertices
        low = np.where(np.isfinite(self._low), self._low, 0.0)[part]
        return (vertices - low) / self._size + lattice_offsets(part, len(self._low))


def lattice_offsets(part: np.ndarray, n_parts: int) -> np.ndarray:
    """(k, 3) offsets that move items of different parts (k,), numbered from 0, into different boxes of a lattice.

    For items in a box of size 1: what is nearest to an item after that is of the same part.
    """
    per_axis = int(np.cbrt(n_parts - 1)) + 1
    return LATTICE_SPACING * np.stack(np.unravel_index(part, [per_axis] * 3), axis=1)
