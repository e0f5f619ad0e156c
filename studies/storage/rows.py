"""Rows on disk: one per trial, each written as soon as it is made."""

import contextlib
import json
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.columns import Column, dtypes
from studies.storage.atomic import atomic_write
from studies.storage.folders import PLAN_FILE, ROWS_FILE, TABLE_FILE, move_to_backup, planned_ids, table_is_current
from studies.storage.text import encodable

if TYPE_CHECKING:
    import pandas as pd

_BATCH_SIZE = 10_000  # rows that are in memory as dicts at the same time

Row = Mapping[str, Any]


class StoredRows:
    """The rows of a results folder. Only their states are kept in memory.

    A later row of a trial replaces an earlier one. A line that is damaged, because a crash cut it, is left out.

    Parameters
    ----------
    folder : Path

    Attributes
    ----------
    path : Path
        the file of the rows
    status : dict
        trial_id -> "ok", "failed", "timeout" or "crashed"
    damaged : int
        number of lines that were left out
    """

    def __init__(self, folder: Path | str) -> None:
        self.path = Path(folder) / ROWS_FILE
        self.status: dict[str, str] = {}
        self.damaged = 0
        self._seconds = 0.0
        self._n_timed = 0
        for row in parse_rows(self.path):
            if row is None:
                self.damaged += 1
            else:
                self._note(row)

    @property
    def seconds(self) -> float | None:
        """Mean seconds per trial, including its share of what it shares with others; None if that is not known."""
        return self._seconds / self._n_timed if self._n_timed else None

    def __iter__(self) -> Iterator[dict[str, Any]]:
        """Every row of the file, in its order, even those that later ones replace."""
        return (row for row in parse_rows(self.path) if row is not None)

    def frame(self, trial_ids: Iterable[str], columns: Sequence[Column]) -> "pd.DataFrame":
        """The stored rows of trials.

        Parameters
        ----------
        trial_ids : iterable of str
            trials, of which some may not be stored
        columns : sequence of Column
            the columns of the DataFrame

        Returns
        -------
        pandas.DataFrame
            a row per stored trial, in the order of ``trial_ids``
        """
        import pandas as pd

        position = {trial_id: i for i, trial_id in enumerate(trial_ids)}
        rows = (row for row in self if row["trial_id"] in position)
        batches = [_frame(batch, columns) for batch in _batches(rows)] or [_frame([], columns)]
        frame = pd.concat(batches, ignore_index=True).drop_duplicates("trial_id", keep="last")
        return frame.iloc[frame["trial_id"].map(position).argsort(kind="stable")].reset_index(drop=True)

    def _note(self, row: Row) -> None:
        self.status[row["trial_id"]] = row["status"]
        seconds = row.get("seconds")
        if isinstance(seconds, int | float):
            self._seconds += seconds
            self._n_timed += 1


class RowStore(StoredRows):
    """The rows of a results folder, to which this process alone writes until the store is closed.

    Parameters
    ----------
    folder : Path
        created if necessary
    fresh : bool
        move what the folder contains to a new folder next to it, and start empty

    Attributes
    ----------
    moved_to : Path or None
        the folder that earlier results were moved to

    Raises
    ------
    StoreLockedError
        If another process, or another store of this one, writes to the folder.

    Examples
    --------
    >>> import tempfile
    >>> with RowStore(tempfile.mkdtemp()) as store:
    ...     store.add({"trial_id": "a", "status": "ok"}, {"trial_id": "b", "status": "failed"})
    ...     store.status
    {'a': 'ok', 'b': 'failed'}
    """

    def __init__(self, folder: Path | str, fresh: bool = False) -> None:
        from studies.storage.locking import FolderLock

        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self._lock = FolderLock(folder)
        try:
            self.moved_to = move_to_backup(folder) if fresh else None
            super().__init__(folder)
            self._file = self.path.open("a+b", buffering=0)
            if not self._ends_with_newline():
                self._append(b"\n")  # or the next row would continue the line that was cut
        except BaseException:
            self._lock.release()
            raise

    def add(self, *rows: Row) -> None:
        """Store rows; they are on disk when this returns.

        Parameters
        ----------
        *rows : mapping
            values that JSON can represent, among them ``trial_id`` and ``status``

        Raises
        ------
        OSError
            If they cannot be written, as on a full disk; none of them is stored then.
        """
        rows = tuple(_encodable(row) for row in rows)
        self._append("".join(json.dumps(row) + "\n" for row in rows).encode())
        for row in rows:
            self._note(row)

    def add_all(self, rows: Iterable[Row]) -> None:
        """Store the rows of an iterable, many at a time; see `add`."""
        for batch in _batches(rows):
            self.add(*batch)

    def write_plan(self, trial_ids: Iterable[str]) -> None:
        """Store what is planned, so that the rows can be shown in its order even if this process is killed."""
        with atomic_write(self.path.with_name(PLAN_FILE)) as path, path.open("w", encoding="ascii", newline="") as file:
            file.writelines(f"{trial_id}\n" for trial_id in trial_ids)

    def close(self) -> None:
        """Let other processes write to the folder."""
        self._file.close()
        self._lock.release()

    def __enter__(self) -> "RowStore":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ends_with_newline(self) -> bool:
        """Whether the file is empty or its last line complete."""
        if not self._file.seek(0, os.SEEK_END):
            return True
        self._file.seek(-1, os.SEEK_END)
        return self._file.read(1) == b"\n"

    def _append(self, data: bytes) -> None:
        size = self._file.seek(0, os.SEEK_END)
        left = memoryview(data)
        try:
            while left:
                left = left[self._file.write(left) :]
            os.fsync(self._file.fileno())
        except OSError as error:
            with contextlib.suppress(OSError):
                self._file.truncate(size)
            raise OSError(
                f"{self.path}: {error.strerror}; the rows before are stored, and the same command continues from there"
            ) from error


