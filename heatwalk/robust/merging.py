"""Regions of the walk joined where the heat-flow capacity between them is nearly that within them.

Two near-equal peaks of the heat kernel, in one limb or in both legs of a pair, are two regions or one as chance has it.
What tells real parts from such pairs is the persistence of a peak: how far the capacity decreases on the best way to a
higher one. The *peak* of a region is the capacity h(r, r) of its exemplar r, and the *saddle* between two regions the
largest capacity h(x, y) of the edges of the mesh that lead from one to the other:

    for each pair of adjacent regions, the highest saddle first:
        join them if the saddle is at least a given share of the lower of their two peaks
    for each pair of adjacent regions, the highest saddle first:
        join them if one of the two has less than a given share of the area

As saddles decrease and peaks only grow in this order, no pair that is passed over would be joined later, and the result
does not depend on which of two regions comes first.

References
----------
F. Chazal, L. J. Guibas, S. Y. Oudot, P. Skraba, "Persistence-based clustering in Riemannian manifolds", Journal of the
ACM 60(6), 2013, doi:10.1145/2535927
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heatwalk.kernel import HeatKernel
from heatwalk.numerics.compilation import compiled
from heatwalk.numerics.triangles import find_root


@dataclass(frozen=True)
class Merging:
    """Which of K regions are joined to which of K' <= K.

    Attributes
    ----------
    of_region : (K,) int array, 0 … K'-1
        the joined region that each region is part of
    exemplars : (K',) int array, ascending
        the vertex of the highest peak of each joined region
    margin : (K,) float array
        how far the decisions about each region are from the opposite ones, in [0, 1]: 0 if the saddle is at the limit
        between joined and not joined, or the area; 1 if the saddle is as high as the peak, or has no height
    """

    of_region: NDArray[np.int64]
    exemplars: NDArray[np.int64]
    margin: NDArray[np.float64]


@dataclass(frozen=True)
class Saddles:
    """The p pairs of adjacent regions, the highest saddle first.

    Attributes
    ----------
    pairs : (p, 2) int array
        the smaller region first
    heights : (p,) float array, descending
    """

    pairs: NDArray[np.int64]
    heights: NDArray[np.float64]


def saddles_between(kernel: HeatKernel, labels: NDArray[np.int64], edges: NDArray[np.int64]) -> Saddles:
    """The largest heat-flow capacity of the edges between each two adjacent regions.

    Parameters
    ----------
    kernel : HeatKernel
        of a mesh with n vertices
    labels : (n,) int array, 0 … K-1
    edges : (e, 2) int array
        of the mesh

    Returns
    -------
    Saddles

    Examples
    --------
    >>> kernel = HeatKernel(np.array([[1.0, 0], [1, 1], [0, 2]]), np.zeros(3, int), np.ones(3) / 3, time=1.0)
    >>> saddles_between(kernel, np.array([0, 0, 1]), np.array([[0, 1], [1, 2], [2, 0]]))
    Saddles(pairs=array([[0, 1]]), heights=array([2.]))
    """
    between = labels[edges]
    crosses = between[:, 0] != between[:, 1]
    (start, end), between = edges[crosses].T, np.sort(between[crosses], axis=1)
    capacity = np.einsum("ij,ij->i", kernel.factor[start], kernel.factor[end])
    order = np.lexsort((between[:, 1], between[:, 0], -capacity))
    between, capacity = between[order], capacity[order]
    n_regions = int(labels.max()) + 1
    first = np.sort(np.unique(between[:, 0] * n_regions + between[:, 1], return_index=True)[1])
    return Saddles(between[first], capacity[first])


def merge_regions(
    saddles: Saddles,
    exemplars: NDArray[np.int64],
    peaks: NDArray[np.float64],
    areas: NDArray[np.float64],
    *,
    persistence: float,
    min_area: float,
) -> Merging:
    """Join adjacent regions.

    Parameters
    ----------
    saddles : Saddles
        of K regions
    exemplars : (K,) int array
    peaks : (K,) float array
        h(r, r) of each exemplar r
    areas : (K,) float array
        of each region, whose sum is the area of the mesh
    persistence : float
        join two regions if the saddle between them is at least this share of the lower peak; above 1: none
    min_area : float
        then join regions of less than this share of the area with the neighbour of the highest saddle; 0: none

    Returns
    -------
    Merging

    Notes
    -----
    A connected component of the mesh that is smaller than ``min_area`` has no neighbour and remains a region here.

    Examples
    --------
    >>> saddles = Saddles(np.array([[0, 1], [1, 2]]), np.array([0.95, 0.5]))
    >>> merging = merge_regions(
    ...     saddles, np.array([5, 3, 7]), np.array([1.0, 1.2, 2.0]), np.ones(3), persistence=0.9, min_area=0.01
    ... )
    >>> merging.of_region, merging.exemplars
    (array([0, 0, 1]), array([3, 7]))
    >>> merging.margin.round(2)
    array([0.5 , 0.54, 1.  ])
    """
    from heatwalk.confidence import least_on_path

    roots, targets, margins = _join(
        saddles.pairs, saddles.heights, exemplars, peaks, areas, float(persistence), min_area * float(areas.sum())
    )
    joined = np.sort(exemplars[np.unique(roots)])
    return Merging(np.searchsorted(joined, exemplars[roots]), joined, least_on_path(margins, targets))


@compiled
def _join(
    pairs: NDArray[np.int64],
    heights: NDArray[np.float64],
    exemplars: NDArray[np.int64],
    peaks: NDArray[np.float64],
    areas: NDArray[np.float64],
    persistence: float,
    smallest: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """The root of each region, the region that it was joined to, and the margin of its own join or of none."""
    n_regions = len(exemplars)
    target, shortcut, margin, area = np.arange(n_regions), np.arange(n_regions), np.ones(n_regions), areas.copy()
    for stage in range(3):  # by persistence, by area, and what keeps the rest apart
        for p in range(len(pairs)):
            low, high = find_root(shortcut, pairs[p, 0]), find_root(shortcut, pairs[p, 1])
            if low == high:
                continue
            if peaks[low] > peaks[high] or (peaks[low] == peaks[high] and exemplars[low] < exemplars[high]):
                low, high = high, low
            share, size = heights[p] / peaks[low], min(area[low], area[high])
            if stage == 0:
                joins, of_join = share >= persistence, (share - persistence) / max(1 - persistence, 1e-300)
            elif stage == 1:
                joins, of_join = size < smallest, 1 - size / max(smallest, 1e-300)
            else:
                joins, of_join = False, min(1 - share / persistence, 1 - smallest / area[low])
            if joins:
                target[low] = shortcut[low] = high
                area[high] += area[low]
            if joins or stage == 2:
                margin[low] = min(margin[low], max(of_join, 0.0))
    roots = np.empty(n_regions, dtype=np.int64)
    for region in range(n_regions):
        roots[region] = find_root(shortcut, region)
    return roots, target, margin
