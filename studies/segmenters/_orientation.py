"""Faces turned over so that neighbours agree on which side is outside."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

from studies.segmenters._dual_graph import DualGraph

# Volume enclosed, in units of area^1.5, above which a component is turned over if it is negative: a ball has 0.094, and
# a surface that is far from closed hardly any.
_ENCLOSED = 0.005


def outward(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces, some of them turned over so that their normals point outwards.

    In each connected component the faces in the minority, by area, are turned over if all can be made to agree; then
    the whole component if it encloses a negative volume.

    Parameters
    ----------
    vertices : (n, 3) float array
        coordinates
    faces : (m, 3) int array
        vertices of each face

    Returns
    -------
    (m, 3) int64 array

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> damaged = np.where(np.arange(12)[:, None] < 3, box.faces[:, ::-1], box.faces)
    >>> bool(trimesh.Trimesh(box.vertices, outward(box.vertices, damaged), process=False).volume == 1)
    True
    """
    graph = DualGraph.of(vertices, faces)
    first, second = graph.pairs.T
    m = graph.n_faces
    ahead = [_is_ahead(faces[side], graph.edges) for side in (first, second)]
    is_consistent = ahead[0] != ahead[1]
    # Two copies of each face, as it is (i) and turned over (m + i), joined with the copies of neighbours that agree.
    other = np.where(is_consistent, 0, m)
    ends = np.concatenate([first, first + m]), np.concatenate([second + other, second + m - other])
    copies = sp.coo_array((np.ones(len(ends[0])), ends), (2 * m, 2 * m))
    side = connected_components(copies, directed=False)[1]
    as_is, turned = side[:m], side[m:]
    weight = np.bincount(side, np.concatenate([graph.areas, np.zeros(m)]), minlength=1)
    # Both sides of a component that cannot be made to agree are one, and nothing is turned over.
    is_turned = weight[as_is] < weight[turned]
    component = graph.components()
    volume, area = _volumes(graph, component, np.where(is_turned, -1.0, 1.0))
    is_turned ^= (volume < -_ENCLOSED * area**1.5)[component]
    return np.where(is_turned[:, None], faces[:, ::-1], faces)


def _is_ahead(faces: NDArray[np.int64], edges: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether each face traverses its edge from the first vertex to the second."""
    after = np.roll(faces, -1, axis=1)
    return ((faces == edges[:, :1]) & (after == edges[:, 1:])).any(axis=1)


def _volumes(
    graph: DualGraph, component: NDArray[np.int64], signs: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The volume that each component encloses, seen from its centre, and its area."""
    area = np.bincount(component, graph.areas).astype(np.float64)
    total = np.maximum(area, np.finfo(float).tiny)
    centre = np.column_stack([np.bincount(component, graph.areas * x) / total for x in graph.centres.T])
    heights = np.einsum("ij,ij->i", graph.centres - centre[component], graph.normals)
    return np.bincount(component, signs * graph.areas * heights / 3).astype(np.float64), area
