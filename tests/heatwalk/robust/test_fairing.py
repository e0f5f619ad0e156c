import numpy as np
import pytest
import scipy.sparse as sp
from scipy.spatial.transform import Rotation

from heatwalk.robust.fairing import average, fair, noise_level, smoothed
from heatwalk.robust.half_edges import adjacency
from perturb import Decimation, NormalNoise, as_trimesh
from tests.heatwalk.robust.meshes import arrays, blob

OPTIONS = {"strength": 11.0, "tolerance": 0.05, "max_sweeps": 512, "max_restored": 0.15}


@pytest.fixture(scope="module")
def mesh():
    return blob()


@pytest.fixture(scope="module")
def noisy(mesh):
    return arrays(NormalNoise(amount=0.6)(mesh, np.random.default_rng(0)).mesh)


def faired(vertices, faces):
    return fair(vertices, faces, *adjacency(faces, len(vertices)), **OPTIONS)


@pytest.mark.parametrize("kept", [1.0, 0.25])
def test_a_clean_mesh_stays_as_it_is_coarse_or_fine(mesh, kept):
    vertices, faces = arrays(Decimation(amount=kept)(mesh, np.random.default_rng(0)).mesh)
    smooth, sweeps = faired(vertices, faces)
    assert sweeps == 0
    assert smooth is vertices


def test_averaging_is_the_power_of_the_lazy_random_walk(noisy):
    vertices, faces = noisy
    starts, neighbours = adjacency(faces, len(vertices))
    walk = sp.csr_array((np.ones(len(neighbours)), neighbours, starts), shape=2 * (len(vertices),))
    walk = (sp.eye_array(len(vertices)) + sp.diags_array(1 / np.diff(starts)) @ walk) / 2
    expected = vertices
    for _ in range(5):
        expected = walk @ expected
    assert average(vertices, starts, neighbours, 5) == pytest.approx(expected, abs=1e-12)


def test_the_filter_leaves_a_mode_as_one_minus_the_cube_of_what_averaging_takes():
    n = 64  # a ring, whose modes are waves
    i = np.arange(n)
    faces = np.column_stack([i, (i + 1) % n, np.full(n, n)])
    starts, neighbours = np.arange(0, 2 * n + 1, 2), np.sort(np.column_stack([(i - 1) % n, (i + 1) % n])).ravel()
    assert len(faces) == n
    for frequency in (1, 5, 20):
        wave = np.column_stack([np.cos(2 * np.pi * frequency * i / n)] * 3)
        gain = (0.5 + 0.5 * np.cos(2 * np.pi * frequency / n)) ** 7
        assert smoothed(wave, starts, neighbours, 7) == pytest.approx((1 - (1 - gain) ** 3) * wave, abs=1e-12)


def test_the_area_of_a_noisy_surface_comes_back_and_its_size_stays(mesh, noisy):
    smooth, sweeps = faired(*noisy)
    assert sweeps > 0
    assert as_trimesh(*noisy).area > 1.4 * mesh.area
    assert as_trimesh(smooth, noisy[1]).area == pytest.approx(mesh.area, rel=0.05)
    assert as_trimesh(smooth, noisy[1]).volume == pytest.approx(mesh.volume, rel=0.01)


def test_more_noise_takes_more_sweeps(mesh):
    levels = [arrays(NormalNoise(amount=a)(mesh, np.random.default_rng(0)).mesh) for a in (0.2, 0.4, 0.8, 2.0)]
    sweeps = [faired(*level)[1] for level in levels]
    assert sweeps == sorted(set(sweeps))


def test_the_level_of_noise_is_that_of_white_noise_in_edge_lengths(mesh):
    """(I - N)² has the gain (1 - k)² for a mode k of N: for white noise √(1 + 8/d + …) ≈ 1.3 at six neighbours."""
    vertices, faces = arrays(NormalNoise(amount=0.05)(mesh, np.random.default_rng(0)).mesh)
    assert noise_level(vertices, arrays(mesh)[0], faces, *adjacency(faces, len(vertices))) == pytest.approx(
        1.3 * 0.05, rel=0.15
    )


def test_a_turned_scaled_and_renumbered_surface_is_faired_alike(noisy):
    vertices, faces = noisy
    smooth, sweeps = faired(vertices, faces)
    rng, turn = np.random.default_rng(1), Rotation.from_rotvec([0.3, -1.1, 0.7])
    number = rng.permutation(len(vertices))
    moved = np.empty_like(vertices)
    moved[number] = 3 * turn.apply(vertices)
    other, sweeps_there = faired(moved, rng.permutation(number[faces]))
    assert sweeps_there == sweeps
    assert other[number] == pytest.approx(3 * turn.apply(smooth), abs=1e-9)


def test_noise_of_many_edge_lengths_is_measured_in_those_of_the_smooth_surface(mesh):
    vertices, faces = arrays(NormalNoise(amount=5.0)(mesh, np.random.default_rng(0)).mesh)
    neighbours = adjacency(faces, len(vertices))
    assert noise_level(vertices, vertices, faces, *neighbours) < 1
    assert noise_level(vertices, arrays(mesh)[0], faces, *neighbours) == pytest.approx(1.3 * 5, rel=0.15)
    assert noise_level(vertices, smoothed(vertices, *neighbours, 40), faces, *neighbours) == pytest.approx(6.5, rel=0.3)


def test_sweeps_are_in_proportion_to_the_root_of_the_level(mesh, noisy):
    vertices, faces = noisy
    neighbours = adjacency(faces, len(vertices))
    sweeps = faired(vertices, faces)[1]
    level = noise_level(vertices, smoothed(vertices, *neighbours, sweeps), faces, *neighbours)
    assert sweeps == pytest.approx(11 * (np.sqrt(level) - np.sqrt(0.05)), abs=1)


def test_vertices_stay_where_they_are_along_the_surface(mesh):
    """Of an unevenly sampled surface: averaging alone evens the sampling out."""
    rng = np.random.default_rng(0)
    edge = np.linalg.norm(np.diff(mesh.vertices[mesh.edges_unique], axis=1), axis=2).mean()
    normals = np.array(mesh.vertex_normals)
    shift = rng.uniform(-0.3 * edge, 0.3 * edge, normals.shape)
    vertices = np.array(mesh.vertices + shift - np.sum(shift * normals, axis=1)[:, None] * normals)
    rough = vertices + 0.15 * edge * rng.normal(size=(len(normals), 1)) * normals
    neighbours = adjacency(arrays(mesh)[1], len(vertices))
    drift = {}
    for restored in (0.0, 0.15):
        smooth, sweeps = fair(rough, arrays(mesh)[1], *neighbours, **{**OPTIONS, "max_restored": restored})
        assert sweeps > 0
        moved = smooth - vertices
        drift[restored] = np.linalg.norm(moved - np.sum(moved * normals, axis=1)[:, None] * normals, axis=1).mean()
    assert drift[0.15] < 0.3 * drift[0.0]
