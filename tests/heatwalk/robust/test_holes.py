from functools import cache
from itertools import pairwise

import numpy as np
import pytest
import trimesh

from heatwalk.robust.handles import closed_copy
from heatwalk.robust.holes import CHORD_COST, Loops, boundary_loops, fill, fill_small_holes, loop_lengths
from perturb import Holes, as_trimesh
from tests.heatwalk.robust.meshes import arrays, blob, is_nearly


def cycles(loops):
    """The loops without start and direction."""
    rings = [ring for i in range(len(loops)) for ring in (loops[i], loops[i][::-1])]
    turned = [tuple(np.roll(ring, -int(ring.argmin())).tolist()) for ring in rings]
    return {min(pair) for pair in zip(turned[::2], turned[1::2], strict=True)}


def test_two_holes_that_touch_in_a_vertex_have_an_outline_each():
    ball = trimesh.creation.icosphere(2)
    vertex = 100
    around = np.flatnonzero((ball.faces == vertex).any(axis=1))
    shared = [np.intersect1d(ball.faces[around[0]], ball.faces[f]) for f in around]
    opposite = around[[len(s) for s in shared].index(1)]  # shares nothing but the vertex
    loops = boundary_loops(np.delete(ball.faces, [around[0], opposite], axis=0), len(ball.vertices))
    assert cycles(loops) == cycles(Loops(np.array([0, 3, 6]), ball.faces[[around[0], opposite]].ravel()))


def test_a_moebius_strip_has_one_outline_of_all_its_boundary_edges():
    n = 20
    i = np.arange(n)
    low, high, after = 2 * i, 2 * i + 1, 2 * (i + 1)
    faces = np.concatenate([np.column_stack([low, high, after]), np.column_stack([high, after + 1, after])])
    twisted = np.where(faces >= 2 * n, 1 - (faces - 2 * n), faces)
    loops = boundary_loops(twisted, 2 * n)
    assert np.diff(loops.starts).tolist() == [2 * n]
    assert sorted(loops.vertices.tolist()) == list(range(2 * n))


def test_an_outline_that_ends_at_an_edge_of_three_faces_is_left_out():
    corners = np.array([[0, 1, 2], [1, 0, 3], [0, 1, 4]])
    assert len(boundary_loops(corners, 5)) == 0


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_a_surface_with_many_holes_is_closed_again_and_where_it_was(share):
    mesh = blob()
    perturbed = Holes(amount=share, unit="share_of_triangles")(mesh, np.random.default_rng(0)).mesh
    vertices, faces, n_filled = fill_small_holes(*arrays(perturbed), max_share=1.0)
    filled = as_trimesh(vertices, faces)
    assert n_filled > 0
    assert filled.is_watertight
    assert filled.is_winding_consistent
    assert closed_copy(faces, len(vertices)).genus == 0
    assert is_nearly(mesh, vertices, faces, within=share / 5)


def test_a_triangle_that_only_touches_others_is_covered_by_the_fill_of_the_hole_around_it():
    mesh = blob(3)
    beside = mesh.face_adjacency[(mesh.face_adjacency == 500).any(axis=1)]
    vertices, faces = arrays(as_trimesh(mesh.vertices, np.delete(mesh.faces, beside[beside != 500], axis=0)))
    vertices, faces, n_filled = fill_small_holes(vertices, faces, max_share=0.05)
    assert n_filled == 1
    filled = as_trimesh(vertices, faces)
    assert filled.is_watertight
    assert filled.euler_number == 2
    assert is_nearly(mesh, vertices, faces)


def test_a_single_missing_triangle_is_put_back():
    mesh = blob(2)
    vertices, faces, n_filled = fill_small_holes(*arrays(as_trimesh(mesh.vertices, mesh.faces[1:])), max_share=1.0)
    assert n_filled == 1
    assert sorted(faces[-1].tolist()) == sorted(mesh.faces[0].tolist())
    assert as_trimesh(vertices, faces).is_winding_consistent


def test_a_large_opening_stays_and_a_small_one_beside_it_is_filled():
    mesh = blob()
    faces = np.asarray(mesh.faces)[mesh.triangles_center[:, 0] < 1]
    opening = len(boundary_loops(faces, len(mesh.vertices)))
    without = np.delete(faces, len(faces) // 2, axis=0)
    _, result, n_filled = fill_small_holes(np.array(mesh.vertices), without, max_share=0.02)
    assert n_filled == 1
    assert len(boundary_loops(result, len(mesh.vertices))) == opening == 1


def test_the_hole_of_two_triangles_is_filled_along_the_shorter_diagonal():
    corners = np.array([[0.0, 0, 0], [3, 0, 0], [4, 2, 0], [1, 2, 0]])  # a parallelogram
    _, faces = fill(corners, np.empty((0, 3), np.int64), Loops(np.array([0, 4]), np.arange(4)))
    assert all({1, 3} <= set(face) for face in faces.tolist())


def test_the_fill_costs_least_of_all_triangulations():
    rng = np.random.default_rng(1)
    for size in (5, 6, 8):
        corners = rng.standard_normal((size, 3))
        faces = fill(corners, np.empty((0, 3), np.int64), Loops(np.array([0, size]), np.arange(size)))[1]
        costs = [cost(corners, triangulation) for triangulation in triangulations(tuple(range(size)))]
        assert cost(corners, faces) == pytest.approx(min(costs))


def cost(corners, faces):
    """Area, and the share of the squares of the edges within."""
    edges = np.sort(np.asarray(faces)[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    chords = {(a, b) for a, b in edges.tolist() if b - a not in (1, len(corners) - 1)}
    squares = sum(np.sum((corners[a] - corners[b]) ** 2) for a, b in chords)
    return as_trimesh(corners, faces).area + CHORD_COST * squares


@cache
def triangulations(polygon):
    """All triangulations of a polygon."""
    if len(polygon) < 3:
        return [[]]
    return [
        [*left, [polygon[0], polygon[k], polygon[-1]], *right]
        for k in range(1, len(polygon) - 1)
        for left in triangulations(polygon[: k + 1])
        for right in triangulations(polygon[k:])
    ]


def test_no_edge_of_the_fill_is_one_that_the_mesh_has():
    mesh = blob(2)
    perturbed = Holes(amount=0.3, unit="share_of_triangles")(mesh, np.random.default_rng(3)).mesh
    _, faces, _ = fill_small_holes(*arrays(perturbed), max_share=1.0)
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    assert np.unique(sides, axis=0, return_counts=True)[1].max() == 2


def test_the_length_of_a_loop_is_that_of_its_polygon():
    vertices = np.random.default_rng(0).standard_normal((7, 3))
    loops = Loops(np.array([0, 3, 7]), np.array([4, 2, 0, 1, 3, 5, 6]))
    for length, loop in zip(loop_lengths(vertices, loops), ([4, 2, 0, 4], [1, 3, 5, 6, 1]), strict=True):
        assert length == pytest.approx(sum(np.linalg.norm(vertices[a] - vertices[b]) for a, b in pairwise(loop)))
