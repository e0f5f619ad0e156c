"""What the table of a study needs is imported while workers run its trials."""

import contextlib
import dataclasses
import io
import os
import subprocess
import sys
import threading
import time
from importlib import import_module

import pytest
from rich.console import Console

from studies.execution import imports_ahead
from studies.execution.imports_ahead import ImportsAhead
from studies.execution.serial import Serial
from studies.execution.study import run_study
from tests.studies.conftest import STUDY

pytestmark = pytest.mark.usefixtures("charts_as_text")

SLOW = "import time\ntime.sleep(0.5)\n"


@pytest.fixture
def study(here, configured):
    """A study whose trials take no time."""
    return configured(*STUDY, "engine=serial", "results_dir=results")


@pytest.fixture
def modules(tmp_path, monkeypatch):
    """A function that writes modules, which are forgotten after the test."""
    written = []

    def write(**codes):
        for name, code in codes.items():
            (tmp_path / f"{name}.py").write_text(code)
            written.append(name)

    monkeypatch.syspath_prepend(str(tmp_path))
    yield write
    for name in written:
        sys.modules.pop(name, None)


def threads():
    return [thread for thread in threading.enumerate() if thread.name == "imports ahead"]


def test_modules_are_imported_in_a_thread_that_ends_with_the_context(modules):
    modules(early="import threading\nTHREAD = threading.current_thread()\n", late="")
    with ImportsAhead(["early", "late"]) as ahead:
        assert "early" not in sys.modules
        ahead.start()
        deadline = time.monotonic() + 60
        while "late" not in sys.modules and time.monotonic() < deadline:
            time.sleep(0.01)
    assert sys.modules["early"].THREAD.name == "imports ahead"
    assert not threads()


def test_a_thread_that_never_started_is_not_waited_for():
    with ImportsAhead(["early"]):
        pass
    assert not threads()


@pytest.mark.parametrize("error", ["ImportError('no library')", "SystemExit('no licence')"])
def test_what_needs_a_module_that_cannot_be_imported_gets_its_error(modules, error):
    modules(broken=f"raise {error}", behind="")
    with ImportsAhead(["broken", "behind"]) as ahead:
        ahead.start()
    assert "behind" not in sys.modules
    with pytest.raises((ImportError, SystemExit), match=r"no library|no licence"):
        import_module("broken")


def test_only_the_module_that_is_being_imported_is_waited_for_when_the_block_is_interrupted(modules):
    modules(slow=SLOW, behind="")

    def import_and_interrupt():
        with ImportsAhead(["slow", "behind"]) as ahead:
            ahead.start()
            while "slow" not in sys.modules:
                time.sleep(0.01)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        import_and_interrupt()
    assert not threads()
    assert "behind" not in sys.modules
    assert import_module("slow").time is time


class Interrupted:
    """An engine with workers elsewhere, during whose first task the user presses Ctrl-C."""

    remote = False
    processes = 1

    def __init__(self):
        self.threads = []

    def warm_up(self):
        pass

    def active(self):
        return []

    @contextlib.contextmanager
    def open(self, function):
        yield self

    @property
    def pending(self):
        return 1

    def has_room(self):
        return False

    def wait(self):
        self.threads = threads()
        raise KeyboardInterrupt


def test_a_study_that_is_interrupted_meanwhile_ends_as_any_other(study, modules, monkeypatch):
    modules(slow=SLOW)
    monkeypatch.setattr(imports_ahead, "OF_TABLE", ("slow",))
    engine, shown = Interrupted(), io.StringIO()
    outcome = run_study(dataclasses.replace(study, engine=engine), Console(file=shown))
    assert outcome.interrupted
    assert len(engine.threads) == 1
    assert not threads()
    assert "the same command continues from there" in shown.getvalue()
    whole = run_study(dataclasses.replace(study, engine=Serial()), Console(quiet=True))
    assert whole.complete


def test_the_serial_engine_leaves_no_time_and_imports_nothing_ahead(study, modules, monkeypatch):
    modules(early="")
    monkeypatch.setattr(imports_ahead, "OF_TABLE", ("early",))
    assert run_study(dataclasses.replace(study, engine=Serial()), Console(quiet=True)).complete
    assert "early" not in sys.modules


def test_a_library_of_the_table_that_cannot_be_imported_is_a_mistake_that_is_named(here):
    (here / "pandas.py").write_text("raise ImportError('this pandas is broken')")
    words = [sys.executable, "-m", "studies.run", *STUDY, "engine.workers=1", "results_dir=results"]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(here), *sys.path])}
    done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=300)
    assert done.returncode == 2
    assert done.stderr == ("studies.run: error: ImportError: this pandas is broken (HYDRA_FULL_ERROR=1 shows where)\n")
    (rows,) = here.rglob("trials.jsonl")
    assert rows.read_text().count('"status": "ok"') == rows.read_text().count("\n") > 0
