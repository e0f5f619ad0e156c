"""The Rand Index error of two labelings."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.columns import Column
from studies.metrics.contingency import contingency_table
from studies.metrics.metric import Metric


def rand_index_error(a: ArrayLike, b: ArrayLike) -> float:
    """One minus the Rand Index: the share of pairs of points together in one labeling and apart in the other.

    All points have the same weight, whatever area they represent. 0 for a single point, which forms no pair.

    Parameters
    ----------
    a, b : (n,) int array
        labels of the same n points

    Returns
    -------
    float
        0 for equal partitions, at most 1

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    Notes
    -----
    Computed in integers until the last division, hence exact for up to three billion points.

    References
    ----------
    W. M. Rand, Objective criteria for the evaluation of clustering methods, J. Am. Stat. Assoc. 66, 1971,
    doi:10.1080/01621459.1971.10482356.

    Examples
    --------
    >>> rand_index_error([0, 0, 1, 1], [0, 0, 0, 1])
    0.5
    """
    table = contingency_table(a, b)
    return error_of_counts(table.data, table.sum(axis=1), table.sum(axis=0))


def error_of_counts(cells: NDArray[np.int64], rows: NDArray[np.int64], columns: NDArray[np.int64]) -> float:
    """The Rand Index error from the numbers of points in the cells, rows and columns of a contingency table."""
    n = int(rows.sum())
    if n == 1:
        return 0.0
    ordered_pairs = (rows**2).sum() + (columns**2).sum() - 2 * (cells**2).sum()
    return int(ordered_pairs) / (n * (n - 1))


METRICS = (
    Metric(
        column=Column(
            name="rand_index_error",
            heading="Rand error",
            format=".4f",
            lower_is_better=True,
            help="One minus the Rand Index: the share of pairs of points together in one segmentation and apart in "
            "the other.",
            compact=False,
        ),
        function=lambda comparison: rand_index_error(comparison.reference, comparison.labels),
        symmetric=True,
    ),
)
