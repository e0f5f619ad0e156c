"""Tasks for the tests of engines, and what becomes of them."""

import multiprocessing
import os
import signal
import subprocess
import sys
import time

import numpy as np
import psutil
from threadpoolctl import threadpool_info


def outcomes_of(engine, function, tasks):
    """Task -> outcome, for hashable tasks, which are submitted as a study does."""
    return dict(completed(engine, function, tasks))


def completed(engine, function, tasks):
    """Yields (task, outcome) as tasks finish."""
    tasks = iter(tasks)
    with engine.open(function) as session:
        while True:
            while session.has_room():
                try:
                    session.submit(next(tasks))
                except StopIteration:
                    break
            if not session.pending:
                return
            yield from session.wait()


def wait_for(condition, seconds=60):
    """Wait until a condition holds; the time limit only ends a test that fails."""
    end = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end
        time.sleep(0.02)


def runs(pid):
    """Whether a process has not ended, not even as a zombie that its parent, or its new one, has yet to collect."""
    try:
        return psutil.Process(pid).status() != psutil.STATUS_ZOMBIE
    except psutil.NoSuchProcess:
        return False


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


def kill_the_dask_worker_at_three(x):
    if x == 3:
        os.kill(multiprocessing.parent_process().pid, signal.SIGKILL)
        time.sleep(60)
    return x


def fill_memory(x):
    if x == "bit by bit":
        held = [np.ones(2**21) for _ in range(300)]
        return len(held)
    if x == "in one call":
        return len(b"x" * 2**32)  # bytes are filled without another thread of the process getting a turn
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


def add_up(task):
    return task[0].sum()


def note_and_hang(folder):
    open(os.path.join(folder, str(os.getpid())), "w").close()
    time.sleep(600)
