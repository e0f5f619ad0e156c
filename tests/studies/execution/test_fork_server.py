"""The process that workers are forked from starts with the command, and ends with it."""

import os
import signal
import subprocess
import sys
import time

import psutil
import pytest

from studies.execution import fork_server
from studies.execution.fork_server import HEAD, START_METHOD, _needs_workers
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
def test_it_is_safe_from_ctrl_c_from_its_beginning_and_leaves_it_to_the_programs_of_workers():
    code = (
        "import time; from multiprocessing import forkserver; from pathlib import Path\n"
        "from studies.execution.fork_server import process_context\n"
        "def masks():\n"
        "    status = Path(f'/proc/{forkserver._forkserver._forkserver_pid}/status').read_text()\n"
        "    masks = dict(line.split(':') for line in status.splitlines())\n"
        "    return [int(masks[name], 16) >> 1 & 1 for name in ('SigBlk', 'SigIgn')]\n"
        "process_context()\n"
        "print(masks())\n"
        "while not masks()[1]: time.sleep(0.01)\n"
        "while masks()[0]: time.sleep(0.01)\n"
        "print(masks())"
    )
    words = [sys.executable, "-c", code]
    done = subprocess.run(words, env=os.environ, capture_output=True, text=True, check=True, timeout=60)
    assert done.stdout == "[1, 0]\n[0, 1]\n"


@needs_fork
def test_ctrl_c_that_is_pressed_while_it_is_started_is_noticed_afterwards():
    done = []

    def start():
        with fork_server._ctrl_c_later():
            signal.raise_signal(signal.SIGINT)
            done.append("started")

    with pytest.raises(KeyboardInterrupt):
        start()
    assert done == ["started"]


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


@pytest.mark.parametrize(("is_head", "expected"), [(True, "all imported\n"), (False, "")])
def test_it_imports_no_further_once_the_process_that_it_is_for_has_ended(is_head, expected):
    environment = os.environ | {HEAD: str(os.getpid() if is_head else os.getppid())}
    code = "import os, studies.execution.preload; print('all imported')"
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == expected
