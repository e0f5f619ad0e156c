"""How much memory a piece of code needs at most, above what its process used before."""

from __future__ import annotations

import ctypes
import re
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

MEGABYTE = 1e6  # bytes
INTERVAL = 0.002  # seconds between two samples, where the system keeps no mark that can be reset

_RESET = "5"  # sets the mark to what is used now: man 5 proc, /proc/pid/clear_refs
_CLEAR, _STATUS = Path("/proc/self/clear_refs"), Path("/proc/self/status")
_MARK = re.compile(r"^VmHWM:\s*(\d+) kB", re.MULTILINE)


@dataclass
class PeakMemory:
    """What `peak_memory` measured.

    Attributes
    ----------
    megabytes : float or None
        10⁶ bytes; None until the block has ended, and where it cannot be measured
    """

    megabytes: float | None = None


@contextmanager
def peak_memory() -> Iterator[PeakMemory]:
    """Measure the peak of this process's resident memory while a block runs, above what it was at its start.

    On Linux the kernel keeps the peak, and reading it costs about 0.1 ms; freed memory that the C library has kept is
    returned first, which takes up to 2 ms, or what comes next would seem to need none. Elsewhere a thread samples the
    memory, and what the process had freed and kept counts as used before. Programs that the block starts do not count;
    code that it loads does, and so do other threads of the process.

    Yields
    ------
    PeakMemory
        with its value after the block

    Examples
    --------
    >>> import numpy as np
    >>> with peak_memory() as memory:
    ...     total = np.ones(5_000_000).sum()
    >>> memory.megabytes is None or 35 < memory.megabytes < 60
    True
    """
    memory = PeakMemory()
    before = _reset_mark()
    if before is not None:
        yield memory
        after = _mark()
        memory.megabytes = None if after is None else max(after - before, 0) / MEGABYTE
        return
    with _sampled(memory):
        yield memory


def _reset_mark() -> int | None:
    """Let the kernel's mark of the highest memory start again; its value in bytes, None if that is not possible."""
    if not sys.platform.startswith("linux"):
        return None
    trim = getattr(ctypes.CDLL(None), "malloc_trim", None)
    if trim is not None:  # a function of glibc
        trim(0)
    try:
        _CLEAR.write_text(_RESET)
    except OSError:  # a system that is like Linux, or a container that forbids it
        return None
    return _mark()


def _mark() -> int | None:
    """The highest resident memory since the mark was reset, in bytes."""
    try:
        found = _MARK.search(_STATUS.read_text())
    except OSError:
        return None
    return int(found[1]) * 1024 if found else None


@contextmanager
def _sampled(memory: PeakMemory) -> Iterator[None]:
    """Measure by samples, at the start, at the end, and every `INTERVAL` between."""
    import psutil

    process, ended = psutil.Process(), threading.Event()
    before = process.memory_info().rss
    samples = [before]

    def sample() -> None:
        while not ended.wait(INTERVAL):
            samples.append(process.memory_info().rss)

    thread = threading.Thread(target=sample, daemon=True)
    thread.start()
    try:
        yield
    finally:
        ended.set()
        thread.join()
        samples.append(process.memory_info().rss)
    memory.megabytes = (max(samples) - before) / MEGABYTE
