"""What the options of a run do: fresh, retry_failed, on_error, dry_run; and what is reused from other studies."""

import dataclasses
import json
from pathlib import Path

import pandas as pd
import pytest

from studies.columns import Column
from studies.execution.study import run_study
from studies.experiments import Change
from studies.metrics import Metric, registry
from tests.studies.conftest import STUDY
from tests.studies.test_survival import FOLDER, rows, table

pytestmark = pytest.mark.usefixtures("charts_as_text")


def said(capsys):
    return " ".join(capsys.readouterr().out.split())


def _set_stored_seconds(folder, seconds):
    """Replace the measured seconds of stored rows: no test depends on the clock."""
    path = folder / "trials.jsonl"
    rows = [json.loads(line) | {"seconds": seconds} for line in path.read_text().splitlines()]
    path.write_text("".join(json.dumps(row) + "\n" for row in rows))


def test_failed_trials_run_again_only_when_that_is_asked_for(study, here, capsys):
    (here / "broken").touch()
    assert not study("repeats=2")
    (here / "broken").unlink()
    assert not study("repeats=2")
    assert "4 of them stored already" in said(capsys)
    assert set(rows()["status"]) == {"failed"}
    assert study("repeats=2", "retry_failed=true")
    assert "stored already" not in said(capsys)
    assert study("repeats=2", results="other")
    pd.testing.assert_frame_equal(rows(), rows("other"))
    assert table() == table("other")


def test_fresh_starts_over_and_keeps_what_was(study, here, capsys):
    (here / "broken").touch()
    study("repeats=1")
    before = table()
    (here / "broken").unlink()
    assert study("repeats=1", "fresh=true")
    moved = next(path for path in (here / "results" / "normal_noise").iterdir() if ".before-" in path.name)
    assert f"moved to: {moved.relative_to(here)}" in said(capsys)
    assert (moved / "table.csv").read_bytes() == before != table()
    assert study("repeats=2")
    assert "reused" not in said(capsys)


def test_the_first_failure_can_stop_a_study(study, here, capsys):
    assert study("levels=[0.1]", "repeats=2")
    (here / "broken").touch()
    assert not study("repeats=2", "on_error=stop")
    assert "on_error=stop" in said(capsys)
    assert rows()["status"].tolist() == ["ok", "ok", "failed"]
    with pytest.raises(ValueError, match="on_error is 'stopp': it must be one of continue, stop"):
        study("on_error=stopp")


def test_a_dry_run_says_what_there_is_to_do_and_writes_nothing(study, here, capsys):
    assert study("repeats=3", "dry_run=true")
    out = said(capsys)
    assert "6 trials" in out
    assert "6 to run; time left: unknown" in out
    assert [path.name for path in here.iterdir()] == ["ant.off"]
    study("repeats=3", "levels=[0.1]", "+segmenter.seconds=0.01")
    _set_stored_seconds(here / "results" / FOLDER, 0.6)
    before = {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}
    capsys.readouterr()
    assert study("repeats=4", "dry_run=true", "+segmenter.seconds=0.01")
    out = said(capsys)
    assert "│ 1 │ 2 │ 4 │ 8 │ 3 │ 0 │ 5 │" in out
    assert "5 to run; time left, estimated from the stored trials: 0:00:03 of work" in out
    assert before == {path: path.read_bytes() for path in here.rglob("*") if path.is_file()}


def test_rows_of_another_study_are_taken_over_and_that_is_said(study, here, configured, console, capsys):
    words = ("parts.shot_noise.levels=[0.1]", "parts.holes.levels=[3]", "parts.short_circuits.levels=[1]")
    noise = "parts.normal_noise.levels=[0.1,0.2]"
    config = ("+study=table2", *STUDY[1:-1], noise, *words, "engine=serial", "repeats=1")
    assert run_study(configured(*config), console).complete
    capsys.readouterr()
    assert study("repeats=1", "dry_run=true")
    assert "2 would be reused from results/table2/files/trials.jsonl 0 to run" in said(capsys)
    assert study("repeats=1")
    assert "2 of them reused from results/table2/files/trials.jsonl" in said(capsys)
    assert set(rows()["study"]) == {"normal_noise"}
    assert study("repeats=1", results="other")
    assert "reused" not in said(capsys)
    pd.testing.assert_frame_equal(rows(), rows("other"))
    assert table() == table("other")


