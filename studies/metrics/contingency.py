"""The contingency table of two labelings, the basis of every comparison of labels in this package."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

if TYPE_CHECKING:
    from scipy.sparse import coo_array


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
    labels_a, row = np.unique(a, return_inverse=True)
    labels_b, column = np.unique(b, return_inverse=True)
    cells, cell = np.unique(row * len(labels_b) + column, return_inverse=True)
    content = np.bincount(cell, weights=weights)
    return coo_array((content, np.divmod(cells, len(labels_b))), shape=(len(labels_a), len(labels_b)))


def _checked(labels: ArrayLike, which: str) -> NDArray[np.integer]:
    """The labels as an array, if they are one integer per point."""
    array = np.asarray(labels)
    if array.ndim != 1 or array.size == 0:
        raise ValueError(f"the {which} labeling must have the shape (n,) with n >= 1, got {array.shape}")
    if array.dtype.kind not in "iu":
        raise ValueError(f"the {which} labeling must hold integers, got {array.dtype}")
    return array
