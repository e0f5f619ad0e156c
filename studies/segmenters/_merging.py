"""Greedy merging of neighbouring regions, the cheapest pair first."""

from __future__ import annotations

import heapq
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled
from studies.segmenters._union_find import root


class Regions(NamedTuple):
    """Regions of a graph and the pairs of them that are neighbours, which `join` updates.

    Attributes
    ----------
    ends : (p, 2) int array
        the two regions of each pair, named by one of their nodes
    weights : (p, w) float array
        what is added up where pairs become the same
    version : (p,) int array
        how often one of its regions has grown, -1 for a pair that is gone
    parent : (m,) int array
        the node into whose region each node was merged, or itself
    head, tail : (m,) int array
        the list of the pairs of each region, in which a pair has one link per end: 2 i and 2 i + 1
    following : (2 p,) int array
        the next link, -1 after the last
    length : (m,) int array
        how many links the list has had
    seen_in, seen_pair : (m,) int array
        the list in which each region was seen last, and by which pair
    """

    ends: NDArray[np.int64]
    weights: NDArray[np.float64]
    version: NDArray[np.int64]
    parent: NDArray[np.int64]
    head: NDArray[np.int64]
    tail: NDArray[np.int64]
    following: NDArray[np.int64]
    length: NDArray[np.int64]
    seen_in: NDArray[np.int64]
    seen_pair: NDArray[np.int64]


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
    regions = linked_regions(pairs, costs.copy().reshape(-1, 1), len(areas))
    ends, cost, size, cut = regions.ends, regions.weights[:, 0], areas.copy(), np.zeros(len(areas))
    for i in range(len(pairs)):
        cut[pairs[i, 0]] += costs[i]
        cut[pairs[i, 1]] += costs[i]
    heap = [(_gain(ends[i, 0], ends[i, 1], cost[i], cut, size), i, 0) for i in range(len(pairs)) if is_left(regions, i)]
    heapq.heapify(heap)
    left = len(areas)
    while left > n_regions:
        i = next_pair(heap, regions)
        if i < 0:
            break
        kept, gone = join(regions, i)
        cut[kept] += cut[gone] - 2 * cost[i]
        size[kept] += size[gone]
        for j in pairs_of(regions, kept):
            heapq.heappush(heap, (_gain(ends[j, 0], ends[j, 1], cost[j], cut, size), j, regions.version[j]))
        left -= 1
    return numbered(regions)


@compiled
def _gain(a: int, b: int, cost: float, cut: NDArray[np.float64], size: NDArray[np.float64]) -> float:
    """By how much merging two regions changes the sum of cut / area."""
    return (cut[a] + cut[b] - 2 * cost) / (size[a] + size[b]) - cut[a] / size[a] - cut[b] / size[b]


@compiled
def linked_regions(pairs: NDArray[np.int64], weights: NDArray[np.float64], m: int) -> Regions:
    """Each of ``m`` nodes as a region of its own; pairs that occur twice are added up, in ``weights`` itself."""
    p = len(pairs)
    regions = Regions(
        pairs.copy(), weights, np.zeros(p, np.int64), np.arange(m), np.full(m, -1), np.full(m, -1),
        np.full(2 * p, -1), np.zeros(m, np.int64), np.full(m, -1), np.zeros(m, np.int64),
    )  # fmt: skip
    for link in range(2 * p):
        node = pairs[link // 2, link % 2]
        if regions.head[node] < 0:
            regions.head[node] = link
        else:
            regions.following[regions.tail[node]] = link
        regions.tail[node] = link
        regions.length[node] += 1
    for node in range(m):
        _combine(node, -2 - node, regions)
    return regions


@compiled
def is_left(regions: Regions, i: int) -> bool:
    """Whether a pair is still one of neighbours, and none that has been added to another."""
    return regions.version[i] >= 0


@compiled
def next_pair(heap: list[tuple[float, int, int]], regions: Regions) -> int:
    """The pair with the least cost, removed from a heap of (cost, pair, version); -1 if none is left."""
    while len(heap) > 0:
        _, i, version = heapq.heappop(heap)
        if regions.version[i] == version:
            return i
    return -1


@compiled
def join(regions: Regions, i: int) -> tuple[int, int]:
    """Merge the regions of a pair: the one that remains, whose pairs have a new version, and the one that is gone."""
    kept, gone = regions.ends[i, 0], regions.ends[i, 1]
    if regions.length[kept] < regions.length[gone]:
        kept, gone = gone, kept
    regions.version[i] = -1
    regions.parent[gone] = kept
    regions.length[kept] += regions.length[gone]
    link = regions.head[gone]
    while link >= 0:
        regions.ends[link // 2, link % 2] = kept
        link = regions.following[link]
    regions.following[regions.tail[kept]] = regions.head[gone]
    regions.tail[kept] = regions.tail[gone]
    _combine(kept, gone, regions)
    for j in pairs_of(regions, kept):
        regions.version[j] += 1
    return kept, gone


@compiled
def pairs_of(regions: Regions, node: int) -> list[int]:
    """The pairs of a region."""
    pairs, link = [], regions.head[node]
    while link >= 0:
        pairs.append(link // 2)
        link = regions.following[link]
    return pairs


@compiled
def _combine(node: int, name: int, regions: Regions) -> None:
    """Remove pairs that are gone from a region's list, and combine those with the same other end.

    The list is named by a number that no other has had: that of the region that has just been merged into this one.
    """
    last, link = -1, regions.head[node]
    regions.head[node] = -1
    while link >= 0:
        i, after = link // 2, regions.following[link]
        if is_left(regions, i):
            other = regions.ends[i, 1 - link % 2]
            if regions.seen_in[other] == name:
                for w in range(regions.weights.shape[1]):
                    regions.weights[regions.seen_pair[other], w] += regions.weights[i, w]
                regions.version[i] = -1
            else:
                regions.seen_in[other] = name
                regions.seen_pair[other] = i
                if last < 0:
                    regions.head[node] = link
                else:
                    regions.following[last] = link
                last = link
        link = after
    if last >= 0:
        regions.following[last] = -1
    regions.tail[node] = last


@compiled
def numbered(regions: Regions) -> NDArray[np.int64]:
    """The region of each node, numbered in the order of their first nodes: (m,)."""
    labels, number, n = np.empty_like(regions.parent), np.full(len(regions.parent), -1), 0
    for node in range(len(labels)):
        region = root(regions.parent, node)
        if number[region] < 0:
            number[region], n = n, n + 1
        labels[node] = number[region]
    return labels
