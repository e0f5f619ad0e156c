"""By how many segments two labelings differ."""

from __future__ import annotations

from numpy.typing import ArrayLike

from studies.columns import Column
from studies.metrics.contingency import contingency_table
from studies.metrics.metric import Metric


def segment_count_difference(a: ArrayLike, b: ArrayLike) -> int:
    """The absolute difference of the numbers of segments.

    Absolute, because a mean of signed differences is 0 where as many segments are gained on some variants as are lost
    on others; which of the two prevails can be seen from the mean numbers of segments.

    Parameters
    ----------
    a, b : (n,) int array
        labels of the same n points

    Returns
    -------
    int
        a count, 0 for equal partitions

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    Examples
    --------
    >>> segment_count_difference([0, 0, 1, 1], [5, 6, 7, 7])
    1
    """
    n_a, n_b = contingency_table(a, b).shape
    return abs(n_a - n_b)


METRICS = (
    Metric(
        column=Column(
            name="segment_count_difference",
            dtype="Int64",
            heading="Δ segments",
            format="d",
            lower_is_better=True,
            help="Absolute difference of the numbers of segments that the compared points have.",
            compact=False,
        ),
        function=lambda comparison: segment_count_difference(comparison.reference, comparison.labels),
        symmetric=True,
    ),
)
