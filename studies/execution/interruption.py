"""Ctrl-C, as distinct from an exception of the same name that the code under study raises.

Methods, perturbations, metrics and datasets are other people's code. Whatever they raise is the failure of one trial,
also what is not an `Exception`: ``sys.exit()`` in a wrapped program, a KeyboardInterrupt or GeneratorExit of their own.
"""

import contextlib
import signal
import threading
import traceback
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

# What is kept of a traceback.
TRACEBACK_LINES = 100
TRACEBACK_WIDTH = 1000


class _Watch:
    """A handler of SIGINT that notes the signal before the previous handler raises KeyboardInterrupt."""

    def __init__(self, previous: Any) -> None:
        self.previous = previous
        self.was_pressed = False

    def __call__(self, number: int, frame: FrameType | None) -> None:
        self.was_pressed = True
        self.previous(number, frame)


@contextlib.contextmanager
def watch_ctrl_c() -> Iterator[Callable[[], bool]]:
    """Note Ctrl-C while the block runs, so that `is_ctrl_c` recognizes it. No effect outside the main thread.

    Yields
    ------
    callable
        () -> whether Ctrl-C has been pressed, even if the exception that it raised has been caught
    """
    previous = signal.getsignal(signal.SIGINT)
    # A handler that is not callable ignores the signal, or ends the process; None was not installed by Python.
    if threading.current_thread() is not threading.main_thread() or not callable(previous):
        yield lambda: False
        return
    watch = _Watch(previous)
    signal.signal(signal.SIGINT, watch)
    try:
        yield lambda: watch.was_pressed
    finally:
        is_main = threading.current_thread() is threading.main_thread()  # a generator may be closed in another one
        if is_main and signal.getsignal(signal.SIGINT) is watch:
            signal.signal(signal.SIGINT, previous)


@contextlib.contextmanager
def keep_ctrl_c() -> Iterator[None]:
    """Keep the handler of Ctrl-C while the block imports a module: `dask_jobqueue` installs one of its own.

    Examples
    --------
    >>> before = signal.getsignal(signal.SIGINT)
    >>> with keep_ctrl_c():
    ...     _ = signal.signal(signal.SIGINT, signal.SIG_IGN)
    >>> signal.getsignal(signal.SIGINT) is before
    True
    """
    before = signal.getsignal(signal.SIGINT)
    try:
        yield
    finally:
        is_main = threading.current_thread() is threading.main_thread()
        if is_main and before is not None and signal.getsignal(signal.SIGINT) is not before:
            signal.signal(signal.SIGINT, before)


def is_ctrl_c(error: BaseException) -> bool:
    """Whether an exception stems from the user's Ctrl-C, and must not be treated as the failure of a trial.

    Examples
    --------
    >>> with watch_ctrl_c():  # in the main thread
    ...     is_ctrl_c(KeyboardInterrupt()), is_ctrl_c(SystemExit(0))
    (False, False)
    """
    if not isinstance(error, KeyboardInterrupt) or threading.current_thread() is not threading.main_thread():
        return False
    handler = signal.getsignal(signal.SIGINT)
    if isinstance(handler, _Watch):
        return handler.was_pressed
    return handler is not signal.SIG_IGN  # worker processes ignore it


def traceback_of(error: BaseException) -> str:
    """Where an exception was raised, as Python shows it; of a deep recursion the first and last lines."""
    try:
        lines = "".join(traceback.format_exception(error)).splitlines()
    except BaseException as raised:  # such as one of the message of the exception
        if is_ctrl_c(raised):
            raise
        return reason(error)
    if len(lines) > TRACEBACK_LINES:
        half = TRACEBACK_LINES // 2
        lines = [*lines[:half], f"  … {len(lines) - 2 * half} lines …", *lines[-half:]]
    return "\n".join(line[:TRACEBACK_WIDTH] for line in lines)


def reason(error: BaseException) -> str:
    """An exception as one line.

    Examples
    --------
    >>> reason(SystemExit(3))
    'SystemExit: 3'
    """
    try:
        text = str(error)
    except BaseException as raised:
        if is_ctrl_c(raised):
            raise
        text = "(its message cannot be shown)"
    return " ".join(f"{type(error).__name__}: {text}".split())
