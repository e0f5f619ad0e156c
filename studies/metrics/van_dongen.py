"""Van Dongen's distance of two partitions."""

from __future__ import annotations

from numpy.typing import ArrayLike

from studies.columns import Column
from studies.metrics.contingency import contingency_table
from studies.metrics.metric import Metric


def van_dongen(a: ArrayLike, b: ArrayLike) -> float:
    """Van Dongen's distance of two partitions, in percent.

    Equals the Change Percentage if segments match one to one, and is smaller if a segment splits or two merge: each
    segment is compared with the one that it overlaps most, even if other segments overlap that one most too.

    Parameters
    ----------
    a, b : (n,) int array
        labels of the same n points

    Returns
    -------
    float
        in percent, 0 for equal partitions, below 200

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    Notes
    -----
    With n_ij points in segment i of `a` and j of `b`: 100 (2n - sum_i max_j n_ij - sum_j max_i n_ij) / n. A metric
    in the mathematical sense.

    References
    ----------
    S. van Dongen, Performance criteria for graph clustering and Markov cluster experiments, CWI INS-R0012, 2000.

    Examples
    --------
    >>> van_dongen([0, 0, 0, 0], [0, 0, 0, 1])
    25.0
    """
    table = contingency_table(a, b)
    n = table.sum()
    return float(100 * (2 * n - table.max(axis=1).sum() - table.max(axis=0).sum()) / n)


METRICS = (
    Metric(
        column=Column(
            name="van_dongen",
            heading="van Dongen",
            format=".2f",
            unit="%",
            lower_is_better=True,
            help="Van Dongen's distance: as the Change Percentage, but each segment is compared with the one that it "
            "overlaps most.",
            compact=False,
        ),
        function=lambda comparison: van_dongen(comparison.reference, comparison.labels),
        symmetric=True,
    ),
)
