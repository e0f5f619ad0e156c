"""What the two kinds of noise move, by how much, and in which direction."""

import numpy as np
import pytest
import scipy.stats
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled

ANT, COW = bundled("ant"), bundled("cow")


def rng(seed=0):
    return np.random.default_rng(seed)


def normals(mesh):
    """Angle-weighted vertex normals, from the two edges at every corner."""
    here, there, yonder = (np.asarray(mesh.vertices)[np.roll(mesh.faces, -k, axis=1)] for k in range(3))
    a, b = there - here, yonder - here
    normal = np.cross(a, b)
    sine, cosine = np.linalg.norm(normal, axis=2), (a * b).sum(axis=2)
    weight = np.arctan2(sine, cosine) / np.where(sine > 0, sine, 1)
    total = np.zeros((len(mesh.vertices), 3))
    np.add.at(total, mesh.faces, weight[..., None] * normal)
    return total / np.linalg.norm(total, axis=1, keepdims=True)


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
    # To first order the volume grows by area times distance; 0.05 mean edge lengths are not quite nothing.
    thickness = 0.05 * COW.edges_unique_length.mean()
    assert swollen.volume - COW.volume == pytest.approx(COW.area * thickness, rel=0.05)


@settings(max_examples=30, deadline=None)
@given(share=st.floats(0, 1), height=st.floats(0.001, 5), seed=st.integers(0, 2**32))
def test_shot_noise_turns_exactly_the_share_into_spikes_of_exactly_the_height(share, height, seed):
    mesh = ANT
    result = perturb.ShotNoise(share, height=height)(mesh, rng(seed))
    displacement = result.mesh.vertices - mesh.vertices
    distance = np.linalg.norm(displacement, axis=1)
    spikes = distance > 0
    absolute = height * mesh.edges_unique_length.mean()
    assert spikes.sum() == round(share * len(mesh.vertices)) == result.applied["vertices_moved"]
    np.testing.assert_allclose(distance[spikes], absolute, atol=1e-12 * mesh.scale)
    np.testing.assert_array_equal(result.mesh.vertices[~spikes], mesh.vertices[~spikes])
    np.testing.assert_array_equal(result.counterpart, np.arange(len(mesh.vertices)))
    assert result.applied["absolute_height"] == pytest.approx(absolute, rel=1e-12)


@pytest.mark.parametrize("share", [0.11, 0.63])
def test_spikes_stand_along_or_against_the_normal_at_figure_10_heights(psb_mesh, share):
    mesh = psb_mesh(10)
    shot = perturb.ShotNoise(0.06, height=share, height_unit="bounding_box_diagonal")
    displacement = shot(mesh, rng()).mesh.vertices - mesh.vertices
    spikes = displacement.any(axis=1)
    signed = np.einsum("ij,ij->i", displacement, normals(mesh))[spikes]
    np.testing.assert_allclose(np.abs(signed), share * np.linalg.norm(mesh.extents), rtol=1e-9)
    outwards = np.count_nonzero(signed > 0)
    assert scipy.stats.binomtest(outwards, len(signed)).pvalue > 0.001


def test_height_0_moves_nothing():
    result = perturb.ShotNoise(0.5, height=0)(COW, rng())
    np.testing.assert_array_equal(result.mesh.vertices, COW.vertices)
    assert result.applied["vertices_moved"] == 0


def test_vertices_without_a_normal_stay_and_become_no_spikes():
    n = len(COW.vertices)
    vertices = np.concatenate([COW.vertices, COW.vertices[:1]])
    stray = trimesh.Trimesh(vertices, COW.faces, process=False)
    moved = perturb.NormalNoise(1.0)(stray, rng())
    np.testing.assert_array_equal(moved.mesh.vertices[-1], vertices[-1])
    assert moved.applied["vertices_moved"] == n
    with pytest.raises(PerturbationError, match=rf"{n + 1} spikes are asked for, but only {n} of {n + 1} vertices"):
        perturb.ShotNoise(1.0)(stray, rng())
