"""Which variants the viewer of a leaderboard shows."""

from types import SimpleNamespace

import pandas as pd
import pytest

from studies.figures.variant_scenes import MOST_SECONDS, MOST_SECONDS_OF_ALL, worst_draws

TITLES = {"holes": "Holes", "noise": "Noise"}
METHODS = ("HeatWalk", "cuts", "slow")


def trial(method, part, level):
    return SimpleNamespace(
        trial_id=f"{method}-{part}-{level}", segmenter_name=method, part=part, level=level, repeat=0,
        draw=f"{part}-{level}", model=SimpleNamespace(name="cow", category=""),
    )  # fmt: skip


@pytest.fixture
def planned():
    return [trial(method, part, level) for method in METHODS for part in TITLES for level in (0.1, 0.2)]


def rows_of(planned, seconds=0.1):
    changes = {"HeatWalk": 1.0, "cuts": 2.0, "slow": 3.0}
    return pd.DataFrame(
        {
            "trial_id": [each.trial_id for each in planned],
            "status": "ok",
            "change_percentage": [changes[t.segmenter_name] + t.level + (t.part == "noise") for t in planned],
            "seconds_perturb": 0.0,
            "seconds_segment": [2 * MOST_SECONDS if t.segmenter_name == "slow" else seconds for t in planned],
        }
    )


def test_each_method_is_shown_where_it_changed_most_beside_the_reference(planned):
    draws = worst_draws(planned, rows_of(planned), 1, "HeatWalk", TITLES)
    assert [[each.trial_id for each in draw.trials] for draw in draws] == [
        ["HeatWalk-noise-0.2"],
        ["cuts-noise-0.2", "HeatWalk-noise-0.2"],
    ]
    assert [draw.at["perturbation"] for draw in draws] == ["Noise", "Noise"]
    assert [draw.at["method"] for draw in draws] == ["HeatWalk", "cuts"]


def test_further_cases_are_of_other_perturbations_after_the_first_of_all_methods(planned):
    draws = worst_draws(planned, rows_of(planned), 2, "HeatWalk", TITLES)
    assert [(draw.trials[0].segmenter_name, draw.trials[0].part) for draw in draws] == [
        ("HeatWalk", "noise"), ("cuts", "noise"), ("HeatWalk", "holes"), ("cuts", "holes"),
    ]  # fmt: skip


def test_together_they_take_no_more_than_the_limit(planned):
    seconds = MOST_SECONDS_OF_ALL / 2 / 3.5
    assert seconds > MOST_SECONDS  # a variant alone is too slow then
    assert worst_draws(planned, rows_of(planned, seconds), 2, "HeatWalk", TITLES) == []
    draws = worst_draws(planned, rows_of(planned, MOST_SECONDS), 2, "HeatWalk", TITLES)
    assert sum(2 * MOST_SECONDS * len(draw.trials) for draw in draws) <= MOST_SECONDS_OF_ALL


def test_none_are_shown_if_none_are_wanted_or_nothing_changed(planned):
    rows = rows_of(planned)
    assert worst_draws(planned, rows, 0, "HeatWalk", TITLES) == []
    assert worst_draws(planned, rows.assign(change_percentage=0.0), 3, "HeatWalk", TITLES) == []
