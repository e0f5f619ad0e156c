"""Worker processes whose death costs one task: the isolation behind `studies.execution.Local` and `Dask`.

Each worker has a pipe of its own and shares nothing with the others, neither a queue nor a lock. It can therefore be
killed at any moment, even between tasks, without harm to the others, and the pool always knows its task.
"""

import atexit
import contextlib
import multiprocessing
import os
import pickle
import queue
import signal
import threading
import time
from collections.abc import Iterable
from concurrent.futures import CancelledError
from importlib import import_module
from multiprocessing import connection
from multiprocessing.connection import Connection
from typing import Any

import psutil
import threadpoolctl

from studies.execution.engine import TaskFailure, parse_bytes
from studies.execution.fork_server import process_context
from studies.execution.interruption import reason, traceback_of
from studies.execution.process_tree import find_families, kill_processes, resident_memory, split_supervised
from studies.execution.supervise_program import wait_until_ended

POLL_SECONDS = 0.25  # between two measurements of the memory of the workers, each of which takes some 5 ms
GRACE_SECONDS = 30.0  # in which the supervisors of a worker's programs end by themselves and clean up
EXIT_SECONDS = 10.0  # in which a process that has closed its pipe must exit
ATTEMPTS = 3  # workers that may die before one of them starts a task
PAUSE_SECONDS = 0.1  # before the next attempt, then longer: a process that died is not noticed at once

_STARTED = b"started"  # what a worker sends when it starts a task

# Starting a process reads the exit codes of all others that have ended; of two threads that read one at the same time,
# one would get a wrong one.
_exit_codes = threading.Lock()


class WorkerPoolError(OSError):
    """Worker processes cannot be started; the message tells how they ended."""


