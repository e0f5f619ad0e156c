"""A real scheduler and three workers, processes of their own, over TCP on loopback."""

import json
import os
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path

import psutil
import pytest

from studies.datasets.files import FileModel
from studies.execution import Serial, TaskFailure, map_ordered, run_trials
from studies.execution.interruption import keep_ctrl_c
from studies.planning.trial import COLUMNS, TIMINGS
from tests.helpers.meshes import bundled
from tests.studies.conftest import STUDY
from tests.studies.execution.engines import (
    abort_at_three,
    blas_threads,
    completed,
    hang_at_three,
    kill_the_dask_worker_at_three,
    outcomes_of,
    process,
    runs,
    square,
    wait_for,
)

pytest.importorskip("distributed", reason="the extra 'dask' is not installed")

import distributed

from studies.execution import Dask

PROJECT = str(Path(__file__).parents[3])
ALLOWED_FAILURES = 1  # how many workers a task may lose


def start(folder, *words):
    command = [sys.executable, "-m", "dask", *words]
    environment = os.environ | {
        "PYTHONPATH": PROJECT,  # as if it was installed
        "DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES": str(ALLOWED_FAILURES),
    }
    with (folder / f"{words[0]}-{len(list(folder.iterdir()))}.log").open("wb") as log:
        return subprocess.Popen(command, cwd=folder, env=environment, stdout=log, stderr=log, start_new_session=True)


def start_worker(folder):
    """A nanny and its worker."""
    return start(folder, "worker", "--scheduler-file", "scheduler.json", "--nthreads", "1", "--no-dashboard")


def n_workers(address):
    with distributed.Client(address, set_as_default=False) as client:
        return len(client.nthreads())


@pytest.fixture(scope="module")
def scheduler(tmp_path_factory):
    """A scheduler's address, its workers, and the folder of its file; tests may end two of the workers."""
    folder = tmp_path_factory.mktemp("dask")
    words = ("--host", "127.0.0.1", "--port", "0", "--no-dashboard", "--scheduler-file", "scheduler.json")
    programs = [start(folder, "scheduler", *words)]
    wait_for((folder / "scheduler.json").exists)
    programs += [start_worker(folder) for _ in range(3)]
    address = json.loads((folder / "scheduler.json").read_text())["address"]
    wait_for(lambda: n_workers(address) == 3)
    yield address, programs[1:], folder
    for program in programs:
        os.killpg(program.pid, signal.SIGTERM)
    for program in programs:
        program.wait()


def test_every_task_gets_its_own_outcome(scheduler):
    engine = Dask(scheduler[0])
    assert outcomes_of(engine, square, range(30)) == {x: x * x for x in range(30)}
    assert engine.active() == []


def test_work_is_done_by_processes_of_the_workers_with_one_blas_thread_each(scheduler):
    pids = {pid for _, pid in completed(Dask(scheduler[0]), process, range(12))}
    assert len(pids) == n_workers(scheduler[0])
    assert os.getpid() not in pids
    assert {n for _, n in completed(Dask(scheduler[0]), blas_threads, [0])} == {1}


def test_a_task_that_crashes_or_hangs_costs_itself_only_and_no_worker(scheduler):
    outcomes_of(Dask(scheduler[0]), square, range(8))  # the workers start their processes
    before = {child.pid for worker in scheduler[1] for child in psutil.Process(worker.pid).children()}
    outcomes = outcomes_of(Dask(scheduler[0]), abort_at_three, range(8))
    assert outcomes.pop(3) == TaskFailure("crashed", "its process died with exit code -6")
    assert outcomes == {x: x for x in range(8) if x != 3}
    outcomes = outcomes_of(Dask(scheduler[0], timeout=1), hang_at_three, range(8))
    assert outcomes.pop(3) == TaskFailure("timeout", "took longer than trial.timeout=1 seconds")
    assert outcomes == {x: x for x in range(8) if x != 3}
    assert before == {child.pid for worker in scheduler[1] for child in psutil.Process(worker.pid).children()}


def test_a_worker_finds_the_modules_that_the_head_process_finds(scheduler, own_modules):
    (own_modules / "only_the_head_has_it.py").write_text("def cube(x):\n    return x**3\n")
    sys.path.insert(0, str(own_modules))
    import only_the_head_has_it

    assert outcomes_of(Dask(scheduler[0]), only_the_head_has_it.cube, [2, 3]) == {2: 8, 3: 27}


def slowly(task):
    x, folder = task
    open(os.path.join(folder, f"{os.getpid()}"), "w").close()
    time.sleep(0.15)
    return x * x


