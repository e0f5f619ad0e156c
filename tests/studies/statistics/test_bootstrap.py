import numpy as np
import pandas as pd
import pytest

from studies.statistics.bootstrap import RESAMPLES, _nested, interval_of_mean, interval_over_pairs, model_mean


def trials(values):
    """A frame of trials from {model: [value of each repeat]}."""
    return pd.DataFrame(
        [{"model": model, "value": value} for model, repeats in values.items() for value in repeats],
        columns=["model", "value"],
    )


def test_a_model_with_failures_weighs_as_much_as_the_others():
    assert model_mean(trials({"a": [1.0, 3.0], "b": [6.0]}), "value") == 4.0


def test_the_interval_covers_the_true_mean_about_as_often_as_it_claims():
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(200):
        centres = rng.normal(10, 3, 20)
        frame = trials({f"m{i}": rng.normal(c, 1, 3).tolist() for i, c in enumerate(centres)})
        low, high = interval_of_mean(frame, "value")
        hits += low <= 10 <= high
    assert 0.88 <= hits / 200 <= 0.98  # a percentile bootstrap over 20 models is a little narrow


def test_the_interval_of_one_model_resamples_its_repeats_alone():
    values = [1.0, 2.0, 4.0, 8.0]
    low, high = interval_of_mean(trials({"a": values}), "value")
    rng = np.random.default_rng(1)
    means = rng.choice(values, (20000, 4)).mean(axis=1)
    assert low == pytest.approx(np.quantile(means, 0.025), abs=0.26)
    assert high == pytest.approx(np.quantile(means, 0.975), abs=0.26)


def test_with_one_value_per_model_the_library_gives_what_resampling_models_then_repeats_gives():
    values = np.random.default_rng(5).normal(size=110)
    frame = trials({f"m{i:03}": [value] for i, value in enumerate(values)})
    nested = _nested([np.array([value]) for value in values])
    assert interval_of_mean(frame, "value") == pytest.approx(nested, rel=1e-12)


def test_no_interval_from_a_single_trial_or_none():
    assert np.isnan(interval_of_mean(trials({"a": [1.0]}), "value")).all()
    assert np.isnan(interval_of_mean(trials({}), "value")).all()


def test_equal_values_have_an_interval_of_no_width():
    assert interval_of_mean(trials({"a": [2.0], "b": [2.0]}), "value") == (2.0, 2.0)


def test_the_interval_is_the_same_every_time():
    frame = trials({"a": [1.0, 2.0], "b": [3.0, 5.0]})
    assert interval_of_mean(frame, "value") == interval_of_mean(frame, "value")


def test_pairs_of_two_items_have_no_interval():
    assert np.isnan(interval_over_pairs([np.array([[0.0, 1.0], [1.0, 0.0]])])).all()
    assert np.isnan(interval_over_pairs([])).all()


@pytest.mark.parametrize("n", [2, 3, 11, 40])
def test_one_value_per_model_gives_the_interval_that_scipy_gives(n):
    import scipy.stats

    values = np.random.default_rng(n).gamma(2, size=n)
    found = scipy.stats.bootstrap(
        (values,), np.mean, method="percentile", n_resamples=2000, rng=np.random.default_rng(0)
    ).confidence_interval
    frame = pd.DataFrame({"model": [f"{i:02}" for i in range(n)], "value": values})
    assert interval_of_mean(frame, "value") == pytest.approx((found.low, found.high), rel=1e-14)


@pytest.mark.parametrize(("n_models", "n_repeats"), [(3, 3), (41, 2), (1, 7)])
def test_resampling_a_few_at_a_time_gives_the_interval_of_resampling_all_at_once_to_the_last_bit(n_models, n_repeats):
    values = np.random.default_rng(n_models).normal(size=(n_models, n_repeats))
    rng = np.random.default_rng(0)
    models = rng.integers(n_models, size=(RESAMPLES, n_models))
    repeats = (rng.random((RESAMPLES, n_models, n_repeats)) * n_repeats).astype(int)
    means = values[models[:, :, None], repeats].mean(axis=2).mean(axis=1)
    assert _nested(list(values)) == tuple(np.quantile(means, (0.025, 0.975)).tolist())
