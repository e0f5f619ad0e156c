"""Tasks on other machines, by dask.distributed: ``pip install 'heatwalk[dask]'``."""

import contextlib
import gc
import logging
import multiprocessing
import pickle
import sys
import time
import uuid
import warnings
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import CancelledError
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from typing import Any, ClassVar

from studies.execution.engine import TaskFailure, check_limits, check_workers
from studies.execution.interruption import reason
from studies.execution.worker_pool import WorkerPool
from studies.planning.targets import construct
from studies.planning.types import has_type

try:
    import distributed
except ImportError as error:
    raise ImportError("engine=dask needs dask.distributed: pip install 'heatwalk[dask]'") from error

NOTICE_SECONDS = 60.0  # between two lines that say that workers are awaited
REFILL_SECONDS = 5.0  # after which workers that have joined get tasks, even if no task has finished


@dataclass(frozen=True)
class Dask:
    """Execute tasks on the workers of a dask scheduler.

    Each thread of a dask worker has a process of its own, as with `Local`: a task that crashes, hangs or outgrows its
    memory has the outcome that it would have there, and the dask worker goes on. The tasks of a dask worker that dies
    run again on another one, as often as the scheduler's setting ``allowed-failures`` permits.

    Parameters
    ----------
    address : str, optional
        address of a running scheduler, such as "tcp://10.0.0.1:8786"
    cluster : mapping, optional
        instead: the class that starts a cluster for the study (``_target_``, such as dask_jobqueue.SLURMCluster) and
        its options
    workers : int, optional
        number of workers that the cluster is asked for; by default what it starts by itself
    wait : float, optional
        seconds to wait for a first worker, and for another one when all have gone; by default without end
    timeout, memory : optional
        limits of one task, as for `Local`

    Raises
    ------
    ValueError
        If an option is not what it should be, or not exactly one of ``address`` and ``cluster`` is given.
    """

    remote: ClassVar[bool] = True
    address: str | None = None
    cluster: Mapping[str, Any] | None = None
    workers: int | None = None
    wait: float | None = None
    timeout: float | None = None
    memory: int | str | None = None
    _sessions: list["_DaskSession"] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if (self.address is None) == (self.cluster is None):
            raise ValueError(
                "engine=dask requires either engine.address=tcp://HOST:PORT of a running scheduler, "
                "or 'engine.cluster={_target_:dask_jobqueue.SLURMCluster,…}'"
            )
        if self.address is not None and not (isinstance(self.address, str) and self.address):
            raise ValueError(f"engine.address is {self.address!r}: must be text, such as tcp://HOST:8786")
        if self.cluster is not None and not (isinstance(self.cluster, Mapping) and "_target_" in self.cluster):
            raise ValueError(
                f"engine.cluster is {self.cluster!r}: must be a class and its options, as in "
                "'engine.cluster={_target_:dask_jobqueue.SLURMCluster,cores:1,memory:4GB}'"
            )
        if self.wait is not None and not (has_type(self.wait, float) and self.wait > 0):
            raise ValueError(f"engine.wait is {self.wait!r}: must be a number of seconds above 0, or null")
        check_workers(self.workers)
        check_limits(self.timeout, self.memory)

    @property
    def processes(self) -> int | None:
        """How many workers the cluster is asked for."""
        return self.workers

    def warm_up(self) -> None:
        """Nothing: workers are asked for when a session opens."""

    @contextmanager
    def open(self, function: Callable[[Any], Any]) -> Iterator["_DaskSession"]:
        """A session that applies ``function`` to tasks on the workers; see `studies.execution.Engine`.

        Raises
        ------
        OSError
            If the scheduler cannot be reached, or the cluster refuses to start any worker. `wait` of the session
            raises it if no worker comes within the time ``wait``.
        """
        logging.getLogger("distributed").setLevel(logging.WARNING)  # not a line for each worker that joins or leaves
        name = f"studies-{uuid.uuid4().hex}"
        with ExitStack() as stack:
            client = stack.enter_context(self._client(stack))
            plugin = _IsolationPlugin(sys.path, pickle.dumps(function), self.timeout, self.memory)
            client.register_plugin(plugin, name=name)
            stack.callback(client.unregister_worker_plugin, name)
            session = _DaskSession(client, name, self.workers or 1, self.address or "the cluster", self.wait)
            self._sessions.append(session)
            stack.callback(self._sessions.remove, session)
            yield session

    def active(self) -> list[Any]:
        """The tasks that workers have: one per thread is being worked on, and one may wait behind it."""
        return [task for session in self._sessions[:] for task in session.active()]

    def _client(self, stack: ExitStack) -> distributed.Client:
        if self.cluster is None:
            try:
                return distributed.Client(self.address, set_as_default=False)
            except ValueError as error:
                raise ValueError(f"engine.address is {self.address!r}: {error}") from error
        with _quiet("asyncio", "tornado.application"):  # they log the traceback of every worker that is refused
            cluster = stack.enter_context(_start_cluster(self.cluster))
            stack.callback(gc.collect)  # dask asserts, when it closes a cluster, that no object of a job is left
            if self.workers:
                cluster.scale(self.workers)
            if isinstance(cluster, distributed.SpecCluster):
                _check_started(cluster)
        return distributed.Client(cluster, set_as_default=False)


@contextmanager
def _quiet(*loggers: str) -> Iterator[None]:
    """No messages of these loggers, nor of a dashboard that moves to another port, while the block runs."""
    levels = {name: logging.getLogger(name).level for name in loggers}
    for name in loggers:
        logging.getLogger(name).setLevel(logging.CRITICAL + 1)
    try:
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", r"Port \d+ is already in use")
            yield
    finally:
        for name, level in levels.items():
            logging.getLogger(name).setLevel(level)


