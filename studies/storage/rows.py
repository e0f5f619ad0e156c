"""Rows on disk: one per trial, each written as soon as it is made."""

import contextlib
import json
import math
import os
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from studies.columns import Column, dtypes
from studies.planning.trial_ids import WIDTH, TrialIds
from studies.storage.atomic import atomic_write
from studies.storage.folders import PLAN_FILE, ROWS_FILE, TABLE_FILE, move_to_backup, read_plan, table_is_current
from studies.storage.statuses import Statuses
from studies.storage.tables import table_files
from studies.storage.text import encodable

if TYPE_CHECKING:
    import pandas as pd

_BATCH_SIZE = 10_000  # rows that are in memory as dicts at the same time
_LARGE = 1 << 22  # bytes of a file of which only the states of the rows are read
_BLOCK = 1 << 24  # bytes of it that are read at the same time
_MANY_ROWS = 1_000_000  # whose states are packed at the same time

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
    status : Statuses
        trial_id -> "ok", "failed", "timeout" or "crashed"
    damaged : int
        number of lines that were left out
    """

    def __init__(self, folder: Path | str) -> None:
        self.path = Path(folder) / ROWS_FILE
        self.status = Statuses()
        self.damaged = 0
        self._seconds = 0.0
        self._n_timed = 0
        if self.path.exists() and self.path.stat().st_size >= _LARGE:
            self._scan()
            return
        for row in parse_rows(self.path):
            self._note_parsed(row)

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

        asked = trial_ids if isinstance(trial_ids, TrialIds) else TrialIds(trial_ids)
        frames, positions = [_frame([], columns)], [np.zeros(0, np.int64)]
        for batch in self.batches(asked, columns):
            frames.append(batch[0])
            positions.append(batch[1])
        at = np.concatenate(positions)
        # The last row of each trial, in the order asked for.
        kept = len(at) - 1 - np.unique(at[::-1], return_index=True)[1]
        frame = pd.concat(frames[1:] or frames, ignore_index=True)
        return frame.iloc[kept].reset_index(drop=True)

    def batches(
        self, trial_ids: TrialIds, columns: Sequence[Column]
    ) -> Iterator[tuple["pd.DataFrame", NDArray[np.int64]]]:
        """The rows of trials in the order of the file, even those that later ones replace, some thousand at a time.

        Yields
        ------
        DataFrame, (n,) int array
            rows, and the positions of their trials in ``trial_ids``
        """
        for batch in _batches(self):
            positions = trial_ids.positions(TrialIds(row["trial_id"] for row in batch))
            asked = np.flatnonzero(positions >= 0)
            if len(asked):
                yield _frame([batch[i] for i in asked], columns), positions[asked]

    def _scan(self) -> None:
        """Note the rows of a large file, of which only few columns are parsed to Python objects."""
        noted: list[tuple[TrialIds, list[str]]] = []
        for lines in _blocks_of_lines(self.path):
            columns = _parsed_states(lines)
            if columns is None:
                self._note_all(noted)
                noted.clear()
                for line in lines.splitlines(keepends=True):
                    self._note_parsed(parse_line(line))
                continue
            seconds = _numbers_in(columns["seconds"].drop_null().combine_chunks())
            self._seconds += math.fsum(seconds)
            self._n_timed += len(seconds)
            noted.append((_ids_in(columns["trial_id"]), _texts_in(columns["status"])))
            if sum(len(ids) for ids, _ in noted) >= _MANY_ROWS:
                self._note_all(noted)
                noted.clear()
        self._note_all(noted)

    def _note_all(self, noted: Sequence[tuple[TrialIds, list[str]]]) -> None:
        self.status.add(TrialIds.joined(ids for ids, _ in noted), [status for _, each in noted for status in each])

    def _note_parsed(self, row: Row | None) -> None:
        if row is None:
            self.damaged += 1
        else:
            self._note(row)

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
    if not table_is_current(folder):
        rows = StoredRows(folder)
        planned = read_plan(folder)
        return rows.frame(rows.status if planned is None else planned, columns)
    return read_table(folder / TABLE_FILE, columns)


def read_table(path: Path, columns: Sequence[Column], without: Sequence[str] = ()) -> "pd.DataFrame":
    """The rows of a table, in its order.

    Parameters
    ----------
    path : Path
        a parquet file, or a folder of them
    columns : sequence of Column
        the columns of the DataFrame
    without : sequence of str
        columns that are not read: their values are missing

    Raises
    ------
    ValueError
        If the table is damaged, or not one of trials.
    """
    import pandas as pd

    types = dtypes(columns)
    try:
        if without:
            known = [name for name in _schema_names(path) if name not in without]
            table = pd.read_parquet(path, columns=known)
        else:
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


def _blocks_of_lines(path: Path) -> Iterator[bytes]:
    """The content of a file in large pieces that end where a line does."""
    with path.open("rb") as file:
        while block := file.read(_BLOCK):
            yield block + file.readline()


def _parsed_states(lines: bytes) -> Any:
    """The ids, statuses and seconds of the rows of some lines, as a table; None if any line needs a closer look.

    Such as one with half a surrogate pair, which Python's parser of JSON takes for text and Arrow's for damage.
    """
    import pyarrow
    from pyarrow import json as arrow_json

    schema = pyarrow.schema(
        [("trial_id", pyarrow.string()), ("status", pyarrow.string()), ("seconds", pyarrow.float64())]
    )
    try:
        table = arrow_json.read_json(
            pyarrow.BufferReader(lines),
            read_options=arrow_json.ReadOptions(block_size=max(_BLOCK // 8, 1 << 20)),
            parse_options=arrow_json.ParseOptions(explicit_schema=schema, unexpected_field_behavior="ignore"),
        )
    except pyarrow.ArrowException:
        return None
    n_lines = lines.count(b"\n") + (not lines.endswith(b"\n"))
    if table.num_rows != n_lines or table["trial_id"].null_count or table["status"].null_count:
        return None
    return table


def _ids_in(column: Any) -> TrialIds:
    """The ids in a column of pyarrow."""
    array = column.combine_chunks()
    _, offsets, characters = array.buffers()
    bounds = np.frombuffer(offsets, np.int32)[array.offset : array.offset + len(array) + 1]
    if (np.diff(bounds) == 2 * WIDTH).all():
        digits = np.frombuffer(characters, np.uint8)[bounds[0] : bounds[-1]].reshape(-1, 2 * WIDTH)
        ids = TrialIds.of_digits(digits)
        if ids is not None:
            return ids
    return TrialIds(array.to_pylist())


def _texts_in(column: Any) -> list[str]:
    """The texts in a column of pyarrow, of which few are different."""
    encoded = column.combine_chunks().dictionary_encode()
    return np.array(encoded.dictionary.to_pylist(), dtype=object)[_numbers_in(encoded.indices)].tolist()


def _numbers_in(array: Any) -> NDArray[Any]:
    """The numbers in an array of pyarrow without missing ones; its own method would import pandas."""
    return np.from_dlpack(array)


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
    columns: dict[str, list[Any]] = {}
    for file in table_files(path):
        with _parquet(file) as opened:
            for name, values in opened.read(columns=list(names)).to_pydict().items():
                columns.setdefault(name, []).extend(values)
    return columns


def _schema_names(path: Path) -> list[str]:
    """The names of the columns of a table."""
    with _parquet(table_files(path)[0]) as opened:
        return opened.schema_arrow.names


def count_table_rows(path: Path) -> int:
    """The number of rows of a parquet file; ValueError if it is not one."""
    total = 0
    for file in table_files(path):
        with _parquet(file) as opened:
            total += opened.metadata.num_rows
    return total


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
