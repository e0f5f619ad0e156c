from collections import Counter

import numpy as np
import pytest
import trimesh
from scipy.cluster.hierarchy import DisjointSet

from heatwalk.io import read_mesh
from heatwalk.meshes import (
    check_mesh,
    drop_unreferenced,
    face_areas,
    inspect_mesh,
    repeats_earlier_face,
    without_repeated_faces,
)
from tests.helpers.meshes import BUNDLED, bundled_path

OCTAHEDRON = trimesh.convex.convex_hull(np.vstack([np.eye(3), -np.eye(3)]))
TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)


@pytest.mark.parametrize("scale", [1e-300, 1e-200, 1e-30, 1.0, 1e30, 1e200, 1e307])
def test_the_magnitude_of_the_coordinates_does_not_matter(scale):
    cow = read_mesh(bundled_path("cow"))
    vertices, faces = check_mesh(cow.vertices * scale, cow.faces)
    assert np.array_equal(vertices, cow.vertices * scale)
    assert np.array_equal(faces, cow.faces)
    assert inspect_mesh(vertices, faces).n_degenerate_faces == 0


@pytest.mark.parametrize("vertex_type", [np.float32, np.float64, np.longdouble, np.int32])
@pytest.mark.parametrize("face_type", [np.int32, np.uint8, np.uint64, np.int64])
def test_numbers_of_every_type_and_layout_become_float64_and_int64(vertex_type, face_type):
    given_vertices = np.asfortranarray(TETRAHEDRON[0].astype(vertex_type))
    given_faces = TETRAHEDRON[1].astype(face_type)[:, ::-1]
    vertices, faces = check_mesh(given_vertices, given_faces)
    assert (vertices.dtype, faces.dtype) == (np.float64, np.int64)
    assert vertices.flags.c_contiguous
    assert faces.flags.c_contiguous
    assert np.array_equal(vertices, TETRAHEDRON[0])
    assert np.array_equal(faces, TETRAHEDRON[1][:, ::-1])


def test_lists_are_converted_to_arrays():
    vertices, faces = check_mesh(TETRAHEDRON[0].tolist(), TETRAHEDRON[1].tolist())
    assert np.array_equal(vertices, TETRAHEDRON[0])
    assert np.array_equal(faces, TETRAHEDRON[1])


@pytest.mark.parametrize("scale", [1e-200, 1.0, 1e200])
def test_faces_with_a_repeated_corner_or_no_height_are_degenerate(scale):
    vertices = scale * np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0, 0], [1, 0, 0], [0.3, 1e-11, 0]])
    good = TETRAHEDRON[1].tolist()
    degenerate = [[0, 1, 1], [2, 2, 2], [0, 1, 4], [1, 5, 3], [5, 4, 0]]
    sliver = [[0, 1, 6]]
    report = inspect_mesh(vertices, [*good, *degenerate, *sliver])
    assert report.n_degenerate_faces == len(degenerate)
    assert report.n_faces == len(good) + len(degenerate) + len(sliver)


def brute_force_edges(faces):
    """How many faces with three different corners have each edge (smaller vertex first), and run along it so."""
    directed = Counter(pair for a, b, c in faces.tolist() for pair in ((a, b), (b, c), (c, a)) if len({a, b, c}) == 3)
    edges = Counter()
    for pair, n in directed.items():
        edges[min(pair), max(pair)] += n
    return edges, directed


@pytest.mark.parametrize("name", list(BUNDLED))
def test_the_report_on_a_real_mesh_agrees_with_plain_counts(name):
    mesh = read_mesh(bundled_path(name))
    report = inspect_mesh(mesh.vertices, mesh.faces)
    edges, directed = brute_force_edges(mesh.faces)
    assert report.n_boundary_edges == sum(n == 1 for n in edges.values())
    assert report.n_nonmanifold_edges == sum(n > 2 for n in edges.values())
    assert report.is_watertight == all(n == 2 for n in edges.values())
    opposite = (directed[a, b] == directed[b, a] for (a, b), n in edges.items() if n == 2)
    assert report.is_consistently_oriented == all(opposite)
    assert report.euler_characteristic == len(mesh.vertices) - len(edges) + sum(directed.values()) // 3
    a, b, c = mesh.vertices[mesh.faces.T]
    assert report.area == pytest.approx(np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2, rel=1e-12)
    lengths = [np.linalg.norm(mesh.vertices[i] - mesh.vertices[j]) for i, j in edges]
    assert report.mean_edge_length == pytest.approx(np.mean(lengths), rel=1e-12)
    assert report.bounding_box_diagonal == pytest.approx(np.linalg.norm(np.ptp(mesh.vertices, axis=0)), rel=1e-12)
    pieces = DisjointSet(range(len(mesh.vertices)))
    for i, j in edges:
        pieces.merge(i, j)
    assert report.n_components == pieces.n_subsets
    assert report.problem is None


def test_a_torus_has_euler_characteristic_0_and_a_sphere_2():
    torus, sphere = trimesh.creation.torus(2, 0.5), trimesh.creation.icosphere(2)
    assert inspect_mesh(torus.vertices, torus.faces).euler_characteristic == 0
    assert inspect_mesh(sphere.vertices, sphere.faces).euler_characteristic == 2


def test_every_triangle_removed_from_a_sphere_leaves_a_boundary_loop():
    sphere = trimesh.creation.icosphere(3)
    apart = [0, 300, 600, 900]
    assert len(np.unique(sphere.faces[apart])) == 12
    report = inspect_mesh(sphere.vertices, np.delete(sphere.faces, apart, axis=0))
    assert (report.n_boundary_loops, report.n_boundary_edges, report.is_watertight) == (4, 12, False)
    assert report.euler_characteristic == 2 - 4


