import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from heatwalk import read_mesh
from heatwalk.robust import spikes
from heatwalk.robust.half_edges import adjacency
from heatwalk.robust.spikes import remove_spikes
from perturb import as_trimesh
from tests.heatwalk.robust.meshes import arrays, blob
from tests.helpers.meshes import bundled_path


@pytest.fixture(scope="module")
def surface():
    return arrays(blob())


@pytest.fixture(scope="module")
def spiky(surface):
    """A twentieth of the vertices far out, and which."""
    vertices, _ = surface
    spike = np.random.default_rng(0).permutation(len(vertices)) < len(vertices) // 20
    return np.where(spike[:, None], 1.5 * vertices, vertices), spike


def test_no_vertex_of_a_clean_mesh_moves(surface):
    vertices, faces = surface
    mended, moved = remove_spikes(vertices, *adjacency(faces, len(vertices)))
    assert not moved.any()
    assert np.array_equal(mended, vertices)


def test_exactly_the_spikes_move_and_back_to_within_an_edge_of_where_they_were(surface, spiky):
    vertices, faces = surface
    mended, moved = remove_spikes(spiky[0], *adjacency(faces, len(vertices)))
    edge = np.linalg.norm(np.diff(vertices[faces[:, :2]], axis=1), axis=2).max()
    assert np.array_equal(moved, spiky[1])
    assert np.linalg.norm(mended - vertices, axis=1).max() < edge


def test_a_turned_and_scaled_shape_is_mended_alike(surface, spiky):
    neighbours = adjacency(surface[1], len(surface[0]))
    turn = Rotation.from_rotvec([0.3, -1.1, 0.7])
    mended, moved = remove_spikes(spiky[0], *neighbours)
    turned, moved_there = remove_spikes(5 * turn.apply(spiky[0]), *neighbours)
    assert np.array_equal(moved_there, moved)
    np.testing.assert_allclose(turned, 5 * turn.apply(mended), rtol=0, atol=1e-9)


def test_most_spikes_of_one_edge_length_are_found_and_nothing_else(surface):
    vertices, faces = surface
    mesh = as_trimesh(vertices, faces)
    ends = mesh.edges_unique.ravel()
    lengths = np.bincount(ends, np.repeat(mesh.edges_unique_length, 2)) / np.bincount(ends)
    is_spike = np.random.default_rng(0).random(len(vertices)) < 0.06
    rough = vertices + (is_spike * lengths)[:, None] * mesh.vertex_normals
    _, moved = remove_spikes(rough, *adjacency(faces, len(vertices)))
    assert np.mean(moved[is_spike]) > 0.75
    assert not moved[~is_spike].any()


@pytest.mark.parametrize("height", [0.1, 0.3])
def test_high_spikes_next_to_others_are_found_on_an_uneven_mesh(height):
    mesh = read_mesh(bundled_path("cow"))
    surface = as_trimesh(mesh.vertices, mesh.faces)
    starts, neighbours = adjacency(mesh.faces, len(mesh.vertices))
    for seed in range(3):
        is_spike = np.random.default_rng(seed).random(len(mesh.vertices)) < 0.06
        rough = mesh.vertices + height * surface.scale * is_spike[:, None] * surface.vertex_normals
        _, moved = remove_spikes(rough, starts, neighbours)
        n_spikes_around = np.add.reduceat(is_spike[neighbours].astype(int), starts[:-1])
        is_crowded = is_spike & (n_spikes_around > 2)  # about half of what is around are spikes, too
        is_at_crowd = is_crowded | np.logical_or.reduceat(is_crowded[neighbours], starts[:-1])
        assert moved[is_spike & ~is_at_crowd].all()
        assert np.count_nonzero(moved & ~is_spike) <= 3


def test_sharp_edges_stay():
    """Long triangles at the rims of a wheel: its vertices are far from the median of their neighbours."""
    wheel = trimesh.creation.annulus(r_min=0.8, r_max=1.0, height=0.2, sections=32)
    vertices, faces = arrays(wheel)
    _, moved = remove_spikes(vertices, *adjacency(faces, len(vertices)))
    assert not moved.any()


def test_passes_measure_again_all_that_has_changed(surface, spiky, monkeypatch):
    vertices, neighbours = spiky[0], adjacency(surface[1], len(surface[0]))
    rng = np.random.default_rng(1)
    vertices = vertices * (1 + 0.4 * (rng.random((len(vertices), 1)) < 0.25))  # spikes next to spikes
    at_once, moved = remove_spikes(vertices, *neighbours)
    passes = []
    for _ in range(spikes.PASSES):
        with monkeypatch.context() as patched:
            patched.setattr(spikes, "PASSES", 1)
            vertices, moved_now = remove_spikes(vertices, *neighbours)
        passes.append(moved_now)
    union = np.logical_or.reduce(passes)
    assert passes[2].any()
    assert np.array_equal(at_once, vertices)
    assert np.array_equal(moved, union)


@pytest.mark.parametrize("seed", range(5))
def test_spikes_that_hide_one_another_are_found(surface, seed):
    """Four neighbouring vertices: more than half of what is around some of them are spikes."""
    vertices, faces = surface
    rng = np.random.default_rng(seed)
    starts, neighbours = adjacency(faces, len(vertices))
    is_spike = np.zeros(len(vertices), bool)
    for face in faces[rng.choice(len(faces), 20, replace=False)]:
        is_spike[face] = is_spike[np.setdiff1d(neighbours[starts[face[0]] : starts[face[0] + 1]], face)[0]] = True
    outwards = as_trimesh(vertices, faces).vertex_normals * rng.choice([-2, 2], (len(vertices), 1))
    mended, moved = remove_spikes(vertices + is_spike[:, None] * outwards, starts, neighbours)
    edge = np.linalg.norm(np.diff(vertices[faces[:, :2]], axis=1), axis=2).max()
    assert moved[is_spike].all()
    assert np.linalg.norm(mended - vertices, axis=1).max() < 2 * edge


def test_the_rim_of_a_large_fan_is_not_looked_at_by_way_of_its_hub():
    """A cone of n triangles: the second ring of each vertex of its rim would have all others."""
    n = 5000
    angle = 2 * np.pi * np.arange(n) / n
    vertices = np.vstack([np.column_stack([np.cos(angle), np.sin(angle), 0 * angle]), [[0, 0, 1]], [[0, 0, -1]]])
    rim, following = np.arange(n), (np.arange(n) + 1) % n
    top, bottom = np.full(n, n), np.full(n, n + 1)
    faces = np.concatenate([np.column_stack([rim, following, top]), np.column_stack([following, rim, bottom])])
    starts, neighbours = adjacency(faces, n + 2)
    assert len(spikes._second_ring(0, starts, neighbours)) <= 6
    assert not remove_spikes(vertices, starts, neighbours)[1].any()
