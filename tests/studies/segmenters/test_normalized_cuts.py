"""Normalized cuts."""

import numpy as np
import pytest
import trimesh
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from perturb.testing import odd_meshes
from studies.metrics.psb import rand_index_error
from studies.segmenters import make_segmenter
from studies.segmenters._cut_costs import cut_costs, number_of_regions
from studies.segmenters._dual_graph import DualGraph
from studies.segmenters._unit_size import unit_size
from studies.segmenters.normalized_cuts import NormalizedCuts
from studies.testing import check_segmenter, example_meshes
from tests.helpers.beads import beads

METHOD = NormalizedCuts()


@pytest.fixture(scope="module")
def necklace():
    return beads()


def test_keeps_to_the_contract_of_segmenters():
    check_segmenter(METHOD, labels_of="faces")
    check_segmenter(make_segmenter({"_target_": "studies.segmenters.normalized_cuts.NormalizedCuts"}))


@pytest.mark.parametrize("lengths", [(1.0, 1.6, 1.0), (1.0, 1.6, 1.0, 0.7), (1.0, 1.0)])
def test_cuts_beads_exactly_at_their_necks(lengths):
    mesh, truth = beads(lengths)
    assert rand_index_error(METHOD(mesh.vertices, mesh.faces, len(lengths)), truth) == 0


@pytest.mark.parametrize("label", ["ellipsoid", "torus", "open"])
def test_labels_do_not_change_when_the_mesh_is_moved_turned_or_scaled(label):
    mesh = example_meshes()[label]
    mesh.vertices += 0.1 * mesh.vertices**2 @ np.random.default_rng(0).normal(size=(3, 3))  # no central symmetry either
    turn = Rotation.from_euler("xyz", [20, 40, 60], degrees=True).as_matrix()
    moved = 37.0 * mesh.vertices @ turn.T + [5, -3, 8]
    assert np.array_equal(METHOD(moved, mesh.faces, 5), METHOD(mesh.vertices, mesh.faces, 5))


def test_regions_are_connected_and_as_many_as_asked_for(necklace):
    mesh, _ = necklace
    graph = DualGraph.of(mesh.vertices, mesh.faces)
    for n_segments in (1, 2, 6, 20):
        labels = METHOD(mesh.vertices, mesh.faces, n_segments)
        inside = graph.matrix((labels[graph.pairs[:, 0]] == labels[graph.pairs[:, 1]]).astype(float))
        inside.eliminate_zeros()
        n_connected, _ = connected_components(inside, directed=False)
        assert len(np.unique(labels)) == n_connected == n_segments


@pytest.mark.parametrize("angle", np.radians([-170, -60, -20, 0, 20, 60, 170]))
def test_cutting_along_a_concave_edge_costs_less_and_along_any_other_its_length(angle):
    # Two triangles on either side of the y axis, the second turned down by the angle about it, both seen from above.
    vertices = np.array([[0, 0, 0], [0, 2.0, 0], [-1, 1, 0], [np.cos(angle), 1, -np.sin(angle)]])
    graph = DualGraph.of(vertices, np.array([[0, 1, 2], [1, 0, 3]]))
    w = min((1 + angle / np.pi) ** 10, 1)
    assert cut_costs(graph, 10) == pytest.approx([2 * w], rel=1e-9)
    assert cut_costs(graph, 10, least=0.5) == pytest.approx([2 * (w + 0.5) / 1.5], rel=1e-9)


def test_specks_are_segments_beside_those_asked_for(necklace):
    mesh, truth = necklace
    speck = trimesh.creation.icosphere(0, radius=0.005)
    specks = [speck.copy().apply_translation([i, 2, 0]) for i in range(4)]
    both = trimesh.util.concatenate([mesh, *specks])
    labels = METHOD(both.vertices, both.faces, 3)
    assert len(np.unique(labels)) == 7
    assert rand_index_error(labels[: len(truth)], truth) == 0


def test_more_components_than_segments_are_segments_each():
    balls = [trimesh.creation.icosphere(1).apply_translation([3 * i, 0, 0]) for i in range(5)]
    both = trimesh.util.concatenate(balls)
    labels = METHOD(both.vertices, both.faces, 2)
    assert np.array_equal(labels, np.repeat(range(5), 80))


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_faces_that_are_turned_over_change_nothing(necklace, share):
    mesh, truth = necklace
    is_turned = np.random.default_rng(0).random(len(truth)) < share
    faces = np.where(is_turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    assert rand_index_error(METHOD(mesh.vertices, faces, 3), truth) == 0


def test_a_soup_and_fewer_faces_than_segments_are_a_segment_per_face(necklace):
    mesh, _ = necklace
    soup = np.arange(mesh.faces.size).reshape(-1, 3)
    assert np.array_equal(METHOD(mesh.vertices[mesh.faces].reshape(-1, 3), soup, 3), range(len(soup)))
    assert METHOD(np.eye(3), np.array([[0, 1, 2]]), 3).tolist() == [0]


@pytest.mark.parametrize(("label", "mesh"), odd_meshes().items())
def test_odd_meshes_get_at_least_the_segments_asked_for(label, mesh):
    graph = DualGraph.of(unit_size(mesh.vertices, mesh.faces), mesh.faces)
    labels = METHOD(mesh.vertices, mesh.faces, 4)
    assert labels.shape == (len(mesh.faces),)
    assert len(np.unique(labels)) == number_of_regions(graph, 4), label


def test_faces_without_area_change_no_other_label(necklace):
    mesh, truth = necklace
    with_degenerate = np.concatenate([mesh.faces, [[0, 0, 0], [3, 3, 9]]])
    labels = METHOD(mesh.vertices, with_degenerate, 3)
    assert rand_index_error(labels[: len(truth)], truth) == 0


@pytest.mark.parametrize("name", ["concavity_exponent", "least_cost", "regularisation"])
@pytest.mark.parametrize("value", [-1.0, np.nan, np.inf])
def test_an_option_out_of_range_is_refused_by_name(name, value):
    with pytest.raises(ValueError, match=rf"^segmenter\.{name} is {value}: it must be at least 0 and finite$"):
        NormalizedCuts(**{name: value})


def test_a_mesh_that_cannot_be_segmented_is_refused_in_one_line():
    faces = np.array([[0, 1, 2]])
    with pytest.raises(ValueError, match=r"^vertex 0 has NaN or infinite coordinates$"):
        METHOD(np.full((3, 3), np.nan), faces, 2)
    with pytest.raises(ValueError, match=r"^the mesh has no faces$"):
        METHOD(np.eye(3), faces[:0], 2)
    with pytest.raises(ValueError, match=r"^n_segments must be at least 1, got 0$"):
        METHOD(np.eye(3), faces, 0)
