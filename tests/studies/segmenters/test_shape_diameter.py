"""Segmentation by the shape diameter function."""

import sys

import numpy as np
import pytest
import scipy.sparse as sp
import trimesh
from scipy.sparse.csgraph import shortest_path

from studies.segmenters._bilateral import bilateral
from studies.segmenters._dual_graph import DualGraph
from studies.segmenters._shape_diameter_function import by_embree, by_meshlab, cone_of_rays
from studies.segmenters.shape_diameter import ShapeDiameter, _filled
from studies.testing import check_segmenter
from tests.helpers.peers import bulbs, labels_or_reasons, same_partition, turned


@pytest.fixture(scope="module")
def sphere():
    mesh = trimesh.creation.icosphere(3)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


@pytest.fixture(scope="module")
def row():
    """Three bodies of different thickness."""
    return bulbs([0.5, 1.0, 0.7])


def thickness(vertices, faces, caster=by_embree, n_rays=25, cone=120.0):
    return caster(vertices, faces, DualGraph.of(vertices, faces), n_rays, cone)


def test_the_thickness_of_a_ball_is_the_mean_chord_of_the_cone(sphere):
    # A ray at an angle θ to the diameter is a chord of length 2 cos θ.
    chords = 2 * cone_of_rays(25, 120.0)[:, 2]
    deviations = np.abs(chords - np.median(chords))
    expected = chords[deviations <= 1.5 * np.median(deviations)].mean()
    assert thickness(*sphere) == pytest.approx(expected, rel=0.02)


def test_a_narrow_cone_measures_the_distance_between_two_parallel_sides():
    box = trimesh.creation.box((1, 2, 3))
    expected = np.abs(box.face_normals) @ [1.0, 2.0, 3.0]
    assert thickness(box.vertices, box.faces, cone=0.01) == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("caster", [by_embree, by_meshlab])
def test_bodies_are_as_thick_as_they_are(row, caster):
    vertices, faces, labels = row
    values = thickness(vertices, faces, caster)
    medians = [np.nanmedian(values[labels == body]) for body in range(3)]
    assert np.array(medians) / medians[1] == pytest.approx([0.5, 1.0, 0.7], rel=0.1)


def test_only_rays_that_leave_the_body_count(sphere):
    vertices, faces = sphere
    around = np.concatenate([vertices, 3 * vertices]), np.concatenate([faces, faces + len(vertices)])
    inside_out = np.concatenate([vertices, 3 * vertices]), np.concatenate([faces[:, ::-1], faces + len(vertices)])
    # Of a hollow ball, the outer wall is behind the inner one; of two balls, one inside the other, it is not.
    alone = thickness(vertices, faces)
    assert thickness(*around)[: len(faces)] == pytest.approx(alone, rel=0.01)
    assert (thickness(*inside_out)[: len(faces)] > 1.9).all()


def test_turned_over_faces_take_the_thickness_of_their_neighbours(row):
    vertices, faces, _ = row
    flipped = faces.copy()
    some = np.random.default_rng(0).random(len(faces)) < 0.05
    flipped[some] = flipped[some, ::-1]
    # Unless a ray from one meets another, across the valley between two bodies.
    assert np.isnan(thickness(vertices, flipped)[some]).mean() > 0.8
    assert not np.isnan(thickness(vertices, flipped)[~some]).any()
    assert not np.isnan(thickness(vertices, faces[:, ::-1])).any()
    before, after = ShapeDiameter()(vertices, faces), ShapeDiameter()(vertices, flipped)
    assert np.mean(before == after) > 0.97


def test_missing_values_are_filled_ring_by_ring():
    chain = sp.csr_array(np.eye(5, k=1) + np.eye(5, k=-1))
    assert _filled(np.array([1, np.nan, np.nan, np.nan, 3]), chain).tolist() == [1, 1, 2, 3, 3]
    apart = sp.csr_array((4, 4))
    assert _filled(np.array([1, 2, 6, np.nan]), apart).tolist() == [1, 2, 6, 2]


