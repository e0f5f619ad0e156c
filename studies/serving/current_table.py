"""The main table of a study that is running, made beside the server and not more often than it is worth."""

from __future__ import annotations

import threading
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from studies.serving.watching import FolderWatch, Signature
from studies.terminal import one_line

if TYPE_CHECKING:
    from studies.columns import Table

REST = 9  # a table is made again after that many times the seconds that making it took: a tenth of a processor at most

_ONE_AT_A_TIME = threading.Lock()


@dataclass(frozen=True)
class CurrentTable:
    """The main table of a study.

    Parameters
    ----------
    title : str
    table : Table or None
        None if it could not be made
    n_rows : int
        of how many trials
    problem : str
        why it could not be made, in one line
    """

    title: str = ""
    table: Table | None = None
    n_rows: int = 0
    problem: str = ""


class TableMaker:
    """Makes the table of one results folder in a thread of its own.

    Parameters
    ----------
    watch : FolderWatch
    """

    def __init__(self, watch: FolderWatch) -> None:
        self._watch = watch
        self._made: CurrentTable | None = None
        self._of: Signature | None = None
        self._not_before = 0.0
        self._thread: threading.Thread | None = None
        self._lock = threading.Lock()

    def latest(self) -> CurrentTable | None:
        """The last table that was made, None if there is none yet; a newer one is begun if it is time to."""
        with self._lock:
            is_busy = self._thread is not None and self._thread.is_alive()
            if not is_busy and self._of != self._watch.signature and time.monotonic() >= self._not_before:
                self._thread = threading.Thread(target=self._make, daemon=True)  # it keeps no Ctrl-C waiting
                self._thread.start()
        return self._made

    def _make(self) -> None:
        with _ONE_AT_A_TIME:
            signature = self._watch.signature
            start = time.monotonic()
            self._made = current_table(self._watch.folder)
            self._of = signature
            self._not_before = time.monotonic() + REST * (time.monotonic() - start)


def current_table(folder: Path) -> CurrentTable:
    """The main table of a results folder from the rows that are stored now; if it cannot be made, why."""
    from studies.reporting.results import Results

    try:
        results = Results.load(folder)
        if results.rows.empty:
            return CurrentTable(problem="no trial has ended yet")
        return CurrentTable(results.title, results.main_table, len(results.rows))
    except Exception as error:  # whatever rows lead to that are incomplete, or a file that no study wrote
        return CurrentTable(problem=one_line(error))
