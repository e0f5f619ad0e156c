import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

import heatwalk
from studies import metrics, segmenters
from studies.columns import Column
from studies.execution import Serial, run_trials
from studies.experiments import Change
from studies.experiments.change import summary
from studies.experiments.experiment import row_columns
from studies.metrics import change_percentage
from tests.studies.conftest import configured_with


def row_of(trial):
    """The row of one trial, run in this process."""
    (row,) = run_trials(Serial(), [trial])
    return row


@pytest.fixture
def ant_trial(plan):
    words = ("dataset.models=[ant]", "levels=[0.3]", "repeats=1", "gallery.models=0")
    return plan("+study=normal_noise", *words)[0]


def test_the_row_says_what_the_parts_say(ant_trial):
    row = row_of(ant_trial)
    mesh = ant_trial.model.load()
    reference = heatwalk.segment(mesh.vertices, mesh.faces).labels
    perturbed = ant_trial.perturbation(ant_trial.prepare().mesh, np.random.default_rng(ant_trial.seed))
    labels = heatwalk.segment(perturbed.mesh.vertices, perturbed.mesh.faces).labels
    assert set(row) == {column.name for column in row_columns(Change)} | {"seconds"}
    assert row["status"] == "ok"
    assert row["change_percentage"] == change_percentage(reference, labels)
    assert row["n_segments_reference"] == len(set(reference))
    assert row["n_segments"] == len(set(labels))
    assert row["n_vertices"] == row["n_vertices_perturbed"] == row["n_compared"] == len(mesh.vertices)
    assert json.loads(row["applied"]) == perturbed.applied


def test_only_vertices_that_still_exist_are_compared(plan):
    trial = plan("+study=missing_parts", "dataset.models=[ant]", "levels=[0.2]", "repeats=1")[0]
    outcome = trial.variant(trial.prepare())
    before, after = outcome.compared()
    assert len(before) == len(after) == row_of(trial)["n_compared"] < len(outcome.counterpart)
    kept = np.flatnonzero(outcome.counterpart >= 0)
    np.testing.assert_array_equal(
        outcome.mesh.vertices[outcome.counterpart[kept]], outcome.reference.mesh.vertices[kept]
    )


FACTORS = [0.5, 1.5, 3, 10]


@pytest.fixture(scope="module")
def scaled():
    """The rows of the bundled models, scaled."""
    return list(
        run_trials(
            Serial(), configured_with("+study=scaling", f"levels={FACTORS}", "repeats=1", "engine=serial").plan()
        )
    )


@pytest.mark.parametrize("factor", FACTORS)
def test_scaling_changes_nothing_at_all(scaled, factor):
    rows = [row for row in scaled if row["level"] == factor]
    assert len(rows) == 3
    for row in rows:
        assert row["change_percentage"] == row["van_dongen"] == row["rand_index_error"] == 0


@pytest.mark.slow
def test_scaling_changes_nothing_at_all_on_the_benchmark(plan, psb_zip):
    for trial in plan("+study=scaling", "dataset=psb", f"dataset.root={psb_zip}"):
        assert row_of(trial)["change_percentage"] == 0, trial.model.name


def raise_oddly(vertices, faces):
    raise RuntimeError("no luck\ntoday")


def too_few_labels(vertices, faces):
    return np.zeros(3, dtype=int)


@pytest.mark.parametrize(
    ("segmenter", "error"),
    [
        ("raise_oddly", "RuntimeError: no luck today"),
        ("too_few_labels", "LabelError: too_few_labels returned 3 labels"),
    ],
)
def test_a_segmenter_that_fails_is_a_row(ant_trial, segmenter, error):
    row = row_of(
        dataclasses.replace(ant_trial, segmenter=segmenters.make_segmenter({"_target_": f"{__name__}.{segmenter}"}))
    )
    assert row["status"] == "failed"
    assert row["error"].startswith(error)
    assert row.get("change_percentage") is None
    assert row["trial_id"] == ant_trial.trial_id


def test_a_mesh_that_cannot_be_read_is_a_row(plan, tmp_path):
    (tmp_path / "broken.off").write_text("OFF\n4 4 0\n0 0 0\n")
    trial = plan("+study=holes", "dataset=files", f"dataset.glob={tmp_path}", "repeats=1")[0]
    row = row_of(trial)
    assert row["status"] == "failed"
    assert "broken.off" in row["error"]


def test_the_background_is_a_segment_like_any_other_in_the_comparison(ant_trial):
    outcome = ant_trial.variant(ant_trial.prepare())
    assert -1 in outcome.labels
    assert row_of(ant_trial)["n_segments"] == len(np.unique(outcome.labels))


def test_a_trial_of_the_gallery_keeps_its_labels_and_the_others_do_not(plan):
    trials = plan("+study=normal_noise", "dataset.models=[ant]", "levels=[0.1,0.3]", "repeats=2", "gallery.columns=1")
    assert [trial.keep_labels for trial in trials] == [True, False, False, False]
    row = row_of(trials[0])
    variant = trials[0].variant(trials[0].prepare())
    np.testing.assert_array_equal(row["labels"], variant.labels)
    np.testing.assert_array_equal(row["reference_labels"], variant.reference.labels)
    assert "labels" not in row_of(trials[1])


