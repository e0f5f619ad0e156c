import os
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest
from threadpoolctl import threadpool_info

from studies.execution.engine import Local, Lost, Serial, parse_bytes


def square(x):
    return x * x


def abort_at_three(x):
    if x == 3:
        os.abort()
    return x


def hang_at_three(x):
    if x == 3:
        time.sleep(600)
    return x


def fill_memory(x):
    if x == "by and by":
        held = [np.ones(2**21) for _ in range(300)]
        return len(held)
    if x == "in one call":
        return len(b"x" * 2**32)  # bytes are filled without giving another thread a turn
    if x[0] == "/":
        code = f"import os; open({x!r}, 'w').write(str(os.getpid()))\nheld = [b'x' * 2**24 for _ in range(200)]"
        subprocess.run([sys.executable, "-c", code], check=True, timeout=30)
    return x


def blas_threads(_):
    np.ones((400, 400)) @ np.ones((400, 400))
    return max(pool["num_threads"] for pool in threadpool_info())


def process(_):
    time.sleep(0.2)
    return os.getpid()


class UnreadableHere:
    """A task that cannot be unpickled where it should be worked on."""

    def __reduce__(self):
        return __import__, ("a_module_that_only_the_head_process_has",)


@pytest.mark.parametrize("engine", [Serial(), Local(workers=1), Local(workers=2)])
def test_every_task_gets_its_own_outcome(engine):
    assert dict(engine.run(square, range(20))) == {x: x * x for x in range(20)}
    assert engine.active() == []


def test_work_is_spread_over_the_workers():
    pids = {pid for _, pid in Local(workers=2).run(process, range(8))}
    assert len(pids) == 2
    assert os.getpid() not in pids


def test_a_worker_has_one_blas_thread(monkeypatch):
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        monkeypatch.setenv(variable, "2")
    assert [n for _, n in Local(workers=1).run(blas_threads, [0])] == [1]


def test_a_worker_that_dies_costs_its_own_task_only():
    outcomes = dict(Local(workers=2).run(abort_at_three, range(8)))
    lost = outcomes.pop(3)
    assert lost == Lost("crashed", "its process died with exit code -6")
    assert outcomes == {x: x for x in range(8) if x != 3}


def test_a_worker_that_hangs_costs_its_own_task_only():
    outcomes = dict(Local(workers=2, timeout=1).run(hang_at_three, range(8)))
    assert outcomes.pop(3) == Lost("timeout", "took longer than trial.timeout=1 seconds")
    assert outcomes == {x: x for x in range(8) if x != 3}


class SlowToRead:
    """A task whose class takes a while to be imported."""

    def __reduce__(self):
        return slow_to_read, ()


def slow_to_read():
    time.sleep(0 if imported else 3)
    imported.append(True)
    return SlowToRead()


imported = []


def test_imports_do_not_count_as_a_tasks_time():
    outcomes = [outcome for _, outcome in Local(workers=1, timeout=2).run(type, [SlowToRead(), SlowToRead()])]
    assert outcomes == [SlowToRead, SlowToRead]


def test_a_task_that_takes_all_memory_costs_itself_only_and_ends_with_what_it_started(tmp_path):
    program = tmp_path / "program"
    large, small = ["by and by", "in one call", str(program)], ["a", "b", "c"]
    outcomes = dict(Local(workers=2, timeout=60, memory="700 MB").run(fill_memory, [*large, *small]))
    too_large = Lost("crashed", "out of memory: it held more than trial.memory=700 MB")
    assert outcomes == dict.fromkeys(large, too_large) | {x: x for x in small}
    wait_for(lambda: not psutil.pid_exists(int(program.read_text())))


def test_a_task_that_cannot_be_read_is_an_error_and_not_a_study_that_waits_for_ever():
    with pytest.raises(ModuleNotFoundError, match="a_module_that_only_the_head_process_has"):
        list(Local(workers=1, timeout=60).run(square, [UnreadableHere()]))


def test_a_task_may_hold_a_large_mesh():
    vertices = np.arange(3_000_000.0).reshape(-1, 3)
    (((task, _), total),) = Local(workers=1).run(add_up, [(vertices, "a name")])
    assert task is vertices
    assert total == vertices.sum()


def add_up(task):
    return task[0].sum()


@pytest.mark.parametrize("engine", [Serial(), Local(workers=2)])
def test_it_says_which_tasks_are_at_work(engine):
    seen = set()
    for x, _ in engine.run(process if isinstance(engine, Local) else lambda x: seen.update(engine.active()), range(6)):
        seen.update(engine.active())
        assert len(engine.active()) <= 2
        assert x not in engine.active()
    assert len(seen) >= 4


def test_a_worker_that_hangs_ends_with_a_head_process_that_is_killed(tmp_path):
    code = (
        "from studies.execution.engine import Local; from tests.studies.execution.test_engine import note_and_hang;"
        f"list(Local(workers=2).run(note_and_hang, [{str(tmp_path)!r}] * 2))"
    )
    head = subprocess.Popen(
        [sys.executable, "-c", code], env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, stderr=-3
    )
    wait_for(lambda: len(list(tmp_path.iterdir())) == 2)
    head.send_signal(signal.SIGKILL)
    head.wait()
    wait_for(lambda: not any(psutil.pid_exists(int(path.name)) for path in tmp_path.iterdir()))


def note_and_hang(folder):
    open(os.path.join(folder, str(os.getpid())), "w").close()
    time.sleep(600)


def wait_for(condition, seconds=30):
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def test_tasks_are_taken_a_few_at_a_time():
    taken = []

    def tasks():
        for x in range(1000):
            taken.append(x)
            yield x

    outcomes = Local(workers=2).run(square, tasks())
    next(outcomes)
    assert len(taken) <= 8
    outcomes.close()


@pytest.mark.parametrize(
    ("memory", "size"),
    [(1500, 1500), ("1500", 1500), ("2GB", 2 * 10**9), ("1.5 MB", 1_500_000), ("4 GiB", 2**32), ("1kb", 1000)],
)
def test_memory_is_bytes_or_a_number_with_its_unit(memory, size):
    assert parse_bytes(memory) == size


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"workers": 0}, "engine.workers is 0"),
        ({"workers": 1.5}, "engine.workers is 1.5"),
        ({"timeout": -1}, "is -1"),
        ({"memory": "much"}, "trial.memory is 'much'"),
        ({"memory": "1.2.3 GB"}, "trial.memory is '1.2.3 GB'"),
        ({"memory": 0}, "trial.memory is 0"),
    ],
)
def test_options_that_make_no_sense_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        Local(**options)


@pytest.mark.parametrize(("limit", "value"), [("timeout", 5), ("memory", "2GB")])
def test_one_process_that_cannot_stop_itself_takes_no_limits(limit, value):
    with pytest.raises(ValueError, match=rf"trial\.{limit} is .* engine=serial sets no limits"):
        Serial(**{limit: value})


def test_what_workers_are_forked_from_has_no_thread_that_a_fork_would_lose():
    code = "import os, studies.execution.preload; print(len(os.listdir('/proc/self/task')))"
    environment = {key: value for key, value in os.environ.items() if not key.endswith("_NUM_THREADS")}
    environment |= {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stdout == "1\n"