def test_a_worker_that_is_killed_costs_nothing(scheduler, tmp_path):
    address, workers, _ = scheduler
    n = n_workers(address)
    tasks = [(x, str(tmp_path)) for x in range(24)]
    results = completed(Dask(address), slowly, tasks)
    outcomes = dict(next(results) for _ in range(4))
    wait_for(lambda: len(list(tmp_path.iterdir())) == n)
    os.killpg(workers[0].pid, signal.SIGKILL)  # the nanny; its worker is in another session
    victims = [path.name for path in tmp_path.iterdir()]
    outcomes |= dict(results)
    assert outcomes == {(x, path): x * x for x, path in tasks}
    assert len(victims) == n > 1


@pytest.mark.slow  # three workers start one after the other
def test_a_task_that_kills_one_worker_after_the_other_is_given_up_and_the_others_go_on(scheduler):
    outcomes = {}
    with Dask(scheduler[0]).open(kill_the_dask_worker_at_three) as session:
        for x in (2, 3, 4, 5):
            session.submit(x)
            while session.pending:
                outcomes |= session.wait()
    assert outcomes == {2: 2, 3: TaskFailure("crashed", "the worker that ran it died, 2 times"), 4: 4, 5: 5}


def test_it_says_which_tasks_the_workers_have(scheduler):
    engine = Dask(scheduler[0])
    seen = set()
    for _ in completed(engine, process, range(8)):
        seen.update(engine.active())
        assert len(engine.active()) <= 4
    assert len(seen) >= 4


def test_a_cluster_is_started_for_the_study_and_ends_with_it():
    options = {"n_workers": 1, "threads_per_worker": 2, "dashboard_address": ":0"}
    engine = Dask(cluster={"_target_": "distributed.LocalCluster", **options})
    pids = {pid for _, pid in completed(engine, process, range(8))}
    assert len(pids) == 2
    wait_for(lambda: not any(runs(pid) for pid in pids))


def test_tasks_of_a_worker_that_is_retired_run_on_another(scheduler, tmp_path):
    n = n_workers(scheduler[0])
    tasks = [(x, str(tmp_path)) for x in range(24)]
    results = completed(Dask(scheduler[0]), slowly, tasks)
    outcomes = dict(next(results) for _ in range(4))
    wait_for(lambda: len(list(tmp_path.iterdir())) == n > 1)
    with distributed.Client(scheduler[0], set_as_default=False) as client:
        assert len(client.retire_workers(list(client.nthreads())[:1])) == 1
    outcomes |= results
    assert n_workers(scheduler[0]) == n - 1
    assert outcomes == {(x, path): x * x for x, path in tasks}


SLURM = {"_target_": "dask_jobqueue.SLURMCluster", "cores": 1, "memory": "1GB", "interface": "lo"}
TYPED_SLURM = "engine.cluster={_target_:dask_jobqueue.SLURMCluster,cores:1,memory:1GB,interface:lo}"


def queue_of(folder, monkeypatch, sbatch):
    """A queue whose programs are shell scripts: ``sbatch`` is the text of one."""
    with keep_ctrl_c():
        pytest.importorskip("dask_jobqueue", reason="the extra 'dask' is not installed")
    for name, text in (("sbatch", sbatch), ("scancel", "exit 0")):
        if text:
            (folder / name).write_text(f"#!/bin/sh\n{text}\n")
            (folder / name).chmod(0o755)
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")


@pytest.mark.parametrize(
    ("sbatch", "words"),
    [
        ("echo 'sbatch: error: invalid partition specified: fast' >&2; exit 1", "invalid partition specified: fast"),
        ("echo nothing that has a number of a job", "Could not parse job id"),
        ("", "No such file or directory: 'sbatch'"),
    ],
)
def test_a_queue_that_takes_no_job_ends_the_study_with_its_words(here, monkeypatch, interpreter, sbatch, words):
    queue_of(here, monkeypatch, sbatch)
    words_typed = ("engine=dask", "engine.workers=2", TYPED_SLURM, "repeats=1")
    done = interpreter.run(["-m", "studies.run", *STUDY, *words_typed], here, {"COLUMNS": "80"})
    assert done.returncode == 2
    assert done.stderr.startswith("studies.run: error: 2 of 2 workers of the cluster could not be started: ")
    assert words in done.stderr
    assert done.stderr.count("\n") == 1


