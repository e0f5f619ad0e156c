"""Change Percentage, the share of points whose segment changed, and the matching of segments behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.columns import Column
from studies.metrics.contingency import contingency_table
from studies.metrics.metric import Metric

if TYPE_CHECKING:
    from scipy.sparse import coo_array


def change_percentage(a: ArrayLike, b: ArrayLike) -> float:
    """Twice the share of points that must change their segment, in percent.

    Segments are matched one to one so that as few points as possible change; all points of a segment without
    a partner change. Symmetric, 0 for equal partitions whatever their labels, below 200.

    Parameters
    ----------
    a, b : (n,) int array
        labels of the same n points

    Returns
    -------
    float
        in percent

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    References
    ----------
    W. Benjamin, A. W. Polk, S. V. N. Vishwanathan, K. Ramani, Heat Walk: Robust Salient Segmentation of Non-rigid
    Shapes, Computer Graphics Forum 30 (7), 2011, Table 2.

    Examples
    --------
    >>> change_percentage([0, 0, 0, 0, 1, 1, 1, 1], [4, 4, 4, 2, 2, 2, 2, 2])
    25.0
    """
    table = contingency_table(a, b)
    n, unchanged = table.sum(), table.toarray()[_best_matching(table)].sum()
    return float(200 * (n - unchanged) / n)


def match_labels(reference: ArrayLike, labels: ArrayLike) -> NDArray[np.int64]:
    """Rename labels after the segments of a reference, so that a part keeps its label, and its colour, in all variants.

    Parameters
    ----------
    reference, labels : (n,) int array
        labels of the same n points

    Returns
    -------
    (n,) int64 array
        The same partition as `labels`. A segment has the label of the reference segment that it is matched with
        by the matching behind `change_percentage`. Segments that have no partner, or no point in common with it,
        are numbered from one more than the largest label of the reference, in the order of their own labels.

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    Examples
    --------
    >>> match_labels([5, 5, 5, 9], [1, 1, 2, 3])
    array([ 5,  5, 10,  9])
    """
    table = contingency_table(reference, labels)
    reference_labels, (_, segment) = np.unique(reference), np.unique(labels, return_inverse=True)
    row, column = _best_matching(table)
    overlap = table.toarray()[row, column] > 0
    matched = np.zeros(table.shape[1], dtype=bool)
    matched[column[overlap]] = True
    renamed = np.empty(table.shape[1], dtype=np.int64)
    renamed[column[overlap]] = reference_labels[row[overlap]]
    renamed[~matched] = reference_labels[-1] + 1 + np.arange(np.count_nonzero(~matched))
    return renamed[segment]


def _best_matching(table: coo_array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The one-to-one matching of rows and columns whose cells contain the most points."""
    from scipy.optimize import linear_sum_assignment  # here, because it takes long to import

    return linear_sum_assignment(table.toarray(), maximize=True)


METRICS = (
    Metric(
        column=Column(
            name="change_percentage",
            heading="CP %",
            format=".2f",
            unit="%",
            lower_is_better=True,
            help="Change Percentage: twice the share of points that must change their segment, under the best "
            "one-to-one matching of segments.",
        ),
        function=lambda comparison: change_percentage(comparison.reference, comparison.labels),
        symmetric=True,
    ),
)
