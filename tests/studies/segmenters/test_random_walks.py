"""Random walks."""

import numpy as np
import pytest
import trimesh

from studies.metrics.psb import rand_index_error
from studies.segmenters import make_segmenter
from studies.segmenters._bridges import connected_dual_graph
from studies.segmenters.random_walks import RandomWalks, merged_regions, regions_of_seeds
from studies.testing import check_segmenter, example_meshes
from tests.helpers.beads import beads
from tests.helpers.label_checks import change_when_moved, change_when_renumbered, errors_on_odd_meshes

METHOD = RandomWalks()


def test_keeps_to_the_contract_of_segmenters():
    check_segmenter(METHOD, labels_of="faces")
    check_segmenter(make_segmenter({"_target_": "studies.segmenters.random_walks.RandomWalks", "n_seeds": 20}))


@pytest.mark.parametrize("lengths", [(1.0, 1.0), (1.0, 1.6, 1.0), (1.0, 1.2, 1.1, 0.9)])
def test_cuts_beads_at_their_necks(lengths):
    mesh, truth = beads(lengths)
    assert rand_index_error(METHOD(mesh.vertices, mesh.faces, len(lengths)), truth) < 0.02


def test_seeds_are_those_that_simulated_walks_reach_first():
    # The probabilities by iterating the walk's transitions, seeds absorbing, until hardly any walk is under way.
    mesh = example_meshes()["open"]
    graph = connected_dual_graph(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    crossings = np.random.default_rng(0).uniform(0.1, 1, len(graph.pairs))
    seeds = np.arange(5, 200, 5)
    steps = graph.matrix(crossings).toarray()
    steps /= steps.sum(axis=1, keepdims=True)
    steps[seeds] = np.eye(200)[seeds]
    reached = np.linalg.matrix_power(steps, 2**14)[:, seeds]
    assert reached.sum(axis=1) == pytest.approx(1)
    assert np.array_equal(regions_of_seeds(graph, crossings, seeds), reached.argmax(axis=1))


def test_small_regions_with_long_borders_are_merged_first():
    # A strip of squares, in regions of the areas 4, 1, 4; the middle one has the stronger border to the last.
    vertices = np.array([[x, y, 0] for x in range(10) for y in (0, 1)], float)
    faces = np.array([f for i in range(0, 18, 2) for f in ((i, i + 2, i + 1), (i + 1, i + 2, i + 3))])
    graph = connected_dual_graph(vertices, faces)
    regions = np.repeat([0, 1, 2], [8, 2, 8])
    strengths = np.where(graph.pairs.max(axis=1) > 9, 2.0, 1.0)
    assert np.array_equal(merged_regions(graph, regions, strengths, 2), np.repeat([0, 1], [8, 10]))
    assert np.array_equal(merged_regions(graph, regions, strengths, 1), np.zeros(18, int))
    assert np.array_equal(merged_regions(graph, regions, strengths, 5), regions)


def test_labels_do_not_depend_on_place_direction_size_or_numbering():
    assert change_when_moved(METHOD, 4) == dict.fromkeys(example_meshes(), 0)
    assert change_when_renumbered(METHOD, example_meshes()["torus"], 4) == 0


def test_odd_meshes_have_as_many_segments_as_asked_for():
    assert errors_on_odd_meshes(RandomWalks(n_seeds=20), 4) == {}


def test_specks_belong_to_the_surface_near_them():
    mesh, truth = beads()
    specks = [trimesh.creation.icosphere(0, radius=0.005).apply_translation([i + 0.2, 0.6, 0]) for i in range(3)]
    both = trimesh.util.concatenate([mesh, *specks])
    labels = METHOD(both.vertices, both.faces, 3)
    assert rand_index_error(labels[: len(truth)], truth) < 0.02


def test_fewer_faces_than_segments_are_segments_each():
    box = trimesh.creation.box()
    assert len(np.unique(METHOD(box.vertices, box.faces, 20))) == 12


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"n_seeds": 0}, "n_seeds is 0: it must be at least 1"),
        ({"convex_weight": 2}, "convex_weight is 2: it must be from 0 to 1"),
        ({"bandwidth": 0}, "bandwidth is 0: it must be positive and finite"),
        ({"merging_bandwidth": np.inf}, "merging_bandwidth is inf: it must be positive and finite"),
    ],
)
def test_options_out_of_range_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        RandomWalks(**options)
