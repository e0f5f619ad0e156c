"""Micro-holes: which triangles are removed, and that holes stay apart."""

import numpy as np
import pytest

import perturb
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import assert_only_these_faces_are_removed, rng

ANT = bundled("ant")
FACES_AT = [set(np.flatnonzero((ANT.faces == v).any(axis=1)).tolist()) for v in range(len(ANT.vertices))]
RINGS = [set(ANT.faces[sorted(faces)].ravel().tolist()) for faces in FACES_AT]


def holes(unit, drawn):
    """For each hole its faces, and the vertices of these."""
    faces = [FACES_AT[v] if unit == "share_of_vertices" else {v} for v in drawn.tolist()]
    return faces, [set(ANT.faces[sorted(each)].ravel().tolist()) for each in faces]


@pytest.mark.parametrize(("unit", "n"), [("share_of_vertices", len(ANT.vertices)), ("share_of_triangles", 912)])
def test_the_requested_number_of_holes_is_removed_and_no_two_share_a_vertex(unit, n):
    micro_holes = perturb.MicroHoles(0.04, unit)
    parameters = micro_holes.sample(ANT, rng())
    faces, vertices = holes(unit, parameters["vertices" if unit == "share_of_vertices" else "triangles"])
    assert len(faces) == round(0.04 * n)
    assert sum(map(len, vertices)) == len(set().union(*vertices))
    result = micro_holes.apply(ANT, parameters)
    removed = np.isin(np.arange(len(ANT.faces)), sorted(set().union(*faces)))
    assert_only_these_faces_are_removed(ANT, result, removed)
    assert result.applied["holes"] == len(faces)
    assert result.applied["holes_touching"] == 0


def test_holes_touch_only_once_no_further_one_has_room():
    micro_holes = perturb.MicroHoles(0.4)
    parameters = micro_holes.sample(ANT, rng())
    drawn, touching = parameters["vertices"], parameters["touching"]
    assert len(set(drawn.tolist())) == round(0.4 * len(ANT.vertices))
    apart = [RINGS[v] for v in drawn[:-touching].tolist()]
    occupied = set().union(*apart)
    assert sum(map(len, apart)) == len(occupied)
    assert all(not ring.isdisjoint(occupied) for ring in RINGS)
    assert micro_holes.apply(ANT, parameters).applied["holes_touching"] == touching


def test_fewer_holes_are_the_first_of_more():
    few, many = (perturb.MicroHoles(amount).sample(ANT, rng())["vertices"] for amount in (0.01, 0.05))
    np.testing.assert_array_equal(few, many[: len(few)])
