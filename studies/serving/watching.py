"""The state of results folders, read again only where something has changed."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

from studies.storage import PLAN_FILE, ROWS_FILE, TABLE_FILE, lock_holder, read_config, result_folders
from studies.storage.records import CONFIG_FILE
from studies.storage.summary import FolderSummary, Summarizer

WALK_SECONDS = 1.0  # new folders are looked for that often
SPEED_SECONDS = 120.0  # the time left is estimated from the trials of this time
LATEST = 25  # rows that are kept to be shown, and as many failures

Signature = tuple[tuple[int, int, int] | None, ...]


class FolderWatch:
    """What a results folder contains at the moment.

    Parameters
    ----------
    folder : Path
    clock : callable
        () -> seconds

    Attributes
    ----------
    latest, failures : deque of dict
        the newest rows, and the newest of those that failed, newest last; empty as long as only the table was read
    """

    def __init__(self, folder: Path, clock: Callable[[], float] = time.monotonic) -> None:
        self.folder = folder
        self.latest: deque[dict[str, Any]] = deque(maxlen=LATEST)
        self.failures: deque[dict[str, Any]] = deque(maxlen=LATEST)
        self._clock = clock
        self._summarizer = Summarizer(folder, self._note, self._forget)
        self._read: tuple[Signature, FolderSummary] | None = None  # the last summary, and of what
        self._progress: deque[tuple[float, int]] = deque()  # when how many trials were done, while it runs
        self._title: tuple[Signature, str] | None = None
        self._lock = threading.Lock()

    @property
    def signature(self) -> Signature:
        """What tells whether rows, table or plan have changed."""
        return signature_of(*(self.folder / name for name in (ROWS_FILE, TABLE_FILE, PLAN_FILE)))

    def summary(self) -> FolderSummary:
        """The summary of the folder, from what is new in it.

        Raises
        ------
        ValueError
            If its table is not the table of a study.
        OSError
            If a file cannot be read.
        """
        with self._lock:
            signature = self.signature
            if self._read is None or self._read[0] != signature:
                self._read = signature, self._summarizer.summary()
            summary = replace(self._read[1], holder=lock_holder(self.folder))
            self._note_progress(summary)
            return summary

    def seconds_left(self) -> float | None:
        """The seconds until the study ends, if it goes on as in the last minutes; None if that is not known."""
        with self._lock:
            if self._read is None or len(self._progress) < 2:
                return None
            (start, first), (end, last) = self._progress[0], self._progress[-1]
            if last <= first:
                return None
            left = self._read[1].n_missing * (end - start) / (last - first)
            return max(0.0, left - (self._clock() - end))

    def title(self) -> str:
        """The title of the study, "" if its configuration cannot be read."""
        signature = signature_of(self.folder / CONFIG_FILE)
        if self._title is None or self._title[0] != signature:
            try:
                title = str(read_config(self.folder)["title"])
            except (OSError, ValueError):
                title = ""
            self._title = signature, title
        return self._title[1]

    def _note_progress(self, summary: FolderSummary) -> None:
        """Note when how many trials are done, while the study runs."""
        if summary.holder is None:
            self._progress.clear()
            return
        now, done = self._clock(), summary.statuses.total()
        if not self._progress or done != self._progress[-1][1]:
            self._progress.append((now, done))
        while len(self._progress) > 2 and now - self._progress[1][0] > SPEED_SECONDS:
            self._progress.popleft()

    def _note(self, row: dict[str, Any]) -> None:
        self.latest.append(row)
        if row["status"] != "ok":
            self.failures.append(row)

    def _forget(self) -> None:
        self.latest.clear()
        self.failures.clear()


class Watch:
    """The results folders below a folder; new ones are found within a second.

    Parameters
    ----------
    root : Path
    contains : callable
        whether a path is below the folder, wherever symbolic links lead
    """

    def __init__(self, root: Path, contains: Callable[[Path], bool]) -> None:
        self._root = root
        self._contains = contains
        self._watches: dict[Path, FolderWatch] = {}
        self._walked = -math.inf
        self._lock = threading.Lock()

    def folders(self) -> list[FolderWatch]:
        """The results folders, sorted by their names."""
        with self._lock:
            if time.monotonic() - self._walked >= WALK_SECONDS:
                found = [folder for folder in result_folders(self._root) if self._is_inside(folder)]
                self._watches = {folder: self._watches.get(folder) or FolderWatch(folder) for folder in found}
                self._walked = time.monotonic()
            return list(self._watches.values())

    def folder(self, path: Path) -> FolderWatch | None:
        """One of the results folders; None if it is none."""
        return next((watch for watch in self.folders() if watch.folder == path), None)

    def _is_inside(self, folder: Path) -> bool:
        """Whether all that is read of a folder is inside, too."""
        return all(self._contains(folder / name) for name in (ROWS_FILE, TABLE_FILE, PLAN_FILE, CONFIG_FILE))


def signature_of(*paths: Path) -> Signature:
    """Number, size and time of files; None for those that are not there."""
    return tuple(map(_signature, paths))


def _signature(path: Path) -> tuple[int, int, int] | None:
    try:
        state = path.stat()
    except OSError:
        return None
    return state.st_ino, state.st_size, state.st_mtime_ns
