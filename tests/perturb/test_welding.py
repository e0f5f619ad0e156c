"""Welding: which vertices are merged, and where."""

import dataclasses

import numpy as np
import pytest
import trimesh
from scipy.spatial.distance import cdist

import perturb
from perturb import PerturbationError
from perturb.testing import odd_meshes
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import far_along_edges, normals, rng

ANT = bundled("ant")


def exhaustively(mesh, near, far, where="any"):
    """The pairs merged if all distances are known: for each vertex the nearest one, then in ascending order."""
    diagonal = np.linalg.norm(mesh.extents)
    distance = cdist(mesh.vertices, mesh.vertices)
    qualified = (distance <= near * diagonal) & far_along_edges(mesh, far * diagonal)
    if where != "any":
        side = 1 if where == "external" else -1
        across = side * (mesh.vertices[None] - mesh.vertices[:, None])
        outwards = (across * normals(mesh)[:, None]).sum(axis=2) > 0
        qualified &= outwards & outwards.T
    distance[~qualified] = np.inf
    nearest = distance.argmin(axis=1)
    candidates = [(distance[v, w], v, w) for v, w in enumerate(nearest.tolist()) if np.isfinite(distance[v, w])]
    taken, pairs = set(), []
    for _, v, w in sorted(candidates):
        if taken.isdisjoint((v, w)):
            taken |= {v, w}
            pairs.append((min(v, w), max(v, w)))
    return pairs


def merged_pairs(result):
    """The pairs of vertices with the same counterpart."""
    order = np.argsort(result.counterpart, kind="stable")
    same = np.flatnonzero(np.diff(result.counterpart[order]) == 0)
    return [(int(order[i]), int(order[i + 1])) for i in same]


@pytest.mark.parametrize("where", ["any", "external", "internal"])
def test_the_pairs_are_those_of_an_exhaustive_search(where):
    expected = exhaustively(ANT, 0.06, 0.2, where)
    result = perturb.Welding(0.06, "bounding_box_diagonal", far=0.2, where=where)(ANT, rng())
    assert sorted(merged_pairs(result)) == sorted(expected)
    assert result.applied["pairs_merged"] == len(expected) > 20
    assert len(result.mesh.vertices) == len(ANT.vertices) - len(expected)


def test_a_share_of_the_vertices_is_merged_nearest_pairs_first():
    result = perturb.Welding(0.05, far=0.15)(ANT, rng())
    expected = exhaustively(ANT, 0.1, 0.15)[: round(0.05 * len(ANT.vertices) / 2)]
    assert sorted(merged_pairs(result)) == sorted(expected)
    gaps = [np.linalg.norm(ANT.vertices[v] - ANT.vertices[w]) for v, w in expected]
    assert result.applied["largest_gap"] == pytest.approx(max(gaps), rel=1e-12)


def test_merged_vertices_are_halfway_and_all_others_and_all_faces_remain():
    result = perturb.Welding(0.05)(ANT, rng())
    first, second = np.array(merged_pairs(result)).T
    halfway = (ANT.vertices[first] + ANT.vertices[second]) / 2
    np.testing.assert_allclose(result.mesh.vertices[result.counterpart[first]], halfway, rtol=1e-12)
    others = np.setdiff1d(np.arange(len(ANT.vertices)), [first, second])
    np.testing.assert_array_equal(result.mesh.vertices[result.counterpart[others]], ANT.vertices[others])
    np.testing.assert_array_equal(result.mesh.faces, result.counterpart[ANT.faces])


def test_two_sheets_are_glued_across_the_gap_or_through_the_body_as_their_normals_say():
    facing = odd_meshes()["two sheets"]  # of which the normals point towards each other
    averted = perturb.as_trimesh(facing.vertices, facing.faces[:, ::-1])
    for mesh, possible, impossible in ((facing, "external", "internal"), (averted, "internal", "external")):
        welding = perturb.Welding(0.1, "bounding_box_diagonal", where=possible)
        assert welding(mesh, rng()).applied["components_after"] == 1
        with pytest.raises(PerturbationError, match=f"only 0 with {impossible} connections"):
            dataclasses.replace(welding, where=impossible)(mesh, rng())


def test_a_shape_without_parts_near_each_other_is_refused_with_the_number_of_pairs_found():
    sphere = trimesh.creation.icosphere(subdivisions=3)
    with pytest.raises(PerturbationError, match=r"3 or more pairs .* only 0 are within 0.1 .*; lower amount or"):
        perturb.Welding(0.01)(sphere, rng())
    with pytest.raises(PerturbationError, match=r"only 0 with external connections are within 0.1 .*; raise amount"):
        perturb.Welding(0.1, "bounding_box_diagonal", where="external")(sphere, rng())


def test_a_length_that_is_too_large_for_far_is_refused_on_the_mesh():
    with pytest.raises(PerturbationError, match=r"far must be at least 1.5 times amount"):
        perturb.Welding(50, "mean_edge_length")(ANT, rng())
