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

_TINY = np.finfo(float).tiny


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
    n_regions, smallest = len(exemplars), min_area * float(areas.sum())
    joins = _Joins(exemplars.tolist(), peaks.tolist(), areas.tolist())
    for a, b, height in zip(*saddles.pairs.T.tolist(), saddles.heights.tolist(), strict=True):
        low, high = joins.roots(a, b)
        if low != high and height >= persistence * joins.peak[low]:
            joins.join(low, high, (height / joins.peak[low] - persistence) / max(1 - persistence, _TINY))
    for a, b in saddles.pairs.tolist():
        low, high = joins.roots(a, b)
        if low != high and (area := min(joins.area[low], joins.area[high])) < smallest:
            joins.join(low, high, 1 - area / smallest)
    for a, b, height in zip(*saddles.pairs.T.tolist(), saddles.heights.tolist(), strict=True):
        low, high = joins.roots(a, b)
        if low != high:
            joins.limit(low, 1 - height / (persistence * joins.peak[low]))
            joins.limit(low, 1 - smallest / joins.area[low])
    roots = np.array([joins.root(region) for region in range(n_regions)])
    joined = np.sort(exemplars[np.unique(roots)])
    return Merging(np.searchsorted(joined, exemplars[roots]), joined, joins.margins())


class _Joins:
    """A forest of regions, each joined to one of a higher peak."""

    def __init__(self, exemplars: list[int], peaks: list[float], areas: list[float]) -> None:
        self.exemplar, self.peak, self.area = exemplars, peaks, areas  # of a root: those of its tree
        self._target = list(range(len(peaks)))
        self._shortcut = list(range(len(peaks)))
        self._margin = [1.0] * len(peaks)

    def root(self, region: int) -> int:
        """The region of the highest peak among those joined."""
        while self._shortcut[region] != region:
            self._shortcut[region] = self._shortcut[self._shortcut[region]]
            region = self._shortcut[region]
        return region

    def roots(self, a: int, b: int) -> tuple[int, int]:
        """The roots of two regions, that of the lower peak first; of equal ones, that of the larger exemplar."""
        a, b = self.root(a), self.root(b)
        return (a, b) if (self.peak[a], -self.exemplar[a]) <= (self.peak[b], -self.exemplar[b]) else (b, a)

    def join(self, low: int, high: int, margin: float) -> None:
        """Join one root to another."""
        self._target[low] = self._shortcut[low] = high
        self.area[high] += self.area[low]
        self.limit(low, margin)

    def limit(self, region: int, margin: float) -> None:
        """Lower the margin of a region, and of those joined to it, to a value in [0, 1]."""
        self._margin[region] = min(self._margin[region], max(margin, 0.0), 1.0)

    def margins(self) -> NDArray[np.float64]:
        """The smallest margin on the way from each region to its root."""
        from heatwalk.confidence import least_on_path

        return least_on_path(np.array(self._margin), np.array(self._target))
