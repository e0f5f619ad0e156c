"""Mistakes in an experiment, a study or a dataset of the user's own: what is lost, and what to do, in one line."""

from importlib import import_module

import pandas as pd
import pytest
from rich.console import Console

from studies.datasets import DatasetError
from studies.execution.study import run_study
from studies.planning.errors import StudyError
from studies.planning.types import wrong_types
from studies.reporting.write import DrawingError
from tests.studies.conftest import typed

MODULE = """
from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import trimesh
from heatwalk import LoadedMesh
from studies.columns import Column, Table
from studies.datasets import Dataset, Model
from studies.experiments import Experiment
from studies.planning.fingerprint import digest
from studies.planning.trial import Trial


@dataclass(frozen=True, kw_only=True)
class OwnTrial(Trial):
    values: tuple[str, ...]

    def prepare(self):
        return None

    def measure(self, prepared):
        return {"n_vertices": 3, "kept": np.zeros(3)} | dict.fromkeys(self.values, 0.5)


@dataclass(frozen=True, kw_only=True)
class Own(Experiment):
    values: Sequence[str] = ()
    fails: str = ""
    depth: int = None

    columns: ClassVar[tuple[Column, ...]] = (Column(name="flatness", help="How flat."),)

    def plan(self, study, dataset, segmenters):
        return [
            OwnTrial(study=study, dataset=dataset.name, part=study, model=model, mesh_digest="",
                     segmenter_name="none", group_key="", trial_id=digest(model.name)[:24], values=tuple(self.values))
            for model in dataset.models()
        ]

    def tables(self, rows):
        return [Table("table", rows[["model"]], (Column(name="model", dtype="string", help="Model."),))]

    def charts(self, study, tables, rows, title):
        if self.fails == "charts":
            raise KeyError("legs")
        return {}

    def pictures(self, study, trials, rows, title, labels):
        if self.fails == "pictures":
            raise KeyError("legs")
        return ()


@dataclass(frozen=True)
class Ball(Model):
    def load(self):
        mesh = trimesh.creation.icosphere(1)
        return LoadedMesh(np.array(mesh.vertices), np.array(mesh.faces), ())

    def digest(self):
        return hashlib.sha256(self.name.encode()).hexdigest()


class Balls(Dataset):
    name = "balls"

    def __init__(self, radii: Sequence[float] = (1.0,), size: Undefined = 1):
        self.radii = radii

    def models(self):
        return [Ball(f"ball-{radius:g}", "ball") for radius in self.radii]


class SizedBalls(Balls):
    def __init__(self, radii: Sequence[float] = (1.0,), seed: int = None):
        self.radii = radii
"""

OWN = ("+study=custom", "study.name=own", "experiment._target_=own_study.Own", "engine=serial", "results_dir=mine")
ANT = ("dataset=files", "dataset.glob=ant.off")
BALLS = ("dataset=custom", "dataset._target_=own_study.SizedBalls")


@pytest.fixture
def run(here, own_modules, configured):
    """A function: overrides -> what a study with an experiment of the user's own, run in this process, amounts to."""
    (here / "own_study.py").write_text(MODULE)
    return lambda *words, data=ANT: run_study(configured(*OWN, *data, *words), Console(quiet=True)).results


def test_a_value_without_a_column_makes_its_trial_fail_and_is_named(run):
    rows = run("+experiment.values=[roughness,flatness,angle]").rows
    assert rows["status"].tolist() == ["failed"]
    assert rows["error"].tolist() == [
        "measure() returns roughness, angle: declare a Column in the experiment's `columns`"
    ]
    assert rows[["n_vertices", "flatness"]].isna().all(axis=None)


def test_declared_values_and_arrays_need_no_more(run):
    rows = run("+experiment.values=[flatness]").rows
    assert rows[["status", "n_vertices", "flatness"]].values.tolist() == [["ok", 3, 0.5]]


@pytest.mark.parametrize("what", ["charts", "pictures"])
def test_an_error_in_drawing_says_that_rows_and_tables_are_written_and_where(run, here, what):
    message = rf"^the {what} of Own failed with KeyError: 'legs'; rows and tables are written to mine.own.files$"
    with pytest.raises(DrawingError, match=message):
        run(f"+experiment.fails={what}")
    assert pd.read_parquet(here / "mine" / "own" / "files" / "trials.parquet")["status"].tolist() == ["ok"]
    assert (here / "mine" / "own" / "files" / "table.csv").exists()
    run()  # once it is repaired, nothing runs again


def test_a_study_whose_file_lacks_its_first_line_is_told_so(here):
    folder = here / "conf" / "study"
    folder.mkdir(parents=True)
    text = "study:\n  name: mine\ntitle: Mine\nlevels: [2]\nperturbation:\n  _target_: perturb.Scaling\n"
    (folder / "mine.yaml").write_text(text)
    done = typed(here, "--config-dir", "conf", "+study=mine", *ANT, "dry_run=true")
    assert done.returncode == 2
    assert "error: the first line of mine.yaml must be `# @package _global_`" in done.stderr
    (folder / "mine.yaml").write_text("# @package _global_\n" + text)
    assert typed(here, "--config-dir", "conf", "+study=mine", *ANT, "dry_run=true").returncode == 0


@pytest.mark.parametrize(
    ("data", "word", "message"),
    [
        (ANT, "+experiment.depth=deep", r"^depth is 'deep': it must be a whole number$"),
        (ANT, "+experiment.values=5", r"^values is 5: it must be a list of texts \[a,b\]$"),
        (BALLS, "+dataset.radii=5", r"^dataset.radii is 5: it must be a list of numbers \[a,b\]$"),
        (BALLS, "+dataset.seed=x", r"^dataset.seed is 'x': it must be a whole number$"),
    ],
)
def test_options_of_the_users_own_datasets_and_experiments_have_the_types_they_declare(run, data, word, message):
    with pytest.raises((StudyError, DatasetError), match=message):
        run(word, data=data)


def test_values_that_are_right_are_taken_and_so_is_a_default_of_another_type(here, own_modules, monkeypatch):
    (here / "own_study.py").write_text(MODULE)
    monkeypatch.syspath_prepend(here)
    own_study = import_module("own_study")
    assert wrong_types(own_study.SizedBalls, {"radii": [1, 2.5], "seed": None}) == {}
    assert wrong_types(own_study.Own, {"depth": None, "values": ["a"], "fails": 3}) == {"fails": "text"}
    assert wrong_types(own_study.Balls, {"radii": 5}) == {}  # one of its annotations means nothing
