"""How many segments of a Heat Walk are distinct: neighbouring exemplars joined, and tiny segments not counted."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heatwalk.meshes import face_areas

if TYPE_CHECKING:
    from scipy.sparse import csr_array

    from heatwalk import Segmentation

# Segments of at least this share of the area are counted.
SHARE = 0.01

# How many edges apart two exemplars may be to be joined.
REACHES = (1, 2)


class DistinctSegments:
    """Counts the distinct segments of segmentations of one mesh.

    Parameters
    ----------
    vertices : (n, 3) float array
        coordinates
    faces : (m, 3) int array
        vertices of each face

    Notes
    -----
    On flat parts of a surface neighbouring vertices can each be their own exemplar, with a region of a few vertices or
    none. So two accumulator regions are one segment if their exemplars are at most so many edges apart, or if a chain
    of such exemplars connects them; and a segment counts if it has at least 1 % of the area, of which a vertex has a
    third of that of its faces. The dissipator region is a segment like any other, and is joined with none.

    Examples
    --------
    >>> import heatwalk, trimesh
    >>> mesh = trimesh.creation.icosphere(3).apply_scale([4, 1.2, 1])
    >>> segmentation = heatwalk.segment(mesh.vertices, mesh.faces)
    >>> DistinctSegments(mesh.vertices, mesh.faces).count(segmentation, 1) <= segmentation.n_segments
    True
    """

    def __init__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> None:
        areas = np.repeat(face_areas(vertices, faces) / 3, 3)
        self._areas = np.bincount(faces.ravel(), areas, len(vertices))
        self._neighbours = _neighbours(len(vertices), faces)

    def count(self, segmentation: Segmentation, reach: int) -> int:
        """The number of distinct segments.

        Parameters
        ----------
        segmentation : heatwalk.Segmentation
            of the mesh
        reach : int
            how many edges apart two exemplars may be to be joined
        """
        joined = self._joined(segmentation.exemplars, reach)
        n_regions = len(segmentation.exemplars)
        # Dissipators, K and above, keep labels of their own.
        of_label = np.concatenate([joined, n_regions + np.arange(segmentation.labels.max() + 1 - n_regions)])
        areas = np.bincount(of_label[segmentation.labels], self._areas)
        return int(np.count_nonzero(areas >= SHARE * self._areas.sum()))

    def _joined(self, exemplars: NDArray[np.int64], reach: int) -> NDArray[np.int64]:
        """The number of the group that each exemplar belongs to."""
        from scipy.sparse.csgraph import connected_components

        around = self._neighbours[exemplars]
        for _ in range(reach - 1):
            around = around @ self._neighbours
        return connected_components(around[:, exemplars], directed=False)[1].astype(np.int64)


def _neighbours(n_vertices: int, faces: NDArray[np.int64]) -> csr_array:
    """(n, n) which vertices are at most one edge apart."""
    from scipy.sparse import coo_array

    start, end = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    own = np.arange(n_vertices)
    positions = np.concatenate([start, end, own]), np.concatenate([end, start, own])
    return coo_array((np.ones(len(positions[0])), positions), shape=(n_vertices, n_vertices)).tocsr()
