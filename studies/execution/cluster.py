"""Trials on other machines, by dask.distributed: ``pip install 'heatwalk[dask]'``."""

import contextlib
import logging
import multiprocessing
import pickle
import sys
import threading
import uuid
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import CancelledError
from dataclasses import dataclass, field
from itertools import islice
from typing import ClassVar

import hydra.utils

from studies.execution.engine import Lost, Processes, check_limits

try:
    import distributed
except ImportError as error:
    raise ImportError("engine=dask needs dask.distributed: pip install 'heatwalk[dask]'") from error

_TOP_UP = 5  # seconds after which workers that joined meanwhile get tasks, if nothing finishes before


@dataclass(frozen=True)
class Dask:
    """Workers of a dask scheduler. Each thread of a worker has a process of its own, as `Local` has them.

    So a task that crashes, hangs or outgrows its memory costs itself and no worker, and has the outcome that it has
    under `Local`. The tasks of a worker that dies run again on another, and are Lost when that happens as often as the
    scheduler allows (its setting ``allowed-failures``).

    address : of a scheduler that runs, as in "tcp://10.0.0.1:8786"
    cluster : instead, what starts one for the study: ``_target_``, such as dask_jobqueue.SLURMCluster, and its options
    workers : how many workers the cluster is asked for; None for what it starts by itself
    timeout, memory : of one task, as for `Local`
    """

    remote: ClassVar[bool] = True
    address: str | None = None
    cluster: Mapping | None = None
    workers: int | None = None
    timeout: float | None = None
    memory: int | str | None = None
    _pending: dict = field(default_factory=dict, init=False, repr=False, compare=False)
    _clients: list = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self):
        if (self.address is None) == (self.cluster is None):
            raise ValueError(
                "engine=dask needs one of engine.address=tcp://HOST:PORT, of a scheduler that runs, "
                "and 'engine.cluster={_target_:dask_jobqueue.SLURMCluster,…}'"
            )
        check_limits(self.timeout, self.memory)

    @property
    def processes(self) -> int | None:
        return self.workers

    def warm_up(self) -> None:
        pass

    def run(self, function: Callable, tasks: Iterable) -> Iterator[tuple]:
        """(task, function(task) or Lost) for every task, as they finish."""
        logging.getLogger("distributed").setLevel(logging.WARNING)  # not the coming and going of workers
        tasks = iter(tasks)
        name = f"studies-{uuid.uuid4().hex}"
        with contextlib.ExitStack() as stack:
            client = stack.enter_context(self._client(stack))
            client.register_plugin(_Isolation(sys.path, pickle.dumps(function), self.timeout, self.memory), name=name)
            stack.callback(client.unregister_worker_plugin, name)
            stack.callback(self._pending.clear)
            stack.callback(self._clients.clear)
            self._clients.append(client)
            while True:
                slots = max(sum(client.nthreads().values()), self.workers or 1)
                for task in islice(tasks, max(0, 2 * slots - len(self._pending))):
                    self._pending[client.submit(_isolated, name, pickle.dumps(task), pure=False)] = task
                if not self._pending:
                    break
                with client.as_current(), contextlib.suppress(TimeoutError):
                    distributed.wait(list(self._pending), timeout=_TOP_UP, return_when="FIRST_COMPLETED")
                for future in [future for future in self._pending if future.done()]:
                    yield self._pending.pop(future), self._outcome(future)

    def active(self) -> list:
        """The tasks that workers have: one a thread is worked on, and one may wait behind it."""
        keys = {key for client in self._clients[:] for keys in client.processing().values() for key in keys}
        return [task for future, task in list(self._pending.items()) if future.key in keys]

    def _client(self, stack):
        cluster = self.cluster and stack.enter_context(hydra.utils.instantiate(self.cluster, _convert_="all"))
        if cluster and self.workers:
            cluster.scale(self.workers)
        return distributed.Client(cluster or self.address, set_as_default=False)

    def _outcome(self, future):
        try:
            return future.result()
        except distributed.KilledWorker as error:
            return Lost("crashed", f"the worker that ran it died, {error.allowed_failures + 1} times")
        except CancelledError as error:
            raise ConnectionError(f"the scheduler at {self.address or 'the cluster'} lost the study's tasks") from error


def _isolated(name, task):
    return distributed.get_worker().plugins[name].outcome(task)


class _Isolation(distributed.WorkerPlugin):
    """What a worker has for one study: where the head process finds modules, and a process for each thread."""

    def __init__(self, path, function, timeout, memory):
        self._path = path
        self._function = function
        self._limits = timeout, memory

    def setup(self, worker):
        sys.path.extend(folder for folder in self._path if folder not in sys.path)
        # A worker is a daemon of its nanny, and those may not have children: what dask's setting
        # ``distributed.worker.daemon`` does, which would have to be made on every worker before it starts.
        multiprocessing.process.current_process()._config["daemon"] = False
        self._processes = {}

    def teardown(self, worker):
        for processes in self._processes.values():
            processes.close()

    def outcome(self, task):
        thread = threading.get_ident()
        if thread not in self._processes:
            self._processes[thread] = Processes(self._function, task, 1, *self._limits)
        processes = self._processes[thread]
        return processes.outcome(processes.submit(task))
