"""Helpers shared by the tests of perturbations."""

import heapq
import math

import numpy as np
from scipy.sparse.csgraph import dijkstra

import perturb


def rng(seed=0):
    return np.random.default_rng(seed)


def distances_along_edges(mesh, source):
    """Shortest paths from a vertex along the edges, by a plain implementation of Dijkstra's algorithm."""
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


def normals(mesh):
    """Angle-weighted vertex normals, computed from the two edges at each corner."""
    here, next_corner, last_corner = (np.asarray(mesh.vertices)[np.roll(mesh.faces, -k, axis=1)] for k in range(3))
    a, b = next_corner - here, last_corner - here
    normal = np.cross(a, b)
    sine, cosine = np.linalg.norm(normal, axis=2), (a * b).sum(axis=2)
    weight = np.arctan2(sine, cosine) / np.where(sine > 0, sine, 1)
    total = np.zeros((len(mesh.vertices), 3))
    np.add.at(total, mesh.faces, weight[..., None] * normal)
    return total / np.linalg.norm(total, axis=1, keepdims=True)


def assert_only_these_faces_are_removed(mesh, result, removed):
    """Assert that `result` is `mesh` without the `removed` (m,) bool faces and without vertices that lost all faces."""
    kept = np.asarray(mesh.faces)[~removed]
    remaining = np.flatnonzero(result.counterpart >= 0)
    np.testing.assert_array_equal(remaining, np.unique(kept))
    np.testing.assert_array_equal(result.counterpart[remaining], np.arange(len(remaining)))
    np.testing.assert_array_equal(result.mesh.vertices, np.asarray(mesh.vertices)[remaining])
    np.testing.assert_array_equal(result.mesh.faces, result.counterpart[kept])
    assert result.applied["triangles_removed"] == np.count_nonzero(removed)
    assert result.applied["vertices_removed"] == len(mesh.vertices) - len(remaining)


def far_along_edges(mesh, far):
    """(n, n) bool, for vertices with faces: farther apart than `far` along the edges, by all shortest paths."""
    used = np.unique(mesh.faces)
    apart = np.isinf(dijkstra(perturb.edge_graph(mesh), limit=far))
    apart[:, np.setdiff1d(np.arange(len(mesh.vertices)), used)] = False
    return apart
