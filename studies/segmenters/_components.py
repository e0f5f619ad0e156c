"""A number of segments, shared among the connected components of a mesh."""

from __future__ import annotations

import heapq
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray


def share_segments(areas: NDArray[np.float64], n_segments: int) -> NDArray[np.int64]:
    """How many segments each component gets, by area: each next one goes to where most area is left for one.

    Parameters
    ----------
    areas : (c,) float array
    n_segments : int

    Returns
    -------
    (c,) int64 array
        their sum is ``n_segments``; 0 for components that are too small

    Notes
    -----
    The method of d'Hondt: of the components' areas divided by 1, 2, 3 …, the largest count.

    Examples
    --------
    >>> share_segments(np.array([6.0, 0.1, 2.5]), 4)
    array([3, 0, 1])
    """
    shares = np.zeros(len(areas), dtype=np.int64)
    largest = np.argsort(-areas, kind="stable")[:n_segments]
    heap = [(-float(areas[i]), int(i)) for i in largest]
    heapq.heapify(heap)
    for _ in range(n_segments):
        _, i = heap[0]
        shares[i] += 1
        heapq.heapreplace(heap, (-float(areas[i]) / (shares[i] + 1), i))
    return shares


def segment_components(
    points: NDArray[np.float64],
    component: NDArray[np.int64],
    areas: NDArray[np.float64],
    n_segments: int,
    segment: Callable[[NDArray[np.int64], int], NDArray[np.int64]],
) -> NDArray[np.int64]:
    """Segment each component on its own, with its share of the segments.

    Parameters
    ----------
    points : (n, 3) float array
        vertices, or centres of the faces
    component : (n,) int array
        the component of each point, 0 … c-1
    areas : (n,) float array
        area of each point, by which the segments are shared
    n_segments : int
    segment : callable
        (indices of the points of a component, a number of segments above 1) -> their labels, 0, 1, 2 …

    Returns
    -------
    (n,) int64 array
        0, 1, 2 …; a component without a segment of its own gets that of the nearest point of another

    Examples
    --------
    >>> points = np.array([[0.0, 0, 0], [1, 0, 0], [9, 0, 0], [0.2, 0, 0]])
    >>> areas = np.array([1.5, 1.5, 2, 0.1])
    >>> segment_components(points, np.array([0, 0, 1, 2]), areas, 3, lambda indices, k: np.arange(len(indices)))
    array([0, 1, 2, 0])
    """
    shares = share_segments(np.bincount(component, areas).astype(np.float64), n_segments)
    order = np.argsort(component, kind="stable")
    bounds = np.searchsorted(component[order], np.arange(len(shares) + 1))
    labels = np.full(len(points), -1, dtype=np.int64)
    n_labels = 0
    for i in np.flatnonzero(shares):
        indices = order[bounds[i] : bounds[i + 1]]
        labels[indices] = n_labels + (segment(indices, int(shares[i])) if shares[i] > 1 else 0)
        n_labels = int(labels[indices].max()) + 1
    return _filled_from_nearest(points, labels)


def _filled_from_nearest(points: NDArray[np.float64], labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """The labels, each -1 replaced by the label of the nearest point that has one."""
    is_missing = labels < 0
    if not is_missing.any():
        return labels
    from scipy.spatial import cKDTree

    labels = labels.copy()
    labels[is_missing] = labels[~is_missing][cKDTree(points[~is_missing]).query(points[is_missing])[1]]
    return labels
