"""What an engine is: the protocol that `Serial`, `Local` and `Dask` implement, and the limits of a task.

A task is any object that can be pickled. An engine applies one function to many tasks, in whatever process it likes,
and returns each task with its outcome: the value of the function, or a `TaskFailure`.
"""

import re
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar

from studies.execution.interruption import is_ctrl_c, reason, traceback_of

_Task = TypeVar("_Task")
_Result = TypeVar("_Result")


@dataclass(frozen=True)
class TaskFailure:
    """The outcome of a task that returned no result.

    Parameters
    ----------
    status : str
        "failed" (it raised an exception), "timeout" (it took too long) or "crashed" (its process died)
    reason : str
        one line for the user
    traceback : str
        where the exception was raised, "" if there was none
    """

    status: str
    reason: str
    traceback: str = field(default="", compare=False, repr=False)


class TaskFailedError(RuntimeError):
    """A task that was required failed; the message is the reason of its `TaskFailure`."""


class Session(Protocol):
    """Tasks that an engine is working on. Opened by `Engine.open`; used by one thread."""

    @property
    def pending(self) -> int:
        """How many submitted tasks `wait` has not returned yet."""

    def has_room(self) -> bool:
        """Whether another task should be submitted: a few are kept ahead of the workers, not all of them."""

    def submit(self, task: Any) -> None:
        """Hand over a task."""

    def wait(self) -> list[tuple[Any, Any]]:
        """Block until a submitted task has finished.

        Returns
        -------
        list of tuple
            (task, outcome) of each task that has finished since the last call. Empty if no task is pending, or if
            room for further tasks has become available meanwhile.
        """


class Engine(Protocol):
    """Where tasks are executed."""

    @property
    def remote(self) -> bool:
        """Whether workers may be unable to see the files of this machine."""

    @property
    def processes(self) -> int | None:
        """How many tasks run at the same time; None if that is not known in advance."""

    def warm_up(self) -> None:
        """Start in the background what every session needs; returns at once."""

    def open(self, function: Callable[[Any], Any]) -> AbstractContextManager[Session]:
        """A session that applies ``function`` to tasks; leaving it ends all work."""

    def active(self) -> list[Any]:
        """The tasks that are being worked on. May be called from any thread."""


def map_ordered(engine: Engine, function: Callable[[_Task], _Result], tasks: Iterable[_Task]) -> list[_Result]:
    """Apply a function to each of a few tasks.

    Parameters
    ----------
    engine : Engine
    function : callable
        task -> result; it and its results are pickled unless the engine is `Serial`
    tasks : iterable

    Returns
    -------
    list
        the results, in the order of the tasks

    Raises
    ------
    TaskFailedError
        If a task fails, for the first that does.

    Examples
    --------
    >>> from studies.execution import Serial
    >>> map_ordered(Serial(), abs, [-1, 2, -3])
    [1, 2, 3]
    """
    results: dict[int, _Result] = {}
    numbered = enumerate(tasks)
    with engine.open(_apply) as session:
        while True:
            while session.has_room() and (following := next(numbered, None)) is not None:
                session.submit((following[0], function, following[1]))
            if not session.pending:
                return [results[i] for i in range(len(results))]
            for (i, *_), outcome in session.wait():
                if isinstance(outcome, TaskFailure):
                    raise TaskFailedError(outcome.reason)
                results[i] = outcome


def _apply(numbered: tuple[int, Callable[[Any], Any], Any]) -> Any:
    """The function's result for a task, or the exception as a failure."""
    _, function, task = numbered
    try:
        return function(task)
    except BaseException as error:
        if is_ctrl_c(error):
            raise
        return TaskFailure("failed", reason(error), traceback_of(error))


def check_limits(timeout: float | None, memory: int | str | None) -> None:
    """Check the limits of a task.

    Raises
    ------
    ValueError
        If ``timeout`` is not positive, or ``memory`` is not a size.
    """
    if timeout is not None and not (isinstance(timeout, int | float) and timeout > 0):
        raise ValueError(f"trial.timeout is {timeout!r}: must be a number of seconds above 0, or null")
    if memory is not None:
        parse_bytes(memory)


def check_workers(workers: int | None) -> None:
    """Raise ValueError unless ``workers`` is None or a whole number of at least 1."""
    if workers is not None and (isinstance(workers, bool) or not isinstance(workers, int) or workers < 1):
        raise ValueError(f"engine.workers is {workers!r}: must be a whole number of at least 1, or null")


def parse_bytes(memory: int | str) -> int:
    """A size in bytes.

    Parameters
    ----------
    memory : int or str
        bytes, or a number with a unit: "2 GB" (powers of 1000) or "1.9GiB" (powers of 1024)

    Raises
    ------
    ValueError
        If it is not a size of at least one byte.

    Examples
    --------
    >>> parse_bytes("1.5 MB"), parse_bytes("4 GiB"), parse_bytes(1500)
    (1500000, 4294967296, 1500)
    """
    match = re.fullmatch(r"\s*(\d+(?:\.\d*)?|\.\d+)\s*(?:([kmgt]?)(i?)b)?\s*", str(memory), re.ASCII | re.IGNORECASE)
    size = float(match[1]) * (1024 if match[3] else 1000) ** " kmgt".index((match[2] or " ").lower()) if match else 0
    if size < 1:
        raise ValueError(f"trial.memory is {memory!r}: must be bytes, a size such as '2 GB', or null")
    return int(size)