def test_the_report_counts_the_faults_of_the_faces():
    vertices, faces = TETRAHEDRON
    two = np.vstack([faces, faces + 4])
    report = inspect_mesh(np.vstack([vertices, vertices + 3]), two)
    assert (report.n_components, report.euler_characteristic, report.is_watertight) == (2, 4, True)

    report = inspect_mesh(vertices, np.vstack([faces, faces[:2, ::-1]]))
    assert report.n_duplicate_faces == 2
    assert report.n_nonmanifold_edges == 5  # all but the one that neither of the two has
    assert report.problem is None

    flipped = faces.copy()
    flipped[0] = flipped[0, ::-1]
    assert not inspect_mesh(vertices, flipped).is_consistently_oriented
    assert inspect_mesh(vertices, flipped).is_watertight

    report = inspect_mesh(np.vstack([vertices, [[2, 2, 2]]]), faces)
    assert report.n_unreferenced_vertices == 1
    assert report.n_components == 1
    assert report.problem == "1 of 5 vertices belong to no face (remove them): 4"


def test_area_and_lengths_are_correct_even_if_their_squares_underflow():
    report = inspect_mesh(TETRAHEDRON[0] * 1e-150, TETRAHEDRON[1])
    assert report.mean_edge_length == pytest.approx(1e-150 * (3 + 3 * 2**0.5) / 6, rel=1e-12)
    assert report.area == pytest.approx(1e-300 * (1.5 + 3**0.5 / 2), rel=1e-12)


def test_a_mesh_with_a_nan_is_reported_without_measurements():
    vertices = TETRAHEDRON[0].copy()
    vertices[2, 1] = np.nan
    report = inspect_mesh(vertices, TETRAHEDRON[1])
    assert report.problem == "1 of 4 vertices have NaN or infinite coordinates: 2"
    assert np.isnan([report.area, report.mean_edge_length, report.bounding_box_diagonal]).all()
    assert report.is_watertight


def test_dropping_unreferenced_vertices_keeps_the_order_and_the_triangles():
    cow = read_mesh(bundled_path("cow"))
    n = len(cow.vertices)
    is_new = np.zeros(n + 20, dtype=bool)
    is_new[np.random.default_rng(0).choice(n + 20, 20, replace=False)] = True
    spread = np.full((n + 20, 3), np.nan)
    spread[~is_new] = cow.vertices
    vertices, faces, kept = drop_unreferenced(spread, np.flatnonzero(~is_new)[cow.faces])
    assert np.array_equal(vertices, cow.vertices)
    assert np.array_equal(faces, cow.faces)
    assert np.array_equal(kept, np.flatnonzero(~is_new))


def test_a_mesh_without_unreferenced_vertices_is_returned_as_it_is():
    vertices, faces, kept = drop_unreferenced(*TETRAHEDRON)
    assert vertices is TETRAHEDRON[0]
    assert faces is TETRAHEDRON[1]
    assert kept.tolist() == [0, 1, 2, 3]


@pytest.mark.parametrize("name", ["cow", "airplane"])
def test_face_areas_equal_those_of_trimesh_for_any_layout_and_index_type(name):
    mesh = read_mesh(bundled_path(name))
    expected = trimesh.triangles.area(mesh.vertices[mesh.faces])
    np.testing.assert_allclose(face_areas(mesh.vertices, mesh.faces), expected, rtol=1e-9, atol=1e-18)
    other = face_areas(np.asfortranarray(mesh.vertices), mesh.faces.astype(np.int32)[:, [1, 2, 0]])
    np.testing.assert_allclose(other, expected, rtol=1e-9, atol=1e-18)


def test_faces_that_all_repeat_a_corner_form_no_surface():
    report = inspect_mesh(TETRAHEDRON[0], [[0, 1, 1], [2, 3, 2]])
    assert (report.n_boundary_edges, report.mean_edge_length, report.area) == (0, 0, 0)
    assert not report.is_watertight
    assert not report.is_consistently_oriented


def test_the_report_counts_vertices_that_coincide_exactly_and_nearly():
    vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 1e-9], [1, 1, 0]])
    report = inspect_mesh(vertices, [[0, 1, 2], [3, 5, 4]])
    assert (report.n_coincident_vertices, report.n_nearly_coincident_vertices) == (2, 2)
    report = inspect_mesh(vertices[[0, 1, 2, 5]], [[0, 1, 2], [1, 3, 2]])
    assert (report.n_coincident_vertices, report.n_nearly_coincident_vertices) == (0, 0)


@pytest.mark.parametrize("n_vertices", [9, 2**21, 2**40])
def test_repeated_faces_are_those_of_the_same_corners_as_an_earlier_one(n_vertices):
    rng = np.random.default_rng(2)
    faces = rng.integers(n_vertices - 9, n_vertices, (300, 3))  # few corners: many repetitions, some with equal corners
    seen, expected = set(), []
    for face in map(tuple, np.sort(faces, axis=1).tolist()):
        expected.append(face in seen)
        seen.add(face)
    assert repeats_earlier_face(faces).tolist() == expected


def test_faces_are_copied_only_if_one_is_left_out():
    faces = np.array([[0, 1, 2], [0, 1, 3], [2, 1, 0]])
    assert without_repeated_faces(faces).tolist() == [[0, 1, 2], [0, 1, 3]]
    assert without_repeated_faces(faces[:2]).base is faces
