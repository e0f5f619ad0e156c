"""The command as a person types it: a process of its own, in a folder of its own."""

import json
import os
import shlex
import signal
import subprocess
import sys
import time

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from studies.experiments import Change
from studies.experiments.experiment import row_columns
from studies.planning.trial import TIMINGS
from tests.helpers.meshes import bundled
from tests.studies.conftest import typed

ANT = ("dataset=files", "dataset.glob=ant.off", "gallery.models=0")  # the ant as it ships: 486 vertices
SMALL = ("+study=shot_noise", "dataset=files", "dataset.glob=ant.off", "levels=[0.0588,0.2]", "repeats=2")


def run(folder, *words, wait=True):
    command = [sys.executable, "-m", "studies.run", *words]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "COLUMNS": "80"}
    if wait:
        return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=300)
    return subprocess.Popen(
        command, cwd=folder, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        start_new_session=True,
    )  # fmt: skip


@pytest.fixture(scope="module")
def small_study(tmp_path_factory):
    """A small study, run once: what it printed, and its folder."""
    folder = tmp_path_factory.mktemp("study")
    bundled("ant").export(folder / "ant.off")
    return run(folder, *SMALL), folder / "results" / "shot_noise" / "files"


@pytest.fixture
def folder(tmp_path):
    """An empty folder but for the ant."""
    bundled("ant").export(tmp_path / "ant.off")
    return tmp_path


def untimed(frame):
    return frame.drop(columns=list(TIMINGS))


def test_it_leaves_what_the_documentation_lists_and_nothing_else(small_study):
    done, results = small_study
    assert done.returncode == 0, done.stderr
    assert {path.name for path in results.iterdir()} == {
        "trials.jsonl", "trials.parquet", "table.csv", "table.md", "table.tex", "failures_and_seconds.csv",
        "failures_and_seconds.tex", "report.html",
        "shot_noise.png", "shot_noise.pdf", "gallery.png",
        "config.yaml", "provenance.json", "planned.txt", "labels",
    }  # fmt: skip
    assert {path.name for path in results.parents[2].iterdir()} == {"ant.off", "results"}


def test_the_rows_are_whole(small_study):
    _, results = small_study
    rows = pd.read_parquet(results / "trials.parquet")
    assert list(rows.columns) == [column.name for column in row_columns(Change)]
    assert len(rows) == 4
    assert (rows["status"] == "ok").all()
    assert (rows["change_percentage"] >= rows["van_dongen"]).all()
    assert rows[["n_segments", "n_vertices", "seconds_segment"]].gt(0).all(axis=None)


def test_the_table_is_the_mean_of_the_rows_beside_the_papers_figure(small_study):
    done, results = small_study
    rows, table = pd.read_parquet(results / "trials.parquet"), pd.read_csv(results / "table.csv")
    expected = rows.groupby("level")["change_percentage"].mean()
    np.testing.assert_allclose(table["mean"], expected, rtol=1e-5)
    assert table["paper"].fillna(0).tolist() == [3.61, 0]
    assert table["n"].tolist() == [2, 2]
    for value in expected:
        assert f"{value:.2f}" in done.stdout
        assert f"{value:.2f}" in (results / "table.md").read_text()


@pytest.mark.parametrize("name", ["shot_noise.png", "gallery.png"])
def test_the_pictures_show_something(small_study, name):
    pixels = np.asarray(Image.open(small_study[1] / name).convert("RGB")).reshape(-1, 3)
    colours = pixels @ np.array([2**16, 2**8, 1])
    white = (colours == 2**24 - 1).mean()
    assert 0.3 < white < 0.97
    assert len(np.unique(colours)) > 200


def test_provenance_says_with_what_and_from_what(small_study):
    provenance = json.loads((small_study[1] / "provenance.json").read_text())
    assert provenance["packages"]["numpy"] == np.__version__
    assert len(provenance["meshes_sha256"]["ant"]) == 64


def test_the_same_command_again_runs_nothing_and_changes_nothing(small_study):
    _, results = small_study
    before = {name: (results / name).read_bytes() for name in ("trials.jsonl", "table.csv", "table.md")}
    again = typed(results.parents[2], *SMALL)
    assert "4 of them stored already" in again.stdout
    assert before == {name: (results / name).read_bytes() for name in before}


