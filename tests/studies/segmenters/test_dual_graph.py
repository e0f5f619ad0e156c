"""The dual graph, against trimesh's and against a construction edge by edge."""

from collections import defaultdict
from itertools import pairwise

import numpy as np
import pytest
import trimesh

from studies.segmenters._dual_graph import DualGraph
from studies.testing import example_meshes

FAN = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, -1, 0], [0, 0, 1.0], [5, 5, 5]])  # faces around the edge 0-1


def brute_force(faces):
    """The faces at each edge in their order, each joined to the next: {((face, face), (vertex, vertex)), …}."""
    at = defaultdict(list)
    for number, face in enumerate(np.asarray(faces).tolist()):
        for edge in {tuple(sorted(pair)) for pair in pairwise([*face, face[0]]) if pair[0] != pair[1]}:
            at[edge].append(number)
    return {(pair, edge) for edge, owners in at.items() for pair in pairwise(owners)}


def found(graph):
    return set(zip(map(tuple, graph.pairs.tolist()), map(tuple, graph.edges.tolist()), strict=True))


def with_inconsistent_faces(mesh):
    faces = np.array(mesh.faces)
    faces[::3] = faces[::3, ::-1]
    return mesh.vertices, faces


MESHES = {
    **{name: (mesh.vertices, mesh.faces) for name, mesh in example_meshes().items()},
    "inconsistent": with_inconsistent_faces(example_meshes()["torus"]),
    "three faces at an edge": (FAN, np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])),
    "a face twice": (FAN, np.array([[0, 1, 2], [0, 1, 2], [1, 0, 3]])),
    "a degenerate face": (FAN, np.array([[0, 1, 2], [0, 1, 1], [1, 0, 3]])),
    "no shared edge": (FAN, np.array([[0, 1, 2], [3, 4, 5]])),
    "a single face": (FAN, np.array([[0, 1, 2]])),
}


@pytest.mark.parametrize("name", MESHES)
def test_the_pairs_are_those_that_are_found_edge_by_edge(name):
    vertices, faces = MESHES[name]
    graph = DualGraph.of(vertices, faces)
    assert found(graph) == brute_force(faces)
    assert len(graph.pairs) == len(found(graph))
    assert (graph.pairs[:, 0] < graph.pairs[:, 1]).all()


@pytest.mark.parametrize("name", example_meshes())
def test_on_a_manifold_angles_and_lengths_are_those_of_trimesh(name):
    mesh = example_meshes()[name]
    graph = DualGraph.of(mesh.vertices, mesh.faces)
    ours, theirs = np.lexsort(graph.pairs.T), np.lexsort(mesh.face_adjacency.T)
    np.testing.assert_array_equal(graph.pairs[ours], mesh.face_adjacency[theirs])
    np.testing.assert_allclose(np.abs(graph.angles[ours]), mesh.face_adjacency_angles[theirs], atol=1e-7)
    bent = np.abs(graph.angles[ours]) > 1e-6
    np.testing.assert_array_equal(graph.angles[ours][bent] > 0, mesh.face_adjacency_convex[theirs][bent])
    ends = mesh.vertices[mesh.face_adjacency_edges[theirs]]
    np.testing.assert_allclose(graph.lengths[ours], np.linalg.norm(ends[:, 0] - ends[:, 1], axis=1))
    np.testing.assert_allclose(graph.areas, mesh.area_faces)
    np.testing.assert_allclose(graph.centres, mesh.triangles_center)
    np.testing.assert_allclose(graph.normals, mesh.face_normals, atol=1e-9)
    halfway = ends.mean(axis=1)
    centres = mesh.triangles_center[mesh.face_adjacency[theirs]]
    lengths = np.linalg.norm(centres - halfway[:, None], axis=2).sum(axis=1)
    np.testing.assert_allclose(graph.distances[ours], lengths)


def test_edges_are_concave_as_seen_from_the_side_of_the_first_face():
    box = trimesh.creation.box()
    outside, inside = (DualGraph.of(box.vertices, faces) for faces in (box.faces, box.faces[:, ::-1]))
    assert np.unique(np.round(outside.angles, 9)).tolist() == pytest.approx([0, np.pi / 2])
    np.testing.assert_allclose(inside.angles, np.where(outside.angles > 0.1, -1, 1) * outside.angles)


def test_faces_that_are_turned_over_do_not_change_how_much_an_edge_is_bent():
    mesh = example_meshes()["torus"]
    turned = DualGraph.of(*with_inconsistent_faces(mesh))
    graph = DualGraph.of(mesh.vertices, mesh.faces)
    np.testing.assert_array_equal(turned.pairs, graph.pairs)
    np.testing.assert_allclose(np.abs(turned.angles), np.abs(graph.angles), atol=1e-12)
    sign = np.where(np.arange(len(mesh.faces)) % 3 == 0, -1, 1)[graph.pairs[:, 0]]
    bent = np.abs(graph.angles) > 1e-6
    np.testing.assert_array_equal(np.sign(turned.angles)[bent], (sign * np.sign(graph.angles))[bent])


def test_a_face_without_area_has_no_normal_and_no_value_is_missing():
    graph = DualGraph.of(*MESHES["a degenerate face"])
    assert graph.areas.tolist() == [0.5, 0, 0.5]
    assert graph.normals[1].tolist() == [0, 0, 0]
    for values in (graph.angles, graph.lengths, graph.distances, graph.centres):
        assert np.isfinite(values).all()


def test_the_matrix_is_symmetric_and_adds_the_weights_of_a_pair_that_shares_two_edges():
    graph = DualGraph.of(*MESHES["a face twice"])
    weights = np.arange(1.0, len(graph.pairs) + 1)
    expected = np.zeros((3, 3))
    for (i, j), weight in zip(graph.pairs, weights, strict=True):
        expected[i, j] += weight
        expected[j, i] += weight
    np.testing.assert_array_equal(graph.matrix(weights).toarray(), expected)


def test_components_are_those_of_the_shapes():
    a, b = trimesh.creation.icosphere(1), trimesh.creation.box()
    b.apply_translation([5, 0, 0])
    both = trimesh.util.concatenate([a, b])
    components = DualGraph.of(both.vertices, both.faces).components()
    assert [set(components[: len(a.faces)]), set(components[len(a.faces) :])] == [{0}, {1}]
