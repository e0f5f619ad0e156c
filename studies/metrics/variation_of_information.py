"""The variation of information of two labelings."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from studies.columns import Column
from studies.metrics.contingency import contingency_table
from studies.metrics.metric import Metric


def variation_of_information(a: ArrayLike, b: ArrayLike) -> float:
    """Entropy of each labeling given the other, added up: what one does not tell about the other.

    Parameters
    ----------
    a, b : (n,) int array
        labels of the same n points

    Returns
    -------
    float
        in bits, 0 for equal partitions, at most twice the logarithm (base 2) of the larger number of segments

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    Notes
    -----
    The sum of the two values of `skimage.metrics.variation_of_information`, which are the contributions of splits and
    of merges. A metric in the mathematical sense.

    References
    ----------
    M. Meilă, Comparing clusterings: an information based distance, J. Multivariate Analysis 98 (5), 2007,
    doi:10.1016/j.jmva.2006.11.013.

    Examples
    --------
    >>> variation_of_information([0, 0, 1, 1], [5, 5, 5, 5])
    1.0
    """
    table = contingency_table(a, b)
    rows, columns = table.coords
    # Each cell by itself, so that a segment that did not change contributes exactly 0.
    splits = np.log2(table.sum(axis=1)[rows] / table.data)
    merges = np.log2(table.sum(axis=0)[columns] / table.data)
    return float(table.data @ (splits + merges) / table.sum())


METRICS = (
    Metric(
        column=Column(
            name="variation_of_information",
            heading="VI",
            format=".3f",
            unit="bits",
            lower_is_better=True,
            help="Variation of information, in bits: entropy of each segmentation given the other, added up.",
            compact=False,
        ),
        function=lambda comparison: variation_of_information(comparison.reference, comparison.labels),
        symmetric=True,
    ),
)
