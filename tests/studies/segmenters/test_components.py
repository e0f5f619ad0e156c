"""Segments shared among components."""

import numpy as np
import pytest

from studies.segmenters._components import segment_components, share_segments


def test_shares_are_those_of_the_largest_quotients():
    areas = np.random.default_rng(0).uniform(0.1, 5, 12)
    for number in (1, 4, 30):
        quotients = areas[:, None] / np.arange(1, number + 1)
        is_largest = quotients >= np.sort(quotients.ravel())[-number]
        assert np.array_equal(share_segments(areas, number), is_largest.sum(axis=1))


@pytest.mark.parametrize("n_segments", [1, 2, 3, 7])
def test_all_segments_are_given_out(n_segments):
    assert share_segments(np.array([3.0, 0, 1, 1]), n_segments).sum() == n_segments


def test_components_without_a_segment_have_that_of_the_nearest_point():
    points = np.array([[0.0, 0, 0], [5, 0, 0], [4.5, 0, 0], [0.3, 0, 0]])
    labels = segment_components(points, np.arange(4), np.array([2.0, 3, 1, 0.5]), 2, lambda indices, count: indices)
    assert labels.tolist() == [0, 1, 1, 0]


def test_each_component_is_segmented_alone_with_its_share():
    asked = []

    def segment(indices, count):
        asked.append((indices.tolist(), count))
        return np.arange(len(indices)) % count

    component = np.array([0, 1, 0, 1, 0, 0])
    labels = segment_components(np.eye(6)[:, :3], component, np.array([2.0, 1, 2, 1, 2, 2]), 5, segment)
    assert asked == [([0, 2, 4, 5], 4)]
    assert labels.tolist() == [0, 4, 1, 4, 2, 3]
