"""The process that workers are forked from starts with the command, and ends with it."""

import os
import signal
import subprocess
import sys
import threading
import time

import psutil
import pytest

from studies.execution import fork_server
from studies.execution.fork_server import START_METHOD, _needs_workers
from tests.studies.conftest import STUDY

needs_fork = pytest.mark.skipif(START_METHOD != "forkserver", reason="workers are not forked")


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        (["+study=holes"], True),
        (["study=holes", "engine=local", "engine.workers=2", "dry_run=false"], True),
        (["-m", "+study=holes,shot_noise"], True),
        ([], False),
        (["+study=holes", "engine=serial"], False),
        (["+study=holes", "engine=dask", "engine.workers=2"], False),
        (["+study=holes", "+engine._target_=my.Engine"], False),
        (["+study=holes", "dry_run=True"], False),
        (["+study=holes", "--cfg", "job"], False),
        (["+study=holes", "hydra.job.env_set.A=1"], False),
        (["--help"], False),
    ],
)
def test_it_starts_ahead_where_a_command_looks_as_if_it_needed_workers(arguments, expected):
    assert _needs_workers(arguments) is expected


def test_what_every_worker_imports_again_imports_no_library():
    code = (
        "import sys, studies.run; print({'hydra', 'numpy', 'omegaconf', 'psutil', 'rich', 'yaml'} & set(sys.modules))"
    )
    done = subprocess.run([sys.executable, "-c", code], env=os.environ, capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"


@needs_fork
def test_it_ignores_ctrl_c_from_its_beginning():
    code = (
        "from multiprocessing import forkserver; from pathlib import Path\n"
        "from studies.execution.fork_server import process_context\n"
        "process_context()\n"
        "print(Path(f'/proc/{forkserver._forkserver._forkserver_pid}/status').read_text())"
    )
    done = subprocess.run([sys.executable, "-c", code], env=os.environ, capture_output=True, text=True, check=True)
    (ignored,) = [line.split()[1] for line in done.stdout.splitlines() if line.startswith("SigIgn")]
    assert int(ignored, 16) >> (signal.SIGINT - 1) & 1


def test_afterwards_ctrl_c_does_what_it_did():
    before = signal.getsignal(signal.SIGINT)
    with fork_server._without_ctrl_c():
        assert signal.getsignal(signal.SIGINT) is signal.SIG_IGN
    assert signal.getsignal(signal.SIGINT) is before


def test_other_threads_leave_ctrl_c_as_it_is():
    found = []

    def note():
        with fork_server._without_ctrl_c():
            found.append(signal.getsignal(signal.SIGINT))

    thread = threading.Thread(target=note)
    thread.start()
    thread.join()
    assert found == [signal.getsignal(signal.SIGINT)]


@needs_fork
@pytest.mark.parametrize("words", [["levels=[a]"], ["no_such_option=1"]])
def test_a_command_with_a_mistake_leaves_no_process_behind(here, words):
    command = [sys.executable, "-m", "studies.run", *STUDY, *words]
    process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, start_new_session=True)
    said = process.communicate(timeout=120)[1]
    assert process.returncode == 2
    assert "Traceback" not in said
    deadline = time.monotonic() + 60
    while (left := of_session(process.pid)) and time.monotonic() < deadline:
        time.sleep(0.1)
    assert left == []


def of_session(session):
    """The processes of a session."""
    found = []
    for pid in psutil.pids():
        try:
            if os.getsid(pid) == session:
                found.append(pid)
        except ProcessLookupError:
            continue
    return found
