"""Rows on disk, each written as it is made, keyed by what determines it."""

import contextlib
import fcntl
import json
import os
import re
import socket
import time
from datetime import datetime
from itertools import islice
from pathlib import Path

from studies.planning.trial import COLUMNS

# The files of a results folder that hold its rows.
ROWS = "trials.jsonl"  # one row a line, appended as they are made
TABLE = "trials.parquet"  # the same rows, in the order of the plan
PLANNED = "planned.txt"  # one trial_id a line, in the order of the plan
LOCK = "trials.lock"  # says who writes to the folder, while somebody does

_ASIDE = ".before-%Y%m%dT%H%M%S"  # what the name of a folder that was moved aside ends in
_IS_ASIDE = re.compile(r"\.before-[0-9]{8}T[0-9]{6}$")
_TRIAL_ID = re.compile(rb'"trial_id": "([^"\\]+)"')  # in a line; within a string of it, quotes would have backslashes
_BATCH = 10_000  # rows that are held as dicts at once
_PATIENCE = 0.5  # seconds that one waits for a lock, which others take for a moment to see whether it is held


class Held(OSError):
    """Another process writes to the folder; the message says which."""


class Rows:
    """What ``trials.jsonl`` of a results folder holds; only states are kept in memory.

    A later row of a trial replaces an earlier one. A line that a crash cut short is left out.

    status : dict, trial_id -> status
    damaged : int, how many lines were left out
    """

    def __init__(self, folder):
        self.path = Path(folder) / ROWS
        self.status = {}
        self.damaged = 0
        self._seconds = []
        for row in self._read():
            if row is None:
                self.damaged += 1
            else:
                self._note(row)

    @property
    def seconds(self):
        """What a trial took on average, with its share of what it shares; None where that is not known."""
        return sum(self._seconds) / len(self._seconds) if self._seconds else None

    def frame(self, trial_ids, further=None):
        """The stored rows of these trials, in this order: a DataFrame.

        further : the columns behind ``COLUMNS``, with their types
        """
        import pandas as pd

        columns = COLUMNS | (further or {})
        place = {trial_id: i for i, trial_id in enumerate(trial_ids)}
        rows = (row for row in self._read() if row and row["trial_id"] in place)
        batches = [_frame(batch, columns) for batch in _batches(rows)] or [_frame([], columns)]
        frame = pd.concat(batches, ignore_index=True).drop_duplicates("trial_id", keep="last")
        return frame.iloc[frame["trial_id"].map(place).argsort(kind="stable")].reset_index(drop=True)

    def _note(self, row):
        self.status[row["trial_id"]] = row["status"]
        if row.get("seconds") is not None:
            self._seconds.append(row["seconds"])

    def _read(self):
        """Every row, None for a damaged line."""
        if not self.path.exists():
            return
        with self.path.open("rb") as file:
            for line in file:
                try:
                    row = json.loads(line)
                    row["trial_id"], row["status"]
                except (ValueError, KeyError, TypeError):
                    row = None
                yield row


class Store(Rows):
    """The rows of one results folder, which only this process writes to until it closes them or ends.

    Raises Held where another process does.

    aside : Path of the folder that what was there has been moved to, if ``fresh`` and there was something
    """

    def __init__(self, folder, fresh=False):
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        self._lock = _hold(folder / LOCK)
        try:
            self.aside = _move_aside(folder) if fresh else None
            super().__init__(folder)
            self._file = os.open(self.path, os.O_RDWR | os.O_CREAT | os.O_APPEND, 0o666)
            size = os.fstat(self._file).st_size
            if size and os.pread(self._file, 1, size - 1) != b"\n":
                self._append(b"\n")  # or the next row would be glued to the cut one
        except BaseException:
            _release(self._lock, folder / LOCK)
            raise

    def add(self, *rows):
        """Keep rows; they are on disk when this returns. An error leaves none of them there."""
        self._append("".join(json.dumps(row) + "\n" for row in rows).encode())
        for row in rows:
            self._note(row)

    def add_all(self, rows):
        """Keep the rows of an iterable, many at a time."""
        for batch in _batches(rows):
            self.add(*batch)

    def plan(self, trial_ids):
        """Write down what is planned, so that the rows can be shown in its order even if this process is killed."""
        with replacing(self.path.with_name(PLANNED)) as path:
            path.write_text("".join(f"{trial_id}\n" for trial_id in trial_ids))

    def close(self):
        os.close(self._file)
        _release(self._lock, self.path.with_name(LOCK))

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _append(self, data):
        size = os.fstat(self._file).st_size
        left = memoryview(data)
        try:
            while left:
                left = left[os.write(self._file, left) :]
            os.fsync(self._file)
        except OSError as error:
            with contextlib.suppress(OSError):
                os.ftruncate(self._file, size)
            raise OSError(
                f"{self.path}: {error.strerror}; the rows before are stored, and the same command goes on from there"
            ) from error


