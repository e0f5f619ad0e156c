"""Nearly convex parts."""

import sys

import numpy as np
import pytest
import trimesh

from studies.segmenters.convex_decomposition import ConvexDecomposition, _outside
from studies.testing import check_segmenter, example_meshes
from tests.helpers.peers import bulbs, labels_or_reasons


@pytest.fixture(scope="module")
def box():
    return trimesh.creation.box((1, 2, 3))


def test_the_depth_in_a_box_is_the_distance_from_its_sides(box):
    points = np.array([[0, 0, 0], [0.4, 0, 0], [2, 0, 0], [0, 0, -1.7]])
    assert _outside(points, np.asarray(box.vertices)) == pytest.approx([-0.5, -0.1, 1.5, 0.2])


def test_a_hull_without_volume_is_as_far_as_its_nearest_vertex():
    flat = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    assert _outside(np.array([[0.0, 0, 2], [3, 1, 0]]), flat) == pytest.approx([2, 2])


def test_bodies_joined_by_a_neck_are_parts():
    vertices, faces, bodies = bulbs([1.0, 1.0], n_around=16, step=0.15)
    labels = ConvexDecomposition()(vertices, faces)
    for body in (0, 1):
        assert np.bincount(labels[bodies == body]).max() > 0.95 * np.sum(bodies == body)
    assert np.bincount(labels[bodies == 0]).argmax() != np.bincount(labels[bodies == 1]).argmax()


def test_it_keeps_to_the_contract_of_segmenters():
    meshes = example_meshes()
    meshes.pop("open")  # its boundary touches itself: refused
    check_segmenter(ConvexDecomposition(), meshes.values(), labels_of="faces")


def test_odd_meshes_have_labels_or_are_said_to_bound_no_solid():
    names = ("two-sided", "duplicate faces", "soup", "size 1e-200", "unreferenced vertices", "open", "needles")
    refused = ("edges of three faces", "fin", "Möbius strip", "far speck")
    results = labels_or_reasons(ConvexDecomposition(), names + refused)
    assert all((results[name] == 0).all() for name in names)
    assert all("needs a solid" in results[name] for name in refused)


def test_too_many_faces_are_refused(box):
    with pytest.raises(ValueError, match=r"the mesh has 12 faces, more than segmenter\.max_faces=11"):
        ConvexDecomposition(max_faces=11)(box.vertices, box.faces)


def test_without_coacd_the_error_says_what_to_install(box, monkeypatch):
    monkeypatch.setitem(sys.modules, "coacd", None)
    with pytest.raises(ImportError, match=r"needs the package coacd: pip install 'heatwalk\[peers\]'$"):
        ConvexDecomposition()(box.vertices, box.faces)


@pytest.mark.parametrize(
    ("option", "value"), [("threshold", 0), ("iterations", 10), ("depth", 1), ("resolution", 1), ("search_faces", 1)]
)
def test_impossible_options_are_refused(option, value):
    with pytest.raises(ValueError, match=rf"segmenter\.{option} is {value!r}: "):
        ConvexDecomposition(**{option: value})
