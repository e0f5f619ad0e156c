"""Flipped faces: which are turned over, and that the Heat Walk does not notice."""

import numpy as np

import heatwalk
import perturb
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

ANT = bundled("ant")


def test_exactly_the_sampled_faces_are_turned_over():
    flipped = perturb.Flipped(0.2)
    drawn = np.isin(np.arange(len(ANT.faces)), flipped.sample(ANT, rng())["faces"])
    result = flipped(ANT, rng())
    np.testing.assert_array_equal(result.mesh.vertices, ANT.vertices)
    np.testing.assert_array_equal(result.mesh.faces[~drawn], ANT.faces[~drawn])
    np.testing.assert_allclose(result.mesh.face_normals[drawn], -ANT.face_normals[drawn], atol=1e-12)
    assert result.applied["faces_flipped"] == np.count_nonzero(drawn) == round(0.2 * len(ANT.faces))


def test_flipping_all_faces_twice_is_the_identity():
    once = perturb.Flipped(1.0)(ANT, rng()).mesh
    assert once.volume == -ANT.volume
    np.testing.assert_array_equal(perturb.Flipped(1.0)(once, rng(1)).mesh.faces, ANT.faces)


def test_the_heat_walk_does_not_depend_on_windings():
    mesh = perturb.Flipped(0.3)(ANT, rng()).mesh
    before, after = (heatwalk.segment(np.asarray(m.vertices), np.asarray(m.faces)) for m in (ANT, mesh))
    np.testing.assert_array_equal(after.labels, before.labels)