def stored(folder, further=None):
    """The rows of a results folder, in the order of its plan, also of a study that runs or was killed: a DataFrame.

    further : the columns behind ``COLUMNS``, with their types
    """
    import pandas as pd

    table, fresher = folder / TABLE, [folder / ROWS, folder / PLANNED]
    if all(path.exists() for path in fresher) and (
        not table.exists() or max(path.stat().st_mtime_ns for path in fresher) >= table.stat().st_mtime_ns
    ):
        return Rows(folder).frame(planned(folder), further)
    columns = COLUMNS | (further or {})
    return pd.read_parquet(table).reindex(columns=list(columns)).astype(columns)


def planned(folder):
    """The trial_ids that a run planned last; None where no run was on this machine."""
    path = folder / PLANNED
    return path.read_text().splitlines() if path.exists() else None


def folders(results):
    """Every folder under ``results`` that holds rows of a study, but those that were moved aside: a list."""
    found = {path.parent for name in (ROWS, TABLE) for path in Path(results).rglob(name)}
    return sorted(folder for folder in found if not any(_IS_ASIDE.search(part) for part in folder.parts))


def elsewhere(results, folder, trial_ids):
    """Where under ``results`` trials stand that gave a figure, other than in the rows of ``folder``.

    The folder's own trials.parquet counts where its rows are not there, as in a fresh clone.

    Returns
    -------
    dict, Path of a file -> set of trial_ids, each of them once
    """
    found, wanted = {}, set(trial_ids)
    for other in sorted(folders(results), key=lambda other: other != folder):
        path = other / ROWS if (other / ROWS).exists() and (other / ROWS).stat().st_size else other / TABLE
        if not wanted or path == folder / ROWS or not path.exists():
            continue
        there = wanted & _good(path)
        if there:
            found[path] = there
            wanted -= there
    return found


def fetch(path, trial_ids):
    """The rows that gave a figure of these trials, from a file that `elsewhere` found: yields dicts."""
    if path.name == ROWS:
        rows = (row for row in Rows(path.parent)._read() if row)
    else:
        import pyarrow.parquet

        rows = (row for batch in pyarrow.parquet.ParquetFile(path).iter_batches() for row in batch.to_pylist())
    return (row for row in rows if row["status"] == "ok" and row["trial_id"] in trial_ids)


def holder(folder):
    """Who writes to a results folder, as text; None where nobody does."""
    with contextlib.suppress(FileNotFoundError), open(folder / LOCK) as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            return file.read() or "another process"
    return None


@contextlib.contextmanager
def replacing(path):
    """A path to write to, which takes the place of ``path`` when all is written; a kill leaves the old or the new."""
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield part
        with part.open("rb") as file:
            os.fsync(file.fileno())
        part.replace(path)
    finally:
        part.unlink(missing_ok=True)


def _good(path):
    """The trials of a file of rows that gave a figure; none for a file that is not one of ours."""
    if path.name == ROWS:
        with path.open("rb") as file:
            ids = (_TRIAL_ID.search(line) for line in file if b'"status": "ok"' in line and line.endswith(b"}\n"))
            return {found[1].decode() for found in ids if found}
    import pyarrow.parquet

    try:
        table = pyarrow.parquet.read_table(path, columns=["trial_id", "status"])
        return set(table.filter(pyarrow.compute.equal(table["status"], "ok"))["trial_id"].to_pylist())
    except (pyarrow.ArrowException, KeyError):
        return set()


def _frame(rows, columns):
    import pandas as pd

    return pd.DataFrame(rows, columns=list(columns)).astype(columns)


def _batches(rows):
    rows = iter(rows)
    return iter(lambda: list(islice(rows, _BATCH)), [])


def _move_aside(folder):
    """Move the files of a folder into one beside it; folders in it are other studies'."""
    files = [path for path in folder.iterdir() if path.is_file() and path.name != LOCK]
    if not files:
        return None
    aside = folder.with_name(folder.name + datetime.now().strftime(_ASIDE))
    aside.mkdir()
    for path in files:
        path.rename(aside / path.name)
    return aside


def _hold(path):
    """Lock a folder by its file ``path``: the open file. The system unlocks it when this process ends in any way."""
    end = time.monotonic() + _PATIENCE
    while True:
        file = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Another one may have had the lock and removed the file meanwhile.
            if os.path.exists(path) and os.path.samestat(os.fstat(file), os.stat(path)):
                os.ftruncate(file, 0)
                since = datetime.now().astimezone().isoformat(timespec="seconds")
                os.write(file, f"process {os.getpid()} on {socket.gethostname()} since {since}".encode())
                return file
        except BlockingIOError:
            if time.monotonic() > end:
                who = os.read(file, 1000).decode() or "another process"
                os.close(file)
                raise Held(
                    f"{path.parent}: {who} writes to this folder; wait for it, or give another results_dir"
                ) from None
            time.sleep(_PATIENCE / 10)
        except OSError:
            os.close(file)
            raise
        os.close(file)


def _release(file, path):
    path.unlink(missing_ok=True)
    os.close(file)
