"""Greedy merging of neighbouring regions, the cheapest pair first."""

from __future__ import annotations

import heapq

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled


@compiled
def merge_by_normalised_cut(
    pairs: NDArray[np.int64], costs: NDArray[np.float64], areas: NDArray[np.float64], n_regions: int
) -> NDArray[np.int64]:
    """Merge neighbours until `n_regions` are left, or none are neighbours, keeping the sum of cut / area small.

    At each step the pair is merged that lowers the sum most; of equal ones, the pair that comes first in `pairs`.

    Parameters
    ----------
    pairs : (p, 2) int array
        neighbouring nodes; pairs that occur twice are added up
    costs : (p,) float array
        what it costs to separate each pair
    areas : (m,) float array
        size of each node, above zero
    n_regions : int
        number of regions at which to stop

    Returns
    -------
    (m,) int array
        for each node the number of its region, numbered in the order of their first nodes

    Notes
    -----
    A pair is evaluated again only if one of its two regions has grown, so a step takes time in proportion to the
    neighbours of the merged region.

    Examples
    --------
    >>> chain = np.array([[0, 1], [1, 2], [2, 3]])
    >>> merge_by_normalised_cut(chain, np.array([1.0, 0.1, 1.0]), np.ones(4), 2)
    array([0, 0, 1, 1])
    """
    m, p = len(areas), len(pairs)
    ends, cost, size = pairs.copy(), costs.copy(), areas.copy()
    cut, parent = np.zeros(m), np.arange(m)
    # The pairs of each region are a linked list, in which a pair has one link per end.
    head, tail, length = np.full(m, -1), np.full(m, -1), np.zeros(m, np.int64)
    following = np.full(2 * p, -1)
    for i in range(p):
        for side in range(2):
            node, link = ends[i, side], 2 * i + side
            cut[node] += cost[i]
            if head[node] < 0:
                head[node] = link
            else:
                following[tail[node]] = link
            tail[node] = link
            length[node] += 1
    version, is_alive = np.zeros(p, np.int64), np.ones(p, np.bool_)
    seen_at, seen_pair = np.full(m, -1), np.zeros(m, np.int64)
    for node in range(m):  # pairs that occur twice
        _combine(node, node, head, tail, following, ends, cost, is_alive, seen_at, seen_pair)
    heap = [(_gain(ends[i, 0], ends[i, 1], cost[i], cut, size), i, 0) for i in range(p) if is_alive[i]]
    heapq.heapify(heap)
    left, step = m, 0
    while left > n_regions and len(heap) > 0:
        _, i, stamp = heapq.heappop(heap)
        if not is_alive[i] or version[i] != stamp:
            continue
        kept, gone = ends[i, 0], ends[i, 1]
        if length[kept] < length[gone]:
            kept, gone = gone, kept
        is_alive[i] = False
        cut[kept] += cut[gone] - 2 * cost[i]
        size[kept] += size[gone]
        parent[gone] = kept
        length[kept] += length[gone]
        link = head[gone]
        while link >= 0:
            ends[link // 2, link % 2] = kept
            link = following[link]
        following[tail[kept]] = head[gone]
        tail[kept] = tail[gone]
        _combine(kept, m + step, head, tail, following, ends, cost, is_alive, seen_at, seen_pair)
        link = head[kept]
        while link >= 0:
            j = link // 2
            version[j] += 1
            heapq.heappush(heap, (_gain(ends[j, 0], ends[j, 1], cost[j], cut, size), j, version[j]))
            link = following[link]
        left, step = left - 1, step + 1
    return _numbered(parent)


@compiled
def _gain(a: int, b: int, cost: float, cut: NDArray[np.float64], size: NDArray[np.float64]) -> float:
    """By how much merging two regions changes the sum of cut / area."""
    return (cut[a] + cut[b] - 2 * cost) / (size[a] + size[b]) - cut[a] / size[a] - cut[b] / size[b]


@compiled
def _combine(
    node: int,
    step: int,
    head: NDArray[np.int64],
    tail: NDArray[np.int64],
    following: NDArray[np.int64],
    ends: NDArray[np.int64],
    cost: NDArray[np.float64],
    is_alive: NDArray[np.bool_],
    seen_at: NDArray[np.int64],
    seen_pair: NDArray[np.int64],
) -> None:
    """Remove pairs that are gone from a region's list, and combine those with the same other end."""
    last, link = -1, head[node]
    head[node] = -1
    while link >= 0:
        i = link // 2
        after = following[link]
        if is_alive[i]:
            other = ends[i, 1 - link % 2]
            if seen_at[other] == step:
                cost[seen_pair[other]] += cost[i]
                is_alive[i] = False
            else:
                seen_at[other] = step
                seen_pair[other] = i
                if last < 0:
                    head[node] = link
                else:
                    following[last] = link
                last = link
        link = after
    if last >= 0:
        following[last] = -1
    tail[node] = last


@compiled
def _numbered(parent: NDArray[np.int64]) -> NDArray[np.int64]:
    """Regions numbered in the order of their first nodes."""
    labels, number, n = np.empty_like(parent), np.full(len(parent), -1), 0
    for node in range(len(parent)):
        root = node
        while parent[root] != root:
            parent[root] = parent[parent[root]]
            root = parent[root]
        if number[root] < 0:
            number[root], n = n, n + 1
        labels[node] = number[root]
    return labels
