"""The operations on meshes that perturbations are built from."""

import numpy as np
import pytest
import scipy.stats
import trimesh
from scipy.spatial import cKDTree

import perturb
from perturb import meshes
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import normals, rng

COW = bundled("cow")


def test_a_mesh_has_exactly_the_given_arrays_even_if_they_could_be_cleaned():
    vertices = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0], [9, 9, 9]]  # a duplicate, and one without a face
    faces = [[0, 1, 2], [0, 1, 3], [0, 0, 1], [0, 1, 2]]  # a degenerate one, and a repeated one
    mesh = perturb.as_trimesh(vertices, faces)
    np.testing.assert_array_equal(mesh.vertices, vertices)
    np.testing.assert_array_equal(mesh.faces, faces)
    assert (mesh.vertices.dtype, mesh.faces.dtype) == (np.float64, np.int64)


def test_a_mesh_shares_no_memory_with_the_given_arrays():
    vertices, faces = np.array(COW.vertices), np.array(COW.faces)
    mesh = perturb.as_trimesh(vertices, faces)
    mesh.vertices[0] += 1
    assert not np.shares_memory(mesh.vertices, vertices)
    assert not np.shares_memory(mesh.faces, faces)
    np.testing.assert_array_equal(vertices, COW.vertices)


def test_a_moved_mesh_has_the_displaced_vertices_and_a_copy_of_the_faces():
    displacement = rng().standard_normal((len(COW.vertices), 3))
    mesh, counterpart = perturb.moved(COW, displacement)
    np.testing.assert_array_equal(mesh.vertices, COW.vertices + displacement)
    np.testing.assert_array_equal(mesh.faces, COW.faces)
    np.testing.assert_array_equal(counterpart, np.arange(len(COW.vertices)))
    assert not np.shares_memory(mesh.faces, COW.faces)


def test_removing_faces_removes_vertices_that_lose_their_last_one_but_no_others():
    vertices = np.concatenate([[[9.0, 9.0, 9.0]], COW.vertices])
    mesh = trimesh.Trimesh(vertices, COW.faces + 1, process=False)
    dropped = (mesh.faces == 1).any(axis=1)
    rest, counterpart = perturb.without_faces(mesh, dropped)
    expected = np.setdiff1d(np.arange(len(vertices)), np.setdiff1d(mesh.faces[dropped], mesh.faces[~dropped]))
    assert 0 in expected
    assert 1 not in expected
    np.testing.assert_array_equal(np.flatnonzero(counterpart >= 0), expected)
    np.testing.assert_array_equal(counterpart[expected], np.arange(len(expected)))
    np.testing.assert_array_equal(rest.vertices, vertices[expected])
    np.testing.assert_array_equal(rest.faces, counterpart[mesh.faces[~dropped]])


def test_the_edge_graph_contains_the_length_of_every_edge_in_both_directions():
    graph = perturb.edge_graph(COW).toarray()
    np.testing.assert_array_equal(graph, graph.T)
    edges = np.unique(COW.edges_sorted, axis=0)
    np.testing.assert_array_equal(np.argwhere(np.triu(graph)), edges)
    expected = np.linalg.norm(COW.vertices[edges[:, 0]] - COW.vertices[edges[:, 1]], axis=1)
    np.testing.assert_allclose(graph[tuple(edges.T)], expected, rtol=1e-12)


@pytest.mark.parametrize("size", [2.0**-100, 1.0, 2.0**100])
def test_vertex_normals_are_weighted_by_angle_at_any_size(size):
    mesh = trimesh.Trimesh(COW.vertices * size, COW.faces, process=False)
    np.testing.assert_allclose(perturb.vertex_normals(mesh), normals(COW), atol=1e-9)


def test_a_vertex_without_faces_has_the_normal_0():
    vertices = np.concatenate([COW.vertices, COW.vertices[:1]])
    found = perturb.vertex_normals(trimesh.Trimesh(vertices, COW.faces, process=False))
    np.testing.assert_array_equal(found[-1], 0)


def test_random_directions_are_uniformly_distributed_unit_vectors():
    generator = rng(1)
    directions = np.array([perturb.random_direction(generator) for _ in range(5000)])
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, rtol=1e-12)
    # By Archimedes' theorem, each coordinate of a uniformly distributed direction is uniform in -1 … 1.
    for coordinate in directions.T:
        assert scipy.stats.kstest(coordinate, scipy.stats.uniform(-1, 2).cdf).pvalue > 0.001
    centres = trimesh.creation.icosahedron().vertices
    counts = np.bincount(cKDTree(centres).query(directions)[1])
    assert scipy.stats.chisquare(counts).pvalue > 0.001


def test_units_of_length_are_those_of_the_mesh():
    corners = np.asarray(COW.vertices)[np.unique(COW.edges_sorted, axis=0)]
    edges = np.linalg.norm(corners[:, 0] - corners[:, 1], axis=1)
    box = COW.vertices.max(axis=0) - COW.vertices.min(axis=0)
    assert list(perturb.LENGTHS) == ["mean_edge_length", "bounding_box_diagonal"]
    assert perturb.LENGTHS["mean_edge_length"](COW) == pytest.approx(edges.mean(), rel=1e-12)
    assert perturb.LENGTHS["bounding_box_diagonal"](COW) == pytest.approx(np.sqrt((box**2).sum()), rel=1e-12)


@pytest.mark.parametrize("n_degenerate", [0, 1, 999, 1000, 2500])
def test_one_proper_triangle_makes_a_mesh_usable_wherever_it_is(n_degenerate):
    vertices = np.vstack([np.eye(3), np.zeros(3)])
    degenerate = np.tile([0, 1, 1], (n_degenerate, 1))
    for faces in ([*degenerate, [0, 1, 2]], [[0, 1, 2], *degenerate]):
        assert meshes.reason_unusable(meshes.as_trimesh(vertices, faces)) is None
    if n_degenerate:
        counts = f"4 vertices, {n_degenerate} faces"
        unusable = meshes.as_trimesh(vertices, degenerate)
        assert meshes.reason_unusable(unusable) == f"has only degenerate triangles ({counts})"
