"""The sentences about a board, from rows that are typed by hand."""

import pytest

from studies.experiments.leaderboard.findings import sentences
from studies.experiments.leaderboard.scores import Options, Scores
from tests.studies.experiments.leaderboard.boards import rows_of

ARGUMENT = {"claim": "that peaks are less stable", "against": ["peaks", "clusters", "absent"]}


def told_of(values, argument=ARGUMENT, **options):
    rows = rows_of({name: {"holes": [each]} for name, each in values.items()}, **options)
    return sentences(Scores(rows, Options()), argument).replace("; ", ".; ").split(". ")


def of_the_argument(values):
    return next(sentence for sentence in told_of(values) if sentence.startswith("The paper argues"))


def test_the_first_and_the_rank_of_the_reference_are_named():
    found = told_of({"HeatWalk": [2, 4, 2], "steady": [1, 2, 1], "peaks": [4, 8, 4]})
    assert found[0] == "Of 3 methods, steady (0.50, 0.50 – 0.50) changes least"
    assert found[1] == "The Heat Walk, whose error is 1 by definition, has rank 2, behind steady"


@pytest.mark.parametrize(
    ("peaks", "clusters", "verdict"),
    [
        (
            [4, 8, 4],
            [6, 12, 6],
            "the board agrees: peaks (2.00, 2.00 – 2.00) and clusters (3.00,",
        ),
        ([4, 8, 4], [1, 2, 1], "the board agrees only in part: above 1: peaks (2.00, 2.00 – 2.00).; below 1: clusters"),
        (
            [1, 2, 1],
            [4, 1, 1],
            "the board does not show it: below 1: peaks (0.50, 0.50 – 0.50).; not told",
        ),
    ],
)
def test_an_argument_is_judged_by_whether_intervals_contain_1(peaks, clusters, verdict):
    found = of_the_argument({"HeatWalk": [2, 4, 2], "peaks": peaks, "clusters": clusters})
    assert found.startswith(f"The paper argues that peaks are less stable.; {verdict}")


def test_one_model_cannot_tell():
    assert "one model cannot tell: peaks (2.00)" in of_the_argument({"HeatWalk": [2], "peaks": [4]})


def test_the_most_accurate_is_named_beside_the_reference():
    found = told_of({"HeatWalk": [2, 4], "steady": [1, 2]}, truth=lambda change: change / 10)
    assert (
        found[-2]
        == "Most accurate on the variants is steady, with a Rand Index error of 0.150.; the Heat Walk has 0.300"
    )
    assert found[-1] == "No method is both more robust and more accurate than steady."


def test_without_the_reference_or_an_argument_nothing_is_said_about_it():
    assert told_of({"steady": [1, 2], "peaks": [2, 4]}) == [""]
    assert not any("argues" in each for each in told_of({"HeatWalk": [1, 2], "peaks": [2, 4]}, argument=None))
