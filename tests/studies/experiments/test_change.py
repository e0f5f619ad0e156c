import dataclasses
import json

import numpy as np
import pytest

import heatwalk
from studies import segmenters
from studies.execution import Serial, run_trials
from studies.metrics import change_percentage
from studies.planning import trial as trials
from studies.planning.plan import plan


def row_of(trial):
    """The row of one trial, run in this process."""
    (row,) = run_trials(Serial(), [trial])
    return row


@pytest.fixture
def ant_trial(composed):
    return plan(composed("+study=normal_noise", "dataset.models=[ant]", "levels=[0.3]", "repeats=1"))[0]


def test_the_row_says_what_the_parts_say(ant_trial):
    row = row_of(ant_trial)
    mesh = ant_trial.model.load()
    reference = heatwalk.segment(mesh.vertices, mesh.faces).labels
    perturbed = ant_trial.perturbation(ant_trial.prepare().mesh, np.random.default_rng(ant_trial.seed))
    labels = heatwalk.segment(perturbed.mesh.vertices, perturbed.mesh.faces).labels
    assert set(row) == {column.name for column in trials.COLUMNS} | {"seconds"}
    assert row["status"] == "ok"
    assert row["change_percentage"] == change_percentage(reference, labels)
    assert row["n_segments_reference"] == len(set(reference))
    assert row["n_segments"] == len(set(labels))
    assert row["n_vertices"] == row["n_vertices_perturbed"] == row["n_compared"] == len(mesh.vertices)
    assert json.loads(row["applied"]) == perturbed.applied


def test_only_vertices_that_still_exist_are_compared(composed):
    trial = plan(composed("+study=missing_parts", "dataset.models=[ant]", "levels=[0.2]", "repeats=1"))[0]
    outcome = trial.variant(trial.prepare())
    before, after = outcome.compared()
    assert len(before) == len(after) == row_of(trial)["n_compared"] < len(outcome.counterpart)
    kept = np.flatnonzero(outcome.counterpart >= 0)
    np.testing.assert_array_equal(
        outcome.mesh.vertices[outcome.counterpart[kept]], outcome.reference.mesh.vertices[kept]
    )


@pytest.mark.parametrize("factor", [0.5, 1.5, 3, 10])
def test_scaling_changes_nothing_at_all(composed, factor):
    for trial in plan(composed("+study=scaling", f"levels=[{factor}]", "repeats=1")):
        row = row_of(trial)
        assert row["change_percentage"] == row["van_dongen"] == row["rand_index_error"] == 0


@pytest.mark.slow
def test_scaling_changes_nothing_at_all_on_the_benchmark(composed, psb_zip):
    for trial in plan(composed("+study=scaling", "dataset=psb", f"dataset.root={psb_zip}")):
        assert row_of(trial)["change_percentage"] == 0, trial.model.name


def raise_oddly(vertices, faces):
    raise RuntimeError("no luck\ntoday")


def too_few_labels(vertices, faces):
    return np.zeros(3, dtype=int)


@pytest.mark.parametrize(
    ("segmenter", "error"),
    [
        ("raise_oddly", "RuntimeError: no luck today"),
        ("too_few_labels", "LabelError: too_few_labels gave 3 labels"),
    ],
)
def test_a_segmenter_that_fails_is_a_row(ant_trial, segmenter, error):
    row = row_of(dataclasses.replace(ant_trial, segmenter=segmenters.make({"_target_": f"{__name__}.{segmenter}"})))
    assert row["status"] == "failed"
    assert row["error"].startswith(error)
    assert row["change_percentage"] is None
    assert row["trial_id"] == ant_trial.trial_id


def test_a_mesh_that_cannot_be_read_is_a_row(composed, tmp_path):
    (tmp_path / "broken.off").write_text("OFF\n4 4 0\n0 0 0\n")
    trial = plan(composed("+study=holes", "dataset=files", f"dataset.glob={tmp_path}", "repeats=1"))[0]
    row = row_of(trial)
    assert row["status"] == "failed"
    assert "broken.off" in row["error"]


def test_the_background_is_a_segment_like_any_other_in_the_comparison(ant_trial):
    outcome = ant_trial.variant(ant_trial.prepare())
    assert -1 in outcome.labels
    assert row_of(ant_trial)["n_segments"] == len(np.unique(outcome.labels))