def test_labels_that_are_given_are_not_computed_again(plan):
    trial = plan("+study=normal_noise", "dataset.models=[ant]", "levels=[0.3]", "repeats=1")[0]
    trial = dataclasses.replace(trial, segmenter=segmenters.make_segmenter({"_target_": f"{__name__}.raise_oddly"}))
    given = np.zeros(len(trial.model.load().vertices), dtype=int)
    variant = trial.variant(trial.reference(given), given)
    assert variant.labels is given
    assert variant.reference.labels is given


def stored(values, level=0.1, **columns):
    """Rows from {model: [Change Percentage of each repeat; None for a failure]}."""
    return pd.DataFrame(
        [
            {
                "segmenter": "HeatWalk",
                "part": "shot_noise",
                "perturbation": "shot_noise",
                "category": "",
                "model": model,
                "level": level,
                "unit": "share_of_vertices",
                "repeat": repeat,
                "status": "failed" if value is None else "ok",
                **dict.fromkeys(
                    ("change_percentage", "van_dongen", "rand_index_error", "n_segments", "n_segments_reference"),
                    np.nan if value is None else value,
                ),
                **columns,
            }
            for model, repeats in values.items()
            for repeat, value in enumerate(repeats)
        ]
    )


def test_a_row_per_level_has_the_mean_over_models_and_counts():
    frame = pd.concat([stored({"a": [1.0, 3.0], "b": [6.0, None]}), stored({"a": [0.0], "b": [10.0]}, level=0.2)])
    table = summary(frame)
    assert table["level"].tolist() == [0.1, 0.2]
    assert table["mean"].tolist() == [4.0, 5.0]  # (2 + 6) / 2: the failed repeat does not make b weigh less
    assert table["median"].tolist() == [3.0, 5.0]
    assert table["n"].tolist() == [3, 2]
    assert table["failures"].tolist() == [1, 0]


def test_a_level_of_which_every_trial_failed_stays_in_the_table():
    (table,) = Change().tables(stored({"a": [None, None]}))
    assert table.frame["failures"].tolist() == [2]
    assert table.frame[["mean", "ci_low", "ci_high", "median"]].isna().all(axis=None)
    shown = dict(zip([column.name for column in table.visible()], table.cells()[0], strict=True))
    assert shown["mean"] == shown["interval"] == "–"
    assert "nan" not in str(shown)


def test_several_segmenters_are_compared_level_by_level():
    both = pd.concat([stored({"a": [2.0]}), stored({"a": [6.0]}, segmenter="other")])
    (table,) = Change().tables(both)
    assert table.frame[["segmenter", "level", "mean"]].to_numpy().tolist() == [
        ["HeatWalk", 0.1, 2.0], ["other", 0.1, 6.0],
    ]  # fmt: skip
    assert table.visible(compact=True)[0].name == "segmenter"
    (alone,) = Change().tables(stored({"a": [2.0]}))
    assert "segmenter" not in alone.frame
    assert "segmenter" not in [column.name for column in alone.visible()]


def test_a_metric_that_older_rows_lack_is_left_out_of_their_table(monkeypatch):
    new = Column(name="newest", heading="newest", format=".1f")
    monkeypatch.setattr(metrics, "columns", lambda: (*Change.columns, new))
    (old,) = Change().tables(stored({"a": [2.0]}, newest=np.nan))
    (current,) = Change().tables(stored({"a": [2.0]}, newest=7.0))
    assert "newest" not in old.frame
    assert current.frame["newest"].tolist() == [7.0]
    assert "7.0" in current.cells()[0]


HUNGRY = ("segmenter=custom", "segmenter._target_=tests.helpers.segmenting.hungry")


def test_a_row_and_the_table_of_costs_have_the_peak_memory_of_segmenting(here, plan, rows_of):
    words = ("dataset=files", "dataset.glob=ant.off", "levels=[0.1]", "repeats=2", "gallery.models=0")
    rows = rows_of(plan("+study=normal_noise", *words, *HUNGRY), Change)
    assert rows["peak_memory"].between(60, 80).all()
    tables = {table.name: table for table in Change().tables(rows)}
    assert tables["failures_and_seconds"].frame["peak_memory"].tolist() == [rows["peak_memory"].median()]
    assert "peak memory (MB)" in [column.title for column in tables["failures_and_seconds"].visible()]


def test_rows_that_are_older_than_the_measurement_of_memory_have_the_tables_of_before(here, plan, rows_of):
    words = ("dataset=files", "dataset.glob=ant.off", "levels=[0.1]", "repeats=1", "gallery.models=0")
    rows = rows_of(plan("+study=normal_noise", *words, *HUNGRY), Change)
    for older in (rows.assign(peak_memory=np.nan), rows.drop(columns="peak_memory")):
        tables = {table.name: table for table in Change().tables(older)}
        assert "peak_memory" not in tables["failures_and_seconds"].frame
