"""Distances between faces of a mesh, along paths in its dual graph."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from studies.segmenters._dual_graph import DualGraph

_LEAST = 1e-9  # of a weight: zeros would be no connections in a sparse matrix


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
    ways = _undirected(ways)
    points, distances = [start], [_distances_from(ways, start)]
    nearest = distances[0].copy()
    while len(points) < number and nearest.max() > 0:
        points.append(int(nearest.argmax()))
        distances.append(_distances_from(ways, points[-1]))
        np.minimum(nearest, distances[-1], out=nearest)
    return np.array(points, dtype=np.int64), np.array(distances)


def distances_from(ways: sp.csr_array, faces: Sequence[int] | NDArray[np.int64]) -> NDArray[np.float64]:
    """Lengths of the shortest paths from each of some faces to all: (k, m)."""
    ways = _undirected(ways)
    return np.array([_distances_from(ways, int(face)) for face in faces]).reshape(len(faces), ways.shape[0])


def _distances_from(ways: sp.csr_array, face: int) -> NDArray[np.float64]:
    """Lengths of the shortest paths from a face to all: (m,)."""
    from studies.segmenters._shortest_paths import shortest_paths  # compiles, which takes long to import

    return shortest_paths(ways.indptr, ways.indices, ways.data, face)


def _undirected(ways: sp.csr_array) -> sp.csr_array:
    """The matrix with the shorter way where the two directions of a pair differ, which rounding of sums may do."""
    reverse = ways.T.tocsr()
    if not all(np.array_equal(getattr(ways, name), getattr(reverse, name)) for name in ("indptr", "indices", "data")):
        ways = ways.minimum(reverse)
    # One type of indices, so that one function is compiled.
    undirected = sp.csr_array(ways.shape)
    undirected.indptr, undirected.indices = ways.indptr.astype(np.int64), ways.indices.astype(np.int64)
    undirected.data = ways.data
    return undirected


def check_shares(method: object, *names: str) -> None:
    """Raise ValueError if an option of a method is not from 0 to 1."""
    for name in names:
        value = getattr(method, name)
        if not 0 <= value <= 1:
            raise ValueError(f"segmenter.{name} is {value!r}: it must be from 0 to 1")
