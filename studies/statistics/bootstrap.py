"""95 % bootstrap intervals of means over models."""

from __future__ import annotations

import functools
import itertools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

RESAMPLES = 2000
TOGETHER = 20  # resamples that are drawn at a time
FEW = 500  # rows of which the models are found without pandas, which takes longer to begin
TAILS = (0.025, 0.975)  # quantiles of the resampled means
NO_INTERVAL = (math.nan, math.nan)


def model_mean(rows: pd.DataFrame, column: str) -> float:
    """Mean over models of the mean over repeats, so that a model with failures weighs as much as the others."""
    return float(rows.groupby("model")[column].mean().astype(float).mean())


def model_means_by(
    rows: pd.DataFrame, keys: Sequence[str], columns: Sequence[str]
) -> dict[tuple[Any, ...], dict[str, float]]:
    """As `model_mean`, of several columns in every group, by its keys; quicker than one after the other.

    Examples
    --------
    >>> import pandas as pd
    >>> rows = pd.DataFrame({"level": [1, 1, 1, 2], "model": ["ant", "ant", "cow", "cow"], "value": [1.0, 3, 6, 9]})
    >>> model_means_by(rows, ["level"], ["value"])
    {(1,): {'value': 4.0}, (2,): {'value': 9.0}}
    """
    of_models = rows.groupby([*keys, "model"], observed=True)[list(columns)].mean()
    values = of_models.to_numpy(dtype=float)
    groups = [key[:-1] for key in of_models.index]
    means = {}
    for group, numbers in itertools.groupby(range(len(groups)), groups.__getitem__):
        of_group = values[list(numbers)]
        known = ~np.isnan(of_group)
        means[group] = {
            name: float(of_group[known[:, i], i].mean()) if known[:, i].any() else math.nan
            for i, name in enumerate(columns)
        }
    return means


def interval_of_mean(rows: pd.DataFrame, column: str) -> tuple[float, float]:
    """95 % percentile-bootstrap interval of `model_mean`.

    Models are drawn with replacement, then repeats of each drawn model: both are samples, of shapes and of noise. With
    a single model only its repeats are resampled, and the interval is about that model alone.

    Parameters
    ----------
    rows : DataFrame
        trials, with the columns model and ``column``
    column : str

    Returns
    -------
    (float, float)
        NaN if there is nothing to resample

    Examples
    --------
    >>> import pandas as pd
    >>> rows = pd.DataFrame({"model": ["ant", "cow", "dog"], "value": [1.0, 2.0, 3.0]})
    >>> interval_of_mean(rows, "value")
    (1.0, 3.0)
    """
    return interval_of_values(_values_of_models(rows, column))


def interval_of_values(values: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """As `interval_of_mean`, of the values of the repeats of each model."""
    if sum(map(len, values)) < 2:
        return NO_INTERVAL
    if all(len(repeats) == 1 for repeats in values):
        return _one_value_per_model(np.concatenate(values))
    return _nested(values)


def _values_of_models(rows: pd.DataFrame, column: str) -> list[NDArray[np.float64]]:
    """The values of each model, in the order of the models' names: ``rows.groupby("model")[column]``, but quicker."""
    import pandas as pd

    values = rows[column].to_numpy(dtype=float)
    if len(rows) <= FEW:
        places: dict[str, list[int]] = {}
        for i, name in enumerate(rows["model"].tolist()):
            if isinstance(name, str):
                places.setdefault(name, []).append(i)
        return [values[places[name]] for name in sorted(places)]
    codes, _ = pd.factorize(rows["model"], sort=True)  # -1 where there is no name
    order = np.argsort(codes, kind="stable")[np.count_nonzero(codes < 0) :]
    return np.split(values[order], np.cumsum(np.bincount(codes[order]))[:-1]) if len(order) else []


def _one_value_per_model(values: NDArray[np.float64]) -> tuple[float, float]:
    """The interval if each model has one value: what `scipy.stats.bootstrap` returns, which takes a second to load."""
    if np.ptp(values) == 0:
        return float(values[0]), float(values[0])
    return quantile_interval(values[_drawn(len(values))].mean(axis=1))


@functools.lru_cache(maxsize=4)
def _drawn(count: int) -> NDArray[np.int64]:
    """Which of so many values each resample has: the same for most rows of a table, which have as many models."""
    drawn = np.random.default_rng(0).integers(count, size=(RESAMPLES, count))
    drawn.flags.writeable = False
    return drawn


def _nested(values: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """The interval if models have several repeats each."""
    rng = np.random.default_rng(0)
    counts = np.array([len(repeats) for repeats in values])
    padded = np.full((len(values), counts.max()), np.nan)
    for i, repeats in enumerate(values):
        padded[i, : len(repeats)] = repeats
    models = rng.integers(len(values), size=(RESAMPLES, len(values)))
    if not np.isnan(padded).any():
        return quantile_interval(_resampled_means(padded, models, rng))
    drawn = (rng.random((RESAMPLES, len(values), counts.max())) * counts[models][:, :, None]).astype(int)
    sample = padded[models[:, :, None], drawn]
    sample[np.arange(counts.max()) >= counts[models][:, :, None]] = np.nan
    return quantile_interval(np.nanmean(sample, axis=2).mean(axis=1))


def _resampled_means(
    values: NDArray[np.float64], models: NDArray[np.int64], rng: np.random.Generator
) -> NDArray[np.float64]:
    """What `_nested` does with the means of drawn models, quicker, if all have the same number of values."""
    n_repeats = values.shape[1]
    means = np.empty(len(models))
    for start in range(0, len(models), TOGETHER):  # few, which fit into the processor's cache
        some = models[start : start + TOGETHER, :, None]
        places = (rng.random((len(some), len(values), n_repeats)) * n_repeats).astype(np.intp) + n_repeats * some
        means[start : start + TOGETHER] = values.ravel().take(places).mean(axis=2).mean(axis=1)
    return means


def interval_over_pairs(matrices: Sequence[NDArray[np.float64]]) -> tuple[float, float]:
    """95 % percentile-bootstrap interval of the mean over pairs, with the items resampled.

    The pairs of one item belong together, so the items are the sample. An item drawn twice makes no pair with itself.

    Parameters
    ----------
    matrices : sequence of (n, n) float arrays
        values of the pairs, symmetric, NaN where missing; the pairs are those within a matrix

    Returns
    -------
    (float, float)
        NaN if no matrix has three items
    """
    if not matrices or max(map(len, matrices)) < 3:
        return NO_INTERVAL
    rng = np.random.default_rng(0)
    totals, counts = np.zeros(RESAMPLES), np.zeros(RESAMPLES)
    for values in matrices:
        n = len(values)
        present = ~np.isnan(values) & ~np.eye(n, dtype=bool)
        weight = rng.multinomial(n, np.full(n, 1 / n), size=RESAMPLES).astype(float)
        totals += ((weight @ np.where(present, values, 0)) * weight).sum(axis=1)
        counts += ((weight @ present.astype(float)) * weight).sum(axis=1)
    return quantile_interval(totals[counts > 0] / counts[counts > 0])


def quantile_interval(means: NDArray[np.float64]) -> tuple[float, float]:
    """The central 95 % interval of resampled means."""
    low, high = np.quantile(means, TAILS).tolist()
    return low, high
