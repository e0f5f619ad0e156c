"""Scaling and missing parts: what is left, and where it was before."""

import heapq
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import perturb
from tests.helpers.meshes import bundled

COW = bundled("cow")


def rng(seed=0):
    return np.random.default_rng(seed)


def distances_along_edges(mesh, source):
    """Dijkstra's algorithm, plainly."""
    neighbours = [{} for _ in mesh.vertices]
    for (a, b), length in zip(mesh.edges_unique.tolist(), mesh.edges_unique_length, strict=True):
        neighbours[a][b] = neighbours[b][a] = length
    distance = np.full(len(mesh.vertices), math.inf)
    queue = [(0.0, source)]
    while queue:
        reached, vertex = heapq.heappop(queue)
        if reached < distance[vertex]:
            distance[vertex] = reached
            for other, length in neighbours[vertex].items():
                heapq.heappush(queue, (reached + length, other))
    return distance


def assert_rest_is_the_original_without(mesh, result, removed):
    """What is left is exactly the faces of `mesh` with no corner in `removed` (n,) bool, in order."""
    there = result.counterpart >= 0
    np.testing.assert_array_equal(result.mesh.vertices[result.counterpart[there]], np.asarray(mesh.vertices)[there])
    kept = np.asarray(mesh.faces)[~removed[mesh.faces].any(axis=1)]
    np.testing.assert_array_equal(result.mesh.faces, result.counterpart[kept])
    np.testing.assert_array_equal(np.flatnonzero(there), np.unique(kept))
    assert result.applied["triangles_removed"] == len(mesh.faces) - len(kept)
    assert result.applied["vertices_removed"] == np.count_nonzero(~there)


@pytest.mark.parametrize("factor", [0.5, 1.5, 3, 10])
def test_scaling_multiplies_coordinates_and_nothing_else(factor):
    mesh = bundled("bunny")
    result = perturb.Scaling(factor)(mesh, rng())
    np.testing.assert_array_equal(result.mesh.vertices, factor * mesh.vertices)
    np.testing.assert_array_equal(result.mesh.faces, mesh.faces)
    np.testing.assert_array_equal(result.counterpart, np.arange(len(mesh.vertices)))
    assert result.mesh.area == pytest.approx(factor**2 * mesh.area, rel=1e-12)


@pytest.mark.parametrize("name", ["cow", "ant", "bunny"])
@pytest.mark.parametrize("share", [0.03, 0.4])
def test_a_ball_takes_the_vertices_nearest_along_the_edges(name, share):
    mesh = bundled(name)
    missing = perturb.MissingParts(share)
    parameters = missing.sample(mesh, rng(4))
    result = missing.apply(mesh, parameters)
    distance = distances_along_edges(mesh, parameters["centre"])
    straight = np.linalg.norm(mesh.vertices - mesh.vertices[parameters["centre"]], axis=1)
    removed = np.zeros(len(mesh.vertices), dtype=bool)
    removed[np.lexsort((straight, distance))[: round(share * len(mesh.vertices))]] = True
    assert_rest_is_the_original_without(mesh, result, removed)
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
    assert_rest_is_the_original_without(COW, result, removed)
    left = result.mesh.vertices @ direction
    assert left.max() <= height[removed].min(initial=np.inf)


def test_the_share_missing_is_what_was_asked_for_on_benchmark_meshes(psb_mesh):
    mesh = psb_mesh(10)
    n = len(mesh.vertices)
    for shape in ("geodesic_ball", "plane"):
        removed = perturb.MissingParts(0.2, shape=shape)(mesh, rng()).applied["vertices_removed"]
        # A few more: vertices at the rim all of whose triangles reached into the part.
        assert round(0.2 * n) <= removed <= 0.21 * n
