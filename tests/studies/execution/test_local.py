import concurrent.futures
import contextlib
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import psutil
import pytest

from studies.execution import Local, Serial, TaskFailedError, TaskFailure, map_ordered
from studies.execution.engine import parse_bytes
from studies.execution.fork_server import START_METHOD
from studies.execution.worker_pool import ATTEMPTS, WorkerPool, WorkerPoolError
from tests.studies.execution.engines import (
    abort_at_three,
    add_up,
    blas_threads,
    completed,
    fill_memory,
    hang_at_three,
    outcomes_of,
    process,
    runs,
    square,
    wait_for,
)


class UnreadableHere:
    """A task that cannot be unpickled in a worker."""

    def __reduce__(self):
        return __import__, ("a_module_that_only_the_head_process_has",)


@pytest.mark.parametrize("engine", [Serial(), Local(workers=1), Local(workers=2)])
def test_every_task_gets_its_own_outcome(engine):
    assert outcomes_of(engine, square, range(20)) == {x: x * x for x in range(20)}
    assert engine.active() == []


@pytest.mark.parametrize("engine", [Serial(), Local(workers=2)])
def test_results_of_map_ordered_are_in_the_order_of_the_tasks(engine):
    assert map_ordered(engine, square, range(9)) == [x * x for x in range(9)]
    assert map_ordered(engine, square, []) == []


def fail_at_three(x):
    if x == 3:
        raise ValueError("no threes,\nplease")
    return x


@pytest.mark.parametrize("engine", [Serial(), Local(workers=1)])
def test_map_ordered_raises_the_reason_of_a_task_that_fails(engine):
    with pytest.raises(TaskFailedError, match=r"^ValueError: no threes, please$"):
        map_ordered(engine, fail_at_three, [1, 3, 5])


def test_work_is_spread_over_the_workers():
    pids = set(map_ordered(Local(workers=2), process, range(8)))
    assert len(pids) == 2
    assert os.getpid() not in pids


def test_a_worker_has_one_blas_thread(monkeypatch):
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(variable, "2")
    assert map_ordered(Local(workers=1), blas_threads, [0]) == [1]


def test_a_worker_that_dies_costs_its_own_task_only():
    outcomes = outcomes_of(Local(workers=2), abort_at_three, range(8))
    assert outcomes.pop(3) == TaskFailure("crashed", f"its process died with exit code {-signal.SIGABRT}")
    assert outcomes == {x: x for x in range(8) if x != 3}


def exit_at_three(x):
    if x == 3:
        sys.exit(0)
    return x


def test_a_task_that_exits_costs_itself_only():
    outcomes = outcomes_of(Local(workers=1), exit_at_three, range(5))
    assert outcomes.pop(3) == TaskFailure("failed", "SystemExit: 0")
    assert outcomes == {x: x for x in range(5) if x != 3}


def test_a_worker_that_hangs_costs_its_own_task_only():
    outcomes = outcomes_of(Local(workers=2, timeout=1), hang_at_three, range(8))
    assert outcomes.pop(3) == TaskFailure("timeout", "took longer than trial.timeout=1 seconds")
    assert outcomes == {x: x for x in range(8) if x != 3}


def start_program_and_hang(path):
    program = subprocess.Popen([sys.executable, "-c", "import time; time.sleep(600)"])
    with open(path, "w") as file:
        file.write(f"{program.pid}\n")
    time.sleep(600)


def test_a_task_whose_time_is_over_ends_with_the_programs_that_it_started(tmp_path):
    path = tmp_path / "pid"
    outcomes = outcomes_of(Local(workers=1, timeout=2), start_program_and_hang, [path])
    assert outcomes[path].status == "timeout"
    wait_for(lambda: not runs(int(path.read_text())))


class SlowToRead:
    """A task whose class takes longer to import than a task may take."""

    def __reduce__(self):
        return slow_to_read, ()


def slow_to_read():
    time.sleep(0 if imported else 1)
    imported.append(True)
    return SlowToRead()


imported = []


def test_imports_do_not_count_as_time_of_a_task():
    assert map_ordered(Local(workers=1, timeout=0.8), type, [SlowToRead(), SlowToRead()]) == [SlowToRead, SlowToRead]


