import numpy as np
import pytest

from studies.statistics.ranks import pareto_front, shared_ranks


def test_methods_that_cannot_be_told_apart_share_a_rank_and_the_next_one_counts_them():
    rng = np.random.default_rng(0)
    common = rng.normal(0, 5, 2000)
    samples = np.stack(
        [common + 1 + rng.normal(0, 1, 2000), common + 1.2 + rng.normal(0, 1, 2000), common + 9, common], 1
    )
    assert shared_ranks([1.0, 1.2, 9.0, 0.0], samples) == [1, 1, 4, 1]
    samples[:, 3] -= 8
    assert shared_ranks([1.0, 1.2, 9.0, -8.0], samples) == [2, 2, 4, 1]


def test_without_resamples_every_difference_counts_and_equal_values_share_a_rank():
    assert shared_ranks([3.0, 1.0, 2.0, 1.0]) == [4, 1, 3, 1]


def test_a_missing_value_has_no_rank_and_moves_no_other():
    assert shared_ranks([np.nan, 2.0, 1.0]) == [None, 2, 1]
    assert shared_ranks([]) == []


@pytest.mark.parametrize("seed", range(5))
def test_the_front_has_the_points_that_no_other_dominates(seed):
    x, y = np.random.default_rng(seed).integers(0, 6, (2, 25)).astype(float)
    x[3] = y[7] = np.nan

    def dominated(i):
        return any(x[j] <= x[i] and y[j] <= y[i] and (x[j] < x[i] or y[j] < y[i]) for j in range(25) if j not in (3, 7))

    expected = [i not in (3, 7) and not dominated(i) for i in range(25)]
    assert pareto_front(x, y).tolist() == expected
