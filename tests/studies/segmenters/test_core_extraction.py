"""Core extraction."""

import numpy as np
import pytest
import scipy.sparse as sp
import trimesh
from scipy.spatial.distance import cdist

from studies.metrics.psb import rand_index_error
from studies.segmenters import make_segmenter
from studies.segmenters.core_extraction import (
    CoreExtraction,
    core_depths,
    embedded,
    feature_points,
    limbs_outside_core,
)
from studies.testing import check_segmenter, example_meshes
from tests.helpers.beads import beads
from tests.helpers.label_checks import change_when_moved, change_when_renumbered, errors_on_odd_meshes

METHOD = CoreExtraction(n_samples=80)


@pytest.fixture(scope="module")
def star():
    """Four arms around a ball, and for each face the number of its arm, 0 for the ball."""
    mesh = trimesh.creation.icosphere(4)
    directions = np.array([[1, 1, 1], [-1, -1, 1], [-1, 1, -1], [1, -1, -1]]) / np.sqrt(3)
    nearness = mesh.vertices @ directions.T
    arm = np.maximum((nearness.max(axis=1) - 0.93) / 0.07, 0)
    mesh.vertices *= (1 + 2 * np.minimum(4 * arm, 1) * (0.5 + 0.5 * arm))[:, None]
    is_arm = nearness.max(axis=1) > 0.93
    of_vertex = np.where(is_arm, nearness.argmax(axis=1) + 1, 0)
    return mesh, np.sort(of_vertex[mesh.faces], axis=1)[:, 1]


def bent(vertices):
    """Vertices after a bend about the vertical axis, by up to 40 degrees."""
    angle = 0.25 * vertices[:, :1]
    y, z = vertices[:, 1:2], vertices[:, 2:]
    return np.concatenate([np.sin(angle) * (4 + y), np.cos(angle) * (4 + y) - 4, z], axis=1)


def test_keeps_to_the_contract_of_segmenters():
    check_segmenter(METHOD, labels_of="faces")
    options = {"_target_": "studies.segmenters.core_extraction.CoreExtraction", "n_samples": 30}
    check_segmenter(make_segmenter(options))


def test_finds_four_arms_around_a_ball_in_any_pose(star):
    mesh, truth = star
    for vertices in (mesh.vertices, bent(mesh.vertices)):
        labels = METHOD(vertices, mesh.faces)
        assert len(np.unique(labels)) == 5
        assert rand_index_error(labels, truth) < 0.08


def test_the_ends_of_a_necklace_are_limbs_of_its_middle():
    mesh, truth = beads((1.0, 1.6, 1.0))
    assert rand_index_error(METHOD(mesh.vertices, mesh.faces), truth) < 0.02


def test_a_ball_is_a_single_core():
    ball = trimesh.creation.icosphere(3)
    assert (METHOD(ball.vertices, ball.faces) == 0).all()


def test_distances_in_space_are_embedded_exactly():
    points = np.random.default_rng(0).normal(size=(60, 3))
    distances = cdist(points, points)
    assert cdist(*[embedded(distances, 3)] * 2) == pytest.approx(distances, abs=1e-9)


def test_each_iteration_lowers_the_stress_of_an_embedding():
    # Distances along a great circle, which do not fit in space.
    ball = trimesh.creation.icosphere(2).vertices
    distances = np.arccos(np.clip(ball @ ball.T, -1, 1))
    stresses = [((cdist(*[embedded(distances, i)] * 2) - distances) ** 2).sum() for i in range(0, 12, 2)]
    assert (np.diff(stresses) < 0).all()


def test_points_mirrored_onto_the_hull_are_the_core_and_those_behind_others_are_not():
    # A spike outside a sphere of points: mirrored, it is inside the ball.
    ball = trimesh.creation.icosphere(2).vertices
    points = np.concatenate([ball, 2.5 * ball[:1]])
    depths = core_depths(points)
    assert depths[:-1] == pytest.approx(1, abs=0.02)
    assert depths[-1] == pytest.approx(2.5 / 4, abs=0.02)


def test_features_are_remote_points_of_the_hull():
    # On a path, 1 has a larger remoteness than its neighbours but is not on the hull; 3 and 4 are on the hull.
    points = np.array([[0, 0, 0], [0.1, 0.1, 0.1], [1, 0, 0], [0, 1, 0], [0, 0, 1.0]])
    path = sp.csr_array(np.eye(5, k=1) + np.eye(5, k=-1))
    assert feature_points(points, np.array([1.0, 3, 2, 5, 4]), path).tolist() == [3]


def test_the_core_is_the_smallest_that_separates_most_limbs():
    # A path: the limbs at its ends are connected through 1 to 4, unless the core has all depths from 0.95 on, or 0.8.
    path = sp.csr_array(np.eye(6, k=1) + np.eye(6, k=-1))
    depths, ends = np.array([0.5, 0.6, 0.8, 0.95, 0.6, 0.5]), np.array([0, 5])
    assert limbs_outside_core(path, depths, ends, np.ones(6), 0).tolist() == [1, 1, 1, 0, 2, 2]
    assert limbs_outside_core(path, depths, ends, np.ones(6), 3).tolist() == [1, 1, 1, 1, 1, 1]
    assert limbs_outside_core(path, depths, np.array([0]), np.ones(6), 0).tolist() == [1, 1, 1, 1, 1, 1]
    depths[3] = 0.78
    assert limbs_outside_core(path, depths, ends, np.ones(6), 0).tolist() == [1, 1, 0, 2, 2, 2]


def test_labels_do_not_depend_on_place_direction_size_or_numbering():
    assert change_when_moved(METHOD) == dict.fromkeys(example_meshes(), 0)
    assert change_when_renumbered(METHOD, example_meshes()["torus"]) == 0


def test_odd_meshes_are_segmented():
    assert errors_on_odd_meshes(CoreExtraction(n_samples=30, iterations=20)) == {}


def test_specks_belong_to_the_surface_near_them():
    mesh, truth = beads()
    specks = [trimesh.creation.icosphere(0, radius=0.005).apply_translation([i + 0.2, 0.6, 0]) for i in range(3)]
    both = trimesh.util.concatenate([mesh, *specks])
    labels = METHOD(both.vertices, both.faces)
    assert rand_index_error(labels[: len(truth)], truth) < 0.02


def test_a_few_faces_are_one_segment():
    tetrahedron = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    assert METHOD(np.concatenate([np.zeros((1, 3)), np.eye(3)]), tetrahedron).tolist() == [0, 0, 0, 0]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_samples": 5}, "n_samples is 5: it must be at least 6"),
        ({"iterations": -1}, "iterations is -1: it must be at least 0"),
        ({"convex_weight": 1.5}, "convex_weight is 1.5: it must be from 0 to 1"),
        ({"limb_share": 2}, "limb_share is 2: it must be from 0 to 1"),
        ({"centre_share": -0.5}, "centre_share is -0.5: it must be from 0 to 1"),
    ],
)
def test_options_out_of_range_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        CoreExtraction(**options)
