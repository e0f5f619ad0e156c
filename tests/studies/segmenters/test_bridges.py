"""Dual graphs made connected, and distances in them."""

import numpy as np
import pytest
import trimesh
from scipy.sparse.csgraph import dijkstra

from perturb.testing import odd_meshes
from studies.segmenters._bridges import bridged, connected_dual_graph
from studies.segmenters._distances import distances_from, farthest_points, katz_tal_weights, outermost_face
from studies.segmenters._dual_graph import DualGraph
from studies.testing import example_meshes
from tests.helpers.meshes import bundled


@pytest.fixture(scope="module")
def torus():
    return example_meshes()["torus"]


def test_every_odd_mesh_becomes_connected_and_keeps_its_pairs():
    for name, mesh in odd_meshes().items():
        own = DualGraph.of(mesh.vertices / np.abs(mesh.vertices).max(), mesh.faces)
        graph = connected_dual_graph(np.asarray(mesh.vertices), np.asarray(mesh.faces))
        assert graph.components().max() == 0, name
        assert np.array_equal(graph.pairs[: len(own.pairs)], own.pairs), name
        assert np.isfinite(np.concatenate([graph.distances, graph.areas])).all(), name


def test_a_connected_graph_stays_as_it_is(torus):
    graph = DualGraph.of(torus.vertices, torus.faces)
    assert bridged(graph) is graph


def test_a_bridge_joins_the_faces_that_are_nearest_to_each_other():
    balls = [trimesh.creation.icosphere(1).apply_translation([x, 0.1, 0.2]) for x in (0, 4)]
    both = trimesh.util.concatenate(balls)
    graph = bridged(DualGraph.of(both.vertices, both.faces))
    distance = np.linalg.norm(graph.centres[:80, None] - graph.centres[80:], axis=2)
    (first, second) = graph.pairs[-1]
    assert len(graph.pairs) == 2 * 120 + 1
    assert distance[first, second - 80] == distance.min()


def test_a_bridge_is_a_flat_edge_of_mean_length():
    balls = [trimesh.creation.icosphere(1).apply_translation([x, 0, 0]) for x in (0, 4)]
    both = trimesh.util.concatenate(balls)
    graph = bridged(DualGraph.of(both.vertices, both.faces))
    assert graph.angles[-1] == 0
    assert graph.lengths[-1] == pytest.approx(graph.lengths[:-1].mean())
    assert graph.distances[-1] == pytest.approx(graph.distances[:-1].mean())


@pytest.mark.parametrize(
    ("vertices", "faces", "message"),
    [
        (np.eye(3), np.zeros((0, 3), int), "no faces"),
        (np.array([[0, 0, 0], [1, 0, 0], [np.nan, 1, 0]]), np.array([[0, 1, 2]]), "not finite"),
    ],
)
def test_a_mesh_without_distances_is_refused(vertices, faces, message):
    with pytest.raises(ValueError, match=message):
        connected_dual_graph(vertices, faces)


@pytest.mark.parametrize("share", [0, 0.3, 1])
def test_weights_are_those_of_the_formula(torus, share):
    graph = DualGraph.of(torus.vertices, torus.faces)
    angular = 1 - np.cos(graph.angles)
    angular[graph.angles >= 0] *= 0.2
    expected = share * graph.distances / graph.distances.mean() + (1 - share) * angular / angular.mean()
    assert katz_tal_weights(graph, share, 0.2) == pytest.approx(np.maximum(expected, 1e-9), rel=1e-12)


def test_each_farthest_point_is_the_farthest_from_those_before_it(torus):
    graph = DualGraph.of(torus.vertices, torus.faces)
    ways = graph.matrix(graph.distances)
    between = dijkstra(ways, directed=False)
    points, distances = farthest_points(ways, outermost_face(graph), 12)
    assert distances == pytest.approx(between[points])
    for i in range(1, 12):
        assert between[points[:i]].min(axis=0)[points[i]] == between[points[:i]].min(axis=0).max()


@pytest.mark.parametrize("share", [0, 0.5, 1])  # with 0, most lengths are a millionth of a few
def test_shortest_paths_are_those_of_scipy_bit_for_bit(share):
    mesh = bundled("cow")
    balls = trimesh.util.concatenate([mesh, trimesh.creation.icosphere(2).apply_translation([9, 0, 0])])
    graph = DualGraph.of(balls.vertices, balls.faces)
    ways = graph.matrix(katz_tal_weights(graph, share, 0.2))
    sources = [0, 1000, graph.n_faces - 1]
    assert np.array_equal(distances_from(ways, sources), dijkstra(ways, directed=False, indices=sources))


def test_there_are_no_more_farthest_points_than_faces():
    box = trimesh.creation.box()
    graph = DualGraph.of(box.vertices, box.faces)
    points, _ = farthest_points(graph.matrix(graph.distances), 3, 50)
    assert sorted(points) == list(range(12))


def test_the_outermost_face_does_not_depend_on_the_numbering(torus):
    order = np.random.default_rng(0).permutation(len(torus.faces))
    of = [outermost_face(DualGraph.of(torus.vertices, faces)) for faces in (torus.faces, torus.faces[order])]
    assert order[of[1]] == of[0]


def test_shortest_paths_across_odd_meshes_and_bridges_are_those_of_scipy_bit_for_bit():
    for name, mesh in odd_meshes().items():
        graph = connected_dual_graph(np.asarray(mesh.vertices), np.asarray(mesh.faces))
        faces = np.unique(np.linspace(0, graph.n_faces - 1, 5).astype(int))
        for weights in (np.maximum(graph.distances, 1e-12), katz_tal_weights(graph, 0.5, 0.2)):
            ways = graph.matrix(weights)
            assert np.array_equal(distances_from(ways, faces), dijkstra(ways, directed=False, indices=faces)), name
