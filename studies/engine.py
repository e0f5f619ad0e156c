"""Where trials run. A trial does not know: ``engine.run(function, tasks)`` gives (task, outcome) as they finish."""

import concurrent.futures
import multiprocessing
import os
import signal
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import islice

import pebble


@dataclass(frozen=True)
class Lost:
    """The outcome of a task that gave no result: it failed, its time ran out or its process died."""

    status: str  # failed | timeout | crashed
    reason: str


class LostError(RuntimeError):
    """What was asked of an engine was lost; the message says why."""


@dataclass(frozen=True)
class Serial:
    """One task after the other, in this process."""

    def run(self, function: Callable, tasks: Iterable) -> Iterator[tuple]:
        """(task, function(task)) for every task, in order."""
        for task in tasks:
            yield task, function(task)


@dataclass(frozen=True)
class Local:
    """Processes on this machine, one BLAS thread each; a process that dies or hangs costs only its own task.

    workers : how many processes; None for one a processor
    timeout : seconds that one task may take; None for no limit
    """

    workers: int | None = None
    timeout: float | None = None

    def __post_init__(self):
        if self.workers is not None and not (isinstance(self.workers, int) and self.workers >= 1):
            raise ValueError(f"engine.workers is {self.workers!r}: give a whole number of at least 1, or null")
        if self.timeout is not None and not self.timeout > 0:
            raise ValueError(f"engine.timeout is {self.timeout!r}: give a number of seconds above 0, or null")

    def run(self, function: Callable, tasks: Iterable) -> Iterator[tuple]:
        """(task, function(task) or Lost) for every task, as they finish."""
        workers = self.workers or len(os.sched_getaffinity(0))
        tasks = iter(tasks)
        pool = pebble.ProcessPool(
            max_workers=workers,
            # Not fork: a forked child inherits locks that the parent's threads hold, and native libraries' state.
            context=multiprocessing.get_context("spawn"),
            initializer=_prepare_worker,
        )
        try:
            pending = {}
            while True:
                # A few tasks ahead of the workers, not all of them: a plan may hold a hundred thousand.
                for task in islice(tasks, 2 * workers - len(pending)):
                    pending[pool.schedule(function, args=[task], timeout=self.timeout)] = task
                if not pending:
                    break
                finished, _ = concurrent.futures.wait(pending, return_when=concurrent.futures.FIRST_COMPLETED)
                for future in finished:
                    yield pending.pop(future), self._outcome(future)
        finally:
            pool.stop()
            pool.join()

    def _outcome(self, future):
        try:
            return future.result()
        except TimeoutError:
            return Lost("timeout", f"took longer than engine.timeout={self.timeout:g} seconds")
        except pebble.ProcessExpired as error:
            return Lost("crashed", f"its process died with exit code {error.exitcode}")


def _prepare_worker():
    """One thread a worker, and Ctrl-C left to the head process."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Libraries loaded from here on read the variables; those loaded already are told by threadpoolctl.
    for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[variable] = "1"
    import threadpoolctl

    threadpoolctl.threadpool_limits(1)