@pytest.mark.parametrize("window", [1, 3])
def test_smoothing_is_the_weighted_mean_of_the_definition(sphere, window):
    graph = DualGraph.of(*sphere)
    adjacency = graph.matrix(np.ones(len(graph.pairs)))[:300, :300]
    values = np.random.default_rng(0).random(300)
    steps = shortest_path(adjacency, unweighted=True)
    difference = values - values[:, None]
    near = steps <= window
    variance = np.where(near, difference**2, 0).sum(axis=1) / near.sum(axis=1)
    weights = near * np.exp(-0.5 * (np.where(near, steps, 0) / (window / 2)) ** 2)
    weights *= np.exp(-0.5 * difference**2 / variance[:, None])
    expected = (weights * values).sum(axis=1) / weights.sum(axis=1)
    assert bilateral(values, adjacency.indptr, adjacency.indices, window) == pytest.approx(expected)


def test_bodies_of_different_thickness_are_segments(row):
    vertices, faces, bodies = row
    labels = ShapeDiameter(n_clusters=4)(vertices, faces)
    for body in range(3):
        _, counts = np.unique(labels[bodies == body], return_counts=True)
        assert counts.max() > 0.8 * counts.sum()
    largest = [np.bincount(labels[bodies == body]).argmax() for body in range(3)]
    assert len(set(largest)) == 3


def test_segments_are_connected(row):
    vertices, faces, _ = row
    labels = ShapeDiameter(smoothness=0.01)(vertices, faces)
    assert len(np.unique(labels)) > 5
    assert same_partition(labels, DualGraph.of(vertices, faces).components(labels))


def test_place_direction_and_size_do_not_matter(row):
    vertices, faces, _ = row
    labels, again = ShapeDiameter()(vertices, faces), ShapeDiameter()(turned(vertices), faces)
    # Rays are cast in single precision.
    overlap = max(
        np.mean(again[labels == label] == np.bincount(again[labels == label]).argmax()) for label in set(labels)
    )
    assert len(np.unique(labels)) == len(np.unique(again)) > 1
    assert overlap > 0.98


@pytest.mark.parametrize("rays", ["embree", "meshlab"])
def test_it_keeps_to_the_contract_of_segmenters(rays):
    check_segmenter(ShapeDiameter(rays=rays), labels_of="faces")


def test_odd_meshes_have_labels_or_are_said_to_have_no_thickness():
    # The last two: too small beside the bounding box for single precision, and without an inside.
    names = (
        "half flipped", "duplicate faces", "soup", "specks", "size 1e-200", "size 1e200", "repeated corners",
        "unreferenced vertices", "open", "several components", "edges of three faces", "two-sided",
        "far speck", "fin",
    )  # fmt: skip
    results = labels_or_reasons(ShapeDiameter(n_rays=8), names)
    reasons = {name: result for name, result in results.items() if isinstance(result, str)}
    assert all("it has no thickness" in reason for reason in reasons.values())
    assert set(reasons) == {"far speck", "fin"}
    assert len(np.unique(results["soup"])) == len(results["soup"])
    assert same_partition(results["size 1e-200"], results["size 1e200"])
    assert len(np.unique(results["several components"])) >= 4


def test_without_embreex_the_error_says_what_to_install(sphere, monkeypatch):
    monkeypatch.setitem(sys.modules, "embreex.rtcore_scene", None)
    with pytest.raises(
        ImportError, match=r"shape_diameter needs the package embreex: pip install 'heatwalk\[peers\]'$"
    ):
        ShapeDiameter()(*sphere)


@pytest.mark.parametrize(
    ("option", "value"), [("n_rays", 0), ("n_clusters", 0), ("cone", 180), ("smoothness", -1), ("rays", "lasers")]
)
def test_impossible_options_are_refused(option, value):
    with pytest.raises(ValueError, match=rf"segmenter\.{option} is {value!r}: "):
        ShapeDiameter(**{option: value})
