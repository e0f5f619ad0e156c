import os
import subprocess
import sys

import psutil
import pytest

from studies.execution.process_tree import find_families, kill_processes, resident_memory, split_supervised, supervised
from studies.execution.supervise_program import wait_until_ended
from tests.studies.execution.engines import runs, wait_for

SLEEP = "import time; time.sleep(600)"

# Starts a process that has a session of its own, and whose parent ends: nothing but its environment connects them.
DETACH = f"""
import os, subprocess, sys
sleep = [sys.executable, "-c", {SLEEP!r}]
code = f"import subprocess; print(subprocess.Popen({{sleep}}, start_new_session=True, stdout=-3, stderr=-3).pid)"
print(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout, os.getpid(), flush=True)
"""


def start_supervised(folder, code):
    """A supervised program: the process that supervises it, and the ids that the program prints."""
    process = subprocess.Popen(
        supervised([sys.executable, "-c", code], folder), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    return process, [int(word) for word in " ".join(process.stdout.readline() for _ in range(2)).split()]


@pytest.mark.parametrize("ending", ["", SLEEP])
def test_a_process_that_a_program_has_detached_ends_with_it_or_with_the_process_that_asked_for_it(ending, tmp_path):
    folder = tmp_path / "own"
    folder.mkdir()
    process, pids = start_supervised(folder, DETACH + ending)
    assert len(pids) == 2
    if ending:
        assert all(map(runs, pids))
        process.stdin.close()
        assert process.wait() == 1
        assert not folder.exists()
    else:
        assert process.wait() == 0
        assert folder.exists()
    wait_for(lambda: not any(map(runs, pids)))


@pytest.mark.parametrize(
    ("code", "exit_code"), [("", 0), ("import sys; sys.exit(7)", 7), ("import os; os.abort()", 134)]
)
def test_a_supervised_program_has_its_own_exit_code(code, exit_code, tmp_path):
    with subprocess.Popen(supervised([sys.executable, "-c", code], tmp_path), stdin=subprocess.PIPE) as process:
        assert process.wait() == exit_code


def test_a_program_that_does_not_exist_has_the_exit_code_of_a_shell(tmp_path):
    words = supervised([str(tmp_path / "no program")], tmp_path)
    done = subprocess.run(words, input="", capture_output=True, text=True)
    assert done.returncode == 127
    assert done.stderr == f"{tmp_path / 'no program'}: No such file or directory\n"


def test_a_family_is_a_process_with_its_descendants_parents_first(tmp_path):
    code = f"import subprocess, sys; p = subprocess.Popen([sys.executable, '-c', {SLEEP!r}]); print(p.pid); "
    code += "sys.stdout.flush(); p.wait()"
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    child = int(process.stdout.readline())
    try:
        families = find_families({process.pid, os.getpid(), 1})
        assert [member.pid for member in families[process.pid]] == [process.pid, child]
        assert families.keys() == {process.pid}  # neither this process nor one that is not its descendant
        assert resident_memory(families[process.pid]) > 2**20
    finally:
        kill_processes(families[process.pid])
    process.wait()
    wait_for(lambda: not runs(child))
    assert resident_memory(families[process.pid]) == 0


def test_supervisors_are_told_from_the_programs_that_nobody_supervises(tmp_path):
    process, _ = start_supervised(tmp_path, f"print(1)\nprint(2, flush=True)\n{SLEEP}")
    other = subprocess.Popen([sys.executable, "-c", SLEEP])
    descendants = psutil.Process().children(recursive=True)
    ours = [member for member in descendants if member.pid in (process.pid, other.pid) or member.ppid() == process.pid]
    plain, supervisors = split_supervised(ours)
    assert [member.pid for member in supervisors] == [process.pid]
    assert [member.pid for member in plain] == [other.pid]
    other.kill()
    other.wait()
    process.communicate()


def test_a_process_that_nobody_collects_has_ended():
    process = subprocess.Popen([sys.executable, "-c", ""], stdin=subprocess.PIPE)
    with subprocess.Popen([sys.executable, "-c", SLEEP]) as sleeping:
        both = [psutil.Process(process.pid), psutil.Process(sleeping.pid)]
        assert wait_until_ended(both[:1], 60) == []
        assert both[0].status() == psutil.STATUS_ZOMBIE
        assert wait_until_ended(both, 0.1) == both[1:]
        sleeping.kill()
    process.communicate()
    assert wait_until_ended(both, 0) == []
