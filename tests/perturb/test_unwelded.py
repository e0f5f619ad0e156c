"""Unwelded faces: what is cut loose, and that the surface stays where it is."""

import numpy as np
import pytest

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

ANT = bundled("ant")


@pytest.mark.parametrize("share", [0.02, 0.5, 1.0])
def test_faces_stay_where_they_are_and_loose_ones_share_no_vertex(share):
    unwelded = perturb.Unwelded(share)
    loose = unwelded.sample(ANT, rng())["faces"]
    result = unwelded(ANT, rng())
    np.testing.assert_array_equal(result.mesh.triangles, ANT.triangles)
    uses = np.bincount(result.mesh.faces.ravel(), minlength=len(result.mesh.vertices))
    assert len(loose) == round(share * len(ANT.faces)) == result.applied["faces_cut_loose"]
    assert (uses[result.mesh.faces[loose]] == 1).all()
    others = np.delete(np.arange(len(ANT.faces)), loose)
    np.testing.assert_array_equal(result.mesh.faces[others], ANT.faces[others])


@pytest.mark.parametrize("share", [0.02, 0.5, 1.0])
def test_a_vertex_is_the_counterpart_of_itself_and_its_copies_are_added(share):
    loose = perturb.Unwelded(share).sample(ANT, rng())["faces"]
    result = perturb.Unwelded(share)(ANT, rng())
    n = len(ANT.vertices)
    np.testing.assert_array_equal(result.counterpart, np.arange(n))
    np.testing.assert_array_equal(result.mesh.vertices[:n], ANT.vertices)
    # A loose corner is a copy, except for one of each vertex that has only loose ones.
    only_loose = np.setdiff1d(np.arange(n), np.delete(ANT.faces, loose, axis=0))
    assert result.applied["vertices_added"] == 3 * len(loose) - len(only_loose) == len(result.mesh.vertices) - n


def test_merging_what_coincides_undoes_it():
    result = perturb.Unwelded(0.3)(ANT, rng()).mesh
    _, first, position = np.unique(result.vertices, axis=0, return_index=True, return_inverse=True)
    np.testing.assert_array_equal(first[position.ravel()][result.faces], ANT.faces)


def test_a_soup_cannot_be_cut_further():
    soup = perturb.Unwelded(1.0)(ANT, rng()).mesh
    with pytest.raises(PerturbationError, match="they are loose already"):
        perturb.Unwelded(0.5)(soup, rng())