def _start_cluster(options: Mapping[str, Any]) -> Any:
    """A cluster, as a context manager."""
    cluster = construct("engine.cluster", options, ValueError)
    if isinstance(cluster, partial):  # of a function
        cluster = cluster()
    if not isinstance(cluster, distributed.deploy.Cluster):
        raise ValueError(f"engine.cluster._target_={options['_target_']} is not a cluster of dask")
    return cluster


def _check_started(cluster: distributed.SpecCluster) -> None:
    """Raise if the cluster has no workers, or none of them could be started; print if some could not."""

    async def start_again() -> list[str]:
        """Per worker, why it could not be started; "" if it could."""
        with contextlib.suppress(Exception):  # it raises for the first worker that could not be started
            await cluster
        problems = []
        for worker in list(cluster.workers.values()):
            try:
                await worker  # what has been started answers at once; what could not be is tried again, and tells why
                problems.append("")
            except Exception as error:
                worker.status = distributed.Status.failed  # or the cluster could not be closed
                problems.append(reason(error))
        return problems

    if not cluster.worker_spec:
        raise ValueError("engine.workers is required: the cluster starts no worker by itself; engine.workers=N")
    problems = cluster.sync(start_again)
    refused = [problem for problem in problems if problem]
    if refused:
        message = f"{len(refused)} of {len(problems)} workers of the cluster could not be started: {refused[0]}"
        if len(refused) == len(problems):
            raise OSError(message)
        print(message, file=sys.stderr, flush=True)


class _DaskSession:
    def __init__(
        self, client: distributed.Client, plugin: str, n_expected: int, scheduler: str, limit: float | None
    ) -> None:
        self._client = client
        self._plugin = plugin
        self._n_expected = n_expected
        self._scheduler = scheduler
        self._limit = limit
        self._alone_since: float | None = None  # when it was first seen that there is no worker
        self._notice_at = 0.0  # how many seconds later a line says so
        self._pending: dict[distributed.Future, Any] = {}

    @property
    def pending(self) -> int:
        return len(self._pending)

    def has_room(self) -> bool:
        return len(self._pending) < 2 * max(sum(self._client.nthreads().values()), self._n_expected)

    def submit(self, task: Any) -> None:
        self._pending[self._client.submit(_run_isolated, self._plugin, pickle.dumps(task), pure=False)] = task

    def wait(self) -> list[tuple[Any, Any]]:
        finished: list[distributed.Future] = []
        while self._pending and not finished:
            with self._client.as_current(), contextlib.suppress(TimeoutError):
                seconds = min(REFILL_SECONDS, self._limit or REFILL_SECONDS)
                distributed.wait(list(self._pending), timeout=seconds, return_when="FIRST_COMPLETED")
            finished = [future for future in self._pending if future.done()]
            self._check_workers()
            if self.has_room():
                break
        return [(self._pending.pop(future), self._outcome(future)) for future in finished]

    def _check_workers(self) -> None:
        """Say that workers are awaited if there are none; TimeoutError if that takes too long."""
        if self._client.nthreads():
            self._alone_since = None
            self._notice_at = 0.0
            return
        now = time.monotonic()
        if self._alone_since is None:
            self._alone_since = now
        waited = now - self._alone_since
        if self._limit is not None and waited >= self._limit:
            raise TimeoutError(
                f"no worker of {self._scheduler} has come within engine.wait={self._limit:g} seconds; the rows before "
                "are stored, and the same command continues from there"
            )
        if waited >= self._notice_at:
            self._notice_at = waited + NOTICE_SECONDS
            limit = "no limit (engine.wait=SECONDS sets one)" if self._limit is None else f"{self._limit:g} seconds"
            print(
                f"waiting for workers of {self._scheduler}, {waited:.0f} seconds so far, {limit}",
                file=sys.stderr,
                flush=True,
            )

    def active(self) -> list[Any]:
        keys = {key for keys in self._client.processing().values() for key in keys}
        return [task for future, task in list(self._pending.items()) if future.key in keys]

    def _outcome(self, future: distributed.Future) -> Any:
        try:
            return future.result()
        except distributed.KilledWorker as error:
            return TaskFailure("crashed", f"the worker that ran it died, {error.allowed_failures + 1} times")
        except CancelledError as error:
            raise ConnectionError(f"the scheduler at {self._scheduler} lost the study's tasks") from error


def _run_isolated(plugin: str, task: bytes) -> Any:
    plugins: dict[str, Any] = distributed.get_worker().plugins
    try:
        return plugins[plugin].pool.outcome(task)
    except CancelledError:  # this worker is closing
        raise distributed.Reschedule from None


class _IsolationPlugin(distributed.WorkerPlugin):
    """What a dask worker has for one study: the module path of the head process, and a process per thread."""

    def __init__(self, path: list[str], function: bytes, timeout: float | None, memory: int | str | None) -> None:
        self._path = path
        self._function = function
        self._limits = timeout, memory

    def setup(self, worker: distributed.Worker) -> None:
        sys.path.extend(folder for folder in self._path if folder not in sys.path)
        # A worker is a daemon of its nanny, and daemons may not have children. This is what dask's setting
        # ``distributed.worker.daemon`` does, which would have to be made on every worker before it starts.
        multiprocessing.process.current_process()._config["daemon"] = False  # type: ignore[attr-defined]
        self.pool = WorkerPool(self._function, worker.state.nthreads, *self._limits)

    def teardown(self, worker: distributed.Worker) -> None:
        self.pool.close()
