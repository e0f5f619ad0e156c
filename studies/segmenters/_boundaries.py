"""Labels carried from a coarse mesh to a fine one: islands removed, borders moved to where cutting costs least."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, connected_components, dijkstra, maximum_flow

from studies.segmenters._dual_graph import DualGraph

_CAPACITY = 10**9  # of all edges of a graph cut together, which SciPy computes in 32 bits


def without_islands(graph: DualGraph, labels: NDArray[np.int64]) -> NDArray[np.int64]:
    """Labels of which each is one connected region: the largest by area; other faces get the nearest label.

    Parameters
    ----------
    graph : DualGraph
    labels : (m,) int array

    Returns
    -------
    (m,) int64 array
        a face from which no region that is kept can be reached keeps its label
    """
    first, second = graph.pairs.T
    is_inside = (labels[first] == labels[second]).astype(float)
    inside = graph.matrix(is_inside)
    inside.eliminate_zeros()
    _, region = connected_components(inside, directed=False)
    areas = np.bincount(region, graph.areas)
    label_of = np.zeros(len(areas), dtype=np.int64)
    label_of[region] = labels
    order = np.lexsort((np.arange(len(areas)), -areas, label_of))
    is_first = np.concatenate([[True], np.diff(label_of[order]) != 0]) if len(order) else np.zeros(0, bool)
    kept = np.flatnonzero(np.isin(region, order[is_first]))
    if len(kept) == len(labels):
        return labels
    _, _, nearest = dijkstra(_ways(graph), directed=False, indices=kept, min_only=True, return_predecessors=True)
    return np.where(nearest < 0, labels, labels[np.maximum(nearest, 0)])


def moved_to_cheapest(
    graph: DualGraph, costs: NDArray[np.float64], labels: NDArray[np.int64], reach: float
) -> NDArray[np.int64]:
    """Labels whose borders are, between each two regions, where cutting costs least within a reach: a minimum cut.

    Parameters
    ----------
    graph : DualGraph
    costs : (p,) float array
        what it costs to cut each pair of faces
    labels : (m,) int array
    reach : float
        how far a border may move, along the surface; at most half-way into a region

    Returns
    -------
    (m,) int64 array
    """
    labels = labels.copy()
    first, second = graph.pairs.T
    is_cut = labels[first] != labels[second]
    if not is_cut.any():
        return labels
    at_border = np.unique(graph.pairs[is_cut])
    depth = dijkstra(_ways(graph), directed=False, indices=at_border, min_only=True)
    deepest = np.zeros(labels.max() + 1)
    np.maximum.at(deepest, labels, np.where(np.isfinite(depth), depth, 0))
    is_fixed = depth > np.minimum(reach, deepest / 2)[labels]
    # A region whose faces are all at the border has none that is deeper.
    is_fixed |= (deepest == 0)[labels]
    neighbours = np.unique(np.sort(np.column_stack([labels[first], labels[second]])[is_cut], axis=1), axis=0)
    for one, other in neighbours:
        _move_border(graph, costs, labels, is_fixed, int(one), int(other))
    return labels


def _move_border(
    graph: DualGraph,
    costs: NDArray[np.float64],
    labels: NDArray[np.int64],
    is_fixed: NDArray[np.bool_],
    one: int,
    other: int,
) -> None:
    """Move the border between two regions, in place."""
    is_free = ~is_fixed & ((labels == one) | (labels == other))
    free = np.flatnonzero(is_free)
    node = np.full(graph.n_faces, -1)
    node[free] = np.arange(2, len(free) + 2)
    node[is_fixed & (labels == one)] = 0
    node[is_fixed & (labels == other)] = 1
    ends = node[graph.pairs]
    is_arc = (ends >= 0).all(axis=1) & (ends[:, 0] != ends[:, 1]) & (ends.max(axis=1) > 1)
    ends, capacity = ends[is_arc], costs[is_arc]
    if not len(ends) or capacity.sum() <= 0:
        return
    size = len(free) + 2
    both = np.concatenate([ends, ends[:, ::-1]])
    network = sp.coo_array((np.tile(capacity, 2), (both[:, 0], both[:, 1])), (size, size)).tocsr()
    network.data = np.ceil(network.data * (_CAPACITY / network.data.sum()))
    capacities = network.astype(np.int32)  # what SciPy's flow accepts
    residual = capacities - maximum_flow(capacities, 0, 1).flow
    residual.data = np.maximum(residual.data, 0)
    residual.eliminate_zeros()
    is_reached = np.zeros(size, dtype=bool)
    is_reached[breadth_first_order(residual, 0, return_predecessors=False)] = True
    labels[free] = np.where(is_reached[node[free]], one, other)


def _ways(graph: DualGraph) -> sp.csr_array:
    """The distances between neighbouring faces; faces that coincide are not at a distance of zero, which is no way."""
    first, second = np.sort(graph.pairs, axis=1).T
    _, kept = np.unique(first * np.int64(graph.n_faces) + second, return_index=True)
    ways = np.maximum(graph.distances[kept], np.finfo(float).tiny)
    shape = (graph.n_faces, graph.n_faces)
    return sp.coo_array((ways, (first[kept], second[kept])), shape).tocsr()
