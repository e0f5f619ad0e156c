"""Labels carried to a finer mesh: islands, and borders moved to where cutting costs least."""

from itertools import product

import numpy as np
import pytest
import trimesh

from studies.segmenters._boundaries import moved_to_cheapest, without_islands
from studies.segmenters._dual_graph import DualGraph
from tests.helpers.beads import beads


@pytest.fixture(scope="module")
def necklace():
    mesh, truth = beads()
    return DualGraph.of(mesh.vertices, mesh.faces), truth


def strip(n):
    """A strip of n triangles of equal area, in a row."""
    x = np.arange(n + 2) / 2
    vertices = np.column_stack([x, np.arange(n + 2) % 2, np.zeros(n + 2)])
    faces = np.column_stack([np.arange(n), np.arange(1, n + 1), np.arange(2, n + 2)])
    return DualGraph.of(vertices, faces)


def test_islands_get_the_label_around_them(necklace):
    graph, truth = necklace
    labels = truth.copy()
    rng = np.random.default_rng(0)
    at_border = np.unique(graph.pairs[truth[graph.pairs[:, 0]] != truth[graph.pairs[:, 1]]])
    inner = np.setdiff1d(np.arange(len(truth)), at_border)
    labels[rng.choice(inner, 40, replace=False)] = 1
    repaired = without_islands(graph, labels)
    assert np.array_equal(repaired, truth)


def test_labels_without_islands_are_left_alone(necklace):
    graph, truth = necklace
    assert np.array_equal(without_islands(graph, truth), truth)


def test_regions_of_other_components_that_nothing_reaches_keep_their_labels():
    balls = [trimesh.creation.icosphere(1).apply_translation([3 * i, 0, 0]) for i in range(2)]
    both = trimesh.util.concatenate(balls)
    graph = DualGraph.of(both.vertices, both.faces)
    assert np.array_equal(without_islands(graph, np.zeros(160, dtype=int)), np.zeros(160))


def test_a_border_moves_to_the_cheapest_edge_within_reach():
    n = 40
    graph = strip(n)
    position = graph.pairs.min(axis=1)  # a border at i is between the faces i and i + 1
    for start, cheapest in product([15, 20], [14, 18, 23]):
        costs = np.where(position == cheapest, 0.5, 1.0)
        labels = (np.arange(n) > start).astype(int)
        moved = moved_to_cheapest(graph, costs, labels, reach=4.5 * graph.distances.mean())
        expected = cheapest if abs(cheapest - start) <= 4 else start
        if expected == cheapest:
            assert np.array_equal(moved, np.arange(n) > cheapest)
        else:  # all edges within reach cost the same
            assert costs[np.flatnonzero(moved[graph.pairs[:, 0]] != moved[graph.pairs[:, 1]])].tolist() == [1.0]


def test_a_ragged_border_becomes_the_neck_beside_it(necklace):
    graph, truth = necklace
    rng = np.random.default_rng(1)
    ragged = truth.copy()
    for _ in range(3):
        cut = graph.pairs[ragged[graph.pairs[:, 0]] != ragged[graph.pairs[:, 1]]]
        some = cut[rng.random(len(cut)) < 0.4]
        ragged[some[:, 0]] = ragged[some[:, 1]]
    assert np.count_nonzero(ragged != truth) > 10
    costs = graph.lengths * np.minimum(1 + graph.angles / np.pi, 1) ** 10
    assert np.array_equal(moved_to_cheapest(graph, costs, ragged, reach=0.3), truth)


def test_no_region_vanishes_and_one_region_stays_one(necklace):
    graph, truth = necklace
    labels = truth.copy()
    labels[100] = 3  # a single face
    moved = moved_to_cheapest(graph, graph.lengths, labels, reach=10.0)
    assert np.unique(moved).tolist() == [0, 1, 2, 3]
    assert not moved_to_cheapest(graph, graph.lengths, np.zeros_like(truth), reach=1.0).any()
