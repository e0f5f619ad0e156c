"""Adapted Rand error, variation of information and numbers of segments, with scikit-image as the oracle."""

import numpy as np
import pytest
from skimage.metrics import adapted_rand_error as skimage_adapted_rand_error
from skimage.metrics import variation_of_information as skimage_variation_of_information

from studies.metrics.adapted_rand_error import adapted_rand_error
from studies.metrics.segment_count import segment_count_difference
from studies.metrics.variation_of_information import variation_of_information


def pairs(count=40):
    """Two random labelings each of 30 to 300 points, with any number of segments from 1."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        n = rng.integers(30, 300)
        yield rng.integers(0, rng.integers(1, 12), n), rng.integers(0, rng.integers(1, 12), n)


def test_the_adapted_rand_error_is_that_of_scikit_image_with_no_label_ignored():
    for a, b in pairs():
        expected = skimage_adapted_rand_error(a, b, ignore_labels=())[0]
        assert adapted_rand_error(a, b) == pytest.approx(expected, rel=1e-12, abs=1e-15)


def test_the_label_zero_counts_like_any_other_in_the_adapted_rand_error():
    a, b = np.repeat([0, 1], 10), np.repeat([0, 1, 0, 1], 5)
    assert adapted_rand_error(a, b) == adapted_rand_error(a + 7, b) == adapted_rand_error(a - 1, b + 1)
    assert adapted_rand_error(a, b) != skimage_adapted_rand_error(a, b)[0]


def test_the_adapted_rand_error_of_single_points_is_zero_and_of_a_merged_whole_one():
    points = np.arange(9)
    assert adapted_rand_error(points, points[::-1]) == 0
    assert adapted_rand_error(points, np.zeros(9, dtype=int)) == 1


def test_the_adapted_rand_error_is_exact_for_many_points():
    n = 3_000_000
    a = np.repeat([0, 1], n // 2)
    pairs_of_half, pairs_of_all = (n // 2) * (n // 2 - 1), n * (n - 1)
    expected = 1 - 2 * (2 * pairs_of_half) / (2 * pairs_of_half + pairs_of_all)
    assert adapted_rand_error(a, np.zeros(n, dtype=int)) == expected


def test_the_variation_of_information_is_the_sum_of_both_values_of_scikit_image():
    for a, b in pairs():
        expected = skimage_variation_of_information(a, b).sum()
        assert variation_of_information(a, b) == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_the_variation_of_information_is_a_distance():
    rng = np.random.default_rng(5)
    for _ in range(20):
        a, b, c = rng.integers(0, 5, (3, 60))
        assert variation_of_information(a, c) <= variation_of_information(a, b) + variation_of_information(b, c) + 1e-12
        assert variation_of_information(a, 4 - a) == 0


def test_the_difference_in_segments_counts_the_labels_that_occur():
    for a, b in pairs():
        assert segment_count_difference(a, b) == abs(len(set(a.tolist())) - len(set(b.tolist())))
    assert segment_count_difference([0, 9, -1], [5, 5, 5]) == 2
