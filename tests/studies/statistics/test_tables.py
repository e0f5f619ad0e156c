import numpy as np
import pandas as pd
import pytest

from studies.statistics.tables import HEADINGS, display, interval, markdown, summary


def trials(values, level=0.1):
    """A frame of trials from {model: [change percentage of each repeat; None for a failure]}."""
    return pd.DataFrame(
        [
            {
                "part": "shot_noise",
                "model": model,
                "level": level,
                "unit": "share_of_vertices",
                "repeat": repeat,
                "status": "failed" if value is None else "ok",
                **dict.fromkeys(
                    ("change_percentage", "van_dongen", "rand_index_error", "n_segments", "n_segments_reference"),
                    np.nan if value is None else value,
                ),
            }
            for model, repeats in values.items()
            for repeat, value in enumerate(repeats)
        ]
    )


def test_a_row_a_level_with_mean_over_models_counts_and_the_papers_figure():
    frame = pd.concat([trials({"a": [1.0, 3.0], "b": [6.0, None]}), trials({"a": [0.0], "b": [10.0]}, level=0.2)])
    table = summary(frame, {"shot_noise": {0.2: 4.5}})
    assert table["level"].tolist() == [0.1, 0.2]
    assert table["mean"].tolist() == [4.0, 5.0]  # (2 + 6) / 2: the failed repeat does not make b weigh less
    assert table["median"].tolist() == [3.0, 5.0]
    assert table["n"].tolist() == [3, 2]
    assert table["failures"].tolist() == [1, 0]
    assert np.isnan(table["paper"][0])
    assert table["paper"][1] == 4.5


def test_a_level_of_which_every_trial_failed_stays_in_the_table():
    table = summary(trials({"a": [None, None]}), {"shot_noise": {}})
    assert table["failures"].tolist() == [2]
    assert table[["mean", "ci_low", "ci_high", "median"]].isna().all(axis=None)
    assert display(table)[0]["mean"] == "–"


def test_the_interval_covers_the_true_mean_about_as_often_as_it_says():
    rng = np.random.default_rng(3)
    hits = 0
    for _ in range(200):
        centres = rng.normal(10, 3, 20)
        low, high = interval(trials({f"m{i}": rng.normal(c, 1, 3).tolist() for i, c in enumerate(centres)}))
        hits += low <= 10 <= high
    assert 0.88 <= hits / 200 <= 0.98  # a percentile bootstrap over 20 models is a little narrow


def test_the_interval_of_one_model_resamples_its_repeats_alone():
    values = [1.0, 2.0, 4.0, 8.0]
    low, high = interval(trials({"a": values}))
    rng = np.random.default_rng(1)
    means = rng.choice(values, (20000, 4)).mean(axis=1)
    assert low == pytest.approx(np.quantile(means, 0.025), abs=0.26)
    assert high == pytest.approx(np.quantile(means, 0.975), abs=0.26)


def test_no_interval_from_a_single_trial():
    assert np.isnan(interval(trials({"a": [1.0]}))).all()


def test_the_interval_is_the_same_every_time():
    frame = trials({"a": [1.0, 2.0], "b": [3.0, 5.0]})
    assert interval(frame) == interval(frame)


def test_the_page_shows_every_level_and_nothing_is_nan():
    frame = pd.concat([trials({"a": [1.0]}), trials({"a": [None]}, level=0.2)])
    page = markdown("Shot noise on files", HEADINGS, display(summary(frame, {"shot_noise": {}})), "What it means.")
    assert "| 0.1 | share of vertices | 1.00 | – |" in page
    assert "| 0.2 |" in page
    assert page.startswith("# Shot noise on files\n")
    assert page.endswith("\nWhat it means.\n")
    assert "nan" not in page
