"""Scores of hand-made rows, whose values can be computed in one's head, and of random ones by brute force."""

import numpy as np
import pandas as pd
import pytest

from studies.experiments.leaderboard.scores import Options, Scores
from studies.experiments.leaderboard.tables import remarks
from studies.statistics.paired import resampled_counts
from tests.studies.experiments.leaderboard.boards import drawn, rows_of

OPTIONS = Options(controls=("rotation",))


def board_of(rows, options=OPTIONS):
    return Scores(rows, options).board.set_index("segmenter")


def test_the_scores_of_two_methods_under_two_perturbations_and_a_control():
    rows = rows_of(
        {
            "HeatWalk": {"holes": [[1, 3], [2, 2]], "noise": [[10, 10], [10, 10]], "rotation": [[0, 0], [0, 0]]},
            "cuts": {"holes": [[2, 2], [4, 4]], "noise": [[5, 5], [5, 5]], "rotation": [[8, 8], [0, 0]]},
        },
        truth=lambda value: value / 100,
    )
    board = board_of(rows)
    assert board.loc["HeatWalk", "mce"] == 1
    assert board.loc["cuts", "mce"] == (12 / 8 + 20 / 40) / 2
    assert board["mean_cp"].to_dict() == {"HeatWalk": 6.0, "cuts": 4.0}
    assert board["control_cp"].to_dict() == {"HeatWalk": 0.0, "cuts": 4.0}
    assert board["rand_original"].tolist() == pytest.approx([0.1, 0.1])
    assert board["rand_perturbed"].to_dict() == pytest.approx({"HeatWalk": 0.06, "cuts": 0.04})
    assert board["n"].tolist() == [14, 14]
    assert board["seconds"].tolist() == [0.5, 0.5]


def test_a_failed_trial_counts_with_the_bounds_and_is_counted():
    rows = rows_of(
        {"HeatWalk": {"holes": [[50, 50]]}, "cuts": {"holes": [[None, 50]]}}, truth=lambda value: value / 100
    )
    scores = Scores(rows, OPTIONS)
    board = scores.board.set_index("segmenter")
    assert board.loc["cuts", "mce"] == 250 / 100
    assert board.loc["cuts", "rand_perturbed"] == (1 + 0.5) / 2
    assert board.loc["cuts", "failed_share"] == 25  # of four, with the two originals
    assert board.loc["cuts", "missing"] == 0
    assert scores.failures.loc["cuts", "holes"] == 1


@pytest.mark.parametrize("status", ["timeout", "crashed"])
def test_a_trial_that_ran_out_of_time_or_crashed_costs_as_much_as_one_that_failed(status):
    rows = rows_of({"HeatWalk": {"holes": [[50, 50]]}, "cuts": {"holes": [[None, 50]]}})
    other = rows.assign(status=rows["status"].replace("failed", status))
    pd.testing.assert_frame_equal(board_of(rows), board_of(other))


def test_a_variant_that_its_perturbation_could_not_make_counts_for_no_method_and_is_named():
    rows = rows_of(
        {"HeatWalk": {"holes": [[1, 3]], "noise": [[2, 2]]}, "cuts": {"holes": [[2, None]], "noise": [[None, 2]]}}
    )
    unmade = (rows["part"] == "holes") & (rows["model"] == "m1")
    rows["error"] = [None if status == "ok" else "ValueError: no segments" for status in rows["status"]]
    rows.loc[unmade, ["status", "error"]] = ["failed", "PerturbationError: holes: no triangle is left"]
    scores = Scores(rows, OPTIONS)
    pd.testing.assert_frame_equal(scores.board, Scores(rows[~unmade], OPTIONS).board)
    assert scores.board.set_index("segmenter").loc["cuts", "failed_share"] == 20  # noise on m0, of five
    assert scores.unmade_variants == [("holes", 0.0, "m1")]
    assert scores.n_left_out == 0
    assert remarks(scores, {"holes": "Holes"})[1:] == [
        "The perturbation could not make these variants, which count for no method: Holes 0 (m1)."
    ]