def test_a_task_that_takes_all_memory_costs_itself_only_and_ends_with_the_programs_that_it_started(tmp_path):
    program = tmp_path / "program"
    large, small = ["bit by bit", "in one call", str(program)], ["a", "b", "c"]
    outcomes = outcomes_of(Local(workers=2, timeout=60, memory="700 MB"), fill_memory, [*large, *small])
    too_large = TaskFailure("crashed", "out of memory: it held more than trial.memory=700 MB")
    assert outcomes == dict.fromkeys(large, too_large) | {x: x for x in small}
    wait_for(lambda: not runs(int(program.read_text())))


hoard = []


def keep_memory(x):
    hoard.append(b"x" * 600_000_000 if x == "large" else b"")
    return os.getpid()


def test_memory_that_a_worker_keeps_between_tasks_kills_it_only_during_a_task():
    pool = WorkerPool(pickle.dumps(keep_memory), 1, memory="800 MB")
    try:
        pid = pool.outcome(pickle.dumps("large"))
        time.sleep(1)  # several measurements
        assert runs(pid)
        assert pool.outcome(pickle.dumps("small")) == pid
    finally:
        pool.close()


def test_a_worker_that_is_killed_between_tasks_costs_no_task():
    pool = WorkerPool(pickle.dumps(process), 1)
    try:
        pids = [pool.outcome(pickle.dumps(0))]
        for _ in range(3):
            psutil.Process(pids[-1]).kill()
            pids.append(pool.outcome(pickle.dumps(0)))
        assert len(set(pids)) == 4
    finally:
        pool.close()


def killed_again_and_again(function, n_tasks, n_kills):
    """Outcomes of tasks on two workers, of which some are killed at arbitrary moments."""
    random = np.random.default_rng(7)
    pool = WorkerPool(pickle.dumps(function), 2)
    finished = threading.Event()

    def kill():
        for _ in range(n_kills):
            if finished.wait(random.uniform(0, 0.2)):
                return
            for worker in list(pool._workers)[:1]:
                os.kill(worker.pid, signal.SIGKILL)

    killer = threading.Thread(target=kill)
    try:
        with concurrent.futures.ThreadPoolExecutor(2) as threads:
            pool.outcome(pickle.dumps(0))  # workers can be started
            killer.start()
            outcomes = list(threads.map(pool.outcome, map(pickle.dumps, range(n_tasks))))
        return outcomes
    finally:
        finished.set()
        killer.join()
        pool.close()


def test_workers_that_are_killed_at_arbitrary_moments_cost_their_own_tasks_only():
    outcomes = killed_again_and_again(square, 3000, 25)
    lost = {x: outcome for x, outcome in enumerate(outcomes) if isinstance(outcome, TaskFailure)}
    assert len(lost) <= 25
    assert {outcome.status for outcome in lost.values()} <= {"crashed"}
    assert all(outcome == x * x for x, outcome in enumerate(outcomes) if x not in lost)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_two_hundred_killed_workers_cost_no_more_than_a_task_each_and_never_the_session(seed):
    """Tasks so small that most kills come between two of them, or while a worker is started."""
    random = np.random.default_rng(seed)
    engine = Local(workers=2)
    n_killed = 0
    finished = threading.Event()

    def kill():
        nonlocal n_killed
        while n_killed < 200 and not finished.wait(random.exponential(0.05)):
            children = [child for child in psutil.Process().children(recursive=True) if is_worker(child)]
            if children:
                with contextlib.suppress(psutil.NoSuchProcess):
                    children[random.integers(len(children))].kill()
                    n_killed += 1

    def tasks():
        x = 0
        while n_killed < 200:
            yield x
            x += 1

    killer = threading.Thread(target=kill)
    try:
        results = completed(engine, square, tasks())
        outcomes = dict([next(results)])  # workers can be started
        killer.start()
        outcomes |= results
    finally:
        finished.set()
        killer.join()
    lost = {x for x, outcome in outcomes.items() if isinstance(outcome, TaskFailure)}
    assert n_killed == 200
    assert len(lost) <= 200
    assert {outcomes[x].status for x in lost} <= {"crashed"}
    assert all(outcomes[x] == x * x for x in range(len(outcomes)) if x not in lost)