class WorkerPool:
    """Worker processes, each with one BLAS thread, that apply a function to tasks.

    A worker is started when a task needs it, and replaced when it has died. It is killed when its task takes too much
    time or memory. A task that had not started when its worker died runs on another one.

    Parameters
    ----------
    function : bytes
        the pickled function
    size : int
        number of workers
    timeout : float, optional
        seconds that a task may take, not counting the imports that its worker needs for its first task
    memory : int or str, optional
        what a worker and the programs that it runs may hold together while it is at work

    Examples
    --------
    >>> pool = WorkerPool(pickle.dumps(abs), size=1)
    >>> pool.outcome(pickle.dumps(-2))
    2
    >>> pool.close()
    """

    def __init__(
        self, function: bytes, size: int, timeout: float | None = None, memory: int | str | None = None
    ) -> None:
        self._function = function
        self._timeout = timeout
        self._memory = memory
        self._slots: queue.LifoQueue[_Worker | None] = queue.LifoQueue()  # idle workers; None if not started yet
        for _ in range(size):
            self._slots.put(None)
        self._workers: set[_Worker] = set()
        self._starting = threading.Lock()
        self._closed = threading.Event()
        self._has_worked = False
        self._watcher: threading.Thread | None = None
        if memory is not None:
            self._watcher = threading.Thread(target=self._watch_memory, args=[parse_bytes(memory)], daemon=True)
            self._watcher.start()
        atexit.register(self.close)  # or the interpreter would wait for the workers when it exits

    def outcome(self, task: bytes) -> Any:
        """Apply the function to a task, in a worker; blocks until it has finished. May be called from any thread.

        Parameters
        ----------
        task : bytes
            the pickled task

        Returns
        -------
        Any
            what the function returned, or a `TaskFailure`

        Raises
        ------
        Exception
            what the function raised; `WorkerPoolError` if no worker can be started; `CancelledError` once the pool is
            closed
        """
        worker = self._slots.get()
        try:
            for attempt in range(ATTEMPTS):
                try:
                    worker = worker or self._start_worker()
                    worker.start_task(task)
                    self._has_worked = True
                    break
                except _WorkerDiedError as death:
                    ended = self._remove(worker) if worker else str(death)
                    worker = None
                    self._closed.wait(PAUSE_SECONDS * attempt)
            else:
                return self._not_started(ended)
            try:
                return worker.result(self._timeout)
            except _WorkerDiedError:
                dead, worker = worker, None
                return self._crash(dead)
            except _TimeIsUpError:
                slow, worker = worker, None
                return self._timed_out(slow)
        finally:
            self._slots.put(worker)

    def close(self) -> None:
        """Kill the workers and the programs that they run."""
        atexit.unregister(self.close)
        with self._starting:
            self._closed.set()
            workers = list(self._workers)
        families = find_families({worker.pid for worker in workers}) if workers else {}
        for worker in workers:
            worker.kill(families.get(worker.pid, [])[1:])
        for worker in workers:
            self._remove(worker)
        if self._watcher is not None:
            self._watcher.join()

    def _start_worker(self) -> "_Worker":
        with self._starting:
            self._check_open()
            try:
                worker = _Worker(self._function)
            except (OSError, EOFError) as error:
                raise _WorkerDiedError(f"no process could be started ({type(error).__name__}: {error})") from error
            self._workers.add(worker)
            return worker

    def _remove(self, worker: "_Worker") -> str:
        """Forget a worker that has died: how it ended."""
        self._workers.discard(worker)
        return f"its process died with exit code {worker.end()}"

    def _not_started(self, ended: str) -> TaskFailure:
        self._check_open()
        if not self._has_worked:
            raise WorkerPoolError(
                f"no worker process could be used: {ended} before it started a task. A script that calls studies.run "
                'must do so under: if __name__ == "__main__":'
            )
        return TaskFailure("crashed", f"{ended} before it started, {ATTEMPTS} times")

    def _timed_out(self, worker: "_Worker") -> TaskFailure:
        """Kill a worker whose task takes too long."""
        worker.kill(find_families({worker.pid}).get(worker.pid, [])[1:])
        self._remove(worker)
        return TaskFailure("timeout", f"took longer than trial.timeout={self._timeout:g} seconds")

    def _crash(self, worker: "_Worker") -> TaskFailure:
        """Why a worker died while it was at work."""
        ended = self._remove(worker)
        self._check_open()
        if worker.was_too_large:
            return TaskFailure("crashed", f"out of memory: it held more than trial.memory={self._memory}")
        return TaskFailure("crashed", ended)

    def _check_open(self) -> None:
        if self._closed.is_set():
            raise CancelledError("the pool of worker processes is closed")

    def _watch_memory(self, limit: int) -> None:
        """Kill the workers that hold too much.

        From outside, because a worker that fills its memory in native code runs no other thread; and only while it is
        at work, because what it holds between two tasks is no task's fault.
        """
        while not self._closed.wait(POLL_SECONDS):
            at_work = {worker.pid: (worker, task) for worker in list(self._workers) if (task := worker.task)}
            if not at_work:
                continue
            for pid, family in find_families(at_work.keys()).items():
                worker, task = at_work[pid]
                if resident_memory(family) > limit and worker.task == task:
                    worker.was_too_large = True
                    worker.kill(family[1:])


class _WorkerDiedError(Exception):
    """A worker ended, or could not be started."""


class _TimeIsUpError(Exception):
    """A worker had no result when the time of its task was up."""


