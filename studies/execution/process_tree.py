"""Processes and their descendants."""

import contextlib
from collections.abc import Collection, Iterable

import psutil


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


def end_processes(processes: Collection[psutil.Process], grace: float) -> None:
    """Wait ``grace`` seconds for processes to end by themselves, then kill those that have not."""
    _, alive = psutil.wait_procs(list(processes), timeout=grace)
    for process in alive:
        with contextlib.suppress(psutil.Error):
            process.kill()
