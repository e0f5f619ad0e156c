"""Tasks in processes on this machine."""

import concurrent.futures
import pickle
from collections.abc import Callable, Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, ClassVar

from studies.execution.engine import check_limits, check_workers
from studies.execution.fork_server import process_context
from studies.execution.worker_pool import WorkerPool


@dataclass(frozen=True)
class Local:
    """Execute tasks in processes on this machine, each with one BLAS thread.

    A process that dies, hangs or outgrows its memory costs its own task only.

    Parameters
    ----------
    workers : int, optional
        number of processes; by default one per processor that this process may use
    timeout : float, optional
        seconds that a task may take
    memory : int or str, optional
        what a worker and the programs that it runs may hold together: bytes, or a size such as "2 GB"

    Raises
    ------
    ValueError
        If an option is not what it should be.

    Examples
    --------
    >>> from studies.execution import map_ordered
    >>> map_ordered(Local(workers=1, timeout=60, memory="2 GB"), abs, [-1, 2, -3])
    [1, 2, 3]
    """

    remote: ClassVar[bool] = False
    workers: int | None = None
    timeout: float | None = None
    memory: int | str | None = None
    _sessions: list["_LocalSession"] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        check_workers(self.workers)
        check_limits(self.timeout, self.memory)

    @property
    def processes(self) -> int:
        """How many tasks run at the same time."""
        if self.workers is not None:
            return self.workers
        import loky  # respects the affinity of this process, and the limits of a container

        return loky.cpu_count()

    def warm_up(self) -> None:
        """Start the process that workers are forked from; it imports what they need."""
        process_context()

    @contextmanager
    def open(self, function: Callable[[Any], Any]) -> Iterator["_LocalSession"]:
        """A session that applies ``function`` to tasks in worker processes; see `studies.execution.Engine`."""
        n_workers = self.processes
        pool = WorkerPool(pickle.dumps(function), n_workers, self.timeout, self.memory)
        threads = ThreadPoolExecutor(n_workers, thread_name_prefix="worker")
        session = _LocalSession(pool, threads, n_workers)
        self._sessions.append(session)
        try:
            yield session
        finally:
            self._sessions.remove(session)
            threads.shutdown(wait=False, cancel_futures=True)
            pool.close()
            threads.shutdown()

    def active(self) -> list[Any]:
        """The tasks that workers are on."""
        return [task for session in self._sessions[:] for task in session.active()]


class _LocalSession:
    """A thread per worker process hands over the tasks, so that workers never wait for this process."""

    def __init__(self, pool: WorkerPool, threads: ThreadPoolExecutor, n_workers: int) -> None:
        self._pool = pool
        self._threads = threads
        self._n_workers = n_workers
        self._pending: dict[Future[Any], Any] = {}

    @property
    def pending(self) -> int:
        return len(self._pending)

    def has_room(self) -> bool:
        return len(self._pending) < 2 * self._n_workers

    def submit(self, task: Any) -> None:
        self._pending[self._threads.submit(self._pool.outcome, pickle.dumps(task))] = task

    def wait(self) -> list[tuple[Any, Any]]:
        finished, _ = concurrent.futures.wait(self._pending, return_when=concurrent.futures.FIRST_COMPLETED)
        return [(self._pending.pop(future), future.result()) for future in finished]

    def active(self) -> list[Any]:
        return [task for future, task in list(self._pending.items()) if future.running()]
