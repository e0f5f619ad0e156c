"""Shot noise: which vertices move, by how much, and in which direction."""

import numpy as np
import pytest
import scipy.stats
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import normals, rng

ANT, COW = bundled("ant"), bundled("cow")


@settings(max_examples=30, deadline=None)
@given(share=st.floats(0, 1), height=st.floats(0.001, 5), seed=st.integers(0, 2**32))
def test_exactly_the_share_of_vertices_become_spikes_of_exactly_the_height(share, height, seed):
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
def test_spikes_point_along_or_against_the_normal_at_the_heights_of_figure_10(psb_mesh, share):
    mesh = psb_mesh(10)
    shot = perturb.ShotNoise(0.06, height=share, height_unit="bounding_box_diagonal")
    displacement = shot(mesh, rng()).mesh.vertices - mesh.vertices
    spikes = displacement.any(axis=1)
    signed = np.einsum("ij,ij->i", displacement, normals(mesh))[spikes]
    np.testing.assert_allclose(np.abs(signed), share * np.linalg.norm(mesh.extents), rtol=1e-9)
    outwards = np.count_nonzero(signed > 0)
    assert scipy.stats.binomtest(outwards, len(signed)).pvalue > 0.001


def test_a_height_of_0_moves_nothing():
    result = perturb.ShotNoise(0.5, height=0)(COW, rng())
    np.testing.assert_array_equal(result.mesh.vertices, COW.vertices)
    assert result.applied["vertices_moved"] == 0


def test_vertices_without_a_normal_do_not_become_spikes():
    n = len(COW.vertices)
    vertices = np.concatenate([COW.vertices, COW.vertices[:1]])
    with_unreferenced = trimesh.Trimesh(vertices, COW.faces, process=False)
    with pytest.raises(
        PerturbationError, match=rf"{n + 1} spikes were requested, but only {n} of {n + 1} vertices have a normal"
    ):
        perturb.ShotNoise(1.0)(with_unreferenced, rng())
    almost_all = perturb.ShotNoise((n + 0.4) / (n + 1))(with_unreferenced, rng())
    assert almost_all.applied["vertices_moved"] == n
    np.testing.assert_array_equal(almost_all.mesh.vertices[-1], vertices[-1])
