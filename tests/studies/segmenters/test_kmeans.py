"""K-means."""

import numpy as np
import pytest
import trimesh
from scipy.sparse.csgraph import dijkstra

from studies.metrics.psb import rand_index_error
from studies.segmenters import make_segmenter
from studies.segmenters._bridges import connected_dual_graph
from studies.segmenters._distances import katz_tal_weights
from studies.segmenters.kmeans import KMeans
from studies.testing import check_segmenter, example_meshes
from tests.helpers.beads import beads
from tests.helpers.label_checks import change_when_moved, change_when_renumbered, errors_on_odd_meshes

METHOD = KMeans(n_samples=80)


def test_keeps_to_the_contract_of_segmenters():
    check_segmenter(METHOD, labels_of="faces")
    check_segmenter(make_segmenter({"_target_": "studies.segmenters.kmeans.KMeans", "n_samples": 30}))


@pytest.mark.parametrize("lengths", [(1.0, 1.0), (1.0, 1.6, 1.0), (1.0, 1.2, 1.1, 0.9)])
def test_cuts_beads_at_their_necks(lengths):
    mesh, truth = beads(lengths)
    assert rand_index_error(METHOD(mesh.vertices, mesh.faces, len(lengths)), truth) < 0.02


def test_every_face_belongs_to_the_nearest_medoid_and_each_medoid_has_the_least_sum_of_distances():
    # Samples are all faces, and distances are computed independently, all of them.
    mesh = example_meshes()["ellipsoid"]
    method = KMeans(iterations=100, n_samples=len(mesh.faces))
    labels = method(mesh.vertices, mesh.faces, 5)
    graph = connected_dual_graph(np.asarray(mesh.vertices), np.asarray(mesh.faces))
    between = dijkstra(graph.matrix(katz_tal_weights(graph, method.geodesic_share, method.convex_weight)))
    clusters = [np.flatnonzero(labels == i) for i in range(5)]
    medoids = [each[(graph.areas[each] @ between[np.ix_(each, each)]).argmin()] for each in clusters]
    assert between[medoids, :][labels, np.arange(len(labels))] == pytest.approx(between[medoids].min(axis=0))


def test_labels_do_not_depend_on_place_direction_size_or_numbering():
    assert change_when_moved(METHOD, 4) == dict.fromkeys(example_meshes(), 0)
    assert change_when_renumbered(METHOD, example_meshes()["torus"], 4) == 0


def test_odd_meshes_have_as_many_segments_as_asked_for():
    assert errors_on_odd_meshes(KMeans(n_samples=40), 4) == {}


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
        ({"geodesic_share": 1.1}, "geodesic_share is 1.1: it must be from 0 to 1"),
        ({"convex_weight": -0.1}, "convex_weight is -0.1: it must be from 0 to 1"),
        ({"iterations": 0}, "iterations is 0: it must be at least 1"),
        ({"n_samples": 0}, "n_samples is 0: it must be at least 1"),
    ],
)
def test_options_out_of_range_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        KMeans(**options)
