"""Every shipped study on one small model, from its configuration to its tables and curves."""

import dataclasses
from pathlib import Path

import pandas as pd
import pytest

import conf
from studies.execution.study import run_study
from tests.helpers.meshes import bundled

STUDIES = sorted(path.stem for path in (Path(conf.__file__).parent / "study").glob("*.yaml") if path.stem != "custom")

# Studies of many methods, with few of them.
FEWER = {
    "ablation": ["segmenters=[heat_walk,heat_walk_robust]", "perturbations=[holes,figure9]"],
    "leaderboard": ["segmenters=[heat_walk,one_segment]", "perturbations=[holes,scaling]"],
}


@pytest.fixture
def small(tmp_path, request):
    """A function: study -> the options that make it small."""

    def options(study):
        if study == "table1":
            return f"dataset.root={request.getfixturevalue('psb_zip')}", "dataset.models=[50]"
        if study == "pose":
            return f"dataset.root={request.getfixturevalue('tosca_zip')}", "dataset.models=[cat0,cat1]"
        bundled("ant").export(tmp_path / "ant.off")  # as it ships: 486 vertices
        return "dataset=files", f"dataset.glob={tmp_path / 'ant.off'}", *FEWER.get(study, ())

    return options


@pytest.mark.parametrize("study", STUDIES)
def test_it_runs_and_shows_what_it_found(study, small, configured, console, tmp_path):
    made = configured(
        f"+study={study}", *small(study), "repeats=1", "engine=serial", f"results_dir={tmp_path}", "gallery.models=0"
    )
    if hasattr(made.experiment, "plates"):
        made = dataclasses.replace(made, experiment=dataclasses.replace(made.experiment, plates={}))
    run_study(made, console)
    (folder,) = [path.parent for path in tmp_path.rglob("trials.parquet")]
    rows, table = pd.read_parquet(folder / "trials.parquet"), pd.read_csv(folder / "table.csv")
    assert folder.parts[-2] == study
    assert (rows["status"] == "ok").any()
    assert len(table) > 0
    assert not table.isna().all(axis=None)
    page = (folder / "table.md").read_text()
    what = "1 model, 2 methods" if study in FEWER else "HeatWalk"
    assert page.startswith(f"# {made.title} on {rows['dataset'].iloc[0]}: {what}")
    assert all(path.stat().st_size > 5000 for path in folder.glob("*.png"))


def test_what_is_left_behind_does_not_say_where_the_data_are(small, configured, console, tmp_path, psb_zip):
    made = configured("+study=table1", *small("table1"), "engine=serial", f"results_dir={tmp_path}")
    run_study(made, console)
    folder = tmp_path / "table1" / "psb"
    for name in ("config.yaml", "provenance.json", "table.md", "table.csv"):
        assert str(psb_zip.parent) not in (folder / name).read_text()
    assert psb_zip.name in (folder / "config.yaml").read_text()