@pytest.mark.parametrize(
    ("command", "engine"),
    [
        (typed, "engine=serial"),
        pytest.param(run, "engine.workers=1", marks=pytest.mark.slow),
        pytest.param(run, "engine.workers=4", marks=pytest.mark.slow),
    ],
)
def test_any_number_of_workers_gives_the_same_rows_and_table(small_study, folder, command, engine):
    rows = untimed(pd.read_parquet(small_study[1] / "trials.parquet"))
    done = command(folder, *SMALL, engine, "gallery.models=0")
    assert done.returncode == 0, done.stderr
    results = folder / "results" / "shot_noise" / "files"
    pd.testing.assert_frame_equal(untimed(pd.read_parquet(results / "trials.parquet")), rows)
    assert (results / "table.csv").read_bytes() == (small_study[1] / "table.csv").read_bytes()
    assert not (results / "gallery.png").exists()


def start_and_wait_for_rows(folder, words, count):
    """Start a study and wait until rows are stored: its process, and the file of the rows."""
    process = run(folder, *words, wait=False)
    stored = folder / "results" / "normal_noise" / "files" / "trials.jsonl"
    deadline = time.monotonic() + 120
    while not (stored.exists() and stored.read_bytes().count(b"\n") >= count):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.02)
    return process, stored


@pytest.mark.slow  # test_survival kills a quicker study at twenty moments
def test_a_killed_study_goes_on_where_it_was(folder):
    words = ("+study=normal_noise", *ANT, "repeats=60", "levels=[0.1]", "engine.workers=1")
    process, stored = start_and_wait_for_rows(folder, words, 5)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    kept = stored.read_bytes()
    assert kept.count(b"\n") < 60
    done = run(folder, *words)
    assert done.returncode == 0, done.stderr
    assert stored.read_bytes().startswith(kept)
    assert stored.read_bytes().count(b"\n") == 60
    assert pd.read_parquet(stored.parent / "trials.parquet")["repeat"].tolist() == list(range(60))


@pytest.mark.parametrize("engine", ["engine.workers=2", "engine=serial"])
def test_ctrl_c_keeps_what_is_done_and_shows_it(folder, engine):
    process, stored = start_and_wait_for_rows(
        folder, ("+study=normal_noise", *ANT, "repeats=2000", "levels=[0.1]", engine), 5
    )
    os.killpg(process.pid, signal.SIGINT)
    output, _ = process.communicate(timeout=60)
    assert process.returncode == 130, output
    assert "Traceback" not in output
    assert "continues from there" in output
    assert 5 <= pd.read_csv(stored.parent / "table.csv")["n"][0] < 2000


@pytest.mark.usefixtures("charts_as_text")
def test_a_failed_trial_is_counted_and_said_and_the_exit_code_tells(folder):
    (folder / "bad.off").write_text("OFF\n3 1 0\n0 0 0\n")
    done = typed(
        folder, "+study=holes", "dataset=files", "dataset.glob=*.off", "levels=[5]", "repeats=1", "gallery.models=0"
    )
    assert done.returncode == 1
    assert "1 of 2 trials failed" in done.stdout
    assert "bad.off: declares 3 vertices but contains 1: the file is truncated" in done.stdout
    assert not done.stderr
    rows = pd.read_parquet(folder / "results" / "holes" / "files" / "trials.parquet").set_index("model")
    assert rows["status"].to_dict() == {"bad": "failed", "ant": "ok"}


@pytest.mark.usefixtures("charts_as_text")
def test_a_sweep_gives_each_study_and_each_value_a_folder(folder):
    done = typed(folder, "-m", "+study=holes,normal_noise", "segmenter.time=0.5,1", *ANT, "levels=[1]", "repeats=1")
    assert done.returncode == 0, done.stderr
    found = {path.relative_to(folder / "results").parent.as_posix() for path in folder.rglob("table.csv")}
    assert found == {
        f"{study}/files/segmenter.time={time}" for study in ("holes", "normal_noise") for time in ("0.5", "1")
    }


@pytest.mark.usefixtures("charts_as_text")
def test_a_sweep_of_studies_alone_writes_where_single_runs_do(folder):
    done = typed(folder, "-m", "+study=holes,scaling", *ANT, "levels=[2]", "repeats=1")
    assert done.returncode == 0, done.stderr
    for study in ("holes", "scaling"):
        assert (folder / "results" / study / "files" / "table.csv").exists()


@pytest.mark.usefixtures("charts_as_text")
def test_a_sweep_goes_on_past_a_study_that_fails(folder):
    (folder / "bad.off").write_text("OFF\n3 1 0\n0 0 0\n")
    words = ("+study=scaling", "dataset=files", "gallery.models=0", "levels=[2]", "repeats=1")
    done = typed(folder, "-m", *words, "dataset.glob=none.off,bad.off,ant.off")
    assert done.returncode == 2
    *_, said, none, bad = done.stderr.splitlines()
    assert said == "2 of the sweep's studies failed, see above:"
    assert "dataset.glob=none.off" in none
    assert none.endswith(": did not run")
    assert "dataset.glob=bad.off" in bad
    assert bad.endswith(": some trials failed")
    table = folder / "results" / "scaling" / "files" / "dataset.glob=ant.off" / "table.csv"
    assert pd.read_csv(table)["mean"].tolist() == [0]


