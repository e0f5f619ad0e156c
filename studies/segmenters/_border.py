"""The border between two sets of faces, by a minimum cut of the dual graph."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

from studies.segmenters._distances import angular_distances
from studies.segmenters._dual_graph import DualGraph

_MEAN_CAPACITY = 1000  # maximum_flow takes integers
_TOTAL_CAPACITY = 2**30  # and adds them up in 32 bits


def cut_capacities(graph: DualGraph, convex_weight: float) -> NDArray[np.float64]:
    """For each pair of faces the length of its edge / (1 + angular distance), that of concave edges being largest.

    See Also
    --------
    studies.segmenters._distances.angular_distances
    """
    return graph.lengths / (1 + angular_distances(graph, convex_weight))


def minimum_cut(
    graph: DualGraph,
    capacities: NDArray[np.float64],
    source: NDArray[np.bool_],
    sink: NDArray[np.bool_],
) -> NDArray[np.bool_]:
    """The faces on the source's side of the cheapest set of edges that separates two sets of faces.

    Parameters
    ----------
    graph : DualGraph
        of any mesh
    capacities : (p,) float array
        for each pair of faces what it costs to separate them, not negative; rounded to a thousandth of their mean, and
        at least that
    source, sink : (m,) bool array
        faces that are to be separated, disjoint; of several cheapest cuts, that nearest to the source is chosen

    Returns
    -------
    (m,) bool array
        True for the source, and for the faces on its side

    Examples
    --------
    >>> import trimesh
    >>> balls = [trimesh.creation.icosphere(1).apply_translation([x, 0, 0]) for x in (0, 3)]
    >>> both = trimesh.util.concatenate(balls)
    >>> graph, number = DualGraph.of(both.vertices, both.faces), np.arange(160)
    >>> np.flatnonzero(minimum_cut(graph, graph.lengths, number == 5, number == 100)).tolist() == list(range(80))
    True
    """
    total = capacities.sum()
    scale = min(_MEAN_CAPACITY * len(capacities), _TOTAL_CAPACITY) / total if total > 0 else 1.0
    whole = np.maximum(np.round(capacities * scale), 1).astype(np.int32)
    # The source becomes node 0, the sink node 1.
    is_free = ~(source | sink)
    node = np.where(sink, 1, 0)
    node[is_free] = 2 + np.arange(np.count_nonzero(is_free))
    first, second = node[graph.pairs].reshape(-1, 2).T
    count = 2 + int(np.count_nonzero(is_free))
    rows, columns = np.concatenate([first, second]), np.concatenate([second, first])
    network = sp.csr_array(sp.coo_array((np.tile(whole, 2), (rows, columns)), (count, count)))
    residual = sp.csr_array(network - maximum_flow(network, 0, 1).flow)
    residual.eliminate_zeros()
    reached = np.zeros(count, dtype=bool)
    reached[breadth_first_order(residual, 0, return_predecessors=False)] = True
    return reached[node]