def test_a_method_that_lacks_a_perturbation_has_no_rank_and_is_listed_below_with_what_it_has():
    rows = rows_of(
        {
            "HeatWalk": {"holes": [[1, 2]], "noise": [[2, 2]]},
            "late": {"holes": [[0.5, 1]]},
            "cuts": {"holes": [[2, 4]], "noise": [[4, 4]]},
        }
    )
    scores = Scores(rows, OPTIONS)
    board = scores.board
    assert board["segmenter"].tolist() == ["HeatWalk", "cuts", "late"]
    late = board.iloc[-1]
    assert pd.isna(late["rank"])
    assert late["missing"] == 2
    assert late["mce"] == 0.5
    assert np.isnan(late["mce_low"])
    assert late["pareto"] == ""
    assert np.isnan(scores.mean_change.loc["late", "noise"])
    assert board["rank"].tolist()[:2] == [1, 2]


def test_models_that_one_method_alone_was_run_on_make_no_other_incomplete():
    values = {name: {"holes": [[1.0 + i, 2.0]]} for i, name in enumerate(("HeatWalk", "cuts", "walks"))}
    more = rows_of(values | {"mine": {"holes": [[1.0, 2.0, 9.0]]}})
    scores = Scores(more, OPTIONS)
    assert scores.board["rank"].notna().all()
    assert scores.models == ["m0", "m1"]
    assert scores.n_left_out == 2  # the third model's original, and its variant


def test_a_perturbation_that_does_not_move_the_reference_is_left_out_of_the_mean():
    rows = rows_of(
        {"HeatWalk": {"holes": [[0, 0]], "noise": [[2, 2]]}, "cuts": {"holes": [[50, 50]], "noise": [[3, 3]]}}
    )
    scores = Scores(rows, OPTIONS)
    assert scores.undefined == ["holes"]
    assert scores.board.set_index("segmenter").loc["cuts", "mce"] == 1.5


def test_without_the_reference_there_are_no_corruption_errors_and_no_ranks():
    rows = rows_of({"cuts": {"holes": [[1, 2]]}, "walks": {"holes": [[3, 4]]}})
    board = board_of(rows)
    assert board["mce"].isna().all()
    assert board["rank"].isna().all()
    assert board["mean_cp"].to_dict() == {"cuts": 1.5, "walks": 3.5}


def test_baselines_are_listed_below_and_move_no_rank():
    rows = rows_of({name: {"holes": [[value, value]]} for name, value in
                    {"OneSegment": 0, "HeatWalk": 2, "cuts": 3, "Voronoi": 2.5}.items()})  # fmt: skip
    board = Scores(rows, OPTIONS).board
    assert board["segmenter"].tolist() == ["HeatWalk", "cuts", "OneSegment", "Voronoi"]
    assert board["rank"].tolist() == [1, 2, pd.NA, pd.NA]
    assert board["baseline"].tolist() == ["", "", "yes", "yes"]


def test_ranks_within_a_kind_ignore_the_other_kind():
    values = {"HeatWalk": 2, "told_best": 0.5, "found": 3, "told_worst": 4}
    rows = rows_of(
        {name: {"holes": [[value, value]]} for name, value in values.items()}, told=("told_best", "told_worst")
    )
    board = board_of(rows)
    assert board["rank"].to_dict() == {"told_best": 1, "HeatWalk": 2, "found": 3, "told_worst": 4}
    assert board["rank_of_kind"].to_dict() == {"told_best": 1, "HeatWalk": 1, "found": 2, "told_worst": 2}
    assert board.loc["told_best", "method"] == "told best (k)"
    assert board["k"].to_dict() == {"told_best": "told", "HeatWalk": "finds", "found": "finds", "told_worst": "told"}


def test_methods_share_a_rank_if_which_is_better_depends_on_the_models():
    rows = rows_of(
        {
            "HeatWalk": {"holes": [[10, 10, 10, 10]]},
            "one": {"holes": [[1, 9, 1, 9]]},
            "other": {"holes": [[9, 1, 9, 2]]},
        }
    )
    board = board_of(rows)
    assert board["rank"].to_dict() == {"one": 1, "other": 1, "HeatWalk": 3}


