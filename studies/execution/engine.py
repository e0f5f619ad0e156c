"""Where trials run. A trial does not know: ``engine.run(function, tasks)`` gives (task, outcome) as they finish.

``engine.active()`` gives the tasks that are being worked on, to whichever thread asks; ``engine.processes`` is how many
of them at once, None where that is not known before; ``engine.remote`` says whether they may be worked on where the
files of this machine are not seen. ``engine.warm_up()`` begins what ``run`` needs whatever the tasks are, and returns
at once. `studies.execution.cluster` has the engine for other machines.

Tasks are taken a few at a time, so that an iterator that makes them (and reads their meshes) on demand holds few of
them.
"""

import concurrent.futures
import contextlib
import ctypes
import multiprocessing
import os
import pickle
import re
import signal
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from importlib import import_module
from itertools import islice
from multiprocessing import forkserver
from typing import ClassVar

import numpy as np
import pebble
import psutil
import threadpoolctl

_LOOK = 0.25  # seconds between two looks at the memory of the workers; one takes some 5 ms
_SLOTS = 1 << 15  # for the processes at work, by their id; two workers with one slot are as unlikely as harmless


@dataclass(frozen=True)
class Lost:
    """The outcome of a task that gave no result: it failed, its time ran out or its process died."""

    status: str  # failed | timeout | crashed
    reason: str


class LostError(RuntimeError):
    """What was asked of an engine was lost; the message says why."""


def gathered(engine, function, tasks):
    """``function`` of each of a few tasks, in their order; LostError where one of them is lost."""
    found = {}
    for (i, *_), outcome in engine.run(_apply, [(i, function, task) for i, task in enumerate(tasks)]):
        if isinstance(outcome, Lost):
            raise LostError(outcome.reason)
        found[i] = outcome
    return [found[i] for i in range(len(tasks))]


def _apply(numbered):
    _, function, task = numbered
    try:
        return function(task)
    except Exception as error:
        return Lost("failed", f"{type(error).__name__}: {error}")


@dataclass(frozen=True)
class Serial:
    """One task after the other, in this process, which can set no limits to itself: both must be None."""

    remote: ClassVar[bool] = False
    timeout: None = None
    memory: None = None
    _at_work: list = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self):
        for limit in ("timeout", "memory"):
            if getattr(self, limit) is not None:
                raise ValueError(f"trial.{limit} is {getattr(self, limit)!r}, and engine=serial sets no limits: null")

    @property
    def processes(self) -> int:
        return 1

    def warm_up(self) -> None:
        pass

    def run(self, function: Callable, tasks: Iterable) -> Iterator[tuple]:
        """(task, function(task)) for every task, in order."""
        for task in tasks:
            self._at_work[:] = [task]
            outcome = function(task)
            self._at_work.clear()
            yield task, outcome

    def active(self) -> list:
        return list(self._at_work)


@dataclass(frozen=True)
class Local:
    """Processes on this machine, one BLAS thread each; a process that dies or hangs costs only its own task.

    workers : how many processes; None for one a processor
    timeout : seconds that one task may take; None for no limit
    memory : what a worker and the programs that it runs may hold, in bytes or as in "2 GB"; None for no limit
    """

    remote: ClassVar[bool] = False
    workers: int | None = None
    timeout: float | None = None
    memory: int | str | None = None
    _pending: dict = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self):
        if self.workers is not None and not (isinstance(self.workers, int) and self.workers >= 1):
            raise ValueError(f"engine.workers is {self.workers!r}: give a whole number of at least 1, or null")
        check_limits(self.timeout, self.memory)

    @property
    def processes(self) -> int:
        return self.workers or len(os.sched_getaffinity(0))

    def warm_up(self) -> None:
        context()

    def run(self, function: Callable, tasks: Iterable) -> Iterator[tuple]:
        """(task, function(task) or Lost) for every task, as they finish."""
        workers = self.processes
        tasks = iter(tasks)
        try:
            first = next(tasks)
        except StopIteration:
            return
        sent = pickle.dumps(first)
        processes = Processes(pickle.dumps(function), sent, workers, self.timeout, self.memory)
        try:
            self._pending[processes.submit(sent)] = first
            while True:
                # A few tasks ahead of the workers, not all of them: a plan may hold a hundred thousand.
                for task in islice(tasks, 2 * workers - len(self._pending)):
                    self._pending[processes.submit(pickle.dumps(task))] = task
                if not self._pending:
                    break
                finished, _ = concurrent.futures.wait(self._pending, return_when=concurrent.futures.FIRST_COMPLETED)
                for future in finished:
                    yield self._pending.pop(future), processes.outcome(future)
        finally:
            self._pending.clear()
            processes.close()

    def active(self) -> list:
        return [task for future, task in list(self._pending.items()) if future.running()]


def context():
    """How worker processes are made: forked, from a process that begins now to import what they need.

    Not from this process: a fork inherits locks that other threads of its parent hold. On macOS, whose own libraries do
    not survive any fork, each worker starts anew.
    """
    if sys.platform != "linux":
        return multiprocessing.get_context("spawn")
    found = multiprocessing.get_context("forkserver")
    found.set_forkserver_preload(["studies.execution.preload"])
    forkserver.ensure_running()
    return found


