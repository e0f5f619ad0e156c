"""Paired bootstrap over models: every method and the reference are resampled with the same models."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from studies.statistics.bootstrap import NO_INTERVAL, RESAMPLES, quantile_interval

SEED = 0


def resampled_counts(n_models: int, n_resamples: int = RESAMPLES, seed: int = SEED) -> NDArray[np.int64]:
    """How often each model is drawn in each resample: (n_resamples, n_models), drawn with replacement.

    Examples
    --------
    >>> resampled_counts(3, n_resamples=2).sum(axis=1).tolist()
    [3, 3]
    """
    rng = np.random.default_rng(seed)
    return rng.multinomial(n_models, np.full(n_models, 1 / n_models), size=n_resamples)


def resampled_mce(
    areas: NDArray[np.float64], reference: NDArray[np.float64], counts: NDArray[np.int64]
) -> NDArray[np.float64]:
    """The mean corruption error of every method in every resample.

    Parameters
    ----------
    areas : (m, p, n) float array
        sums over strengths of m methods under p perturbations of n models, see `studies.statistics.severity.areas`
    reference : (p, n) float array
        those of the method that the errors are relative to
    counts : (r, n) int array
        from `resampled_counts`

    Returns
    -------
    (r, m) float array
        A perturbation under which the reference is 0 is left out of a resample; NaN where that leaves none.
    """
    sums = np.einsum("rn,mpn->rmp", counts, areas, optimize=True)
    standard = np.einsum("rn,pn->rp", counts, reference)[:, None, :]
    defined = np.broadcast_to(standard > 0, sums.shape)
    errors = np.divide(sums, standard, out=np.zeros_like(sums), where=defined)
    n_defined = defined.sum(axis=2)
    return np.divide(errors.sum(axis=2), n_defined, out=np.full(sums.shape[:2], np.nan), where=n_defined > 0)


def resampled_means(values: NDArray[np.float64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """The mean over models of every method in every resample: (r, m) of values (m, n)."""
    return counts @ values.T / counts.sum(axis=1, keepdims=True)


def intervals(samples: NDArray[np.float64]) -> list[tuple[float, float]]:
    """The central 95 % interval of every column of resampled values; NaN if some are missing."""
    return [quantile_interval(column) if np.isfinite(column).all() else NO_INTERVAL for column in samples.T]


def is_better(first: NDArray[np.float64], second: NDArray[np.float64]) -> bool:
    """Whether the first of two methods is lower in a way that resampling does not undo.

    Parameters
    ----------
    first, second : (r,) float array
        resampled values of both, for the same resamples

    Returns
    -------
    bool
        True if the 95 % interval of their difference is below 0; False if it contains 0: they cannot be told apart

    Examples
    --------
    >>> is_better(np.array([1.0, 2.0]), np.array([1.5, 2.5])), is_better(np.array([1.0, 2.0]), np.array([1.5, 1.5]))
    (True, False)
    """
    high = quantile_interval(first - second)[1]
    return not math.isnan(high) and high < 0