def test_with_one_model_there_are_no_intervals_and_every_difference_counts():
    scores = Scores(rows_of({"HeatWalk": {"holes": [[2]]}, "cuts": {"holes": [[1.9]]}}), OPTIONS)
    assert not scores.has_intervals
    assert scores.board["mce_low"].isna().all()
    assert scores.board["segmenter"].tolist() == ["cuts", "HeatWalk"]
    assert scores.board["rank"].tolist() == [1, 2]


PARTS, N_MODELS = ("holes", "noise", "view"), 4


@pytest.fixture
def three_methods():
    """Random rows, and a function: method -> its mean corruption error in every resample, by brute force."""
    rows = drawn(["HeatWalk", "cuts", "walks"], PARTS, N_MODELS, seed=3)
    rows = rows[(rows["part"] != "view") & (rows["part"] != "original")]
    totals = rows.assign(value=rows["change_percentage"].fillna(200.0)).groupby(["segmenter", "part", "model"])["value"]
    sums = totals.sum().to_dict()

    def resampled(method):
        samples = []
        for count in resampled_counts(N_MODELS):
            errors = []
            for part in ("holes", "noise"):
                ours, standard = (
                    sum(times * sums[name, part, f"m{i}"] for i, times in enumerate(count))
                    for name in (method, "HeatWalk")
                )
                errors.append(ours / standard)
            samples.append(np.mean(errors))
        return np.array(samples)

    return rows, resampled


def test_the_interval_of_the_mean_corruption_error_is_that_of_resampled_models(three_methods):
    rows, resampled = three_methods
    cuts = board_of(rows).loc["cuts"]
    assert [cuts["mce_low"], cuts["mce_high"]] == pytest.approx(np.quantile(resampled("cuts"), [0.025, 0.975]).tolist())


def test_differences_are_those_of_the_same_models_in_both_methods(three_methods):
    rows, resampled = three_methods
    board = board_of(rows, Options(controls=("rotation",), paired_with="walks"))
    expected = np.quantile(resampled("cuts") - resampled("walks"), [0.025, 0.975])
    assert board.loc["cuts", "difference"] == pytest.approx(board.loc["cuts", "mce"] - board.loc["walks", "mce"])
    assert board.loc["cuts", ["difference_low", "difference_high"]].tolist() == pytest.approx(expected.tolist())
    assert board.loc["walks", ["difference", "difference_low", "difference_high"]].isna().all()
    assert "difference" not in board_of(rows)


def test_the_order_of_rows_changes_no_score():
    rows = drawn(["HeatWalk", "cuts", "walks"], ("holes", "noise", "rotation"), 3, seed=4)
    shuffled = rows.sample(frac=1, random_state=1).reset_index(drop=True)
    first, second = (board_of(each).sort_index() for each in (rows, shuffled))
    exact = ["rank", "missing", "failed_share", "n", "pareto", "mce", "mean_cp"]
    pd.testing.assert_frame_equal(first[exact], second[exact], rtol=1e-12)


def test_repeats_are_averaged_before_models():
    rows = rows_of({"HeatWalk": {"holes": [[4, 4]]}, "cuts": {"holes": [[1, 8]]}})
    again = rows[(rows["segmenter"] == "cuts") & (rows["model"] == "m0")].assign(repeat=1, change_percentage=3.0)
    board = board_of(pd.concat([rows, again], ignore_index=True))
    assert board.loc["cuts", "mce"] == (2 + 8) / 8


def test_memory_is_on_the_board_if_rows_have_it():
    rows = rows_of({"HeatWalk": {"holes": [[4, 4]]}})
    assert "peak_memory" not in board_of(rows)
    assert board_of(rows.assign(peak_memory=[1.0, 7.0, 3.0, 2.0])).loc["HeatWalk", "peak_memory"] == 7
