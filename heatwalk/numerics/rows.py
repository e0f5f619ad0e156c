"""Equal rows of an array, merged without sorting rows."""

import numpy as np
from numpy.typing import NDArray

# An odd factor that spreads bits over 64 of them: 2**64 over the golden ratio.
_MIXER = np.uint64(0x9E3779B97F4A7C15)


def merge_equal(points: NDArray) -> tuple[NDArray, NDArray[np.int64]]:
    """The distinct rows of a (k, 3) float array without negative zeros, sorted, and for each row its place among them.

    As `numpy.unique` of rows, but what is sorted is one number per row, which mixes its bits.
    """
    found = None
    if np.isfinite(points).all():
        bits = np.ascontiguousarray(points).view(f"u{points.dtype.itemsize}")
        mixed = np.zeros(len(points), dtype=np.uint64)
        for axis in range(3):
            mixed = (mixed ^ bits[:, axis]) * _MIXER  # wraps around
            mixed ^= mixed >> np.uint64(29)
        found = _merge_alike(points, *_sorted_with_place(mixed)) or _merge_alike(
            points, np.sort(mixed), np.argsort(mixed)
        )
    if found is None:  # not finite, or different rows of the same mix
        distinct, inverse = np.unique(points, axis=0, return_inverse=True)
        return distinct, inverse.reshape(-1)
    vertices, rank = found
    by_row = _order_of_rows(vertices)
    place = np.empty(len(vertices), dtype=np.int64)
    place[by_row] = np.arange(len(vertices))
    return vertices[by_row], place[rank]


def _sorted_with_place(mixed: NDArray[np.uint64]) -> tuple[NDArray[np.uint64], NDArray[np.int64]]:
    """The leading bits of numbers, sorted, and the place of each: both in one number, which is quicker to sort."""
    n_bits = np.uint64(len(mixed).bit_length())
    both = np.sort((mixed >> n_bits << n_bits) | np.arange(len(mixed), dtype=np.uint64))
    return both >> n_bits, (both & ((np.uint64(1) << n_bits) - np.uint64(1))).astype(np.int64)


def _merge_alike(
    points: NDArray, ordered: NDArray[np.uint64], order: NDArray[np.int64]
) -> tuple[NDArray, NDArray] | None:
    """The rows that differ in their sorted number, and for each row its place among them; None if others differ."""
    begins = np.append(True, ordered[1:] != ordered[:-1])[: len(points)]
    narrow = np.int32 if len(points) < 2**31 else np.int64  # scattered in half the time
    rank = np.empty(len(points), dtype=narrow)
    rank[order] = np.cumsum(begins, dtype=narrow) - 1
    rows = points[order[begins]]
    return (rows, rank) if np.array_equal(rows[rank], points) else None


def _order_of_rows(rows: NDArray) -> NDArray[np.int64]:
    """The order of distinct rows: by the first column, and where that is equal, by the others."""
    order = np.argsort(rows[:, 0])
    first = rows[order, 0]
    ties = first[1:] == first[:-1]
    tied = np.flatnonzero(np.append(ties, False) | np.append(False, ties))
    order[tied] = order[tied][np.lexsort(rows[order[tied]].T[::-1])]
    return order
