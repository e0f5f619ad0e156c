"""Tessellations: number and shape of the triangles, their distance from the surface, and the counterparts."""

import hashlib

import numpy as np
import pymeshlab
import pytest
import pyvista
import trimesh

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled, coarse
from tests.helpers.perturbing import rng

AMOUNTS = (0.5, 1.5)


def tessellate(mesh, amount, method="isotropic", seed=0):
    return perturb.Tessellation(amount, method=method)(mesh, rng(seed))


@pytest.fixture(scope="module")
def armadillo(psb_mesh):
    """The benchmark's finest kind of model, with all relief that 12,000 of its 50,542 faces can show."""
    return coarse(psb_mesh(281), 12_000)


def distances(mesh, points):
    """Distances of points, at most a thousand of them, from a surface, by VTK."""
    some = rng().permutation(points)[:1000]
    cloud = pyvista.PolyData(some).compute_implicit_distance(pyvista.wrap(mesh))
    return np.abs(cloud["implicit_distance"])


def boundary_loops(mesh):
    edges, uses = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    return len(trimesh.graph.connected_components(edges[uses == 1]))


@pytest.fixture(
    scope="module",
    params=[
        ("cow", "isotropic"),
        ("cow", "irregular"),
        ("bunny", "anisotropic"),
        ("bunny", "irregular"),
        (124, "isotropic"),
        (203, "anisotropic"),
        ("armadillo", "isotropic"),
    ],
    ids=lambda param: f"{param[0]}-{param[1]}",
)
def tessellated(request):
    """A mesh, and its tessellations with half and with twice the triangles."""
    model, method = request.param
    if model == "armadillo":
        mesh = request.getfixturevalue(model)
    else:
        mesh = bundled(model) if isinstance(model, str) else request.getfixturevalue("psb_mesh")(model)
    return mesh, [tessellate(mesh, amount, method) for amount in AMOUNTS]


def test_the_number_of_faces_is_met_within_the_tolerance(tessellated):
    mesh, results = tessellated
    for amount, result in zip(AMOUNTS, results, strict=True):
        ratio = len(result.mesh.faces) / len(mesh.faces)
        assert ratio == pytest.approx(amount, rel=0.05)
        assert result.applied["ratio_of_faces_reached"] == ratio


def test_the_topology_and_the_orientation_are_preserved(tessellated):
    mesh, results = tessellated
    for result in results:
        _, uses = np.unique(result.mesh.edges_sorted, axis=0, return_counts=True)
        assert uses.max() == 2
        assert result.mesh.is_winding_consistent == mesh.is_winding_consistent
        assert result.mesh.euler_number == mesh.euler_number
        assert boundary_loops(result.mesh) == boundary_loops(mesh)
        assert result.applied["components_after"] == result.applied["components_before"]
        assert result.mesh.volume == pytest.approx(mesh.volume, rel=0.1)


def test_new_vertices_are_on_the_surface_and_the_surface_remains_near(tessellated):
    mesh, results = tessellated
    diagonal = np.linalg.norm(mesh.extents)
    for result in results:
        assert distances(mesh, result.mesh.vertices).max() < 1e-6 * diagonal
        away = distances(result.mesh, mesh.vertices)
        assert away.max() < 0.04 * diagonal
        assert away.mean() < 0.003 * diagonal
        assert distances(mesh, result.mesh.triangles_center).max() < 0.02 * diagonal


def test_a_counterpart_is_the_nearest_corner_of_the_closest_triangle(tessellated):
    mesh, results = tessellated
    for result in results:
        corners = np.asarray(result.mesh.triangles)
        for vertex in rng().choice(len(mesh.vertices), 20, replace=False):
            point = mesh.vertices[vertex]
            closest = trimesh.triangles.closest_point(corners, np.broadcast_to(point, (len(corners), 3)))
            distance = np.linalg.norm(closest - point, axis=1)
            # Several triangles are equally close where the closest point is on an edge.
            candidates = result.mesh.faces[distance <= distance.min() + 1e-9 * mesh.scale]
            to_corners = np.linalg.norm(result.mesh.vertices[candidates] - point, axis=2)
            nearest = np.take_along_axis(candidates, to_corners.argmin(axis=1)[:, None], axis=1)
            assert result.counterpart[vertex] in nearest
        assert result.applied["counterpart_by"] == "closest_point"


@pytest.mark.parametrize("model", ["cow", "bunny"])
def test_isotropic_triangles_are_nearly_equilateral_and_of_uniform_size(model):
    mesh = bundled(model)
    result = tessellate(mesh, 1.0).mesh
    smallest = trimesh.triangles.angles(result.triangles).min(axis=1)
    assert np.degrees(np.median(smallest)) > 45
    assert np.degrees(np.median(trimesh.triangles.angles(mesh.triangles).min(axis=1))) < 45
    short, long = np.quantile(result.edges_unique_length, [0.1, 0.9])
    assert long / short < 1.8


