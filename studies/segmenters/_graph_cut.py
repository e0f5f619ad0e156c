"""Labels that cost least, by alpha-expansion."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import breadth_first_order, maximum_flow

# SciPy's maximum flow has 32-bit integers, which the sum of all capacities must not exceed.
_MOST = 2**30


def energy(
    costs: NDArray[np.float64], pairs: NDArray[np.int64], weights: NDArray[np.float64], labels: NDArray[np.int64]
) -> float:
    """What labels cost: the sum of the nodes' costs, and of the weights of the pairs that have different labels."""
    of_nodes = costs[np.arange(len(costs)), labels].sum()
    return float(of_nodes + weights[labels[pairs[:, 0]] != labels[pairs[:, 1]]].sum())


def alpha_expansion(
    costs: NDArray[np.float64], pairs: NDArray[np.int64], weights: NDArray[np.float64]
) -> NDArray[np.int64]:
    """Labels of the nodes of a graph, of which no single expansion of a label is cheaper.

    Y. Boykov, O. Veksler, R. Zabih, Fast Approximate Energy Minimization via Graph Cuts, IEEE Transactions on Pattern
    Analysis and Machine Intelligence 23 (11), 2001. Costs at most twice the least possible; with two labels, the least.
    Every expansion is a minimum cut, by SciPy's maximum flow; costs are rounded to about one billionth of their sum.

    Parameters
    ----------
    costs : (n, k) float array
        what each label costs at each node, at least 0
    pairs : (p, 2) int array
        adjacent nodes
    weights : (p,) float array
        what different labels of each pair cost, at least 0

    Returns
    -------
    (n,) int64 array
        labels 0 … k - 1

    Examples
    --------
    >>> costs = np.array([[0.0, 3], [2, 1], [3, 0]])
    >>> chain = np.array([[0, 1], [1, 2]])
    >>> alpha_expansion(costs, chain, np.array([2.0, 0.5])), alpha_expansion(costs, chain, np.array([0.5, 2]))
    (array([0, 0, 1]), array([0, 1, 1]))
    """
    labels = costs.argmin(axis=1)
    least = energy(costs, pairs, weights, labels)
    unchanged, label, n_labels = 0, 0, costs.shape[1]
    while unchanged < n_labels:
        expanded = _expansion(costs, pairs, weights, labels, label)
        cost = energy(costs, pairs, weights, expanded)
        # Rounding may make a cut that is no cheaper look cheaper.
        if cost < least * (1 - 1e-9):
            labels, least, unchanged = expanded, cost, 0
        unchanged += 1
        label = (label + 1) % n_labels
    return labels


def _expansion(
    costs: NDArray[np.float64],
    pairs: NDArray[np.int64],
    weights: NDArray[np.float64],
    labels: NDArray[np.int64],
    label: int,
) -> NDArray[np.int64]:
    """The cheapest labels that differ from the given ones in that some nodes have ``label`` instead."""
    free = np.flatnonzero(labels != label)
    if not len(free):
        return labels
    number = np.full(len(labels), -1)
    number[free] = np.arange(len(free))
    keep, switch = costs[free, labels[free]], costs[free, label]
    first, second = number[pairs].T
    # A neighbour that has the label already.
    for node, other in ((first, second), (second, first)):
        is_beside = (node >= 0) & (other < 0)
        keep = keep + np.bincount(node[is_beside], weights[is_beside], len(free))
    # Two nodes of different labels cost their weight unless both switch: what the second saves by switching, minus the
    # cost of switching alone.
    between = (first >= 0) & (second >= 0)
    first, second, weight = first[between], second[between], weights[between]
    is_equal = labels[free[first]] == labels[free[second]]
    keep = keep + np.bincount(second[~is_equal], weight[~is_equal], len(free))
    backward = np.where(is_equal, weight, 0.0)
    cut = _cut(keep, switch, np.column_stack([first, second]), weight, backward)
    result = labels.copy()
    result[free[cut]] = label
    return result


def _cut(
    keep: NDArray[np.float64],
    switch: NDArray[np.float64],
    pairs: NDArray[np.int64],
    forward: NDArray[np.float64],
    backward: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """The nodes that switch, so that the sum of the costs is least.

    A pair of which the second node alone switches costs ``forward``, the first alone ``backward``.
    """
    n = len(keep)
    source, sink, nodes = n, n + 1, np.arange(n)
    common = np.minimum(keep, switch)  # paid in any case
    rows = np.concatenate([np.full(n, source), nodes, pairs[:, 0], pairs[:, 1]])
    columns = np.concatenate([nodes, np.full(n, sink), pairs[:, 1], pairs[:, 0]])
    capacities = np.concatenate([switch - common, keep - common, forward, backward])
    scale = _MOST / max(capacities.sum(), np.finfo(float).tiny)
    rounded = np.rint(scale * capacities).astype(np.int32)
    graph = sp.csr_array((rounded, (rows, columns)), shape=(n + 2, n + 2))
    flow = maximum_flow(graph, source, sink).flow
    residual = graph - flow
    residual.data[residual.data < 0] = 0
    residual.eliminate_zeros()
    switches = np.ones(n + 2, dtype=bool)
    switches[breadth_first_order(residual, source, return_predecessors=False)] = False
    return switches[:n]
