"""Tasks one after the other, in this process."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any, ClassVar

from studies.execution.interruption import watch_ctrl_c


@dataclass(frozen=True)
class Serial:
    """Execute one task after the other in this process, as is best for debugging.

    Parameters
    ----------
    timeout, memory : None
        A process cannot enforce limits on itself.

    Raises
    ------
    ValueError
        If a limit is given.

    Examples
    --------
    >>> with Serial().open(abs) as session:
    ...     session.submit(-2)
    ...     session.wait()
    [(-2, 2)]
    """

    remote: ClassVar[bool] = False
    timeout: float | None = None
    memory: int | str | None = None
    _active: list[Any] = field(default_factory=list, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        for limit in ("timeout", "memory"):
            if getattr(self, limit) is not None:
                raise ValueError(
                    f"trial.{limit} is {getattr(self, limit)!r}: must be null, because engine=serial cannot enforce it"
                )

    @property
    def processes(self) -> int:
        """One: this process."""
        return 1

    def warm_up(self) -> None:
        """Nothing: this process runs already."""

    @contextmanager
    def open(self, function: Callable[[Any], Any]) -> Iterator["_SerialSession"]:
        """A session that applies ``function`` to tasks in this process; see `studies.execution.Engine`."""
        try:
            with watch_ctrl_c() as was_pressed:
                yield _SerialSession(function, self._active, was_pressed)
        finally:
            self._active.clear()

    def active(self) -> list[Any]:
        """The task that is being worked on, if any."""
        return list(self._active)


class _SerialSession:
    """Executes a submitted task when it is waited for."""

    def __init__(
        self, function: Callable[[Any], Any], active: list[Any], ctrl_c_was_pressed: Callable[[], bool]
    ) -> None:
        self._function = function
        self._active = active
        self._ctrl_c_was_pressed = ctrl_c_was_pressed
        self._submitted: list[Any] = []

    @property
    def pending(self) -> int:
        return len(self._submitted)

    def has_room(self) -> bool:
        return not self._submitted

    def submit(self, task: Any) -> None:
        self._submitted.append(task)

    def wait(self) -> list[tuple[Any, Any]]:
        if not self._submitted:
            return []
        task = self._submitted.pop(0)
        self._active[:] = [task]
        outcome = self._function(task)
        if self._ctrl_c_was_pressed():  # and the function has caught it
            raise KeyboardInterrupt
        self._active.clear()
        return [(task, outcome)]
