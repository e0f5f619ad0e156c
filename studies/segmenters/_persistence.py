"""Persistence of the peaks of a function on the vertices of a graph."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled


def edge_graph(n_vertices: int, faces: NDArray[np.int64]) -> sp.csr_array:
    """The graph of the edges of a mesh: (n, n), symmetric, each entry 1 or more."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    ends = np.concatenate([start, end]), np.concatenate([end, start])
    graph = sp.coo_array((np.ones(2 * len(start)), ends), (n_vertices, n_vertices)).tocsr()
    graph.setdiag(0)
    graph.eliminate_zeros()
    return graph


def mountains(
    values: NDArray[np.float64], graph: sp.csr_array, least: float
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """The mountain of each vertex, where two that meet become one if the lower is not high enough above their pass.

    Vertices are visited from the highest to the lowest. One without a visited neighbour is a peak; any other belongs
    to the mountain of its highest neighbour. Where mountains meet, those of which the peak is less than ``least`` above
    the pass become part of the highest: the algorithm ToMATo.

    Parameters
    ----------
    values : (n,) float array
    graph : (n, n) sparse array
        neighbours of each vertex
    least : float
        least height of a peak above the pass to a higher mountain; with infinity each component is one mountain

    Returns
    -------
    peaks : (n,) int array
        the vertex that is the peak of the mountain of each vertex
    heights : (p,) float array
        the heights above the pass of the peaks that were merged, in the order of the passes: with ``least`` infinite,
        the persistence of every peak but the highest of each component

    References
    ----------
    F. Chazal, L. Guibas, S. Oudot, P. Skraba, "Persistence-based clustering in Riemannian manifolds", 2013

    Examples
    --------
    >>> line = edge_graph(7, np.array([[i, i + 1, i] for i in range(6)]))
    >>> mountains(np.array([0.0, 5, 1, 2, 0, 4, 3]), line, 1.5)
    (array([1, 1, 1, 1, 5, 5, 5]), array([1.]))
    >>> mountains(np.array([0.0, 5, 1, 2, 0, 4, 3]), line, np.inf)[1]
    array([1., 4.])
    """
    values = np.ascontiguousarray(values, np.float64)
    order = np.argsort(-values, kind="stable")
    return _mountains(values, order, graph.indptr.astype(np.int64), graph.indices.astype(np.int64), float(least))


def branches(values: NDArray[np.float64], graph: sp.csr_array, least: float) -> NDArray[np.int64]:
    """The branch of each vertex: what is above the pass at which a mountain meets another, both of which are high.

    As in `mountains`, those lower than ``least`` become part of the highest. Where others meet, they all end, and what
    is below is no branch.

    Parameters
    ----------
    values : (n,) float array
    graph : (n, n) sparse array
        neighbours of each vertex
    least : float
        least height of a peak above the pass to a higher mountain

    Returns
    -------
    (n,) int array
        the vertex that is the peak of the branch; -1 for what is no branch, and where a component has no pass at which
        a branch could end

    Examples
    --------
    >>> line = edge_graph(7, np.array([[i, i + 1, i] for i in range(6)]))
    >>> branches(np.array([0.5, 5, 1, 2, 0, 4, 3]), line, 1.5)
    array([ 1,  1,  1,  1, -1,  5,  5])
    >>> branches(np.array([0.5, 5, 1, 2, 0, 4, 3]), line, 9.0)
    array([-1, -1, -1, -1, -1, -1, -1])
    """
    values = np.ascontiguousarray(values, np.float64)
    order = np.argsort(-values, kind="stable")
    return _branches(values, order, graph.indptr.astype(np.int64), graph.indices.astype(np.int64), float(least))


@compiled
def _root(parent: NDArray[np.int64], i: int) -> int:
    """The root of a vertex in a forest, in which the way to it becomes shorter."""
    while parent[i] != i:
        parent[i] = parent[parent[i]]
        i = parent[i]
    return i


@compiled
def _mountains(
    values: NDArray[np.float64],
    order: NDArray[np.int64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
    least: float,
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """`mountains`, with the vertices in descending order and the graph as compressed rows."""
    n = len(values)
    rank = np.empty(n, np.int64)
    rank[order] = np.arange(n)
    parent = np.arange(n)  # the root of a mountain is its peak
    heights = np.empty(n)
    n_merged = 0
    for v in order:
        highest = -1
        for u in neighbours[starts[v] : starts[v + 1]]:
            if rank[u] < rank[v] and (highest < 0 or rank[u] < rank[highest]):
                highest = u
        if highest < 0:
            continue
        parent[v] = _root(parent, highest)
        for u in neighbours[starts[v] : starts[v + 1]]:
            if rank[u] > rank[v]:
                continue
            a, b = _root(parent, v), _root(parent, u)
            if a == b:
                continue
            if rank[a] < rank[b]:
                a, b = b, a  # a is the lower peak
            height = values[a] - values[v]
            if height < least:
                parent[a] = b
                heights[n_merged] = height
                n_merged += 1
    for v in range(n):
        parent[v] = _root(parent, v)
    return parent, heights[:n_merged].copy()


@compiled
def _branches(
    values: NDArray[np.float64],
    order: NDArray[np.int64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
    least: float,
) -> NDArray[np.int64]:
    """`branches`, with the vertices in descending order and the graph as compressed rows."""
    n = len(values)
    rank = np.empty(n, np.int64)
    rank[order] = np.arange(n)
    above = np.arange(n)  # connected sets of what has been visited; the root of each is its peak
    branch = np.arange(n)  # the sets that are labelled; those of `body` are no branch
    has_ended = np.zeros(n, np.bool_)  # of each peak, whether its branch has
    body = np.zeros(n, np.bool_)  # of each root of `branch`
    for v in order:
        highest = -1
        for u in neighbours[starts[v] : starts[v + 1]]:
            if rank[u] < rank[v]:
                root = _root(above, u)
                if highest < 0 or rank[root] < rank[highest]:
                    highest = root
        if highest < 0:
            continue
        for u in neighbours[starts[v] : starts[v + 1]]:
            if rank[u] < rank[v]:
                root = _root(above, u)
                if root != highest and values[root] - values[v] >= least:
                    has_ended[highest] = True
        for u in neighbours[starts[v] : starts[v + 1]]:
            if rank[u] > rank[v]:
                continue
            root = _root(above, u)
            if root == highest:
                continue
            if values[root] - values[v] < least:
                if has_ended[highest]:
                    body[_root(branch, root)] = True
                else:
                    branch[_root(branch, root)] = _root(branch, highest)
            above[root] = highest
        above[v] = highest
        if has_ended[highest]:
            body[v] = True
        else:
            branch[v] = _root(branch, highest)
    for v in range(n):
        branch[v] = _root(branch, v)
    result = np.empty(n, np.int64)
    for v in range(n):
        # Without a pass at which a branch could end, the highest peak of a component has not ended.
        result[v] = branch[v] if not body[branch[v]] and has_ended[_root(above, v)] else -1
    return result
