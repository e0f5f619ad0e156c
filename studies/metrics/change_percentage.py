"""Change Percentage, the paper's measure of how much a segmentation changed, and van Dongen's distance."""

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array

from studies.metrics.contingency import contingency_table


def change_percentage(a: ArrayLike, b: ArrayLike) -> float:
    """Twice the share of points that must change their segment, in percent (paper, Table 2).

    Segments are matched one to one so that as few points as possible change; all points of a segment without
    a partner change. Symmetric, 0 for the same partition whatever its labels, below 200.

    Parameters
    ----------
    a, b : (n,) integers
        Labels of the same n points.

    Raises
    ------
    ValueError
        If the labels are empty, not integers, or of different lengths.
    """
    table = contingency_table(a, b)
    n, unchanged = table.sum(), table.toarray()[_best_matching(table)].sum()
    return float(200 * (n - unchanged) / n)


def van_dongen(a: ArrayLike, b: ArrayLike) -> float:
    """Van Dongen's distance of two partitions, in percent.

    Equals the Change Percentage where segments match one to one, and is smaller where a segment splits or two
    merge: each segment is held against the one it overlaps most, whichever others chose that one too.

    Parameters
    ----------
    a, b : (n,) integers
        Labels of the same n points.

    Raises
    ------
    ValueError
        If the labels are empty, not integers, or of different lengths.

    Notes
    -----
    With n_ij points in segment i of `a` and j of `b`: 100 (2n - sum_i max_j n_ij - sum_j max_i n_ij) / n. A
    metric (S. van Dongen, Performance criteria for graph clustering and Markov cluster experiments, CWI
    INS-R0012, 2000).
    """
    table = contingency_table(a, b)
    n = table.sum()
    return float(100 * (2 * n - table.max(axis=1).sum() - table.max(axis=0).sum()) / n)


def match_labels(reference: ArrayLike, labels: ArrayLike) -> NDArray[np.int64]:
    """Rename labels after the segments of a reference: a part keeps its name, and colour, between variants.

    Parameters
    ----------
    reference, labels : (n,) integers
        Labels of the same n points.

    Returns
    -------
    (n,) int64
        The same partition as `labels`. A segment has the label of the reference segment which the matching
        behind `change_percentage` gives it; those that get none, or one they have no point in common with,
        are numbered on from the largest label of the reference, in the order of their own labels.

    Raises
    ------
    ValueError
        If the labels are empty, not integers, or of different lengths.
    """
    table = contingency_table(reference, labels)
    of_reference, (_, segment) = np.unique(reference), np.unique(labels, return_inverse=True)
    row, column = _best_matching(table)
    overlap = table.toarray()[row, column] > 0
    matched = np.zeros(table.shape[1], dtype=bool)
    matched[column[overlap]] = True
    renamed = np.empty(table.shape[1], dtype=np.int64)
    renamed[column[overlap]] = of_reference[row[overlap]]
    renamed[~matched] = of_reference[-1] + 1 + np.arange(np.count_nonzero(~matched))
    return renamed[segment]


def _best_matching(table: coo_array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The one-to-one matching of rows with columns that holds the most points."""
    return linear_sum_assignment(table.toarray(), maximize=True)
