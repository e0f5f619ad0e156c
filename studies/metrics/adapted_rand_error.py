"""The adapted Rand error of two labelings."""

from __future__ import annotations

from numpy.typing import ArrayLike

from studies.columns import Column
from studies.metrics.contingency import contingency_table
from studies.metrics.metric import Metric


def adapted_rand_error(a: ArrayLike, b: ArrayLike) -> float:
    """One minus the F-score of pairs: how well pairs together in one labeling are together in the other.

    Unlike in the Rand Index error, pairs apart in both labelings do not count, so that many small segments do not make
    the error small.

    Parameters
    ----------
    a, b : (n,) int array
        labels of the same n points

    Returns
    -------
    float
        without unit, 0 for equal partitions, at most 1

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    Notes
    -----
    With n_ij points in segment i of `a` and j of `b`, and s(x) = Σ x (x - 1): 1 - 2 s(n_ij) / (s(Σ_j n_ij) +
    s(Σ_i n_ij)), as `skimage.metrics.adapted_rand_error` computes it, in integers until the last division. That
    function leaves out points with the label 0, the background of an image; here all labels count, as with its option
    ``ignore_labels=()``. Where every segment of both labelings is a single point, which forms no pair, the error is 0.

    References
    ----------
    I. Arganda-Carreras et al., Crowdsourcing the creation of image segmentation algorithms for connectomics, Front.
    Neuroanat. 9, 2015, doi:10.3389/fnana.2015.00142.

    Examples
    --------
    >>> adapted_rand_error([0, 0, 1, 1], [5, 5, 5, 5])
    0.5
    """
    table = contingency_table(a, b)
    together = int((table.data * (table.data - 1)).sum())
    in_either = sum(int((sizes * (sizes - 1)).sum()) for sizes in (table.sum(axis=0), table.sum(axis=1)))
    return 1 - 2 * together / in_either if in_either else 0.0


METRICS = (
    Metric(
        column=Column(
            name="adapted_rand_error",
            heading="ARE",
            format=".4f",
            lower_is_better=True,
            help="Adapted Rand error: one minus the F-score of the pairs of points that are together.",
            compact=False,
        ),
        function=lambda comparison: adapted_rand_error(comparison.reference, comparison.labels),
        symmetric=True,
    ),
)
