import numpy as np
import pytest

from studies.statistics.paired import intervals, is_better, resampled_counts, resampled_mce, resampled_means


def by_loops(areas, reference, counts):
    """Mean corruption errors, resample by resample, from the models that were drawn."""
    found = []
    for count in counts:
        drawn = [model for model, times in enumerate(count) for _ in range(times)]
        of_methods = []
        for method in areas:
            errors = [
                sum(method[p, i] for i in drawn) / total
                for p in range(len(reference))
                if (total := sum(reference[p, i] for i in drawn)) > 0
            ]
            of_methods.append(np.mean(errors) if errors else np.nan)
        found.append(of_methods)
    return np.array(found)


def test_all_methods_and_the_reference_are_resampled_with_the_same_models():
    rng = np.random.default_rng(0)
    areas = rng.uniform(0, 10, (3, 4, 5))
    areas[0, 1, [0, 2, 3]] = 0.0  # in some resamples the reference is 0 under this perturbation
    counts = resampled_counts(5, n_resamples=60)
    np.testing.assert_allclose(resampled_mce(areas, areas[0], counts), by_loops(areas, areas[0], counts), rtol=1e-12)


def test_the_reference_has_1_in_every_resample():
    areas = np.random.default_rng(1).uniform(1, 2, (2, 3, 4))
    assert resampled_mce(areas, areas[1], resampled_counts(4, n_resamples=50))[:, 1] == pytest.approx(1.0, abs=1e-12)


def test_nothing_is_defined_where_the_reference_never_changes():
    areas = np.ones((2, 3, 4))
    areas[0] = 0
    samples = resampled_mce(areas, areas[0], resampled_counts(4, n_resamples=5))
    assert np.isnan(samples).all()
    assert np.isnan(intervals(samples)).all()


def test_resampling_is_the_same_every_time_and_draws_every_model_equally_often():
    counts = resampled_counts(6)
    np.testing.assert_array_equal(counts, resampled_counts(6))
    assert counts.shape == (2000, 6)
    assert (counts.sum(axis=1) == 6).all()
    assert counts.mean(axis=0) == pytest.approx(np.ones(6), abs=0.1)


def test_means_are_those_of_the_drawn_models():
    values = np.array([[1.0, 2.0, 6.0], [0.0, 3.0, 3.0]])
    counts = np.array([[3, 0, 0], [1, 1, 1], [0, 1, 2]])
    np.testing.assert_allclose(resampled_means(values, counts), [[1, 0], [3, 2], [14 / 3, 3]])


def test_a_difference_that_is_always_the_same_tells_two_methods_apart_however_wide_their_intervals_are():
    wide = np.random.default_rng(2).normal(0, 100, 2000)
    assert is_better(wide, wide + 0.001)
    assert not is_better(wide + 0.001, wide)
    assert not is_better(wide, wide)
    assert not is_better(wide, np.random.default_rng(3).normal(10, 100, 2000))
