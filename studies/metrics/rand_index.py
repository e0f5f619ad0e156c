"""The Rand Index error of two labelings."""

from numpy.typing import ArrayLike

from studies.metrics.contingency import contingency_table


def rand_index_error(a: ArrayLike, b: ArrayLike) -> float:
    """One minus the Rand Index: the share of pairs of points together in one labeling, apart in the other.

    Points count alike, whatever area they stand for. 0 for a single point, which makes no pair.

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
    Integers until the last division, hence exact up to three thousand million points (W. M. Rand, Objective
    criteria for the evaluation of clustering methods, J. Am. Stat. Assoc. 66, 1971,
    doi:10.1080/01621459.1971.10482356).
    """
    table = contingency_table(a, b)
    n = int(table.sum())
    if n == 1:
        return 0.0
    ordered_pairs = (table.sum(axis=1) ** 2).sum() + (table.sum(axis=0) ** 2).sum() - 2 * (table.data**2).sum()
    return int(ordered_pairs) / (n * (n - 1))
