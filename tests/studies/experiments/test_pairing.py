"""The difference of every method from one of them, of the same models and draws."""

from itertools import combinations

import numpy as np
import pandas as pd
import pytest
import scipy.stats

from studies.experiments import Benchmark, Change, Poses, Times
from studies.experiments.change import summary
from studies.metrics import psb
from studies.planning.errors import StudyError
from studies.reporting.publication import Publication
from studies.reporting.text import markdown_of
from studies.storage.identity import identity
from tests.studies.conftest import configured_with


def changes(segmenter, values):
    """Rows of a study of one level: Change Percentages by model and repeat; None for a trial that failed."""
    return pd.DataFrame(
        {
            "part": "holes", "level": 0.1, "unit": "share", "segmenter": segmenter, "model": model, "repeat": repeat,
            "status": "failed" if value is None else "ok",
            "change_percentage": np.nan if value is None else float(value),
            "n_segments": 3, "n_segments_reference": 3,
        }
        for model, repeats in values.items()
        for repeat, value in enumerate(repeats)
    )  # fmt: skip


def test_the_difference_is_that_of_the_draws_which_both_methods_have():
    walk = changes("walk", {"ant": [1, 2], "cow": [10, None], "dog": [5, 5]})
    peer = changes("peer", {"ant": [2, 5], "cow": [10, 90], "fox": [70, 70]})
    table = summary(pd.concat([walk, peer]), "walk").set_index("segmenter")
    # Of the ant 1 and 3, of the cow 0 in the first repeat; no other draw is of both.
    assert table.loc["peer", "difference"] == pytest.approx((2 + 0) / 2)
    assert table.loc["walk", ["difference", "difference_low", "difference_high"]].isna().all()
    assert table.loc["walk", "mean"] == pytest.approx((1.5 + 10 + 5) / 3)
    assert "difference" not in summary(pd.concat([walk, peer]))


def test_the_interval_of_the_difference_is_the_bootstrap_of_paired_values():
    """Models differ far more than methods, so that only the paired interval tells the two apart."""
    rng = np.random.default_rng(3)
    models, better = rng.exponential(20, 30), rng.normal(1, 0.5, 30)
    walk = changes("walk", {f"{i:02}": [value] for i, value in enumerate(models + better)})
    peer = changes("peer", {f"{i:02}": [value] for i, value in enumerate(models)})
    row = summary(pd.concat([walk, peer]), "walk").set_index("segmenter").loc["peer"]
    expected = scipy.stats.bootstrap((-better,), np.mean, method="percentile", rng=1, n_resamples=20_000)
    assert row["difference"] == pytest.approx(-better.mean())
    assert row["difference_low"] == pytest.approx(expected.confidence_interval.low, abs=0.03)
    assert row["difference_high"] == pytest.approx(expected.confidence_interval.high, abs=0.03)
    assert row["difference_high"] < 0 < row["ci_high"] - row["ci_low"]


def test_the_table_shows_the_difference_with_its_interval_only_where_it_is_asked_for():
    rows = pd.concat([changes("walk", {"ant": [1], "cow": [4]}), changes("peer", {"ant": [2], "cow": [7]})])
    rows = rows.assign(category="animal")
    (shown, *_), (plain, *_) = (Change(paired_with=name, gallery=None).tables(rows) for name in ("walk", None))
    headings = [column.title for column in shown.visible()]
    cells = dict(zip(headings, shown.cells()[1], strict=True))
    assert cells["difference"] == "+2.00 (+1.00 – +3.00)"
    assert shown.cells()[0][headings.index("difference")] == "–"
    assert any("+2.00 (+1.00 – +3.00)" in line for line in markdown_of(shown))
    assert [column.title for column in plain.visible()] == [each for each in headings if each != "difference"]


def poses(segmenter, values):
    """Rows between the poses of a cat, as in `values` by pair of names."""
    return pd.DataFrame(
        {
            "part": "cat", "segmenter": segmenter, "model": a, "other": b, "status": "ok", "change_percentage": value,
            "van_dongen": value, "n_segments": 3, "n_segments_reference": 3,
        }
        for (a, b), value in values.items()
    )  # fmt: skip