def test_jobs_that_never_start_are_awaited_for_a_limited_time_and_a_line_says_so(here, monkeypatch, interpreter):
    queue_of(here, monkeypatch, "echo 'Submitted batch job 42'")
    words = ("engine=dask", "engine.workers=2", TYPED_SLURM, "engine.wait=1", "repeats=1")
    done = interpreter.run(["-m", "studies.run", *STUDY, *words], here, {"COLUMNS": "80"})
    assert done.returncode == 2
    awaited, error = done.stderr.splitlines()
    assert awaited == "waiting for workers of the cluster, 0 seconds so far, 1 seconds"
    assert "no worker of the cluster has come within engine.wait=1 seconds" in error


def test_a_queue_that_takes_some_of_the_jobs_does_with_those(here, monkeypatch, capsys):
    queue_of(
        here, monkeypatch,
        f"mkdir {here}/one 2>&- || {{ echo QOSMaxSubmitJobPerUserLimit >&2; exit 1; }}\n"
        f"cp $1 {here}/job\nPYTHONPATH={PROJECT} sh {here}/job > {here}/log 2>&1 &\necho Submitted batch job 42",
    )  # fmt: skip
    assert map_ordered(Dask(cluster=SLURM, workers=2, wait=60), square, range(4)) == [0, 1, 4, 9]
    assert "1 of 2 workers of the cluster could not be started" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("cluster", "words"),
    [
        ({"_target_": "collections.Counter"}, "is not a cluster of dask"),
        ({"_target_": "no_such_module.Cluster"}, "no_such_module"),
        ({"_target_": "distributed.LocalCluster", "n_workers": 0, "dashboard_address": None}, "engine.workers"),
    ],
)
def test_a_cluster_that_cannot_be_started_is_a_mistake(cluster, words):
    with pytest.raises((ValueError, OSError), match=words):
        list(completed(Dask(cluster=cluster), square, [1]))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"address": 5}, "engine.address is 5"),
        ({"cluster": "slurm"}, "engine.cluster is 'slurm'"),
        ({"address": "tcp://a:1", "wait": 0}, "engine.wait is 0"),
        ({"address": "tcp://a:1", "wait": "1h"}, "engine.wait is '1h'"),
    ],
)
def test_options_of_the_wrong_kind_are_refused_by_name(options, words):
    with pytest.raises(ValueError, match=words):
        Dask(**options)


@pytest.mark.parametrize("options", [{}, {"address": "tcp://127.0.0.1:1", "cluster": {}}])
def test_it_is_told_one_scheduler(options):
    with pytest.raises(ValueError, match=r"engine\.address=tcp://HOST:PORT"):
        Dask(**options)


def test_a_scheduler_that_is_not_there_is_an_error():
    import dask

    with dask.config.set({"distributed.comm.timeouts.connect": "1s"}), pytest.raises(OSError, match=r"127\.0\.0\.1:1"):
        list(completed(Dask("tcp://127.0.0.1:1"), square, [1]))


KEPT = [column.name for column in COLUMNS if column.name not in (*TIMINGS, "traceback")]  # where a file is read


class NotRemote(Dask):
    remote = False


@dataclass(frozen=True)
class OnlyHere(FileModel):
    """A mesh whose file one process alone sees."""

    pid: int = 0

    def load(self):
        if os.getpid() != self.pid:
            raise FileNotFoundError(f"{self.path}: only process {self.pid} sees it")
        return super().load()


def test_meshes_reach_workers_that_do_not_see_their_files(scheduler, tmp_path, plan):
    bundled("ant").export(tmp_path / "ant.off")
    (tmp_path / "bad.off").write_text("OFF\n3 1 0\n0 0 0\n")
    words = ("dataset=files", f"dataset.glob={tmp_path}", "levels=[0.1,0.2]", "repeats=2", *STUDY[3:5])
    planned = [
        replace(trial, model=OnlyHere(trial.model.name, "", trial.model.path, pid=os.getpid()))
        for trial in plan("+study=normal_noise", *words)
    ]

    def rows(engine):
        found = list(run_trials(engine, planned))
        raised = {row["trial_id"]: (row["traceback"] or "").split("\n")[-1] for row in found}
        return {row["trial_id"]: {key: row[key] for key in KEPT} | {"raised": raised[row["trial_id"]]} for row in found}

    engine = Dask(scheduler[0])
    expected = rows(Serial())
    assert sorted(row["status"] for row in expected.values()) == ["failed"] * 4 + ["ok"] * 4
    assert rows(engine) == expected
    assert {row["status"] for row in rows(NotRemote(scheduler[0])).values()} == {"failed"}
