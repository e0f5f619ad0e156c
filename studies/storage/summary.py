"""What a results folder contains, in numbers; read without pandas, so that many folders are read quickly."""

import math
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from studies.storage.folders import ROWS_FILE, TABLE_FILE, planned_ids, table_is_current
from studies.storage.locking import lock_holder
from studies.storage.rows import parse_rows, read_table_columns

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


def summarize(folder: Path) -> FolderSummary:
    """Summarize a results folder.

    Raises
    ------
    ValueError
        If its table is not the table of a study.
    OSError
        If a file cannot be read.
    """
    planned = planned_ids(folder)
    statuses, seconds = _read_table(folder / TABLE_FILE) if table_is_current(folder) else _read_rows(folder, planned)
    paths = [path for path in (folder / ROWS_FILE, folder / TABLE_FILE) if path.exists()]
    return FolderSummary(
        n_planned=statuses.total() if planned is None else len(planned),
        statuses=statuses,
        seconds=seconds,
        written=datetime.fromtimestamp(max(path.stat().st_mtime for path in paths)),
        holder=lock_holder(folder),
    )


def _read_table(path: Path) -> tuple[Counter[str], float]:
    columns = read_table_columns(path, ["status", *TIMINGS])
    if "status" not in columns:
        raise ValueError(f"{path}: not a table of trials: it has no column status")
    seconds = math.fsum(_seconds(columns[name]) for name in TIMINGS if name in columns)
    return Counter(columns["status"]), seconds


def _read_rows(folder: Path, planned: Iterable[str] | None) -> tuple[Counter[str], float]:
    rows: dict[str, tuple[str, float]] = {}
    wanted = None if planned is None else set(planned)
    for row in parse_rows(folder / ROWS_FILE):
        if row is not None and (wanted is None or row["trial_id"] in wanted):
            rows[row["trial_id"]] = row["status"], _seconds(row.get(name) for name in TIMINGS)
    return Counter(status for status, _ in rows.values()), math.fsum(seconds for _, seconds in rows.values())


def _seconds(values: Iterable[Any]) -> float:
    """The sum of those among the values that are numbers."""
    return math.fsum(value for value in values if isinstance(value, int | float) and not math.isnan(value))