class _Worker:
    """A worker process and this process's end of its pipe."""

    def __init__(self, function: bytes) -> None:
        context = process_context()
        self._pipe, pipe_of_worker = context.Pipe()
        self._process = context.Process(  # type: ignore[attr-defined]
            target=_serve, args=(pipe_of_worker, function), name="studies worker", daemon=False
        )
        try:
            with _exit_codes:
                self._process.start()
        finally:
            pipe_of_worker.close()  # or the pipe would stay open when the worker has died
        self._programs: list[psutil.Process] = []
        self._supervisors: list[psutil.Process] = []
        self._ending = threading.Lock()  # two threads may do so when the pool is closed
        self._n_tasks = 0
        self.pid: int = self._process.pid
        self.task = 0  # number of the task that it is on, 0 between tasks
        self.was_too_large = False

    def start_task(self, task: bytes) -> None:
        """Hand over a task, and wait until it starts; _WorkerDiedError if it does not."""
        try:
            self._pipe.send_bytes(task)
        except OSError as error:
            raise _WorkerDiedError from error
        self._receive()
        self._n_tasks += 1
        self.task = self._n_tasks

    def result(self, timeout: float | None) -> Any:
        """The result of the task; raises what the task raised, _TimeIsUpError or _WorkerDiedError."""
        try:
            answer = self._receive(timeout)
        finally:
            self.task = 0
        succeeded, value = pickle.loads(answer)
        if succeeded:
            return value
        raise value

    def kill(self, programs: Iterable[psutil.Process]) -> None:
        """Kill the process; `end` kills the ``programs`` that it runs."""
        plain, supervisors = split_supervised(programs)
        self._programs += plain
        self._supervisors += supervisors
        self._process.kill()

    def end(self) -> int:
        """Wait for the end of the process and of its programs: the exit code."""
        with self._ending:
            if not connection.wait([self._process.sentinel], EXIT_SECONDS):
                self._process.kill()
                connection.wait([self._process.sentinel])
            with _exit_codes:
                self._process.join()
            kill_processes(self._programs)
            kill_processes(wait_until_ended(self._supervisors, GRACE_SECONDS))
            self._pipe.close()
        return self._process.exitcode

    def _receive(self, timeout: float | None = None) -> bytes:
        try:
            if not self._has_message(timeout):
                raise _TimeIsUpError
            if self._pipe.poll():
                return self._pipe.recv_bytes()
        except (OSError, EOFError) as error:
            raise _WorkerDiedError from error
        raise _WorkerDiedError

    def _has_message(self, timeout: float | None) -> bool:
        """Wait for a message or the end of the process; False if there is neither after ``timeout`` seconds."""
        deadline = None if timeout is None else time.monotonic() + timeout
        while True:
            # An hour at most at a time: what the system can wait for in one call is limited.
            left = 3600.0 if deadline is None else max(0.0, min(deadline - time.monotonic(), 3600.0))
            # The process too, because a program that it forked may keep the pipe open.
            if connection.wait([self._pipe, self._process.sentinel], left):
                return True
            if deadline is not None and time.monotonic() >= deadline:
                return False


def _serve(pipe: Connection, function: bytes) -> None:
    """What a worker process does: apply the function to the tasks that come through its pipe."""
    _prepare_process()
    is_prepared = False
    with contextlib.suppress(EOFError, OSError):  # the head process has closed the pool
        while True:
            task = pipe.recv_bytes()
            if not is_prepared:
                with contextlib.suppress(BaseException):  # for the imports; an error is raised again below
                    pickle.loads(function), pickle.loads(task)
                is_prepared = True
            pipe.send_bytes(_STARTED)
            pipe.send_bytes(_answer(function, task))


def _answer(function: bytes, task: bytes) -> bytes:
    """(True, result) or (False, exception), pickled. What is not an `Exception`, such as SystemExit, is a failure."""
    try:
        return pickle.dumps((True, pickle.loads(function)(pickle.loads(task))), pickle.HIGHEST_PROTOCOL)
    except Exception as error:
        return _pickled_error(error)
    except BaseException as error:  # Ctrl-C is ignored here, so that none of them is the user's
        return pickle.dumps((True, TaskFailure("failed", reason(error), traceback_of(error))))


def _pickled_error(error: Exception) -> bytes:
    try:
        pickled = pickle.dumps((False, error))
        pickle.loads(pickled)  # some exceptions can be pickled and not unpickled
        return pickled
    except BaseException:
        return pickle.dumps((False, RuntimeError(reason(error))))


def _prepare_process() -> None:
    """Leave Ctrl-C to the head process, end with it, and compute with one thread."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_head, daemon=True).start()
    # Libraries that are loaded from here on read the variables that it sets; threadpoolctl tells those loaded already.
    import_module("studies.execution.preload")
    threadpoolctl.threadpool_limits(1)


def _end_with_head() -> None:
    """Exit when the head process has ended: a worker that hangs would outlive it."""
    head = multiprocessing.parent_process()
    if head is not None:
        head.join()
        os._exit(1)
