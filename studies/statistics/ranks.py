"""Ranks that methods share if they cannot be told apart, and which methods no other is better than in all respects."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.statistics.paired import is_better


def shared_ranks(values: ArrayLike, samples: NDArray[np.float64] | None = None) -> list[int | None]:
    """The rank of every method: 1 plus the number of methods that are better than it. Lower values are better.

    Parameters
    ----------
    values : (m,) float array
        NaN for a method that has no rank
    samples : (r, m) float array, optional
        paired resampled values: a method is better than another if the 95 % interval of their difference does not
        contain 0. Without them, if its value is lower.

    Returns
    -------
    list of int or None

    Examples
    --------
    >>> shared_ranks([2.0, 1.0, float("nan"), 2.0])
    [2, 1, None, 2]
    >>> shared_ranks([1.0, 1.1], np.array([[1.0, 1.2], [1.2, 1.0]]))
    [1, 1]
    """
    values = np.asarray(values, dtype=float)
    ranked = np.flatnonzero(~np.isnan(values))
    ranks: list[int | None] = [None] * len(values)
    for i in ranked:
        better = (
            values[j] < values[i] if samples is None else is_better(samples[:, j], samples[:, i])
            for j in ranked
            if j != i
        )
        ranks[i] = 1 + sum(map(bool, better))
    return ranks


def pareto_front(x: ArrayLike, y: ArrayLike) -> NDArray[np.bool_]:
    """Which points no other is at least as low as in both coordinates, and lower in one.

    Parameters
    ----------
    x, y : (m,) float array
        a point with a missing coordinate is not on the front

    Returns
    -------
    (m,) bool array

    Examples
    --------
    >>> pareto_front([0.1, 0.2, 0.3, 0.1], [1.0, 0.5, 0.6, float("nan")]).tolist()
    [True, True, False, False]
    """
    x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
    present = ~np.isnan(x) & ~np.isnan(y)
    lower_or_equal = (x[:, None] <= x) & (y[:, None] <= y)
    lower = (x[:, None] < x) | (y[:, None] < y)
    is_dominated = (lower_or_equal & lower & present[:, None]).any(axis=0)
    return present & ~is_dominated
