"""Slivers: that the surface is the same, and how thin the new triangles are."""

import numpy as np
import pytest
import trimesh

import perturb
from perturb import PerturbationError
from perturb.testing import odd_meshes
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

COW = bundled("cow")


def heights_over_longest_edges(mesh):
    """(m,) the height of each triangle over its longest edge, relative to that edge."""
    corners = np.asarray(mesh.triangles)
    longest = np.linalg.norm(corners - np.roll(corners, -1, axis=1), axis=2).max(axis=1)
    return 2 * trimesh.triangles.area(corners) / longest**2


@pytest.mark.parametrize("unit", ["share_of_edges", "share_of_faces"])
@pytest.mark.parametrize("share", [0.1, 1.0])
def test_the_surface_and_its_topology_remain_the_same(unit, share):
    result = perturb.Slivers(share, unit)(COW, rng())
    assert result.mesh.area == pytest.approx(COW.area, rel=1e-12)
    assert result.mesh.volume == pytest.approx(COW.volume, rel=1e-12)
    assert result.mesh.is_watertight
    assert result.mesh.is_winding_consistent
    assert result.mesh.euler_number == COW.euler_number
    np.testing.assert_array_equal(result.mesh.vertices[: len(COW.vertices)], COW.vertices)
    n = len(COW.edges_unique) if unit == "share_of_edges" else len(COW.faces)
    assert result.applied["vertices_added"] == round(share * n) == result.applied["faces_added"] / 2
    assert perturb.slivers.is_degenerate(np.asarray(result.mesh.vertices), np.asarray(result.mesh.faces)).sum() == 0


@pytest.mark.parametrize("aspect", [4, 1000])
def test_a_needle_ends_at_the_sampled_edge_divided_by_the_aspect(aspect):
    slivers = perturb.Slivers(0.2, aspect=aspect)
    edges = slivers.sample(COW, rng())["edges"]
    inserted = np.asarray(slivers(COW, rng()).mesh.vertices)[len(COW.vertices) :]
    start, end = np.asarray(COW.vertices)[edges].transpose(1, 0, 2)
    np.testing.assert_allclose(aspect * (inserted - start), end - start, atol=1e-9 * COW.scale)
    assert len(np.unique(np.sort(edges, axis=1), axis=0)) == len(edges)


def test_an_edge_is_divided_in_all_of_its_faces():
    mesh = odd_meshes()["edges of three faces"]
    result = perturb.Slivers(1.0)(mesh, rng())
    number_of_faces = np.bincount(result.mesh.edges_unique_inverse)
    assert np.bincount(number_of_faces)[3] == 2 * 3  # both pieces of the three edges
    assert len(result.mesh.faces) == 4 * len(mesh.faces)
    assert result.mesh.area == pytest.approx(mesh.area, rel=1e-12)


def test_caps_are_as_flat_as_requested():
    slivers = perturb.Slivers(0.1, "share_of_faces", aspect=200)
    drawn = slivers.sample(COW, rng())["faces"]
    mesh = slivers(COW, rng()).mesh
    caps = np.sort(heights_over_longest_edges(mesh))[: len(drawn)]
    np.testing.assert_allclose(caps, 1 / 200, rtol=1e-6)
    kept = np.delete(np.asarray(COW.faces), drawn, axis=0)
    np.testing.assert_array_equal(mesh.faces[: len(kept)], kept)


def test_an_aspect_that_is_lost_in_the_rounding_of_coordinates_is_refused():
    far = perturb.as_trimesh(COW.vertices + 1e10 * COW.scale, COW.faces)
    for unit in ("share_of_edges", "share_of_faces"):
        with pytest.raises(PerturbationError, match=r"an aspect of 1e\+06 is lost in the rounding"):
            perturb.Slivers(0.5, unit, aspect=1e6)(far, rng())
