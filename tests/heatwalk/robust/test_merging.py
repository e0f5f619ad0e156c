import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from heatwalk.kernel import HeatKernel
from heatwalk.robust.merging import Saddles, merge_regions, saddles_between


def step_by_step(pairs, heights, peaks, areas, persistence, min_area):
    """Joins one pair at a time, always that of the highest saddle among those that fulfil the condition."""
    group = np.arange(len(peaks))
    for by_area in (False, True):
        while True:
            candidates = []
            for (a, b), height in zip(pairs, heights, strict=True):
                first, second = group == group[a], group == group[b]
                if group[a] == group[b]:
                    continue
                lower = min(peaks[first].max(), peaks[second].max())
                smaller = min(areas[first].sum(), areas[second].sum())
                if smaller < min_area * areas.sum() if by_area else height >= persistence * lower:
                    candidates.append((height, a, b))
            if not candidates:
                break
            _, a, b = max(candidates)
            group[group == group[b]] = group[a]
    return [frozenset(np.flatnonzero(group == each)) for each in np.unique(group)]


@settings(max_examples=150, deadline=None)
@given(st.integers(0, 2**32 - 1), st.sampled_from([0.3, 0.6, 0.9, np.inf]), st.sampled_from([0, 0.05, 0.3]))
def test_regions_are_those_joined_one_pair_at_a_time(seed, persistence, min_area):
    rng = np.random.default_rng(seed)
    n = rng.integers(2, 10)
    peaks, areas = 1 + rng.random(n), rng.random(n)
    pairs = np.array([(a, b) for a in range(n) for b in range(a + 1, n) if rng.random() < 0.6], int).reshape(-1, 2)
    heights = np.array([min(peaks[a], peaks[b]) * rng.random() ** 0.3 for a, b in pairs])
    order = np.argsort(-heights, kind="stable")
    saddles = Saddles(pairs[order], heights[order])
    exemplars = rng.permutation(n)
    merging = merge_regions(saddles, exemplars, peaks, areas, persistence=persistence, min_area=min_area)
    expected = step_by_step(pairs, heights, peaks, areas, persistence, min_area)
    found = [frozenset(np.flatnonzero(merging.of_region == each)) for each in range(len(merging.exemplars))]
    assert set(found) == set(expected)
    for each, regions in enumerate(found):
        highest = max(regions, key=lambda region: peaks[region])
        assert merging.exemplars[each] == exemplars[highest]
    assert (np.diff(merging.exemplars) > 0).all()
    assert ((merging.margin >= 0) & (merging.margin <= 1)).all()


def test_saddles_are_the_largest_capacities_of_edges_between_two_regions():
    rng = np.random.default_rng(0)
    kernel = HeatKernel(rng.random((30, 4)), np.zeros(30, int), np.full(30, 1 / 30), 1.0)
    labels, edges = rng.integers(0, 5, 30), rng.integers(0, 30, (100, 2))
    expected = {}
    for x, y in edges:
        pair = tuple(sorted((labels[x], labels[y])))
        expected[pair] = max(expected.get(pair, 0), kernel.factor[x] @ kernel.factor[y])
    saddles = saddles_between(kernel, labels, edges)
    found = {tuple(pair): height for pair, height in zip(saddles.pairs, saddles.heights, strict=True)}
    assert found == pytest.approx({(a, b): height for (a, b), height in expected.items() if a != b})
    assert (np.diff(saddles.heights) <= 0).all()


def test_a_mesh_of_one_region_has_no_saddles_and_one_region():
    kernel = HeatKernel(np.ones((4, 1)), np.zeros(4, int), np.full(4, 0.25), 1.0)
    saddles = saddles_between(kernel, np.zeros(4, int), np.array([[0, 1], [1, 2], [2, 3]]))
    merging = merge_regions(saddles, np.array([2]), np.ones(1), np.ones(1), persistence=0.9, min_area=0.01)
    assert merging.of_region.tolist() == [0]
    assert merging.exemplars.tolist() == [2]
    assert merging.margin.tolist() == [1]


@pytest.mark.parametrize(("height", "margin"), [(0.9, 0), (0.45, 0.5), (0.95, 0.5), (1.0, 1), (0.0, 1)])
def test_the_margin_of_a_region_is_0_at_the_limit_between_joined_and_not(height, margin):
    saddles = Saddles(np.array([[0, 1]]), np.array([height]))
    merging = merge_regions(saddles, np.array([0, 1]), np.array([1.0, 2.0]), np.ones(2), persistence=0.9, min_area=0.0)
    assert merging.margin.tolist() == pytest.approx([margin, 1])
