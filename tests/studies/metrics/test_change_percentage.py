import tracemalloc
from importlib import import_module
from itertools import permutations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from studies.metrics import change_percentage, match_labels, rand_index_error, van_dongen

MEASURES = (change_percentage, van_dongen, rand_index_error)

untimed = settings(deadline=None)


@st.composite
def labelings(draw, count=2):
    """Some labelings of the same 1 to 25 points, of at most 5 segments each, with any integers as labels."""
    n = draw(st.integers(1, 25))
    names = st.lists(st.integers(-(2**40), 2**40), min_size=1, max_size=5, unique=True)
    pools = [draw(names) for _ in range(count)]
    return [np.array(draw(st.lists(st.sampled_from(pool), min_size=n, max_size=n))) for pool in pools]


def fewest_changes(a, b):
    """The fewest points that change, over all one-to-one mappings of labels of one to labels of the other."""
    if len(set(a)) > len(set(b)):
        a, b = b, a
    labels = sorted(set(a))
    return min(
        sum(dict(zip(labels, images, strict=True))[x] != y for x, y in zip(a, b, strict=True))
        for images in permutations(sorted(set(b)), len(labels))
    )


def overlap(a, b, x, y):
    return np.count_nonzero((a == x) & (b == y))


@untimed
@given(labelings())
def test_change_percentage_is_twice_the_fewest_changes_over_all_matchings(ab):
    a, b = ab
    assert change_percentage(a, b) == pytest.approx(200 * fewest_changes(a.tolist(), b.tolist()) / len(a), abs=1e-9)


def many_segments(kind):
    """Two labelings of thousands of segments of the same points."""
    rng = np.random.default_rng(7)
    points = np.arange(30_000)
    match kind:
        case "random":  # nearly all segments overlap each other in a chain
            return rng.integers(6_000, size=len(points)), rng.integers(5_000, size=len(points))
        case "single points":
            return points[:9_000], rng.permutation(9_000)
        case "shifted":
            return points // 5, (points + 2) // 5
        case "merged":
            return points // 3, points // 6
        case "islands":  # groups of segments that overlap within their group only
            return points // 100 * 100 + rng.integers(9, size=len(points)), points // 100 * 100 + points % 11


@pytest.mark.parametrize("kind", ["random", "single points", "shifted", "merged", "islands"])
def test_the_matching_of_thousands_of_segments_is_the_best_and_takes_little_memory(kind):
    a, b = many_segments(kind)
    change_percentage(a[:10], b[:10])  # imports
    tracemalloc.start()
    change, back = change_percentage(a, b), change_percentage(b, a)
    renamed = match_labels(a, b)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 60e6  # a dense table of 5,000 x 6,000 counts has 240 MB
    assert change == back == 200 * np.count_nonzero(renamed != a) / len(a)
    best = {"single points": 0, "shifted": 200 * 2 / 5, "merged": 100}
    assert change == pytest.approx(best.get(kind, change))


@pytest.mark.parametrize("largest_dense", [2, 12, 40])
def test_large_and_small_tables_are_matched_equally_well(largest_dense, monkeypatch):
    rng = np.random.default_rng(largest_dense)
    pairs = [[rng.integers(rng.integers(1, 25), size=n) for _ in range(2)] for n in rng.integers(1, 90, size=60)]
    expected = [change_percentage(*pair) for pair in pairs]
    monkeypatch.setattr(import_module("studies.metrics.change_percentage"), "MAX_DENSE", largest_dense)
    assert [change_percentage(*pair) for pair in pairs] == expected
    assert [200 * np.count_nonzero(match_labels(a, b) != a) / len(a) for a, b in pairs] == pytest.approx(expected)


@untimed
@given(labelings())
def test_van_dongen_counts_the_points_outside_the_segment_that_each_overlaps_most(ab):
    a, b = ab
    kept_a = sum(max(overlap(a, b, x, y) for y in set(b)) for x in set(a))
    kept_b = sum(max(overlap(a, b, x, y) for x in set(a)) for y in set(b))
    assert van_dongen(a, b) == pytest.approx(100 * (2 * len(a) - kept_a - kept_b) / len(a), abs=1e-9)