def test_help_lists_what_there_is(tmp_path):
    done = run(tmp_path, "--help")
    assert done.returncode == 0
    for word in ("\n  decimation ", "\n  psb ", "+study=NAME", "repeats: 3"):
        assert word in done.stdout


def test_help_calls_a_group_as_its_option_is_called(tmp_path):
    done = typed(tmp_path, "--help")
    assert "\n  publication: heat_walk_2011 " in done.stdout
    assert "\nstudy=\n  ablation  " in done.stdout
    assert "\n  custom  " in done.stdout
    assert "paper=" not in done.stdout


OWN_STUDY = """
# @package _global_
study:
  name: own
title: Own
axis: scale
levels: [2]
repeats: 1
perturbation:
  _target_: perturb.Scaling
segmenter:
  _target_: tests.helpers.segmenting.halves
"""


@pytest.mark.usefixtures("charts_as_text")
def test_a_study_in_a_folder_of_the_user_runs_and_says_how_to_run_it_again(folder):
    (folder / "conf" / "study").mkdir(parents=True)
    (folder / "conf" / "study" / "own.yaml").write_text(OWN_STUDY)
    done = typed(folder, "--config-dir", "conf", "+study=own", *ANT)
    assert done.returncode == 0, done.stderr
    results = folder / "results" / "own" / "files"
    assert pd.read_csv(results / "table.csv")["paper"].isna().all()
    assert "aper" not in (results / "table.md").read_text()
    command = json.loads((results / "provenance.json").read_text())["command"]
    assert command.endswith(" --config-dir conf")
    again = typed(folder, *shlex.split(command)[3:])
    assert "1 of them stored already" in again.stdout


@pytest.mark.parametrize("name", ["study/holes", "dataset/files", "segmenter/heat_walk"])
def test_a_file_of_the_user_that_hydra_would_ignore_is_a_mistake(folder, name):
    file = folder / "conf" / f"{name}.yaml"
    file.parent.mkdir(parents=True)
    file.write_text(OWN_STUDY)
    done = typed(folder, "--config-dir", "conf", "+study=holes", *ANT)
    assert done.returncode == 2
    group, _, own = name.partition("/")
    assert done.stderr == (
        f"studies.run: error: {file}: this project has a {group} {own!r} of its own; rename the file\n"
    )
    assert {path.name for path in folder.iterdir()} == {"ant.off", "conf"}


def test_a_study_that_has_nothing_to_run_is_a_mistake(folder):
    (folder / "empty.py").write_text(
        "from studies.datasets import Dataset\n"
        "class Empty(Dataset):\n    name = 'empty'\n    def models(self):\n        return []\n"
    )
    done = typed(folder, "+study=holes", "dataset=custom", "dataset._target_=empty.Empty")
    assert done.returncode == 2
    assert done.stderr == "studies.run: error: holes: there is nothing to run: the dataset empty has no models\n"
    assert not (folder / "results").exists()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (
            (),
            [
                "type +study=NAME",
                "NAME one of ablation, affine, anatomy, bending, ",
                "holes, leaderboard, local_scale, micro_holes",
            ],
        ),
        (("+study=shotnoise",), ["Could not find 'study/shotnoise'", "shot_noise"]),
        (("+study=holes", "dataset=pbs"), ["Could not find 'dataset/pbs'", "psb"]),
        (("+study=holes", "repeat=3"), ["Could not override 'repeat'", "repeats, results_dir, trial.timeout"]),
        (("+study=holes", "dataset=psb", "dataset.root=/nowhere"), ["segeval.cs.princeton.edu", "/nowhere"]),
        (("+study=holes", "dataset=files"), ["dataset.glob="]),
        (("+study=holes", "dataset.models=[cat]"), ["cat", "ant, bunny, cow"]),
        (("+study=holes", "levels=[-1]"), ["amount is -1"]),
        (("+study=holes", "perturbation.unit=acres"), ["unit is 'acres'; choose one of triangles"]),
        (("+study=holes", "engine.workers=0"), ["engine.workers is 0"]),
        (("+study=holes", "levels=[]"), ["levels is empty"]),
    ],
)
def test_a_mistake_gets_one_message_that_says_what_to_type(tmp_path, words, said):
    done = typed(tmp_path, *words)
    assert done.returncode == 2
    for word in said:
        assert word in done.stdout + done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())
