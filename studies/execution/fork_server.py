"""The process that worker processes are forked from, and when it starts.

It imports what workers need, which takes longer than all that a study does before its first trial. A command therefore
starts it before it imports anything itself.
"""

import multiprocessing
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from multiprocessing.context import BaseContext

# Workers are forked, from a process that has imported what they need; not from this process, because a fork inherits
# locks that other threads of its parent hold. Elsewhere each worker starts anew: the libraries of macOS do not survive
# any fork, and Windows has none.
START_METHOD = "forkserver" if sys.platform == "linux" else "spawn"

# The variable that tells the process that workers are forked from which process it is started for.
HEAD = "STUDIES_HEAD_PROCESS"

_SWEEP = ("-m", "--multirun")


def process_context() -> BaseContext:
    """The way in which worker processes are started; see `START_METHOD`."""
    context = multiprocessing.get_context(START_METHOD)
    if START_METHOD == "forkserver":
        from multiprocessing import forkserver, resource_tracker

        context.set_forkserver_preload(["studies.execution.preload"])
        resource_tracker.ensure_running()  # or the next call would start it, which lets Ctrl-C in again
        os.environ[HEAD] = str(os.getpid())
        try:
            with _ctrl_c_later():
                forkserver.ensure_running()
        finally:
            del os.environ[HEAD]
    return context


def start_for_command(arguments: Sequence[str]) -> None:
    """Start the process that workers are forked from if a command looks as if it needed workers.

    If it does, and the process is not there, `studies.execution.Local` starts it later. If it does not after all,
    because it has a mistake, the process ends when the command does.

    Parameters
    ----------
    arguments : sequence of str
        those of `studies.run`
    """
    if _needs_workers(arguments):
        process_context()


def _needs_workers(arguments: Sequence[str]) -> bool:
    """Whether arguments name a study, and neither another engine, a dry run nor settings of Hydra."""
    options = [argument.lstrip("+") for argument in arguments if argument not in _SWEEP]
    return any(option.startswith("study=") for option in options) and not any(
        option.startswith(("-", "hydra", "engine._target_"))
        or (option.startswith("engine=") and option != "engine=local")
        or (option.startswith("dry_run=") and option.lower() != "dry_run=false")
        for option in options
    )


@contextmanager
def _ctrl_c_later() -> Iterator[None]:
    """Have Ctrl-C wait for the end of the block, and in processes that it starts until they have said what it does.

    Such a process would print where it was interrupted. `studies.execution.preload` has it ignore Ctrl-C.
    """
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)