def test_in_a_fresh_clone_the_studys_own_table_holds_its_rows(study, here, capsys):
    assert study("repeats=2")
    results = here / "results" / FOLDER
    before = {name: (results / name).read_bytes() for name in ("table.csv", "trials.parquet")}
    for name in ("trials.jsonl", "planned.txt"):
        (results / name).unlink()
    assert study("repeats=2")
    assert f"4 of them reused from results/{FOLDER}/trials.parquet" in said(capsys)
    assert before == {name: (results / name).read_bytes() for name in before}


METRIC = Metric(
    column=Column(name="agreeing", format="d", dtype="Int64", help="Points whose labels agree.", compact=True),
    function=lambda comparison: int((comparison.reference == comparison.labels).sum()),
)


@pytest.fixture
def add_metric(monkeypatch):
    """A function: a metric -> it is registered until the end of the test."""

    def add(metric):
        found = dict(registry._discovered()) | {metric.column.name: metric}
        monkeypatch.setattr(registry, "_discovered", lambda: found)
        monkeypatch.setattr(Change, "columns", registry.columns())

    return add


@pytest.mark.parametrize("metric", [METRIC, dataclasses.replace(METRIC, needs_mesh=True)])
def test_rows_that_are_older_than_a_metric_are_counted_and_shown_without_it(study, add_metric, capsys, metric):
    assert study("repeats=1", "levels=[0.1]")
    assert "computed before" not in said(capsys)
    add_metric(metric)
    assert study("repeats=1", "levels=[0.1]")
    assert "1 row was computed before the metric agreeing was added: fresh=true computes all rows again" in said(capsys)
    assert study("repeats=1", "levels=[0.1,0.2]")
    out = said(capsys)
    assert "1 row was computed before" in out
    assert rows()["agreeing"].notna().tolist() == [False, True]
    page = (Path("results") / FOLDER / "table.md").read_text(encoding="utf-8").splitlines()
    column = page[2].split(" | ").index("agreeing")
    assert [line.split(" | ")[column] == "–" for line in page[4:6]] == [True, False]
    assert study("repeats=1", "levels=[0.1,0.2]", "fresh=true")
    assert "computed before" not in said(capsys)
    assert rows()["agreeing"].notna().all()


def test_a_metric_of_meshes_that_is_not_defined_for_a_trial_is_not_counted_as_newer_than_its_row(
    study, add_metric, capsys
):
    assert study("repeats=1", "levels=[0.1]")
    add_metric(dataclasses.replace(METRIC, needs_mesh=True, function=lambda comparison: None))
    assert study("repeats=1", "levels=[0.1,0.2]")
    assert "1 row was computed before" in said(capsys)
    assert study("repeats=1", "levels=[0.1,0.2]", "fresh=true")
    assert "computed before" not in said(capsys)


def test_a_compact_metric_of_integers_is_on_the_terminal_with_its_mean(study, add_metric, capsys):
    add_metric(METRIC)
    assert study("repeats=2", "levels=[0.1]")
    out = said(capsys)
    assert "agreeing" in out
    assert f"{rows()['agreeing'].mean():.1f}" in out
    assert "Rand" not in out  # it is not compact


def test_a_trial_and_a_row_are_counted_in_the_singular(study, here, capsys):
    (here / "broken").touch()
    assert not study("repeats=1", "levels=[0.1]")
    out = said(capsys)
    assert "Normal noise on files: halves, 1 trial " in out
    assert "1 of 1 trial failed" in out
