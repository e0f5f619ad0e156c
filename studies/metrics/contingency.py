"""The contingency table of two labelings, on which every comparison of labels here is built."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array


def contingency_table(a: ArrayLike, b: ArrayLike, weights: NDArray[np.float64] | None = None) -> coo_array:
    """Count the points that segment i of `a` and segment j of `b` have in common.

    Parameters
    ----------
    a, b : (n,) integers
        Labels of the same n points, n >= 1. Any integers; segments are numbered in the order of their labels.
    weights : (n,) float64, optional
        What each point counts for; 1 without.

    Returns
    -------
    (segments of a, segments of b) sparse array, each cell once and only the cells in which there are points;
    int64 without weights, float64 with them.

    Raises
    ------
    ValueError
        If `a` or `b` is empty, is not one-dimensional, does not hold integers, or the lengths differ.
    """
    a, b = _checked(a, "first"), _checked(b, "second")
    if len(a) != len(b):
        raise ValueError(f"the labelings must be of the same points, got {len(a)} labels and {len(b)}")
    labels_a, row = np.unique(a, return_inverse=True)
    labels_b, column = np.unique(b, return_inverse=True)
    cells, cell = np.unique(row * len(labels_b) + column, return_inverse=True)
    content = np.bincount(cell, weights=weights)
    return coo_array((content, np.divmod(cells, len(labels_b))), shape=(len(labels_a), len(labels_b)))


def _checked(labels: ArrayLike, which: str) -> NDArray[np.integer]:
    labels = np.asarray(labels)
    if labels.ndim != 1 or labels.size == 0:
        raise ValueError(f"the {which} labeling must have the shape (n,) with n >= 1, got {labels.shape}")
    if labels.dtype.kind not in "iu":
        raise ValueError(f"the {which} labeling must hold integers, got {labels.dtype}")
    return labels
