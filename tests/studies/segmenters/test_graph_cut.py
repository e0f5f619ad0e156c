"""Alpha-expansion."""

from itertools import combinations, product

import numpy as np
import pytest

from studies.segmenters._graph_cut import alpha_expansion, energy


def random_graph(seed, n=7, n_labels=3):
    rng = np.random.default_rng(seed)
    pairs = np.array([pair for pair in combinations(range(n), 2) if rng.random() < 0.4])
    return 2 * rng.random((n, n_labels)), pairs, rng.random(len(pairs))


def least(costs, pairs, weights):
    """The least energy, over all labellings."""
    n, n_labels = costs.shape
    return min(energy(costs, pairs, weights, np.array(labels)) for labels in product(range(n_labels), repeat=n))


@pytest.mark.parametrize("seed", range(5))
def test_two_labels_cost_as_little_as_possible(seed):
    graph = random_graph(seed, n_labels=2)
    assert energy(*graph, alpha_expansion(*graph)) == pytest.approx(least(*graph), rel=1e-7)


@pytest.mark.parametrize("seed", range(3))
def test_no_expansion_of_a_label_is_cheaper_and_the_cost_is_at_most_twice_the_least(seed):
    costs, pairs, weights = random_graph(seed)
    labels = alpha_expansion(costs, pairs, weights)
    cost = energy(costs, pairs, weights, labels)
    assert cost <= 2 * least(costs, pairs, weights)
    for label in range(costs.shape[1]):
        for switches in product((False, True), repeat=len(costs)):
            assert energy(costs, pairs, weights, np.where(switches, label, labels)) >= cost - 1e-7


def test_without_weights_every_node_has_its_cheapest_label():
    costs, pairs, weights = random_graph(0)
    assert (alpha_expansion(costs, pairs, 0 * weights) == costs.argmin(axis=1)).all()


def test_large_weights_give_connected_nodes_one_label():
    costs = np.array([[0.0, 1, 5], [3, 0, 5], [0, 3, 5], [0, 9, 1]])
    labels = alpha_expansion(costs, np.array([[0, 1], [1, 2]]), np.full(2, 100.0))
    assert labels.tolist() == [0, 0, 0, 0]
    assert alpha_expansion(costs, np.zeros((0, 2), dtype=int), np.zeros(0)).tolist() == [0, 1, 0, 0]
