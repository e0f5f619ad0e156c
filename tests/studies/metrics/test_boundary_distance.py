"""Distances between cuts: of constructed segmentations, and compared with all pairs of cut edges."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.distance import cdist

from perturb._odd_meshes import ellipsoid
from studies import metrics
from studies.metrics import Comparison
from studies.metrics.boundary_distance import boundary_distances

NAMES = ("boundary_distance", "boundary_distance_95")


def grid(n=21):
    """A flat square with vertices at whole coordinates, row by row."""
    x, y = np.meshgrid(np.arange(n), np.arange(n), indexing="ij")
    number = np.arange(n * n).reshape(n, n)
    a, b, c, d = (number[i : n - 1 + i, j : n - 1 + j].ravel() for i, j in ((0, 0), (1, 0), (1, 1), (0, 1)))
    faces = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    return trimesh.Trimesh(np.stack([x, y, 0 * x], axis=-1).reshape(-1, 3), faces, process=False)


def values(mesh, a, b, points=None):
    compared = metrics.compare(Comparison(a, b, mesh, np.arange(len(mesh.vertices)) if points is None else points))
    return [compared[name] for name in NAMES]


def test_a_cut_that_moves_by_five_is_five_away_on_both_sides():
    mesh = grid()
    x = np.asarray(mesh.vertices)[:, 0]
    diagonal = 20 * np.sqrt(2)
    np.testing.assert_allclose(boundary_distances(mesh, x > 7, x > 12), 5 / diagonal, rtol=1e-12)
    assert values(mesh, np.int64(x > 7), np.int64(x > 12)) == pytest.approx([5 / diagonal] * 2, rel=1e-12)


def test_a_further_cut_counts_for_its_edges_alone():
    mesh = grid()
    x = np.asarray(mesh.vertices)[:, 0]
    one, two = np.int64(x > 7), np.int64(x > 7) + (x > 12)
    # As many edges on each of three cuts: two at distance 0, and one of the other segmentation at distance 5.
    diagonal = 20 * np.sqrt(2)
    assert values(mesh, one, two) == pytest.approx([5 / 3 / diagonal, 5 / diagonal], rel=1e-12)


def test_distances_are_those_of_all_pairs_of_cut_edges():
    mesh = trimesh.Trimesh(*ellipsoid(), process=False)
    rng = np.random.default_rng(0)
    vertices, edges = np.asarray(mesh.vertices), np.asarray(mesh.edges_unique)
    a, b = (cdist(vertices, rng.normal(size=(k, 3))).argmin(axis=1) for k in (4, 6))
    kept = np.flatnonzero(rng.random(len(vertices)) < 0.8)
    inside = edges[np.isin(edges, kept).all(axis=1)]
    cuts = [vertices[inside[labels[inside[:, 0]] != labels[inside[:, 1]]]].mean(axis=1) for labels in (a, b)]
    apart = cdist(*cuts) / np.linalg.norm(mesh.extents)
    expected = np.concatenate([apart.min(axis=1), apart.min(axis=0)])
    found = boundary_distances(mesh, a[kept], b[kept], kept)
    np.testing.assert_allclose(np.sort(found), np.sort(expected), rtol=1e-12)
    assert values(mesh, a[kept], b[kept], kept) == pytest.approx([expected.mean(), np.percentile(expected, 95)])


def test_a_scaled_moved_and_turned_mesh_has_the_same_distances():
    mesh = trimesh.Trimesh(*ellipsoid(), process=False)
    a, b = (np.int64(np.asarray(mesh.vertices)[:, axis] > 0.1) for axis in (0, 1))
    # A quarter turn, which leaves the diagonal of the bounding box as it is.
    turned = trimesh.Trimesh(8 * np.asarray(mesh.vertices)[:, [1, 2, 0]] + 3, mesh.faces, process=False)
    np.testing.assert_allclose(boundary_distances(turned, a, b), boundary_distances(mesh, a, b), atol=1e-14)


@pytest.mark.parametrize("both", [True, False])
def test_the_value_is_missing_where_a_segmentation_has_no_cut(both):
    mesh = grid()
    whole, halves = np.zeros(len(mesh.vertices), dtype=int), np.int64(np.asarray(mesh.vertices)[:, 0] > 7)
    assert values(mesh, whole, whole if both else halves) == [None, None]
    assert metrics.compare(Comparison(whole, halves))[NAMES[0]] is None


def test_one_label_per_vertex_is_required():
    with pytest.raises(ValueError, match="there are 3 labels for 441 vertices"):
        boundary_distances(grid(), np.zeros(3, dtype=int), np.zeros(441, dtype=int))
