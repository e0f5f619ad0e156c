"""k-means."""

from itertools import product

import numpy as np
import pytest

from studies.segmenters._clustering import bisect, k_means


def cost(points, labels, weights):
    return sum(
        (weights[labels == label] @ ((points[labels == label] - centre) ** 2)).sum()
        for label in np.unique(labels)
        for centre in [np.average(points[labels == label], axis=0, weights=weights[labels == label])]
    )


def test_the_result_is_the_best_of_all_partitions_of_a_few_points():
    rng = np.random.default_rng(0)
    points, weights = rng.normal(size=(7, 2)), rng.uniform(0.1, 3, 7)
    best = min(cost(points, np.array(labels), weights) for labels in product(range(3), repeat=7))
    found = k_means(points, 3, rng, weights=weights, n_starts=50)
    assert cost(points, found, weights) == pytest.approx(best)


def test_a_weight_counts_as_that_many_points():
    rng = np.random.default_rng(1)
    points, times = rng.normal(size=(40, 3)), rng.integers(1, 5, 40)
    once = k_means(points, 4, np.random.default_rng(0), weights=times.astype(float), n_starts=40)
    repeated = k_means(np.repeat(points, times, axis=0), 4, np.random.default_rng(0), n_starts=40)
    assert cost(points, once, times) == pytest.approx(cost(points, repeated[np.cumsum(times) - 1], times))


def test_points_without_weight_belong_to_the_nearest_centre_and_move_none():
    points = np.array([[0.0], [1.0], [10.0], [11.0], [4.0]])
    labels = k_means(points, 2, np.random.default_rng(0), weights=np.array([1.0, 1, 1, 1, 0]))
    assert labels[4] == labels[0] == labels[1] != labels[2]


@pytest.mark.parametrize("n_different", [1, 2, 5])
def test_there_are_no_more_clusters_than_different_points(n_different):
    points = np.repeat(np.arange(n_different, dtype=float)[:, None], 4, axis=0)
    labels = k_means(points, 6, np.random.default_rng(0))
    assert np.array_equal(np.unique(labels), range(n_different))


def test_points_that_all_have_no_weight_count_alike():
    labels = k_means(np.array([[0.0], [0.1], [9.0]]), 2, np.random.default_rng(0), weights=np.zeros(3))
    assert labels[0] == labels[1] != labels[2]


def test_bisection_finds_groups_that_are_far_apart():
    rng = np.random.default_rng(0)
    groups = np.arange(60) % 4
    points = 20 * rng.normal(size=(4, 3))[groups] + rng.normal(size=(60, 3))
    labels = bisect(points, 4)
    assert len(np.unique(np.column_stack([groups, labels]), axis=0)) == 4


def test_each_bisection_splits_one_cluster_and_lowers_the_sum_of_squares():
    rng = np.random.default_rng(1)
    points, weights = rng.normal(size=(50, 2)), rng.uniform(0.1, 2, 50)
    before = np.zeros(50, int)
    for number in range(2, 8):
        labels = bisect(points, number, weights)
        assert len(np.unique(labels)) == number
        assert len(np.unique(np.column_stack([labels, before]), axis=0)) == number  # a refinement
        assert cost(points, labels, weights) < cost(points, before, weights)
        before = labels


def test_bisection_ends_when_all_points_of_a_cluster_are_the_same():
    assert len(np.unique(bisect(np.repeat(np.arange(3.0), 5)[:, None], 9))) == 3
