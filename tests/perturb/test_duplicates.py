"""Duplicate faces: which occur twice, and how they are wound."""

import numpy as np
import pytest

import perturb
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

ANT = bundled("ant")


@pytest.mark.parametrize("winding", ["same", "opposite"])
def test_exactly_the_sampled_faces_follow_the_others_once_more(winding):
    duplicates = perturb.Duplicates(0.2, winding=winding)
    drawn = duplicates.sample(ANT, rng())["faces"]
    result = duplicates(ANT, rng())
    assert len(drawn) == len(np.unique(drawn)) == round(0.2 * len(ANT.faces)) == result.applied["faces_duplicated"]
    np.testing.assert_array_equal(result.mesh.vertices, ANT.vertices)
    np.testing.assert_array_equal(result.mesh.faces[: len(ANT.faces)], ANT.faces)
    copies = perturb.as_trimesh(ANT.vertices, result.mesh.faces[len(ANT.faces) :])
    np.testing.assert_array_equal(np.sort(copies.faces, axis=1), np.sort(ANT.faces[drawn], axis=1))
    sign = 1 if winding == "same" else -1
    np.testing.assert_allclose(copies.face_normals, sign * ANT.face_normals[drawn], atol=1e-12)


def test_a_mesh_all_of_whose_faces_are_doubled_with_opposite_winding_encloses_nothing():
    mesh = perturb.Duplicates(1.0, winding="opposite")(ANT, rng()).mesh
    assert mesh.area == pytest.approx(2 * ANT.area, rel=1e-12)
    a, b, c = np.asarray(mesh.triangles).transpose(1, 0, 2)
    assert (np.cross(a, b) * c).sum() / 6 == pytest.approx(0, abs=1e-12 * ANT.volume)
