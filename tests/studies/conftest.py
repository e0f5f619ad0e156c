"""Compose the shipped configurations as the command line does, and run what they plan."""

import multiprocessing
import os
import subprocess
import sys
from tempfile import TemporaryFile

import pandas as pd
import pytest
from hydra import compose, initialize_config_module

from perturb import perturbation
from studies.columns import Column, dtypes
from studies.execution import Serial
from studies.execution import run_trials as rows_of
from studies.planning.trial import COLUMNS
from studies.run import main, run_study
from tests.helpers.meshes import bundled


@pytest.fixture
def composed():
    """A function: overrides -> the composed configuration."""

    def compose_with(*overrides):
        with initialize_config_module("conf", version_base="1.3"):
            return compose("config", list(overrides))

    return compose_with


# A study whose trials take no time.
STUDY = (
    "+study=normal_noise", "dataset=files", "dataset.glob=ant.off", "segmenter=custom",
    "segmenter._target_=tests.helpers.segmenting.halves", "gallery.models=0", "levels=[0.1,0.2]",
)  # fmt: skip


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The current folder, empty but for the ant."""
    bundled("ant").export(tmp_path / "ant.off")
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def own_modules(tmp_path, monkeypatch):
    """A folder for modules of the user's own, which this process forgets after the test, with what they registered."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(perturbation, "_REGISTRY", dict(perturbation._REGISTRY))
    yield tmp_path
    for name, module in list(sys.modules.items()):
        if (getattr(module, "__file__", None) or "").startswith(f"{tmp_path}{os.sep}"):
            del sys.modules[name]


@pytest.fixture
def study(here, composed):
    """A function: overrides -> whether every trial of ``STUDY`` gave a figure, run in this process."""

    def go(*words, results="results"):
        return run_study(composed(*STUDY, "engine=serial", f"results_dir={results}", *words))

    return go


fork = multiprocessing.get_context("fork")  # for processes of their own that have imported everything


def typed(folder, *words):
    """What ``python -m studies.run`` gives in a folder, with engine=serial if none is named: CompletedProcess."""
    if not any(word.startswith("engine") for word in words):
        words = (*words, "engine=serial")

    def command(said, complained):
        os.chdir(folder)
        os.environ["COLUMNS"] = "80"
        sys.argv, sys.stdout, sys.stderr = ["studies.run", *words], said, complained
        main()

    with TemporaryFile("w+") as said, TemporaryFile("w+") as complained:
        process = fork.Process(target=command, args=(said, complained))
        process.start()
        process.join()
        said.seek(0)
        complained.seek(0)
        return subprocess.CompletedProcess(words, process.exitcode, said.read(), complained.read())


@pytest.fixture
def run_trials():
    """A function: planned trials, an experiment's own columns -> the DataFrame of their rows, run in this process."""

    def run(planned, further=None):
        columns = dtypes([*COLUMNS, *(Column(name=name, dtype=dtype) for name, dtype in (further or {}).items())])
        return pd.DataFrame(list(rows_of(Serial(), planned)), columns=list(columns)).astype(columns)

    return run