@untimed
@given(labelings())
def test_rand_index_error_is_the_share_of_pairs_on_which_the_labelings_disagree(ab):
    a, b = ab
    first, second = np.triu_indices(len(a), 1)
    disagree = (a[first] == a[second]) != (b[first] == b[second])
    assert rand_index_error(a, b) == (disagree.sum() / len(disagree) if len(disagree) else 0)


@untimed
@given(labelings())
def test_measures_are_symmetric(ab):
    a, b = ab
    for measure in MEASURES:
        assert measure(a, b) == measure(b, a)


@untimed
@given(labelings())
def test_measures_do_not_depend_on_the_numbers_of_labels(ab):
    a, b = ab
    renamed = -3 * np.unique(a, return_inverse=True)[1] + 7
    for measure in MEASURES:
        assert measure(a, renamed) == 0
        assert measure(renamed, b) == measure(a, b)


@untimed
@given(labelings())
def test_measures_are_zero_only_for_the_same_partition(ab):
    a, b = ab
    same = np.array_equal(a[:, None] == a, b[:, None] == b)
    for measure in MEASURES:
        assert (measure(a, b) == 0) == same


@untimed
@given(labelings(count=3))
def test_measures_satisfy_the_triangle_inequality(abc):
    a, b, c = abc
    for measure in MEASURES:
        assert measure(a, c) <= measure(a, b) + measure(b, c) + 1e-9


@untimed
@given(labelings())
def test_van_dongen_is_never_more_than_the_change_percentage(ab):
    assert van_dongen(*ab) <= change_percentage(*ab) + 1e-9


def test_both_distances_are_equal_if_segments_match_one_to_one():
    a = np.repeat([0, 1, 2], 10)
    b = np.roll(a, 2)
    # Two of ten points leave each segment for the next one.
    assert change_percentage(a, b) == van_dongen(a, b) == 200 * 6 / 30


def test_a_split_costs_the_smaller_part_twice_and_van_dongen_once():
    whole, split = np.zeros(10, int), np.repeat([0, 1], [7, 3])
    assert change_percentage(whole, split) == 60
    assert van_dongen(whole, split) == 30


def test_rand_index_error_is_exact_for_a_hundred_thousand_points():
    a, b = np.arange(100_000), np.zeros(100_000, int)
    assert rand_index_error(a, b) == 1


@untimed
@given(labelings())
def test_match_labels_keeps_the_partition_and_the_matching(ab):
    reference, labels = ab
    renamed = match_labels(reference, labels)
    assert np.array_equal(renamed[:, None] == renamed, labels[:, None] == labels)
    assert np.count_nonzero(renamed != reference) == fewest_changes(reference.tolist(), labels.tolist())


@untimed
@given(labelings())
def test_match_labels_numbers_new_segments_from_the_largest_label_on(ab):
    reference, labels = ab
    new = np.setdiff1d(match_labels(reference, labels), reference)
    assert np.array_equal(new, reference.max() + 1 + np.arange(len(new)))


@untimed
@given(labelings())
def test_match_labels_returns_the_reference_for_the_same_partition(ab):
    reference = ab[0]
    assert np.array_equal(match_labels(reference, np.unique(reference, return_inverse=True)[1]), reference)


def test_match_labels_numbers_a_segment_anew_that_shares_no_point_with_its_match():
    reference = np.array([5, 5, 5, 9])
    labels = np.array([1, 1, 2, 1])
    assert np.array_equal(match_labels(reference, labels), [5, 5, 10, 5])


@pytest.mark.parametrize("measure", [*MEASURES, match_labels])
@pytest.mark.parametrize(
    ("a", "b", "message"),
    [
        ([0, 1], [0, 1, 2], "2 labels and 3"),
        ([], [], r"n >= 1, got \(0,\)"),
        ([[0, 1]], [[0, 1]], r"got \(1, 2\)"),
        ([0.0, 1.0], [0, 1], "the first labeling must hold integers, got float64"),
        ([0, 1], [False, True], "the second labeling must hold integers, got bool"),
    ],
)
def test_labels_that_are_not_one_integer_per_point_are_refused(measure, a, b, message):
    with pytest.raises(ValueError, match=message):
        measure(a, b)
