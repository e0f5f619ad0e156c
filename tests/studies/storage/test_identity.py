"""What a results folder is about."""

import pytest

from studies.storage.identity import identity

BOARD = {
    "study": {"name": "leaderboard"},
    "experiment": {"_target_": "studies.experiments.Leaderboard", "parts": "${parts}"},
    "dataset": {"_target_": "studies.datasets.Synthetic"},
}


@pytest.mark.parametrize("option", ["paired_with", "relative_to", "controls", "perturbations"])
def test_a_board_from_before_an_option_of_what_it_shows_or_gathers_is_the_same_board(option):
    later = BOARD | {"experiment": BOARD["experiment"] | {option: f"${{oc.select:{option},null}}"}}
    assert identity(later) == identity(BOARD)
    assert identity(later | {option: ["heat_walk"]}) == identity(BOARD)


def test_another_option_of_the_experiment_is_another_board():
    later = BOARD | {"experiment": BOARD["experiment"] | {"repeats": 2, "weights": "areas"}}
    assert identity(later) != identity(BOARD)
