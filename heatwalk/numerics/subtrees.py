"""Which panels of a sparse factor can be eliminated at the same time.

The parent of a panel is the first panel that it is subtracted from; panels are only subtracted from their ancestors.
So ranges of panels of which no panel before them has a parent within them can be eliminated in any order, or at the
same time. After those come the panels in none of them, the top of the tree.

    ranges = [all panels]
    repeat:
        move the last panel of the heaviest range to the top
        cut the rest of it wherever no panel has its parent beyond the cut within the range
    of all of these, choose the ranges with the least estimated time
"""

from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

# Ranges are not cut once the heaviest is this many times lighter than the share of one thread: nothing is to be gained.
FINEST = 8

# Nor if the top has so many panels: each costs a comparison of all its neighbours.
LARGEST_TOP = 200


class Part(NamedTuple):
    """A range of panels, and what of it concerns later ones.

    first, last : int
    is_subtree : bool
        whether it needs nothing from panels before it
    outer : (q,) int array, its panels with rows beyond its own columns
    rows : (m,) int array, these rows, panel after panel
    """

    first: int
    last: int
    is_subtree: bool
    outer: NDArray[np.int64]
    rows: NDArray[np.int32]


def independent_ranges(parents: NDArray[np.int64], weights: NDArray[np.int64], threads: int) -> list[tuple[int, int]]:
    """Ranges of panels that need nothing from panels outside, to be shared among threads.

    Parameters
    ----------
    parents : (p,) int array
        larger than the panel, or -1
    weights : (p,) int array
        of eliminating each panel
    threads : int

    Returns
    -------
    list of (first, last)
        ascending; the other panels come after those that they need, in ascending order

    Examples
    --------
    Two chains that are joined at the end:

    >>> independent_ranges(np.array([1, 2, 6, 4, 5, 6, -1]), np.ones(7, int), 2)
    [(0, 3), (3, 6)]
    """
    total = np.append(0, np.cumsum(weights))
    smallest_child = np.arange(len(parents))
    children = np.flatnonzero(parents >= 0)
    np.minimum.at(smallest_child, parents[children], children)

    ranges = best = [(0, len(parents))]
    least, top = float(total[-1]), 0
    for _ in range(LARGEST_TOP):
        heaviest = max(ranges, key=lambda each: total[each[1]] - total[each[0]])
        first, last = heaviest
        if total[last] - total[first] <= total[-1] / (FINEST * threads):
            break
        top += weights[last - 1]
        ranges = [each for each in ranges if each != heaviest]
        ranges += _independent(smallest_child, total, first, last - 1, total[-1] / (FINEST * threads))
        if not ranges:
            break
        if (time := top + _longest_share(ranges, total, threads)) < least:
            least, best = time, ranges
    return sorted(best)


def _independent(
    smallest_child: NDArray[np.int64], total: NDArray[np.int64], first: int, last: int, weight: float
) -> list[tuple[int, int]]:
    """A range cut wherever possible; neighbours that together have at most this weight stay together."""
    if first == last:
        return []
    smallest = np.minimum.accumulate(smallest_child[first:last][::-1])[::-1]
    cuts = np.append(first + np.flatnonzero(smallest >= np.arange(first, last)), last)
    ranges, at = [], 0
    while at < len(cuts) - 1:
        end = max(at + 1, int(np.searchsorted(total[cuts], total[cuts[at]] + weight, side="right")) - 1)
        ranges.append((int(cuts[at]), int(cuts[end])))
        at = end
    return ranges


def _longest_share(ranges: list[tuple[int, int]], total: NDArray[np.int64], threads: int) -> float:
    """The weight of the thread with most, if each takes the heaviest range that is left as soon as it is free."""
    shares = [0.0] * threads
    for weight in sorted((total[last] - total[first] for first, last in ranges), reverse=True):
        lightest = min(range(threads), key=shares.__getitem__)
        shares[lightest] += weight
    return max(shares)


def stretches(ranges: list[tuple[int, int]], n_panels: int) -> list[tuple[int, int]]:
    """The ranges and what lies between them, in ascending order.

    Examples
    --------
    >>> stretches([(0, 3), (3, 6)], 8)
    [(0, 3), (3, 6), (6, 8)]
    """
    bounds = sorted({0, n_panels, *(bound for each in ranges for bound in each)})
    return list(pairwise(bounds))