@pytest.mark.parametrize(("stretch", "least", "most"), [(1.001, 0.95, 1.05), (2.0, 1.6, 2.1), (4.0, 2.6, 4.2)])
def test_anisotropic_triangles_are_longer_along_the_direction(stretch, least, most):
    mesh = bundled("bunny")
    method = perturb.Tessellation(1.0, method="anisotropic", stretch=stretch)
    direction = method.sample(mesh, rng())["direction"]
    result = method(mesh, rng()).mesh
    along = np.flatnonzero(np.abs(result.face_normals @ direction) < 0.1)
    across = np.cross(result.face_normals[along], direction)
    triangles = np.asarray(result.triangles)[along]
    edges = triangles - np.roll(triangles, 1, axis=1)
    length = np.sqrt(np.mean((edges @ direction) ** 2))
    width = np.sqrt(np.mean(np.einsum("tek,tk->te", edges, across) ** 2))
    assert least < length / width < most


def test_irregular_triangles_grow_from_an_extremity_with_the_square_of_the_distance():
    mesh = bundled("bunny")
    method = perturb.Tessellation(1.0, method="irregular")
    direction = method.sample(mesh, rng())["direction"]
    result = method(mesh, rng()).mesh
    middle = np.asarray(result.vertices)[result.edges_unique].mean(axis=1)
    top = mesh.vertices[(mesh.vertices @ direction).argmax()]
    # The point outside the shape from which the farthest vertex is √8 times as far as the extremity.
    heights = np.linspace(0.01, 3, 3000) * mesh.scale
    farthest = [np.linalg.norm(mesh.vertices - top - height * direction, axis=1).max() for height in heights]
    height = heights[np.abs(np.array(farthest) / heights - np.sqrt(8)).argmin()]
    distance = np.linalg.norm(middle - top - height * direction, axis=1)
    exponent, _ = np.polyfit(np.log(distance), np.log(result.edges_unique_length), 1)
    assert exponent == pytest.approx(2, abs=0.15)  # preserved edges keep their length
    smallest = trimesh.triangles.angles(result.triangles).min(axis=1)
    assert np.degrees(np.median(smallest)) > 45


def test_subdivision_divides_every_triangle_into_four_and_keeps_every_vertex():
    mesh = bundled("bunny")
    once, twice = (tessellate(mesh, amount, "subdivision") for amount in (4, 16))
    for result, pieces in ((once, 4), (twice, 16)):
        assert len(result.mesh.faces) == pieces * len(mesh.faces)
        np.testing.assert_array_equal(result.counterpart, np.arange(len(mesh.vertices)))
        np.testing.assert_array_equal(result.mesh.vertices[: len(mesh.vertices)], mesh.vertices)
        assert result.mesh.euler_number == mesh.euler_number
        assert result.mesh.area == pytest.approx(mesh.area, rel=1e-12)
    again = tessellate(once.mesh, 4, "subdivision").mesh
    np.testing.assert_array_equal(again.vertices, twice.mesh.vertices)
    np.testing.assert_array_equal(again.faces, twice.mesh.faces)
    corners = np.sort(trimesh.triangles.area(once.mesh.triangles))
    np.testing.assert_allclose(corners, np.sort(np.repeat(mesh.area_faces / 4, 4)), rtol=1e-9, atol=0)


SCRIPT = """
import hashlib, numpy, perturb
from tests.helpers.meshes import bundled
result = perturb.Tessellation(0.7, method="irregular")(bundled("cow"), numpy.random.default_rng(0))
arrays = result.mesh.vertices.tobytes() + result.mesh.faces.tobytes() + result.counterpart.tobytes()
print(hashlib.sha256(arrays).hexdigest())
"""


def test_another_process_yields_the_same_result_whatever_pymeshlab_ran_before(interpreter, tmp_path):
    """Its filters remember options until the process ends, so every option is set in each call."""
    cow = bundled("cow")
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(cow.vertices, cow.faces))
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=1, adaptive=True, featuredeg=10, checksurfdist=False, swapflag=False, reprojectflag=False
    )
    meshes.add_mesh(pymeshlab.Mesh(cow.vertices))
    meshes.transfer_attributes_per_vertex(sourcemesh=0, targetmesh=1, geomtransfer=True, vertexsampling=True)
    result = tessellate(cow, 0.7, "irregular")
    arrays = result.mesh.vertices.tobytes() + result.mesh.faces.tobytes() + result.counterpart.tobytes()
    other = interpreter.run(["-c", SCRIPT], tmp_path)
    assert other.stdout.strip() == hashlib.sha256(arrays).hexdigest()


def test_vertices_without_faces_are_removed():
    cow = bundled("cow")
    vertices = np.insert(np.asarray(cow.vertices), 100, cow.vertices[0], axis=0)
    with_unreferenced = trimesh.Trimesh(vertices, cow.faces + (cow.faces >= 100), process=False)
    result, plain = tessellate(with_unreferenced, 0.7, "irregular"), tessellate(cow, 0.7, "irregular")
    assert result.counterpart[100] == -1
    np.testing.assert_array_equal(np.delete(result.counterpart, 100), plain.counterpart)
    np.testing.assert_array_equal(result.mesh.faces, plain.mesh.faces)


def test_an_unreachable_density_is_refused_with_the_density_reached():
    # Fifteen angular components, nearly all of which is preserved because of edges sharper than 45 degrees.
    with pytest.raises(PerturbationError, match=r"0\.25 times the faces were requested, but 0\.9\d* times reached"):
        tessellate(bundled("ant"), 0.25)
