import os
import time

import numpy as np
import pytest
from threadpoolctl import threadpool_info

from studies.engine import Local, Lost, Serial


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


def blas_threads(_):
    np.ones((400, 400)) @ np.ones((400, 400))
    return max(pool["num_threads"] for pool in threadpool_info())


def process(_):
    time.sleep(0.2)
    return os.getpid()


@pytest.mark.parametrize("engine", [Serial(), Local(workers=1), Local(workers=2)])
def test_every_task_gets_its_own_outcome(engine):
    assert dict(engine.run(square, range(20))) == {x: x * x for x in range(20)}


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
    outcomes = dict(Local(workers=2, timeout=2).run(hang_at_three, range(8)))
    assert outcomes.pop(3) == Lost("timeout", "took longer than engine.timeout=2 seconds")
    assert outcomes == {x: x for x in range(8) if x != 3}


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
    ("options", "message"),
    [({"workers": 0}, "engine.workers is 0"), ({"workers": 1.5}, "engine.workers is 1.5"), ({"timeout": -1}, "is -1")],
)
def test_options_that_make_no_sense_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        Local(**options)
