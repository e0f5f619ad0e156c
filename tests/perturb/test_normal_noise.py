"""Normal noise: by how much each vertex moves, and in which direction."""

import numpy as np
import pytest
import scipy.stats
import trimesh

import perturb
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import normals, rng

COW = bundled("cow")


@pytest.mark.parametrize(
    ("unit", "length"),
    [
        ("mean_edge_length", COW.edges_unique_length.mean()),
        ("bounding_box_diagonal", np.linalg.norm(np.ptp(COW.vertices, axis=0))),
    ],
)
@pytest.mark.parametrize("distribution", ["gaussian", "uniform"])
def test_normal_noise_moves_every_vertex_along_its_normal_by_its_drawn_length(unit, length, distribution):
    noise = perturb.NormalNoise(0.2, unit, distribution)
    drawn = noise.sample(COW, rng())["lengths"]
    result = noise(COW, rng())
    expected = COW.vertices + 0.2 * length * drawn[:, None] * normals(COW)
    np.testing.assert_allclose(result.mesh.vertices, expected, atol=1e-9 * length)
    np.testing.assert_array_equal(result.mesh.faces, COW.faces)
    assert result.applied["absolute_amount"] == pytest.approx(0.2 * length, rel=1e-12)
    assert result.applied["vertices_moved"] == len(COW.vertices)
    largest = np.linalg.norm(result.mesh.vertices - COW.vertices, axis=1).max()
    assert result.applied["largest_displacement"] == pytest.approx(largest, rel=1e-9)


@pytest.mark.parametrize(
    ("distribution", "expected"), [("gaussian", scipy.stats.norm()), ("uniform", scipy.stats.uniform(-1, 2))]
)
def test_lengths_follow_the_distribution_on_benchmark_meshes(psb_mesh, distribution, expected):
    mesh = psb_mesh(10)
    noise = perturb.NormalNoise(0.34, distribution=distribution)
    displacement = noise(mesh, rng(1)).mesh.vertices - mesh.vertices
    signed = np.einsum("ij,ij->i", displacement, mesh.vertex_normals)
    lengths = signed / (0.34 * mesh.edges_unique_length.mean())
    n = len(lengths)
    assert abs(lengths.mean()) < 4 * expected.std() / np.sqrt(n)
    kurtosis = expected.stats("k") + 3
    assert abs(lengths.var() / expected.var() - 1) < 4 * np.sqrt((kurtosis - 1) / n)
    assert scipy.stats.kstest(lengths, expected.cdf).pvalue > 0.01


def test_twice_the_amount_moves_the_same_vertices_twice_as_far():
    once, twice = perturb.NormalNoise(0.1), perturb.NormalNoise(0.2)
    parameters = once.sample(COW, rng())
    near = once.apply(COW, parameters).mesh.vertices - COW.vertices
    far = twice.apply(COW, parameters).mesh.vertices - COW.vertices
    np.testing.assert_allclose(far, 2 * near, atol=1e-12 * COW.scale)


def test_positive_lengths_point_outwards():
    noise = perturb.NormalNoise(0.05)
    swollen = noise.apply(COW, {"lengths": np.ones(len(COW.vertices))}).mesh
    assert swollen.volume > COW.volume > 0
    # To first order the volume grows by area times distance; 0.05 mean edge lengths are not negligible.
    thickness = 0.05 * COW.edges_unique_length.mean()
    assert swollen.volume - COW.volume == pytest.approx(COW.area * thickness, rel=0.05)


def test_vertices_without_a_normal_do_not_move():
    n = len(COW.vertices)
    vertices = np.concatenate([COW.vertices, COW.vertices[:1]])
    with_unreferenced = trimesh.Trimesh(vertices, COW.faces, process=False)
    moved = perturb.NormalNoise(1.0)(with_unreferenced, rng())
    np.testing.assert_array_equal(moved.mesh.vertices[-1], vertices[-1])
    assert moved.applied["vertices_moved"] == n