def is_worker(process):
    """Whether a child of this process is a worker, not what workers are forked from or what tracks resources."""
    with contextlib.suppress(psutil.Error):
        return process.parent().pid != os.getpid()
    return False


@pytest.mark.skipif(START_METHOD != "forkserver", reason="there is no process that workers are forked from")
def test_the_process_that_workers_are_forked_from_may_be_killed():
    outcomes, moments = {}, [2, 6]
    for x, outcome in completed(Local(workers=1), square, range(12)):
        outcomes[x] = outcome
        if moments and x >= moments[0] and not isinstance(outcome, TaskFailure):  # of a server that runs
            del moments[0]
            (server,) = [child for child in psutil.Process().children() if "forkserver" in " ".join(child.cmdline())]
            for worker in server.children():
                worker.kill()
            server.kill()
    lost = {x for x, outcome in outcomes.items() if isinstance(outcome, TaskFailure)}
    assert not moments
    assert len(outcomes) == 12
    assert len(lost) <= 4
    assert all(outcomes[x] == x * x for x in outcomes if x not in lost)


def raise_timeout(_):
    raise TimeoutError("the server did not answer")


def test_a_timeout_that_the_task_itself_raises_is_its_error_and_leaves_the_worker_alive():
    pool = WorkerPool(pickle.dumps(raise_timeout), 1)
    try:
        for _ in range(2):
            with pytest.raises(TimeoutError, match="the server did not answer"):
                pool.outcome(pickle.dumps(0))
        assert len(pool._workers) == 1
    finally:
        pool.close()


def exit_at_once(code):
    os._exit(code)


class DeadlyToRead:
    """A task that kills the worker that unpickles it."""

    def __reduce__(self):
        return exit_at_once, (7,)


def test_a_task_that_no_worker_lives_to_start_is_given_up():
    pool = WorkerPool(pickle.dumps(type), 1)
    try:
        assert pool.outcome(pickle.dumps(1)) is int
        pool._workers.copy().pop().kill([])
        reason = f"its process died with exit code 7 before it started, {ATTEMPTS} times"
        assert pool.outcome(pickle.dumps(DeadlyToRead())) == TaskFailure("crashed", reason)
        assert pool.outcome(pickle.dumps(2)) is int
    finally:
        pool.close()


def test_if_no_worker_can_be_started_that_is_an_error_and_not_a_row_per_trial():
    with pytest.raises(WorkerPoolError, match="exit code 7 before it started a task"):
        map_ordered(Local(workers=1), type, [DeadlyToRead()])


def test_a_task_that_cannot_be_read_is_an_error_and_not_a_study_that_waits_forever():
    with pytest.raises(ModuleNotFoundError, match="a_module_that_only_the_head_process_has"):
        outcomes_of(Local(workers=1, timeout=60), square, [UnreadableHere()])


class Unpicklable(Exception):
    def __init__(self, a, b):
        super().__init__(f"{a} and {b}")


def raise_unpicklable(_):
    raise Unpicklable("this", "that")


def test_an_error_that_cannot_be_pickled_is_raised_by_its_text():
    with pytest.raises(RuntimeError, match=r"^Unpicklable: this and that$"):
        outcomes_of(Local(workers=1), raise_unpicklable, [0])


def test_a_task_may_contain_a_large_mesh():
    vertices = np.arange(3_000_000.0).reshape(-1, 3)
    with Local(workers=1).open(add_up) as session:
        session.submit((vertices, "a name"))
        ((task, total),) = session.wait()
    assert task[0] is vertices
    assert total == vertices.sum()


@pytest.mark.parametrize("engine", [Serial(), Local(workers=2)])
def test_it_knows_which_tasks_are_being_worked_on(engine):
    seen = set()
    function = process if isinstance(engine, Local) else lambda x: seen.update(engine.active())
    for x, _ in completed(engine, function, range(6)):
        seen.update(engine.active())
        assert len(engine.active()) <= 2
        assert x not in engine.active()
    assert len(seen) >= 4


