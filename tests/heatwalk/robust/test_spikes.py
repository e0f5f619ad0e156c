import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from heatwalk.robust.half_edges import adjacency
from heatwalk.robust.spikes import remove_spikes
from tests.heatwalk.robust.meshes import arrays, blob


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
