"""Sampling: the density of the vertices, on a surface that remains the same."""

import numpy as np
import pytest
import trimesh

import perturb
from perturb import PerturbationError
from perturb.testing import check_perturbation, default_meshes
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

UP = np.array([0.0, 0.0, 1.0])


@pytest.fixture(scope="module")
def sphere():
    return trimesh.creation.icosphere(subdivisions=4)


@pytest.fixture(scope="module")
def uneven(sphere):
    """Dense at the bottom and coarse at the top."""
    return perturb.Sampling(16, field="direction").apply(sphere, {"direction": UP})


@pytest.fixture(scope="module")
def cow():
    return perturb.Sampling(8)(bundled("cow"), rng())


def test_it_conforms_on_a_mesh_with_a_boundary_several_components_and_a_loose_vertex():
    check_perturbation(perturb.Sampling(4), {"torn pipe": default_meshes()["torn pipe"]})


def test_the_density_falls_exponentially_along_the_direction(uneven):
    # Zones of a sphere between equally spaced heights have the same area.
    counts, _ = np.histogram(uneven.mesh.vertices[:, 2], bins=8, range=(-1, 1))
    slope, intercept = np.polyfit(np.arange(8), np.log(counts), 1)
    np.testing.assert_allclose(np.log(counts), intercept + slope * np.arange(8), atol=0.3)
    assert 16**0.75 < np.exp(-8 * slope) < 16**1.1
    assert uneven.applied["density_ratio_reached"] == pytest.approx(np.exp(-8 * slope), rel=0.2)


def test_the_number_of_faces_remains_about_the_same(uneven, cow):
    for result in (uneven, cow):
        assert result.applied["ratio_of_faces"] == pytest.approx(1, abs=0.1)


def test_all_vertices_are_on_the_original_surface(sphere, uneven):
    flat = sphere.face_normals @ uneven.mesh.vertices.T  # heights above the planes of the faces, and of the origin
    height = np.einsum("ij,ij->i", sphere.face_normals, sphere.triangles[:, 0])
    # A convex polyhedron's surface: no plane is exceeded, and one is met.
    np.testing.assert_allclose((flat - height[:, None]).max(axis=0), 0, atol=1e-9)


def test_the_surface_stays_closed_and_in_one_piece_and_its_triangles_are_well_shaped(cow):
    assert cow.mesh.is_watertight
    assert cow.applied["components_after"] == 1
    assert cow.mesh.volume == pytest.approx(bundled("cow").volume, rel=0.02)
    assert np.quantile(cow.mesh.face_angles.min(axis=1), 0.1) > np.radians(30)


def test_counterparts_are_corners_of_the_triangle_nearby(cow):
    offset = np.linalg.norm(cow.mesh.vertices[cow.counterpart] - bundled("cow").vertices, axis=1)
    longest = np.zeros(len(cow.mesh.vertices))
    np.maximum.at(longest, cow.mesh.edges_unique, cow.mesh.edges_unique_length[:, None])
    assert (offset <= longest[cow.counterpart]).mean() > 0.999


def test_the_random_field_is_dense_at_half_of_the_places_and_coarse_at_the_others(cow):
    places = perturb.Sampling(8).sample(bundled("cow"), rng())["vertices"]
    area = np.bincount(cow.mesh.faces.ravel(), np.repeat(cow.mesh.area_faces, 3)) / np.bincount(cow.mesh.faces.ravel())
    dense, coarse = (np.median(area[cow.counterpart[places[start::2]]]) for start in (0, 1))
    assert coarse > 2.5 * dense


def test_a_mesh_on_which_the_density_cannot_vary_is_refused():
    with pytest.raises(PerturbationError, match=r"a ratio of densities of 1000 was requested, but .* reached"):
        perturb.Sampling(1000)(trimesh.creation.box(), rng())


def test_an_amount_below_1_is_refused():
    with pytest.raises(PerturbationError, match=r"amount is 0\.5; it must be at least 1"):
        perturb.Sampling(0.5)
