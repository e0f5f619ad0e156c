"""What a results folder contains, in numbers; read without pandas, so that many folders are read quickly."""

import math
from collections import Counter
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from datetime import datetime
from itertools import compress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.storage.folders import ROWS_FILE, TABLE_FILE, read_plan, table_is_current
from studies.storage.following import FollowedRows
from studies.storage.locking import lock_holder
from studies.storage.rows import read_table_columns

if TYPE_CHECKING:
    from studies.planning.trial_ids import TrialIds

TIMINGS = ("seconds_perturb", "seconds_segment")


@dataclass(frozen=True)
class FolderSummary:
    """The state of a results folder.

    Parameters
    ----------
    n_planned : int
        trials of the last plan; of the stored rows if the plan is not stored
    statuses : Counter
        status -> number of stored rows of the last plan
    seconds : float
        time that perturbing and segmenting took in all of these trials
    written : datetime
        when a row or the table was last written
    holder : str or None
        who writes to the folder now, see `lock_holder`
    """

    n_planned: int
    statuses: Counter[str]
    seconds: float
    written: datetime
    holder: str | None

    @property
    def n_missing(self) -> int:
        """Planned trials without a row."""
        return self.n_planned - self.statuses.total()

    @property
    def state(self) -> str:
        """Who is writing to it, or how many trials are to go; "" for a study that is complete."""
        if self.holder:
            return f"running: {self.holder}"
        return f"{self.n_missing:,} to go" if self.n_missing > 0 else ""


class Summarizer:
    """Summarizes a results folder again and again, as its study runs: only rows that are new are read.

    Parameters
    ----------
    folder : Path
    note : callable, optional
        called with each row that is read, of this plan or an earlier one
    forget : callable, optional
        called when rows that were noted no longer count, because the folder has been started afresh
    """

    def __init__(
        self,
        folder: Path,
        note: Callable[[dict[str, Any]], None] | None = None,
        forget: Callable[[], None] | None = None,
    ) -> None:
        self._folder = folder
        self._on_row = note
        self._on_restart = forget
        self._rows: dict[str, tuple[str, float]] = {}
        self._followed = FollowedRows(folder / ROWS_FILE, self._note, self._forget)

    def summary(self) -> FolderSummary:
        """The folder as it is now; see `summarize`."""
        folder = self._folder
        planned = read_plan(folder)
        if table_is_current(folder):
            statuses, seconds = _read_table(folder / TABLE_FILE)
        else:
            self._followed.read()
            statuses, seconds = self._of_plan(planned)
        return FolderSummary(
            n_planned=statuses.total() if planned is None else len(planned),
            statuses=statuses,
            seconds=seconds,
            written=datetime.fromtimestamp(max(_written(folder / ROWS_FILE), _written(folder / TABLE_FILE))),
            holder=lock_holder(folder),
        )

    def _of_plan(self, planned: "TrialIds | None") -> tuple[Counter[str], float]:
        rows: Iterable[tuple[str, float]] = self._rows.values()
        if planned is not None and self._rows:
            from studies.planning.trial_ids import TrialIds

            rows = compress(rows, planned.contain(TrialIds(self._rows)))
        rows = list(rows)
        return Counter(status for status, _ in rows), math.fsum(seconds for _, seconds in rows)

    def _note(self, row: dict[str, Any]) -> None:
        self._rows[row["trial_id"]] = row["status"], _seconds(row.get(name) for name in TIMINGS)
        if self._on_row:
            self._on_row(row)

    def _forget(self) -> None:
        self._rows.clear()
        if self._on_restart:
            self._on_restart()


def summarize(folder: Path) -> FolderSummary:
    """Summarize a results folder.

    Raises
    ------
    ValueError
        If its table is not the table of a study.
    OSError
        If a file cannot be read.
    """
    return Summarizer(folder).summary()


def _written(path: Path) -> float:
    """When a file was last written, in seconds; 0 if there is none."""
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return 0.0


def _read_table(path: Path) -> tuple[Counter[str], float]:
    columns = read_table_columns(path, ["status", *TIMINGS])
    if "status" not in columns:
        raise ValueError(f"{path}: not a table of trials: it has no column status")
    seconds = math.fsum(_seconds(columns[name]) for name in TIMINGS if name in columns)
    return Counter(columns["status"]), seconds


def _seconds(values: Iterable[Any]) -> float:
    """The sum of those among the values that are numbers."""
    return math.fsum(value for value in values if isinstance(value, int | float) and not math.isnan(value))
