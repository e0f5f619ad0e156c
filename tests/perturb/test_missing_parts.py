"""Missing parts: which vertices and faces are removed, and which remain."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import perturb
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import assert_only_these_faces_are_removed, distances_along_edges, rng

COW = bundled("cow")


def assert_these_vertices_are_removed(mesh, result, removed):
    """Assert that `result` is `mesh` without all faces that touch the `removed` (n,) bool vertices."""
    assert_only_these_faces_are_removed(mesh, result, removed[mesh.faces].any(axis=1))


@pytest.mark.parametrize("name", ["cow", "ant", "bunny"])
@pytest.mark.parametrize("share", [0.03, 0.4])
def test_a_ball_takes_the_vertices_nearest_along_the_edges(name, share):
    mesh = bundled(name)
    missing = perturb.MissingParts(share)
    parameters = missing.sample(mesh, rng(4))
    result = missing.apply(mesh, parameters)
    distance = distances_along_edges(mesh, parameters["centre"])
    in_space = np.linalg.norm(mesh.vertices - mesh.vertices[parameters["centre"]], axis=1)
    removed = np.zeros(len(mesh.vertices), dtype=bool)
    removed[np.lexsort((in_space, distance))[: round(share * len(mesh.vertices))]] = True
    assert_these_vertices_are_removed(mesh, result, removed)
    assert result.counterpart[parameters["centre"]] == -1


@settings(max_examples=30, deadline=None)
@given(share=st.floats(0.001, 0.8), seed=st.integers(0, 2**32))
def test_a_plane_takes_the_vertices_farthest_in_its_direction(share, seed):
    missing = perturb.MissingParts(share, shape="plane")
    direction = missing.sample(COW, rng(seed))["direction"]
    result = missing(COW, rng(seed))
    assert np.linalg.norm(direction) == pytest.approx(1, rel=1e-12)
    height = COW.vertices @ direction
    count = round(share * len(COW.vertices))
    removed = np.zeros(len(COW.vertices), dtype=bool)
    removed[np.argsort(-height, kind="stable")[:count]] = True
    assert_these_vertices_are_removed(COW, result, removed)
    remaining = result.mesh.vertices @ direction
    assert remaining.max() <= height[removed].min(initial=np.inf)


def test_the_missing_share_is_the_requested_one_on_benchmark_meshes(psb_mesh):
    mesh = psb_mesh(10)
    n = len(mesh.vertices)
    for shape in ("geodesic_ball", "plane"):
        removed = perturb.MissingParts(0.2, shape=shape)(mesh, rng()).applied["vertices_removed"]
        # A few more: vertices at the rim all of whose triangles reached into the part.
        assert round(0.2 * n) <= removed <= 0.21 * n
