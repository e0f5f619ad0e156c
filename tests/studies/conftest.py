"""Compose the shipped configurations as the command line does, and run what they plan."""

import io
import multiprocessing
import os
import subprocess
import sys
from tempfile import TemporaryFile

import pandas as pd
import pytest
from hydra import compose, initialize_config_module
from rich.console import Console

from perturb import perturbation
from studies.columns import dtypes
from studies.execution import Serial, run_trials
from studies.execution.study import run_study
from studies.experiments.experiment import row_columns
from studies.planning.configuration import configure
from studies.run import main
from tests.helpers.meshes import bundled


@pytest.fixture
def composed():
    """A function: overrides -> the composed configuration."""

    def compose_with(*overrides):
        with initialize_config_module("conf", version_base="1.3"):
            return compose("config", list(overrides))

    return compose_with


@pytest.fixture
def configured():
    """A function: overrides -> the Study."""

    def configure_with(*overrides):
        with initialize_config_module("conf", version_base="1.3"):
            return configure(compose("config", list(overrides)), overrides)

    return configure_with


@pytest.fixture
def plan(configured):
    """A function: overrides -> the trials of the study."""
    return lambda *overrides: configured(*overrides).plan()


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
def console():
    """A console whose output is printed where pytest captures it."""
    return Console()


@pytest.fixture
def study(here, configured):
    """A function: overrides -> whether every trial of ``STUDY`` succeeded, run in this process."""

    def run(*words, results="results"):
        chosen = configured(*STUDY, "engine=serial", f"results_dir={results}", *words)
        return run_study(chosen, Console()).complete

    return run


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
def rows_of():
    """A function: trials, their experiment -> the DataFrame of their rows, run in this process."""

    def run(trials, experiment):
        types = dtypes(row_columns(experiment))
        return pd.DataFrame(run_trials(Serial(), trials), columns=list(types)).astype(types)

    return run


def printed(function):
    """What ``function(console)`` prints on a wide console."""
    written = io.StringIO()
    function(Console(file=written, width=200))
    return written.getvalue()
