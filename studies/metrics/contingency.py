"""The contingency table of two labelings, the basis of every comparison of labels in this package."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from scipy.sparse import coo_array

_DENSE = 8  # numbers per label up to which counting them is quicker than sorting the labels


def contingency_table(a: ArrayLike, b: ArrayLike, weights: NDArray[np.float64] | None = None) -> coo_array:
    """Count the points that segment i of `a` and segment j of `b` have in common.

    Parameters
    ----------
    a, b : (n,) int array
        labels of the same n points, n >= 1. Any integers; segments are numbered in the order of their labels.
    weights : (n,) float64 array, optional
        weight of each point; 1 by default

    Returns
    -------
    (k, l) scipy.sparse.coo_array
        a row per segment of `a`, a column per segment of `b`; each cell that contains points is stored once. int64
        without weights, float64 with them.

    Raises
    ------
    ValueError
        If `a` or `b` is empty, is not one-dimensional, or does not hold integers, or if their lengths differ.

    Examples
    --------
    >>> contingency_table([0, 0, 1, 1], [5, 5, 5, 7]).toarray()
    array([[2, 0],
           [1, 1]])
    """
    from scipy.sparse import coo_array  # here, because many processes import metrics for their columns alone

    a, b = _checked(a, "first"), _checked(b, "second")
    if len(a) != len(b):
        raise ValueError(f"the labelings must label the same points, got {len(a)} labels and {len(b)}")
    cells = Cells.of(numbered(a), numbered(b))
    content = cells.counts if weights is None else cells.totals(weights)
    return coo_array((content, (cells.row, cells.column)), shape=cells.shape)


@dataclass(frozen=True)
class Cells:
    """The cells of a contingency table that contain points: their rows, their columns and the cell of each point."""

    row: NDArray[np.int64]
    column: NDArray[np.int64]
    counts: NDArray[np.int64]
    cell: NDArray[np.int64]
    shape: tuple[int, int]

    @classmethod
    def of(cls, a: tuple[NDArray[np.int64], int], b: tuple[NDArray[np.int64], int]) -> Cells:
        """The cells of two labelings, each as `numbered` returns it."""
        (row, n_rows), (column, n_columns) = a, b
        cell, _ = numbered(row * n_columns + column)
        counts = np.bincount(cell)
        first = np.empty(len(counts), dtype=np.int64)
        first[cell] = np.arange(len(cell))  # any point of each cell
        return cls(row[first], column[first], counts, cell, (n_rows, n_columns))

    def totals(self, weights: NDArray[np.float64]) -> NDArray[Any]:
        """The weight of the points of each cell."""
        return np.bincount(self.cell, weights=weights)

    def row_sums(self, content: NDArray[Any]) -> NDArray[Any]:
        """Sums of a content of the cells over each row."""
        return np.bincount(self.row, weights=content, minlength=self.shape[0])

    def column_sums(self, content: NDArray[Any]) -> NDArray[Any]:
        """Sums of a content of the cells over each column."""
        return np.bincount(self.column, weights=content, minlength=self.shape[1])


def numbered(labels: NDArray[np.integer]) -> tuple[NDArray[np.int64], int]:
    """The labels numbered from 0 in their order, without gaps, and how many different ones there are."""
    span = int(labels.max()) - int(labels.min()) + 1
    if span > _DENSE * len(labels):
        values, index = np.unique(labels, return_inverse=True)
        return index, len(values)
    # Counting, because comparing labels with many references would spend most of its time sorting them.
    wide = labels if labels.dtype.kind == "u" else labels.astype(np.int64)
    offsets = (wide - wide.min()).astype(np.int64)
    is_present = np.bincount(offsets, minlength=span) > 0
    return (np.cumsum(is_present) - 1)[offsets], int(is_present.sum())


def _checked(labels: ArrayLike, which: str) -> NDArray[np.integer]:
    """The labels as an array, if they are one integer per point."""
    array = np.asarray(labels)
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"the {which} labeling must have the shape (n,) with n >= 1, got {array.shape}")
    if array.dtype.kind not in "iu":
        raise ValueError(f"the {which} labeling must hold integers, got {array.dtype}")
    return array
