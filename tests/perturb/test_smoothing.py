"""Smoothing: steps to the mean of the neighbours, by a plain implementation, and what becomes of the size."""

import numpy as np
import pytest
import trimesh

import perturb
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

ANT = bundled("ant")


def step(vertices, mesh, share):
    """Every vertex moved a share of the way to the mean of its neighbours."""
    neighbours = [set() for _ in vertices]
    for a, b, c in mesh.faces.tolist():
        neighbours[a] |= {b, c}
        neighbours[b] |= {a, c}
        neighbours[c] |= {a, b}
    means = [
        vertices[sorted(near - {i})].mean(axis=0) if near - {i} else vertices[i] for i, near in enumerate(neighbours)
    ]
    return vertices + share * (np.array(means) - vertices)


@pytest.mark.parametrize(("method", "shares"), [("laplacian", [0.5]), ("taubin", [0.5, -1 / 1.9])])
def test_each_iteration_is_a_step_to_the_mean_of_the_neighbours_or_a_step_forth_and_back(method, shares):
    expected = np.asarray(ANT.vertices)
    for share in 3 * shares:
        expected = step(expected, ANT, share)
    result = perturb.Smoothing(3, method=method)(ANT, rng())
    np.testing.assert_allclose(result.mesh.vertices, expected, atol=1e-12 * ANT.scale)


def test_a_sphere_shrinks_under_laplacian_smoothing_and_hardly_under_taubins():
    sphere = trimesh.creation.icosphere()
    ratios = {
        method: perturb.Smoothing(30, method=method)(sphere, rng()).applied["volume_ratio"]
        for method in ("laplacian", "taubin")
    }
    assert ratios["laplacian"] < 0.75
    assert abs(ratios["taubin"] - 1) < 0.03


def test_noise_is_smoothed_away_and_the_shape_is_not():
    sphere = trimesh.creation.icosphere(subdivisions=4)
    noisy = perturb.NormalNoise(0.3)(sphere, rng()).mesh
    smooth = perturb.Smoothing(10, method="taubin")(noisy, rng()).mesh
    before, after = (np.linalg.norm(mesh.vertices, axis=1).std() for mesh in (noisy, smooth))
    assert after < 0.4 * before


def test_ratios_are_those_of_the_meshes_and_only_a_closed_surface_has_a_volume():
    closed = perturb.Smoothing(5)(bundled("cow"), rng())
    assert closed.applied["area_ratio"] == pytest.approx(closed.mesh.area / bundled("cow").area, rel=1e-9)
    assert closed.applied["volume_ratio"] == pytest.approx(closed.mesh.volume / bundled("cow").volume, rel=1e-6)
    open_mesh = perturb.MissingParts(0.2)(bundled("cow"), rng()).mesh
    assert perturb.Smoothing(5)(open_mesh, rng()).applied["volume_ratio"] is None


def test_vertices_without_faces_and_repeated_corners_stay_where_they_are():
    vertices = np.concatenate([ANT.vertices, [[9, 9, 9]]])
    faces = np.concatenate([ANT.faces, [[0, 0, 1]]])
    result = perturb.Smoothing(2)(perturb.as_trimesh(vertices, faces), rng()).mesh.vertices
    np.testing.assert_array_equal(result[-1], [9, 9, 9])
    np.testing.assert_allclose(result[1:-1], step(step(vertices, perturb.as_trimesh(vertices, faces), 0.5),
                               perturb.as_trimesh(vertices, faces), 0.5)[1:-1], atol=1e-12)  # fmt: skip