def read_rows(folder: Path, columns: Sequence[Column]) -> "pd.DataFrame":
    """The rows of a results folder, even while its study runs or after it was killed.

    Parameters
    ----------
    folder : Path
    columns : sequence of Column
        the columns of the DataFrame

    Returns
    -------
    pandas.DataFrame
        a row per stored trial of the last plan, in its order

    Raises
    ------
    ValueError
        If the table is damaged, or not one of trials.
    """
    import pandas as pd

    if not table_is_current(folder):
        rows = StoredRows(folder)
        planned = planned_ids(folder)
        return rows.frame(rows.status if planned is None else planned, columns)
    path, types = folder / TABLE_FILE, dtypes(columns)
    try:
        table = pd.read_parquet(path)
    except Exception as error:  # pyarrow raises a dozen kinds for damaged files
        raise ValueError(f"{path}: not a parquet file, or damaged: {_first_line(error)}") from error
    absent = {"trial_id", "status"} - set(table.columns)
    if absent:
        raise ValueError(f"{path}: not a table of trials: it has no column {' and '.join(sorted(absent))}")
    try:
        return table.reindex(columns=list(types)).astype(types)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{path}: not a table of trials of this study: {_first_line(error)}") from error


def parse_rows(path: Path) -> Iterator[dict[str, Any] | None]:
    """The rows of a file with one per line, in its order.

    Parameters
    ----------
    path : Path
        need not exist

    Yields
    ------
    dict or None
        a row, or None for a damaged line
    """
    if not path.exists():
        return
    with path.open("rb") as file:
        yield from map(parse_line, file)


def parse_line(line: bytes) -> dict[str, Any] | None:
    """The row of a line; None if it is damaged."""
    try:
        row = json.loads(line)
    except (ValueError, RecursionError):
        return None
    if not _is_row(row):
        return None
    # Rows of earlier versions may have text that no table can hold.
    return _encodable(row) if b"\\ud" in line.lower() else row


def read_table_columns(path: Path, names: Sequence[str]) -> dict[str, list[Any]]:
    """Columns of a parquet file as lists, without pandas.

    Parameters
    ----------
    path : Path
    names : sequence of str
        the columns; those that the file does not have are left out

    Raises
    ------
    ValueError
        If the file is not a parquet file.
    """
    with _parquet(path) as file:
        return file.read(columns=list(names)).to_pydict()


def count_table_rows(path: Path) -> int:
    """The number of rows of a parquet file; ValueError if it is not one."""
    with _parquet(path) as file:
        return file.metadata.num_rows


@contextlib.contextmanager
def _parquet(path: Path) -> Iterator[Any]:
    """An open parquet file, whose errors name it."""
    import pyarrow
    from pyarrow.parquet import ParquetFile

    try:
        with ParquetFile(path) as file:
            yield file
    except (pyarrow.ArrowException, OSError) as error:
        if isinstance(error, OSError) and error.errno is not None:  # the file cannot be opened
            raise
        raise ValueError(f"{path}: not a parquet file, or damaged: {_first_line(error)}") from error


def _first_line(error: BaseException) -> str:
    return next(iter(str(error).splitlines()), type(error).__name__)


def _encodable(row: Row) -> dict[str, Any]:
    """A row whose text can be written to any file."""
    return {name: encodable(value) if isinstance(value, str) else value for name, value in row.items()}


def _is_row(row: object) -> bool:
    return isinstance(row, dict) and isinstance(row.get("trial_id"), str) and isinstance(row.get("status"), str)


def _frame(rows: list[dict[str, Any]], columns: Sequence[Column]) -> "pd.DataFrame":
    import pandas as pd

    types = dtypes(columns)
    try:
        return pd.DataFrame(rows, columns=list(types)).astype(types)
    except (ValueError, TypeError, OverflowError) as error:
        raise ValueError(f"stored rows have values of another type: {_first_line(error)}") from error


def _batches(rows: Iterable[Any]) -> Iterator[list[Any]]:
    rows = iter(rows)
    return iter(lambda: list(islice(rows, _BATCH_SIZE)), [])
