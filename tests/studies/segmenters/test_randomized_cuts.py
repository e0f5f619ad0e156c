"""Randomized cuts."""

import numpy as np
import pytest
import trimesh
from scipy.sparse.csgraph import connected_components
from scipy.spatial.transform import Rotation

from perturb.testing import odd_meshes
from studies.metrics.psb import rand_index_error
from studies.segmenters import make_segmenter
from studies.segmenters._cut_costs import number_of_regions
from studies.segmenters._dual_graph import DualGraph
from studies.segmenters._unit_size import unit_size
from studies.segmenters.randomized_cuts import RandomizedCuts
from studies.testing import check_segmenter
from tests.helpers.beads import beads

QUICK = RandomizedCuts(n_cuts=4)
COARSE = RandomizedCuts(n_cuts=8, n_faces=500)


@pytest.fixture(scope="module")
def necklace():
    return beads()


def test_keeps_to_the_contract_of_segmenters():
    check_segmenter(make_segmenter({"_target_": "studies.segmenters.randomized_cuts.RandomizedCuts", "n_cuts": 3}))


@pytest.mark.parametrize("lengths", [(1.0, 1.6, 1.0), (1.0, 1.6, 1.0, 0.7)])
@pytest.mark.parametrize("method", [QUICK, COARSE])
def test_cuts_beads_exactly_at_their_necks_whether_decimated_or_not(method, lengths):
    mesh, truth = beads(lengths)
    assert rand_index_error(method(mesh.vertices, mesh.faces, len(lengths)), truth) == 0


def test_obvious_parts_are_found_however_the_mesh_is_moved_turned_or_scaled(necklace):
    mesh, truth = necklace
    for seed in range(3):
        turn = Rotation.random(rng=np.random.default_rng(seed)).as_matrix()
        moved = 10.0 ** (seed - 1) * mesh.vertices @ turn.T + [5, -3, 8]
        assert rand_index_error(COARSE(moved, mesh.faces, 3), truth) == 0


def test_segments_are_connected_and_as_many_as_asked_for(necklace):
    mesh, _ = necklace
    graph = DualGraph.of(mesh.vertices, mesh.faces)
    for n_segments in (1, 2, 9):
        labels = COARSE(mesh.vertices, mesh.faces, n_segments)
        inside = graph.matrix((labels[graph.pairs[:, 0]] == labels[graph.pairs[:, 1]]).astype(float))
        inside.eliminate_zeros()
        assert len(np.unique(labels)) == connected_components(inside, directed=False)[0] == n_segments


def test_the_first_cuts_are_also_made_when_more_segments_are_asked_for(necklace):
    mesh, _ = necklace
    method = RandomizedCuts(n_cuts=4)  # of all faces, so that borders move little
    few, many = (method(mesh.vertices, mesh.faces, n) for n in (3, 5))
    assert len({*zip(few, many, strict=True)}) == 5


def test_specks_and_components_are_segments_of_their_own(necklace):
    mesh, truth = necklace
    specks = [trimesh.creation.icosphere(0, radius=0.005).apply_translation([i, 2, 0]) for i in range(4)]
    ball = trimesh.creation.icosphere(2, radius=0.5).apply_translation([0, -3, 0])
    together = trimesh.util.concatenate([mesh, *specks, ball])
    labels = COARSE(together.vertices, together.faces, 4)
    expected = np.concatenate([truth, np.repeat([3, 4, 5, 6], 20), np.full(320, 7)])
    assert rand_index_error(labels, expected) == 0
    balls = trimesh.util.concatenate([ball.copy().apply_translation([0, 2 * i, 0]) for i in range(5)])
    assert np.array_equal(COARSE(balls.vertices, balls.faces, 2), np.repeat(range(5), 320))


@pytest.mark.parametrize("share", [0.2, 1.0])
def test_faces_that_are_turned_over_change_nothing(necklace, share):
    mesh, truth = necklace
    is_turned = np.random.default_rng(0).random(len(truth)) < share
    faces = np.where(is_turned[:, None], mesh.faces[:, ::-1], mesh.faces)
    assert rand_index_error(COARSE(mesh.vertices, faces, 3), truth) == 0


def test_a_soup_and_fewer_faces_than_segments_are_a_segment_per_face(necklace):
    mesh, _ = necklace
    soup = np.arange(mesh.faces.size).reshape(-1, 3)
    assert np.array_equal(QUICK(mesh.vertices[mesh.faces].reshape(-1, 3), soup, 3), range(len(soup)))
    assert QUICK(np.eye(3), np.array([[0, 1, 2]]), 3).tolist() == [0]
    pair = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]])
    assert QUICK(pair, np.array([[0, 1, 2], [2, 1, 3]]), 5).tolist() in ([0, 1], [1, 0])


@pytest.mark.parametrize(("label", "mesh"), odd_meshes().items())
def test_odd_meshes_get_the_segments_asked_for(label, mesh):
    graph = DualGraph.of(unit_size(mesh.vertices, mesh.faces), mesh.faces)
    labels = RandomizedCuts(n_cuts=2, n_faces=300)(mesh.vertices, mesh.faces, 4)
    assert labels.shape == (len(mesh.faces),)
    # Beside a spike a million times as long, decimation leaves too little of the rest to be cut.
    allowed = {2, 3, 4} if label == "far spike" else {number_of_regions(graph, 4)}
    assert len(np.unique(labels)) in allowed, label


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ({"n_cuts": 0}, r"^segmenter\.n_cuts is 0: it must be an integer of at least 1$"),
        ({"n_faces": 4.5}, r"^segmenter\.n_faces is 4\.5: it must be an integer of at least 100$"),
        ({"max_regions": 1}, r"^segmenter\.max_regions is 1: it must be an integer of at least 2$"),
        ({"cost_noise": -1.0}, r"^segmenter\.cost_noise is -1\.0: it must be at least 0 and finite$"),
        ({"least_cost": np.nan}, r"^segmenter\.least_cost is nan: it must be at least 0 and finite$"),
    ],
)
def test_an_option_out_of_range_is_refused_by_name(option, message):
    with pytest.raises(ValueError, match=message):
        RandomizedCuts(**option)


def test_a_mesh_that_cannot_be_segmented_is_refused_in_one_line():
    faces = np.array([[0, 1, 2]])
    with pytest.raises(ValueError, match=r"^vertex 0 has NaN or infinite coordinates$"):
        QUICK(np.full((3, 3), np.nan), faces, 2)
    with pytest.raises(ValueError, match=r"^the mesh has no faces$"):
        QUICK(np.eye(3), faces[:0], 2)
    with pytest.raises(ValueError, match=r"^n_segments must be at least 1, got 0$"):
        QUICK(np.eye(3), faces, 0)
