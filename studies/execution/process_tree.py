"""Processes and their descendants."""

import contextlib
import sys
from collections.abc import Collection, Iterable, Sequence
from pathlib import Path

import psutil

_SUPERVISOR = Path(__file__).with_name("supervise_program.py")


def find_families(pids: Collection[int]) -> dict[int, list[psutil.Process]]:
    """Processes and their descendants, found in one pass over the processes of the machine.

    Parameters
    ----------
    pids : collection of int
        process ids

    Returns
    -------
    dict
        process id -> the process, followed by its descendants, parents first. Only descendants of this process are
        included: a process that is not has died, and its id may belong to another.
    """
    families: dict[int, list[psutil.Process]] = {}
    root_of: dict[int, int] = {}
    for process in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.Error):  # it has ended meanwhile
            root = process.pid if process.pid in pids else root_of.get(process.ppid())
            if root is not None:
                root_of[process.pid] = root
                families.setdefault(root, []).append(process)
    return families


def resident_memory(processes: Iterable[psutil.Process]) -> int:
    """Bytes of memory that processes hold together; native libraries reserve far more than they use."""
    total = 0
    for process in processes:
        with contextlib.suppress(psutil.Error):
            total += process.memory_info().rss
    return total


def supervised(command: Sequence[str], folder: Path | str) -> list[str]:
    """A command that runs a program which ends with the process that started it; see `supervise_program`.

    Parameters
    ----------
    command : sequence of str
        the program and its arguments
    folder : Path
        temporary folder of the program, which is removed if that process is killed

    Returns
    -------
    list of str
        to be started with a pipe as its standard input, which is kept open
    """
    packages = Path(psutil.__file__).parents[1]
    return [sys.executable, "-I", "-S", str(_SUPERVISOR), str(packages), str(folder), *command]


def split_supervised(processes: Iterable[psutil.Process]) -> tuple[list[psutil.Process], list[psutil.Process]]:
    """Separate what ends by itself when its root is killed.

    Parameters
    ----------
    processes : iterable of psutil.Process
        descendants of a process, parents first

    Returns
    -------
    tuple of two lists
        those that have to be killed, and the supervisors of the others
    """
    plain, supervisors = [], []
    supervised_ids = set()
    for process in processes:
        with contextlib.suppress(psutil.Error):  # it has ended
            if process.ppid() in supervised_ids:
                supervised_ids.add(process.pid)
            elif str(_SUPERVISOR) in process.cmdline():
                supervised_ids.add(process.pid)
                supervisors.append(process)
            else:
                plain.append(process)
    return plain, supervisors


def kill_processes(processes: Iterable[psutil.Process]) -> None:
    """Kill those of the processes that are still alive."""
    for process in processes:
        with contextlib.suppress(psutil.Error):
            process.kill()
