"""Floaters: what specks look like, and where they are."""

import numpy as np
import pytest

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import normals, rng


@pytest.fixture(scope="module")
def with_specks():
    """A mesh, the parameters of 30 specks, and their result."""
    mesh = bundled("cow")
    floaters = perturb.Floaters(30, "count", distance=2.5, size=0.8)
    parameters = floaters.sample(mesh, rng())
    return mesh, parameters, floaters.apply(mesh, parameters)


def test_specks_are_regular_tetrahedra_of_the_requested_size_that_point_outwards(with_specks):
    mesh, _, result = with_specks
    corners = np.asarray(result.mesh.vertices)[len(mesh.vertices) :].reshape(30, 4, 3)
    edges = np.linalg.norm(corners[:, :, None] - corners[:, None], axis=3)[:, *np.triu_indices(4, 1)]
    size = 0.8 * perturb.LENGTHS["mean_edge_length"](mesh)
    np.testing.assert_allclose(edges, size, rtol=1e-9)
    specks = perturb.as_trimesh(result.mesh.vertices, result.mesh.faces[len(mesh.faces) :])
    assert specks.is_watertight
    assert specks.is_winding_consistent
    assert specks.volume == pytest.approx(30 * size**3 / (6 * np.sqrt(2)))


def test_specks_float_at_the_distance_on_the_outer_side_of_their_vertices(with_specks):
    mesh, parameters, result = with_specks
    centres = np.asarray(result.mesh.vertices)[len(mesh.vertices) :].reshape(30, 4, 3).mean(axis=1)
    offset = centres - mesh.vertices[parameters["vertices"]]
    distance = 2.5 * perturb.LENGTHS["mean_edge_length"](mesh)
    np.testing.assert_allclose(np.linalg.norm(offset, axis=1), distance, rtol=1e-9)
    assert ((offset * normals(mesh)[parameters["vertices"]]).sum(axis=1) >= 0).all()


def test_the_shape_itself_is_unchanged_and_each_speck_is_a_component(with_specks):
    mesh, _, result = with_specks
    np.testing.assert_array_equal(result.mesh.vertices[: len(mesh.vertices)], mesh.vertices)
    np.testing.assert_array_equal(result.mesh.faces[: len(mesh.faces)], mesh.faces)
    np.testing.assert_array_equal(result.counterpart, np.arange(len(mesh.vertices)))
    assert result.applied["components_after"] == result.applied["components_before"] + 30
    assert (result.applied["specks"], result.applied["vertices_added"]) == (30, 120)


@pytest.mark.parametrize("share", [0.0, 0.01, 1.0])
def test_a_share_of_the_vertices_gets_one_speck_each(share):
    mesh = bundled("ant")
    vertices = perturb.Floaters(share).sample(mesh, rng())["vertices"]
    assert len(vertices) == len(np.unique(vertices)) == round(share * len(mesh.vertices))


def test_specks_that_are_lost_in_the_rounding_of_coordinates_are_refused():
    mesh = bundled("ant")
    far = perturb.as_trimesh(mesh.vertices + 1e9 * mesh.scale, mesh.faces)
    with pytest.raises(PerturbationError, match="lost in the rounding of coordinates"):
        perturb.Floaters(3, "count", size=1e-6)(far, rng())
