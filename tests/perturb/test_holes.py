"""Holes: which triangles and vertices are removed."""

import numpy as np
import pytest
import scipy.stats
from hypothesis import given, settings
from hypothesis import strategies as st

import perturb
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import assert_only_these_faces_are_removed, rng

ANT = bundled("ant")


@settings(max_examples=30, deadline=None)
@given(count=st.integers(0, 900), seed=st.integers(0, 2**32))
def test_holes_remove_exactly_the_sampled_triangles(count, seed):
    holes = perturb.Holes(count)
    sampled = holes.sample(ANT, rng(seed))["triangles"]
    removed = np.isin(np.arange(len(ANT.faces)), sampled)
    assert np.count_nonzero(removed) == count
    assert_only_these_faces_are_removed(ANT, holes(ANT, rng(seed)), removed)


@pytest.mark.parametrize("share", [0.05, 0.1, 0.15, 0.2])
def test_exactly_the_share_of_triangles_is_removed_at_the_levels_of_figure_12(psb_mesh, share):
    mesh = psb_mesh(10)
    applied = perturb.Holes(share, "share_of_triangles")(mesh, rng()).applied
    assert applied["triangles_removed"] == round(share * len(mesh.faces))
    assert applied["faces_after"] == len(mesh.faces) - applied["triangles_removed"]


def test_one_rings_remove_every_triangle_at_the_sampled_vertices():
    mesh = bundled("bunny")
    holes = perturb.Holes(58, "one_rings")
    centres = set(holes.sample(mesh, rng())["vertices"].tolist())
    removed = np.array([not centres.isdisjoint(face) for face in mesh.faces.tolist()])
    assert len(centres) == 58
    result = holes(mesh, rng())
    assert_only_these_faces_are_removed(mesh, result, removed)
    assert (result.counterpart[sorted(centres)] == -1).all()


def test_every_triangle_is_equally_likely_to_be_removed():
    generator = rng(5)
    holes = perturb.Holes(0.1, "share_of_triangles")
    hits = np.zeros(len(ANT.faces))
    for _ in range(1000):
        hits[holes.sample(ANT, generator)["triangles"]] += 1
    # Without replacement the counts vary less than a multinomial's, by the factor 1 - share.
    statistic = scipy.stats.chisquare(hits).statistic / (1 - 91 / 912)
    assert 0.001 < scipy.stats.chi2(len(hits) - 1).cdf(statistic) < 0.999