def test_a_worker_that_hangs_ends_with_a_head_process_that_is_killed(tmp_path):
    code = (
        "from studies.execution import Local, map_ordered\n"
        "from tests.studies.execution.engines import note_and_hang\n"
        f"if __name__ == '__main__': map_ordered(Local(workers=2), note_and_hang, [{str(tmp_path)!r}] * 2)"
    )
    head = subprocess.Popen(
        [sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, stderr=-3
    )
    wait_for(lambda: len(list(tmp_path.iterdir())) == 2)
    head.kill()
    head.wait()
    wait_for(lambda: not any(runs(int(path.name)) for path in tmp_path.iterdir()))


def test_workers_end_when_a_session_is_left_early():
    with Local(workers=2).open(process) as session:
        for x in range(4):
            session.submit(x)
        pids = [pid for _, pid in session.wait()]
    assert not any(runs(pid) for pid in pids)


def test_a_process_that_forgets_to_close_its_pool_exits(interpreter, tmp_path):
    code = (
        "import pickle\nfrom studies.execution.worker_pool import WorkerPool\n"
        "pool = WorkerPool(pickle.dumps(abs), 1)\nprint(pool.outcome(pickle.dumps(-2)))"
    )
    done = interpreter.run(["-c", code], tmp_path)
    assert (done.returncode, done.stdout, done.stderr) == (0, "2\n", "")


def test_tasks_are_taken_a_few_at_a_time():
    taken = []

    def tasks():
        for x in range(1000):
            taken.append(x)
            yield x

    outcomes = completed(Local(workers=2), square, tasks())
    next(outcomes)
    assert len(taken) <= 8
    outcomes.close()


def test_by_default_there_is_a_worker_per_processor_that_this_process_may_use(interpreter, tmp_path):
    code = "from studies.execution import Local; print(Local().processes)"
    assert interpreter.run(["-c", code], tmp_path, {"LOKY_MAX_CPU_COUNT": "1"}).stdout == "1\n"
    assert 1 <= Local().processes <= os.cpu_count()


@pytest.mark.parametrize(
    ("memory", "size"),
    [(1500, 1500), ("1500", 1500), ("2GB", 2 * 10**9), ("1.5 MB", 1_500_000), ("4 GiB", 2**32), ("1kb", 1000)],
)
def test_memory_is_bytes_or_a_number_with_a_unit(memory, size):
    assert parse_bytes(memory) == size


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"workers": 0}, "engine.workers is 0: must be a whole number of at least 1, or null"),
        ({"workers": 1.5}, "engine.workers is 1.5: must be a whole number of at least 1, or null"),
        ({"workers": "many"}, "engine.workers is 'many': must be a whole number of at least 1, or null"),
        ({"timeout": -1}, "trial.timeout is -1: must be a number of seconds above 0, or null"),
        ({"timeout": "10min"}, "trial.timeout is '10min': must be a number of seconds above 0, or null"),
        ({"memory": "much"}, "trial.memory is 'much': must be bytes, a size such as '2 GB', or null"),
        ({"memory": "1.2.3 GB"}, "trial.memory is '1.2.3 GB': must be bytes, a size such as '2 GB', or null"),
        ({"memory": 0}, "trial.memory is 0: must be bytes, a size such as '2 GB', or null"),
    ],
)
def test_options_that_make_no_sense_are_refused_by_name(options, message):
    with pytest.raises(ValueError, match=message):
        Local(**options)


@pytest.mark.parametrize(("limit", "value"), [("timeout", 5), ("memory", "2GB")])
def test_the_serial_engine_takes_no_limits_because_it_cannot_enforce_them(limit, value):
    message = rf"trial\.{limit} is {value!r}: must be null, because engine=serial cannot enforce it"
    with pytest.raises(ValueError, match=message):
        Serial(**{limit: value})


@pytest.mark.skipif(sys.platform != "linux", reason="workers are not forked")
def test_the_process_that_workers_are_forked_from_has_no_thread_that_a_fork_would_lose():
    code = "import os, studies.execution.preload; print(len(os.listdir('/proc/self/task')))"
    environment = {key: value for key, value in os.environ.items() if not key.endswith("_NUM_THREADS")}
    environment |= {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "1\n"