class Processes:
    """Worker processes, each with one BLAS thread; what happens in one of them happens to its task only.

    Function and tasks are handed over as pickles, which nobody on the way has to understand. A worker unpickles the
    function and one task, `first`, before it counts time, so that no task's holds the imports. A worker is replaced
    when it dies, and killed when its task takes longer than `timeout` seconds, or when it and the programs that it runs
    hold more than `memory` (see `Local`).
    """

    def __init__(self, function, first, workers, timeout=None, memory=None):
        self._timeout = timeout
        self._memory = memory
        made = context()
        busy = made.RawArray(ctypes.c_int64, _SLOTS)
        self._pool = pebble.ProcessPool(
            max_workers=workers, context=made, initializer=_prepare_worker, initargs=[function, first, busy]
        )
        self._too_large = set()  # ids of the processes that were killed for their memory
        self._closed = threading.Event()
        self._watcher = threading.Thread(target=self._watch, args=[np.frombuffer(busy, np.int64)], daemon=True)
        if memory is not None:
            self._watcher.start()

    def submit(self, task):
        """A future of what the function makes of a task, for `outcome`."""
        return self._pool.schedule(_work, args=[task], timeout=self._timeout)

    def outcome(self, future):
        """What the function returned, or Lost; waits for it."""
        try:
            return future.result()
        except TimeoutError:
            return Lost("timeout", f"took longer than trial.timeout={self._timeout:g} seconds")
        except pebble.ProcessExpired as error:
            if error.pid not in self._too_large:
                return Lost("crashed", f"its process died with exit code {error.exitcode}")
            self._too_large.remove(error.pid)
            return Lost("crashed", f"out of memory: it held more than trial.memory={self._memory}")

    def close(self):
        self._closed.set()
        if self._watcher.is_alive():
            self._watcher.join()
        self._pool.stop()
        self._pool.join()

    def _watch(self, busy):
        """Kill the workers that hold too much.

        From outside, because a worker that fills its memory in native code runs no thread of its own; by what is
        resident, because native libraries reserve far more than they use; and only a worker that is at work on a task,
        because one that takes or returns a task holds a lock, which would stay locked.
        """
        limit = parse_bytes(self._memory)
        orphans = []
        closed = False
        while orphans or not closed:
            closed = self._closed.wait(_LOOK)
            for process in orphans:  # those of the last look, unless they ended by themselves
                with contextlib.suppress(psutil.Error):
                    process.kill()
            orphans = []
            for pid, family in _families(busy[busy != 0].tolist()).items():
                if _resident(family) > limit and busy[pid % _SLOTS] == pid:
                    busy[pid % _SLOTS] = 0
                    self._too_large.add(pid)
                    os.kill(pid, signal.SIGKILL)
                    orphans += family[1:]


def check_limits(timeout, memory):
    """Raise ValueError for limits of a trial that are none."""
    if timeout is not None and not timeout > 0:
        raise ValueError(f"trial.timeout is {timeout!r}: give a number of seconds above 0, or null")
    if memory is not None:
        parse_bytes(memory)


def parse_bytes(memory):
    """2000000000 or "2 GB" or "1.9GiB" as a number of bytes."""
    parts = re.fullmatch(r"\s*([0-9.]+)\s*(?:([kmgt]?)(i?)b)?\s*", str(memory).lower())
    try:
        size = float(parts[1]) * (1024 if parts[3] else 1000) ** " kmgt".index(parts[2] or " ")
    except (TypeError, ValueError):  # no match, or no number
        size = 0
    if size < 1:
        raise ValueError(f"trial.memory is {memory!r}: give bytes, or as in '2 GB', or null")
    return int(size)


def _families(pids):
    """Those of these processes that are children of this one, each with its descendants behind it: lists, by id.

    The others died, and other processes may have their numbers.
    """
    families, family_of = {}, {}
    for process in psutil.Process().children(recursive=True):  # parents first
        with contextlib.suppress(psutil.Error):  # one that ended meanwhile
            pid = process.pid if process.pid in pids else family_of.get(process.ppid())
            if pid is not None:
                family_of[process.pid] = pid
                families.setdefault(pid, []).append(process)
    return families


def _resident(processes):
    """Bytes of memory that processes hold together."""
    held = 0
    for process in processes:
        with contextlib.suppress(psutil.Error):
            held += process.memory_info().rss
    return held


# In the worker: the pickled function, and the slots of those at work, shared with the head process.
_function = None
_busy = None


def _work(task):
    pid = os.getpid()
    _busy[pid % _SLOTS] = pid
    try:
        # Not by pebble: what it cannot unpickle in a worker it waits for without end.
        return pickle.loads(_function)(pickle.loads(task))
    finally:
        _busy[pid % _SLOTS] = 0


def _prepare_worker(function, first, busy):
    """One thread a worker, Ctrl-C left to the head process, an end with it, and what is needed imported."""
    global _function, _busy
    _function, _busy = function, busy
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_head, daemon=True).start()
    # Libraries loaded from here on read its variables; those loaded already are told by threadpoolctl.
    import_module("studies.execution.preload")
    threadpoolctl.threadpool_limits(1)
    with contextlib.suppress(Exception):  # the task says what it is
        pickle.loads(function)
        pickle.loads(first)


def _end_with_head():
    """Or a worker that hangs would outlive a head process that was killed."""
    multiprocessing.parent_process().join()
    os.kill(os.getpid(), signal.SIGKILL)
