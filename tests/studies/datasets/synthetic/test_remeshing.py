"""Each step of remeshing keeps a closed surface closed, and does what it promises."""

import numpy as np
import pytest
import trimesh

from studies.datasets.synthetic import remeshing
from studies.datasets.synthetic.fields import Field
from studies.datasets.synthetic.skeleton import Shape, Tube
from studies.datasets.synthetic.surface import field_of


@pytest.fixture(scope="module")
def ball() -> Field:
    points = [(0, 0, -1e-6), (0, 0, 1e-6)]
    return field_of(
        Shape(name="ball", limbs=[Tube(name="b", points=points, radii=[1, 1], parts="b", subdivisions=1)]), 1
    )


@pytest.fixture
def uneven():
    """A sphere whose vertices crowd towards one pole."""
    sphere = trimesh.creation.icosphere(3)
    vertices = np.array(sphere.vertices) + np.array([0, 0, 0.9])
    return np.array(vertices / np.linalg.norm(vertices, axis=1)[:, None]), np.array(sphere.faces)


def is_sphere(vertices, faces):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    return mesh.is_watertight and mesh.is_winding_consistent and mesh.euler_number == 2 and mesh.volume > 0


def edge_lengths(vertices, faces):
    return trimesh.Trimesh(vertices, faces, process=False).edges_unique_length


def test_edges_have_the_faces_on_both_sides_and_the_corners_opposite(uneven):
    _, faces = uneven
    edges = remeshing.edges_of(faces)
    assert len(np.unique(edges.ends, axis=0)) == len(edges.ends) == 3 * len(faces) // 2
    for side in range(2):
        corners = np.column_stack([edges.ends, edges.opposite[:, side]])
        assert np.array_equal(np.sort(corners, axis=1), np.sort(faces[edges.faces[:, side]], axis=1))
    assert np.all(edges.faces[:, 0] != edges.faces[:, 1])


def test_collapsing_leaves_short_edges_only_where_a_collapse_would_spoil_the_surface(uneven):
    vertices, faces = remeshing.collapse_short(*uneven, 0.1)
    assert is_sphere(vertices, faces)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    around = [set(neighbours) for neighbours in mesh.vertex_neighbors]
    for a, b in mesh.edges_unique[mesh.edges_unique_length < 0.1]:
        common = around[a] & around[b]
        assert len(common) > 2 or min(len(around[corner]) for corner in common) <= 4
    assert (mesh.edges_unique_length < 0.1).mean() < 0.01 < (edge_lengths(*uneven) < 0.1).mean()


def test_splitting_leaves_no_long_edges_and_keeps_the_area(uneven):
    vertices, faces = remeshing.split_long(*uneven, 0.2)
    assert is_sphere(vertices, faces)
    assert edge_lengths(vertices, faces).max() <= 0.2
    area = trimesh.Trimesh(*uneven, process=False).area
    assert trimesh.Trimesh(vertices, faces, process=False).area == pytest.approx(area, rel=1e-12)


def test_flipping_makes_the_mesh_delaunay(uneven):
    vertices, faces = remeshing.collapse_short(*uneven, 0.1)
    faces = remeshing.flip_to_delaunay(vertices, faces)
    assert is_sphere(vertices, faces)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    opposite = {}
    for face, angles in zip(faces, mesh.face_angles, strict=True):
        for i in range(3):
            opposite.setdefault(frozenset((face[(i + 1) % 3], face[(i + 2) % 3])), []).append(angles[i])
    assert max(sum(angles) for angles in opposite.values()) <= np.pi + 1e-6


def test_a_remeshed_sphere_has_edges_of_the_target_length_and_vertices_on_the_sphere(uneven, ball):
    vertices, faces = remeshing.remesh(*uneven, ball, 0.15)
    assert is_sphere(vertices, faces)
    assert np.abs(np.linalg.norm(vertices, axis=1) - 1).max() < 1e-5
    lengths = edge_lengths(vertices, faces)
    assert lengths.mean() == pytest.approx(0.15, rel=0.12)
    assert lengths.std() < 0.2 * lengths.mean()
    assert np.degrees(trimesh.Trimesh(vertices, faces, process=False).face_angles.min()) > 25
