"""Compose the shipped configurations as the command line does, and run what they plan."""

import functools
import gc
import hashlib
import io
import multiprocessing
import os
import pickle
import runpy
import shutil
import subprocess
import sys
from tempfile import TemporaryFile

import pandas as pd
import pytest
from hydra import initialize_config_module
from hydra._internal.hydra import Hydra
from rich.console import Console

from perturb import perturbation
from studies.columns import dtypes
from studies.execution import Serial, run_trials
from studies.execution.study import run_study
from studies.experiments.experiment import row_columns
from studies.figures import drawing
from studies.figures.charts import Chart
from studies.planning.configuration import configure
from studies.run import main
from studies.storage import atomic_write
from tests.helpers.composing import composition, files_read_once, read_ahead
from tests.helpers.meshes import bundled
from tests.helpers.terminal import import_all


@pytest.fixture(scope="session", autouse=True)
def draw_charts_once(tmp_path_factory):
    """A chart that a test has drawn is copied where the same chart is drawn again: most tests show the same numbers."""
    folder = tmp_path_factory.getbasetemp()
    folder = (folder.parent if "PYTEST_XDIST_WORKER" in os.environ else folder) / "charts"
    draw, save = drawing.draw, drawing.save

    def copy_or_save(figure, path, content=None):
        if not isinstance(figure, Chart):
            save(figure, path, content)
            return
        drawn = folder / f"{hashlib.sha256(pickle.dumps(figure)).hexdigest()}.png"
        if not drawn.with_suffix(".pdf").exists():
            folder.mkdir(exist_ok=True)
            save(draw(figure), drawn)
        for suffix in (".png", ".pdf"):
            with atomic_write(path.with_suffix(suffix)) as part:
                shutil.copyfile(drawn.with_suffix(suffix), part)

    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(drawing, "draw", lambda chart: chart)
        monkeypatch.setattr(drawing, "save", copy_or_save)
        yield


@pytest.fixture
def charts_as_text(monkeypatch):
    """Charts are written as text, for tests of rows, messages and folders: others draw the charts of every study."""
    save = drawing.save

    def write_or_save(figure, path, content=None):
        if not isinstance(figure, Chart):
            save(figure, path, content)
            return
        for suffix in (".png", ".pdf"):
            path.with_suffix(suffix).write_text(str(figure), "utf-8")

    monkeypatch.setattr(drawing, "draw", lambda chart: chart)
    monkeypatch.setattr(drawing, "save", write_or_save)


@pytest.fixture(scope="session", autouse=True)
def wait_for_no_disk():
    """Files are not forced to the disk, which takes milliseconds each: only a loss of power would show a difference."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(os, "fsync", os.fstat)  # which refuses the same descriptors
        yield


@pytest.fixture(autouse=True)
def search_path_of_its_own(monkeypatch):
    """Studies add the current folder to ``sys.path``: after hundreds of tests every import would search hundreds."""
    monkeypatch.setattr(sys, "path", list(sys.path))


@pytest.fixture(scope="session", autouse=True)
def read_configurations_once():
    """Composing a configuration takes most of the time of a command that has little to do."""
    with files_read_once():
        yield


@pytest.fixture
def composed():
    """A function: overrides -> the composed configuration."""

    def compose_with(*overrides):
        with initialize_config_module("conf", version_base="1.3"):
            return composition(overrides)

    return compose_with


def configured_with(*overrides):
    with initialize_config_module("conf", version_base="1.3"):
        return configure(composition(overrides), overrides)


@pytest.fixture
def configured():
    """A function: overrides -> the Study."""
    return configured_with


@pytest.fixture
def plan(configured):
    """A function: overrides -> the trials of the study."""
    return lambda *overrides: configured(*overrides).plan()


# A study whose trials take no time.
STUDY = (
    "+study=normal_noise", "dataset=files", "dataset.glob=ant.off", "segmenter=custom",
    "segmenter._target_=tests.helpers.segmenting.halves", "gallery.models=0", "levels=[0.1,0.2]",
)  # fmt: skip


@functools.cache
def ant():
    """The ant as an OFF file."""
    return bundled("ant").export(file_type="off")


@pytest.fixture
def here(tmp_path, monkeypatch):
    """The current folder, empty but for the ant."""
    (tmp_path / "ant.off").write_text(ant())
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # see `own_modules`
    return tmp_path


@pytest.fixture
def own_modules(tmp_path, monkeypatch):
    """A folder for modules of the user's own, which this process forgets after the test, with what they registered."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    # A module that a test writes again, as long as before and within a second, would be taken for the compiled one.
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
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


CHOICES = ("+study", "dataset", "segmenter", "engine")  # options that choose files

fork = multiprocessing.get_context("fork")  # for processes of their own that have imported everything


import_everything = functools.cache(import_all)  # once, for all processes that are forked from this one


def typed(folder, *words):
    """What ``python -m studies.run`` gives in a folder, with engine=serial if none is named: CompletedProcess."""
    if not any(word.startswith("engine") for word in words):
        words = (*words, "engine=serial")

    def command():
        Hydra.get_mode = lambda *_, **__: None  # it composes everything to read hydra.mode, which nobody types here
        main.__globals__["start_for_command"] = lambda _: None  # see `in_fork`
        main()

    read_ahead(*(word for word in words if word.partition("=")[0] in CHOICES and "," not in word))
    return in_fork(folder, command, "studies.run", *words)


def typed_command(folder, module, *words, columns="80", encoding="utf-8"):
    """What ``python -m MODULE`` gives in a folder, on a terminal of so many columns: CompletedProcess."""

    def command():
        sys.modules.pop(module, None)  # it runs as __main__
        runpy.run_module(module, run_name="__main__", alter_sys=True)

    return in_fork(folder, command, module, *words, columns=columns, encoding=encoding)


def in_fork(folder, command, *words, columns="80", encoding="utf-8"):
    """What a function prints in a process that is forked from this one, and its exit code: CompletedProcess.

    Its streams are those of an interpreter with the encoding, and what follows its colon, in ``PYTHONIOENCODING``. It
    cannot start worker processes: multiprocessing would look for the helpers that this process has started.
    """
    import_everything()

    def run(said, complained):
        gc.freeze()  # what this process has imported is not looked through again
        os.chdir(folder)
        sys.path.insert(0, str(folder))  # as of an interpreter that is started there
        os.environ |= {"COLUMNS": columns, "PYTHONIOENCODING": encoding}
        sys.argv, sys.stdout, sys.stderr = list(words), said, complained
        command()

    name, _, errors = encoding.partition(":")
    with (
        TemporaryFile("w+", encoding=name, errors=errors or "strict") as said,
        TemporaryFile("w+", encoding=name, errors="backslashreplace") as complained,
    ):
        process = fork.Process(target=run, args=(said, complained))
        process.start()
        process.join()
        said.seek(0)
        complained.seek(0)
        return subprocess.CompletedProcess(words, process.exitcode, said.read(), complained.read())


def frame_of_rows(trials, experiment):
    """The DataFrame of the rows of trials, run in this process."""
    types = dtypes(row_columns(experiment))
    return pd.DataFrame(run_trials(Serial(), trials), columns=list(types)).astype(types)


@pytest.fixture
def rows_of():
    """A function: trials, their experiment -> the DataFrame of their rows, run in this process."""
    return frame_of_rows


def printed(function):
    """What ``function(console)`` prints on a wide console."""
    written = io.StringIO()
    function(Console(file=written, width=200))
    return written.getvalue()
