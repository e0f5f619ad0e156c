import numpy as np
import pytest

from heatwalk.io import label_colours
from studies.figures.colours import face_colours, match_colours


@pytest.fixture
def labels():
    """Eight parts in an arbitrary order, and the background."""
    return np.random.default_rng(3).integers(-1, 8, size=300)


def test_parts_keep_their_numbers_whatever_they_were_renumbered_to(labels):
    shuffled = np.random.default_rng(0).permutation(8)[labels]
    shuffled[labels < 0] = -1
    assert np.array_equal(match_colours(labels, shuffled, shuffled), labels)


def test_a_part_without_a_counterpart_has_a_colour_that_the_reference_does_not_have():
    reference = np.array([0, 0, 0, 1, 1, -1])
    compared = np.array([2, 2, 0, 1, 1, -1])
    assert match_colours(reference, compared, compared).tolist() == [0, 0, 2, 1, 1, -1]


def test_points_that_are_not_compared_are_renumbered_with_their_part():
    assert match_colours(np.array([4, 4]), np.array([1, 1]), np.array([1, 0, 1, -1])).tolist()[::2] == [4, 4]


def test_without_a_common_point_every_part_is_new():
    nothing = np.array([], dtype=int)
    assert match_colours(nothing, nothing, np.array([0, 1, -1])).tolist() == [2, 3, -1]


def test_a_face_has_the_colour_of_the_label_that_two_of_its_corners_have():
    labels, faces = np.array([0, 1, 1, 2, -1, -1]), np.array([[0, 1, 2], [3, 4, 5], [0, 1, 3]])
    of_labels = label_colours(np.arange(3))[:, :3]
    grey = face_colours(None, faces)[0]
    np.testing.assert_array_equal(face_colours(labels, faces), [of_labels[1], grey, of_labels[0]])
    assert len(set(grey.tolist())) == 1
