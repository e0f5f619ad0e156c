"""Greedy merging of regions, compared with an implementation that evaluates every pair at every step."""

import numpy as np
import pytest

from studies.segmenters._merging import merge_by_normalised_cut


def merged_naively(pairs, costs, areas, n_regions):
    """The same greedy merging from its definition: all pairs are evaluated at each step."""
    labels, weights = np.arange(len(areas)), np.zeros((len(areas), len(areas)))
    for (a, b), cost in zip(pairs, costs, strict=True):
        weights[[a, b], [b, a]] += cost

    def total(labels):
        members = labels == np.unique(labels)[:, None]
        return sum((weights[region][:, ~region].sum()) / areas[region].sum() for region in members)

    while len(np.unique(labels)) > n_regions:
        neighbours = {tuple(sorted((labels[a], labels[b]))) for a, b in pairs if labels[a] != labels[b]}
        if not neighbours:
            break
        labels = min((np.where(labels == b, a, labels) for a, b in sorted(neighbours)), key=total)
    return np.unique(labels, return_inverse=True)[1]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("n_regions", [1, 2, 5])
def test_merges_the_pairs_that_the_definition_says(seed, n_regions):
    rng = np.random.default_rng(seed)
    pairs = rng.integers(0, 20, (35, 2))
    pairs = pairs[pairs[:, 0] != pairs[:, 1]]  # some occur twice, and some nodes may be alone
    costs, areas = rng.random(len(pairs)), rng.random(20) + 0.1
    expected = merged_naively(pairs, costs, areas, n_regions)
    labels = merge_by_normalised_cut(pairs, costs, areas, n_regions)
    # Both number regions in the order of their first nodes up to the numbers themselves.
    assert len({*zip(labels, expected, strict=True)}) == len(np.unique(labels)) == len(np.unique(expected))


def test_regions_are_numbered_in_the_order_of_their_first_nodes():
    rng = np.random.default_rng(0)
    pairs = np.column_stack([np.arange(49), np.arange(1, 50)])
    labels = merge_by_normalised_cut(pairs, rng.random(49), rng.random(50), 8)
    first = np.unique(labels, return_index=True)[1]
    assert len(first) == 8
    assert (np.diff(first) > 0).all()


def test_stops_when_no_neighbours_are_left():
    pairs = np.array([[0, 1], [2, 3]])
    assert merge_by_normalised_cut(pairs, np.ones(2), np.ones(5), 1).tolist() == [0, 0, 1, 1, 2]


def test_no_pairs_and_no_nodes_are_merged_into_nothing():
    nothing = np.zeros((0, 2), dtype=np.int64)
    assert merge_by_normalised_cut(nothing, np.zeros(0), np.ones(3), 1).tolist() == [0, 1, 2]
    assert merge_by_normalised_cut(nothing, np.zeros(0), np.zeros(0), 1).tolist() == []