def test_between_poses_the_difference_is_of_the_same_pairs():
    rng = np.random.default_rng(0)
    pairs = list(combinations("abcdefgh", 2))
    walk = dict(zip(pairs, rng.uniform(0, 50, len(pairs)), strict=True))
    peer = {pair: value + 3 for pair, value in walk.items() if pair != ("a", "b")}
    (table,) = Poses(paired_with="walk").tables(pd.concat([poses("walk", walk), poses("peer", peer)]))
    frame = table.frame.set_index("segmenter")
    columns = ["difference", "difference_low", "difference_high"]
    assert frame.loc["peer", columns].tolist() == pytest.approx([3, 3, 3])
    assert frame.loc["walk", columns].isna().all()
    assert frame.loc["peer", "ci_high"] - frame.loc["peer", "ci_low"] > 3  # what unpaired intervals do not tell


def test_over_time_the_difference_is_of_the_shares_of_the_same_models():
    def counted(segmenter, numbers):
        return pd.DataFrame(
            {
                "part": "time", "segmenter": segmenter, "model": model, "level": level, "unit": "paper", "repeat": 0,
                "status": "ok", "n_segments": n, "n_segments_reference": n, "change_percentage": 0.0,
            }
            for model, values in numbers.items()
            for level, n in zip((0.6, 1.0, 2.7), values, strict=True)
        )  # fmt: skip

    walk = {"ant": (3, 3, 3), "cow": (4, 3, 3), "dog": (5, 4, 3), "fox": (2, 2, 2)}
    peer = {"ant": (3, 3, 3), "cow": (3, 3, 3), "dog": (3, 3, 3)}
    experiment = Times(times={"first": 0.5, "last": 3, "count": 2}, intervals=[[0.6, 2.7]], paired_with="walk")
    table, by_time = experiment.tables(pd.concat([counted("walk", walk), counted("peer", peer)]))
    frame = table.frame[table.frame["counted"] == "all"].set_index("segmenter")
    assert frame.loc["walk", "unchanged"] == 50
    assert frame.loc["peer", ["unchanged", "difference"]].tolist() == pytest.approx([100, 200 / 3])
    assert frame.loc["peer", ["difference_low", "difference_high"]].tolist() == [0, 100]
    assert pd.isna(frame.loc["walk", "difference"])
    assert (by_time.frame.set_index("segmenter").loc["peer", "difference"] == 0).all()


def test_the_scores_of_table_1_have_their_differences_in_a_table_of_their_own():
    scores = {"walk": {"ant": 0.2, "cow": 0.4}, "peer": {"ant": 0.1, "cow": 0.2, "dog": 0.9}, "Humans": {"ant": 0.0}}
    rows = pd.DataFrame(
        {
            "segmenter": segmenter, "model": model, "category": "animal", "status": "ok", "segmenter_options": None,
            **{metric: value + i for i, metric in enumerate(psb.MAIN)},
        }
        for segmenter, values in scores.items()
        for model, value in values.items()
    )  # fmt: skip
    tables = {table.name: table for table in Benchmark(paired_with="walk").tables(rows)}
    frame = tables["differences"].frame.set_index("method")
    assert frame.index.tolist() == ["peer", "Humans"]
    for metric in psb.MAIN:
        assert frame.loc["peer", [metric, f"{metric}_low", f"{metric}_high"]].tolist() == pytest.approx(
            [-0.15, -0.2, -0.1]
        )
        assert frame.loc["Humans", metric] == pytest.approx(-0.2)
    assert frame["n"].tolist() == [2, 1]
    # What others have published of methods are values, not differences.
    assert Publication.load("heat_walk_2011").annotate(tables["differences"], rows) is tables["differences"]
    assert "differences" not in {table.name for table in Benchmark().tables(rows)}


@pytest.mark.parametrize("study", ["holes", "pose", "time", "table1"])
def test_a_method_that_is_not_in_the_study_is_an_error(study, psb_zip, tosca_zip):
    dataset = [f"dataset.root={tosca_zip if study == 'pose' else psb_zip}"] if study in ("pose", "table1") else []
    several = [f"+study={study}", *dataset, "segmenters=[heat_walk,heat_walk_robust]"]
    with pytest.raises(StudyError, match=r"paired_with is 'Walk'.*choose one of HeatWalk, HeatWalkRobust"):
        configured_with(*several, "paired_with=Walk").plan()
    with pytest.raises(StudyError, match=r"the study has only one: segmenters=\[a,b\]"):
        configured_with(f"+study={study}", *dataset, "paired_with=HeatWalk").plan()


def test_the_option_does_not_make_another_study():
    record = {"study": {"name": "holes"}, "experiment": {"_target_": "studies.experiments.Change"}, "repeats": 3}
    later = record | {"experiment": record["experiment"] | {"paired_with": "${paired_with}"}, "paired_with": "walk"}
    assert identity(later) == identity(record)
