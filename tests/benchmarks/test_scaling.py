"""The benchmark says what memory it takes, and takes no more than there is."""

import pytest

from tests.benchmarks import scaling


@pytest.mark.parametrize(("free", "size", "fits"), [(16e9, 25_000, True), (14e9, 25_000, False), (0.7e9, 5_000, False)])
def test_a_method_that_needs_more_memory_than_is_free_is_left_out_with_its_reason(free, size, fits, capsys):
    kept = scaling.affordable(scaling.planned(25_000), free)
    said = capsys.readouterr().out
    assert ("dense" in kept[size]) == fits
    assert {"ours", "scipy_eigsh"} <= {*kept[size]}
    reasons = [line.split() for line in said.splitlines()[1:]]
    assert ([f"{size:,}", "dense", "left", "out:"] in [words[:4] for words in reasons]) != fits
    assert all(float(words[5]) * 1e9 > 0.99 * free for words in reasons)


def test_it_says_before_it_starts_what_the_largest_measurement_takes(capsys):
    scaling.affordable(scaling.planned(25_000), 64e9)
    assert capsys.readouterr().out == ("takes up to 15.2 GB of memory (dense at 25,000 vertices); 64.0 GB are free\n")


def test_without_memory_for_any_measurement_it_ends_with_one_line():
    with pytest.raises(SystemExit, match=r"^scaling: error: 0\.1 GB of memory are free"):
        scaling.affordable(scaling.planned(5_000), 1e8)


def test_free_memory_is_at_most_that_of_the_machine():
    import psutil

    assert 0 < scaling.free_memory() <= psutil.virtual_memory().total
