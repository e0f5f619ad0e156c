"""Distances between faces of a mesh, along paths in its dual graph."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled
from studies.segmenters._dual_graph import DualGraph

_LEAST = 1e-9  # of a weight: zeros would be no connections in a sparse matrix
_STEP = 0.3  # mean lengths between adjacent faces by which a search for shortest paths moves on


def katz_tal_weights(graph: DualGraph, geodesic_share: float, convex_weight: float) -> NDArray[np.float64]:
    """Distances between adjacent faces of S. Katz, A. Tal, ACM Trans. Graph. 22 (3), 2003, section 3.

    ``δ geodesic / mean(geodesic) + (1 - δ) angular / mean(angular)``. The geodesic distance is that of the centres
    through the midpoint of the edge; the angular one ``1 - cos(angle)``, times ``η`` if the edge is convex.

    Parameters
    ----------
    graph : DualGraph
        of any mesh
    geodesic_share : float
        δ, from 0 to 1
    convex_weight : float
        η, from 0 to 1

    Returns
    -------
    (p,) float array
        for each pair of faces, at least 1e-9

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> weights = katz_tal_weights(DualGraph.of(box.vertices, box.faces), 0.5, 0.2)
    >>> round(float(weights.mean()), 6)
    1.0
    """
    angular = angular_distances(graph, convex_weight)
    weights = geodesic_share * _by_mean(graph.distances) + (1 - geodesic_share) * angular
    return np.maximum(weights, _LEAST)


def angular_distances(graph: DualGraph, convex_weight: float) -> NDArray[np.float64]:
    """``1 - cos(angle)`` between adjacent faces, times ``convex_weight`` if the edge is convex, divided by its mean."""
    return _by_mean(np.where(graph.angles < 0, 1.0, convex_weight) * (1 - np.cos(graph.angles)))


def _by_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values divided by their mean, unless all are 0."""
    return values / values.mean() if values.any() else values


def outermost_face(graph: DualGraph) -> int:
    """The face whose centre is farthest from the centroid of the surface: a start that no numbering determines."""
    total = graph.areas.sum()
    weights = graph.areas / total if total > 0 else np.full(graph.n_faces, 1 / graph.n_faces)
    return int(np.linalg.norm(graph.centres - weights @ graph.centres, axis=1).argmax())


def farthest_points(ways: sp.csr_array, start: int, number: int) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Faces each of which is the farthest from those before it, and the distances from each.

    Parameters
    ----------
    ways : (m, m) sparse array
        distances between adjacent faces, positive; connected
    start : int
        the first face
    number : int
        how many; fewer if the mesh has fewer faces with a distance between them

    Returns
    -------
    points : (k,) int array
    distances : (k, m) float array
        from each of the points to every face
    """
    points, distances = [start], [distances_from(ways, [start])[0]]
    nearest = distances[0].copy()
    while len(points) < number and nearest.max() > 0:
        points.append(int(nearest.argmax()))
        distances.append(distances_from(ways, points[-1:])[0])
        np.minimum(nearest, distances[-1], out=nearest)
    return np.array(points, dtype=np.int64), np.array(distances)


def distances_from(ways: sp.csr_array, faces: Sequence[int] | NDArray[np.int64]) -> NDArray[np.float64]:
    """Lengths of the shortest paths from each of some faces to all: (k, m)."""
    step = _STEP * float(ways.data.mean()) if ways.nnz else 1.0
    return np.array([_shortest(ways.indptr, ways.indices, ways.data, face, step) for face in faces])


@compiled
def _shortest(
    indptr: NDArray[np.int32], indices: NDArray[np.int32], lengths: NDArray[np.float64], start: int, step: float
) -> NDArray[np.float64]:
    """Lengths of the shortest paths from one node to all; inf where there is none.

    Nodes nearer than ``reach`` are relaxed in any order until none changes, then ``reach`` moves on by ``step``: five
    times as quick as a heap. Whatever the order, rounding included, each length is the least over all paths.
    """
    n = len(indptr) - 1
    distance = np.full(n, np.inf)
    near, far = np.empty(n, np.int64), np.empty(n, np.int64)  # near is a ring
    is_near, is_far = np.zeros(n, np.bool_), np.zeros(n, np.bool_)
    distance[start], near[0] = 0.0, start
    first, n_near, n_far, reach = 0, 1, 0, step
    while n_near > 0:
        while n_near > 0:
            node = near[first]
            first, n_near = (first + 1 if first + 1 < n else 0), n_near - 1
            is_near[node] = False
            for way in range(indptr[node], indptr[node + 1]):
                other, length = indices[way], distance[node] + lengths[way]
                if length >= distance[other]:
                    continue
                distance[other] = length
                if length < reach:
                    if not is_near[other]:
                        is_near[other] = True
                        end = first + n_near
                        near[end if end < n else end - n] = other
                        n_near += 1
                elif not is_far[other]:
                    is_far[other] = True
                    far[n_far] = other
                    n_far += 1
        done, least = reach, np.inf
        for i in range(n_far):
            if distance[far[i]] >= done:
                least = min(least, distance[far[i]])
        reach, first, left = least + step, 0, 0
        for i in range(n_far):
            node = far[i]
            if distance[node] >= reach:
                far[left] = node
                left += 1
                continue
            is_far[node] = False
            if distance[node] >= done:
                is_near[node] = True
                near[n_near] = node
                n_near += 1
        n_far = left
    return distance


def check_shares(method: object, *names: str) -> None:
    """Raise ValueError if an option of a method is not from 0 to 1."""
    for name in names:
        value = getattr(method, name)
        if not 0 <= value <= 1:
            raise ValueError(f"segmenter.{name} is {value!r}: it must be from 0 to 1")
