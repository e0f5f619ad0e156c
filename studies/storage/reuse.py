"""Rows that other studies have stored: a trial with the same trial_id has the same result."""

from collections.abc import Collection, Iterable, Iterator
from pathlib import Path
from typing import Any

from studies.planning.trial_ids import TrialIds
from studies.storage.folders import ROWS_FILE, TABLE_FILE, result_folders, table_is_current
from studies.storage.rows import StoredRows, count_table_rows, parse_rows, read_table_columns
from studies.storage.tables import table_files


def find_reusable(results: Path | str, folder: Path, trial_ids: Iterable[str]) -> dict[Path, set[str]]:
    """Where successful rows of trials are stored, other than in the rows of their own folder.

    Parameters
    ----------
    results : Path
        where to look
    folder : Path
        the own folder; its table counts if its rows are absent, as in a fresh clone
    trial_ids : iterable of str

    Returns
    -------
    dict
        file -> trial_ids to be read from it with `read_reusable`, each of them once
    """
    found: dict[Path, set[str]] = {}
    wanted = trial_ids if isinstance(trial_ids, TrialIds) else TrialIds(dict.fromkeys(trial_ids))
    known: set[str] = set()
    for other in sorted(result_folders(results), key=lambda other: other != folder):
        if len(known) == len(wanted):
            break
        path = rows_file(other)
        if path is None or path == folder / ROWS_FILE:
            continue
        successful = TrialIds(_successful_ids(path))
        reusable = set(successful.at(wanted.contain(successful))) - known
        if reusable:
            found[path] = reusable
            known |= reusable
    return found


def read_reusable(path: Path, trial_ids: Collection[str], *, failed: bool = False) -> Iterator[dict[str, Any]]:
    """The successful rows of trials in a file that `find_reusable` found.

    Parameters
    ----------
    path : Path
    trial_ids : collection of str
    failed : bool
        the rows of trials that failed too

    Yields
    ------
    dict
    """
    if path.name == ROWS_FILE:
        rows = [row for row in parse_rows(path) if row is not None and row["trial_id"] in trial_ids]
    else:
        import pyarrow
        from pyarrow import compute
        from pyarrow.parquet import ParquetFile

        rows = []
        for part in table_files(path):
            with ParquetFile(part) as file:
                table = file.read()
            wanted = pyarrow.array(list(trial_ids), table["trial_id"].type)
            rows += table.filter(compute.is_in(table["trial_id"], wanted)).to_pylist()
    return (row for row in rows if failed or row["status"] == "ok")


def rows_file(folder: Path) -> Path | None:
    """The file of a folder that has the rows; None if there is none."""
    rows, table = folder / ROWS_FILE, folder / TABLE_FILE
    if rows.exists() and rows.stat().st_size:
        return rows
    return table if table.exists() else None


def _successful_ids(path: Path) -> set[str]:
    """The successful trials of a file of rows; none if the file is damaged or something else."""
    ids = None
    if path.name == TABLE_FILE or _table_has_all_rows(path.parent):
        ids = _successful_ids_in_table(path.with_name(TABLE_FILE))
    if ids is None and path.name == ROWS_FILE:
        ids = {trial_id for trial_id, status in StoredRows(path.parent).status.items() if status == "ok"}
    return ids or set()


def _successful_ids_in_table(path: Path) -> set[str] | None:
    """The successful trials of a parquet file; None if it is not the table of a study."""
    try:
        columns = read_table_columns(path, ["trial_id", "status"])
    except Exception:  # whatever a file leads to that a study did not write
        return None
    if columns.keys() != {"trial_id", "status"} or not all(isinstance(i, str) for i in columns["trial_id"]):
        return None
    return {i for i, status in zip(columns["trial_id"], columns["status"], strict=True) if status == "ok"}


def _table_has_all_rows(folder: Path) -> bool:
    """Whether the table of a folder, which is faster to read, has every row of the file of rows.

    It need not: rows of earlier plans are only in the file.
    """
    if not table_is_current(folder):
        return False
    with (folder / ROWS_FILE).open("rb") as file:
        n_lines = sum(block.count(b"\n") for block in iter(lambda: file.read(1 << 20), b""))
    try:
        return n_lines == count_table_rows(folder / TABLE_FILE)
    except ValueError:
        return False
