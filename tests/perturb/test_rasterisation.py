"""Rasterisation: which voxels are filled, the surface around them, and counterparts."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.distance import cdist

import perturb
from perturb import PerturbationError
from perturb.testing import odd_meshes
from tests.helpers.perturbing import rng


def nested_spheres():
    """A sphere with a cavity."""
    outer = trimesh.creation.icosphere(subdivisions=3)
    inner = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    inner.invert()
    return trimesh.util.concatenate(outer, inner), len(outer.vertices)


@pytest.fixture(scope="module")
def sphere():
    return trimesh.creation.icosphere(subdivisions=3)


@pytest.mark.parametrize("label", ["soup", "a third flipped", "open", "edges of three faces", "bow-ties", "fin"])
def test_whatever_the_mesh_the_result_is_closed_and_points_outwards(label):
    mesh = perturb.Rasterisation(0.04)(odd_meshes()[label], rng()).mesh
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0


def test_the_voxels_of_a_box_are_those_that_it_reaches():
    box = trimesh.creation.box(extents=[4.0, 3.0, 2.0])
    voxel = 0.25
    rasterisation = perturb.Rasterisation(voxel / np.linalg.norm(box.extents))
    parameters = {"offset": np.array([0.2, 0.6, 0.5 - 1e-6])}
    applied = rasterisation.apply(box, parameters).applied
    # From offset to offset + length, in voxels, the nearest integers are the numbers of the voxels.
    sides = [
        int(np.rint(offset + length / voxel) - np.rint(offset)) + 1
        for offset, length in zip(parameters["offset"], box.extents, strict=True)
    ]
    assert applied["voxels"] == np.prod(sides)


def test_the_surface_is_a_quarter_of_a_voxel_away_from_centres_of_voxels(sphere):
    rasterisation = perturb.Rasterisation(0.05)
    offset = rasterisation.sample(sphere, rng())["offset"]
    mesh = rasterisation(sphere, rng()).mesh
    voxel = 0.05 * np.linalg.norm(sphere.extents)
    in_voxels = (np.asarray(mesh.vertices) - sphere.bounds[0]) / voxel + offset
    from_centres = np.sort(np.abs(in_voxels - np.rint(in_voxels)), axis=1)
    np.testing.assert_allclose(from_centres, np.tile([0, 0, 0.25], (len(from_centres), 1)), atol=1e-5)
    radius = np.linalg.norm(mesh.vertices, axis=1)
    assert radius.min() > 1 - voxel
    assert radius.max() < 1 + 1.5 * voxel


def test_the_counterpart_is_the_nearest_vertex(sphere):
    result = perturb.Rasterisation(0.05)(sphere, rng())
    distance = cdist(sphere.vertices, result.mesh.vertices)
    np.testing.assert_allclose(distance[np.arange(len(distance)), result.counterpart], distance.min(axis=1), rtol=1e-12)
    assert result.applied["vertices_without_counterpart"] == 0


def test_cavities_are_filled_and_their_vertices_have_no_counterpart():
    mesh, n_outer = nested_spheres()
    result = perturb.Rasterisation(0.02)(mesh, rng())
    np.testing.assert_array_equal(result.counterpart >= 0, np.arange(len(mesh.vertices)) < n_outer)
    assert result.applied["components_after"] == 1
    assert result.mesh.euler_number == 2
    assert result.applied["vertices_without_counterpart"] == len(mesh.vertices) - n_outer


def test_parts_less_than_a_voxel_apart_grow_together(sphere):
    pair = trimesh.util.concatenate(sphere, sphere.copy().apply_translation([2.2, 0, 0]))
    for amount, components in ((0.01, 2), (0.08, 1)):
        assert perturb.Rasterisation(amount)(pair, rng()).applied["components_after"] == components


def test_a_grid_that_is_too_large_is_refused(sphere):
    with pytest.raises(PerturbationError, match=r"the bounding box is 577\.4 voxels long, more than 512; raise amount"):
        perturb.Rasterisation(0.001)(sphere, rng())
