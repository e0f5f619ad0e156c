"""The table of a study's rows: one parquet file, or a folder of them if the rows are very many.

A folder has the name of the file. pandas and polars read it as they read the file, and DuckDB by
``read_parquet('trials.parquet/*.parquet')``. The names of its files sort in the order of the plan, in which the rows
are model by model, so that who asks for one model reads few of them.
"""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from studies.storage.atomic import atomic_write

if TYPE_CHECKING:
    import pandas as pd

MOST_ROWS = 1_000_000  # of a table that is one file
ROWS_PER_PART = 250_000


def table_files(path: Path) -> list[Path]:
    """The parquet files of a table, in their order."""
    return sorted(path.glob("*.parquet")) if path.is_dir() else [path]


def write_table(path: Path, rows: pd.DataFrame) -> None:
    """Write rows as a table, which replaces the one that is there.

    Parameters
    ----------
    path : Path
        of the file or folder
    rows : DataFrame
    """
    if len(rows) > MOST_ROWS:
        with _new_folder(path) as folder:
            for number, start in enumerate(range(0, len(rows), ROWS_PER_PART)):
                rows.iloc[start : start + ROWS_PER_PART].to_parquet(_part(folder, number), index=False)
        return
    if path.is_dir():
        _put_aside(path)
    with atomic_write(path) as file:
        rows.to_parquet(file, index=False)
    _remove_leftovers(path)


def write_in_order(path: Path, batches: Iterable[tuple[pd.DataFrame, NDArray[np.int64]]]) -> None:
    """Write rows that come in another order than they shall have, as a folder of files, with little memory.

    Parameters
    ----------
    path : Path
        of the folder
    batches : iterable of (DataFrame, (n,) int array)
        rows of one schema, and the position of each; of those with the same position, the last one counts
    """
    import pandas as pd

    with _new_folder(path) as folder:
        spool = folder / "unsorted"
        spool.mkdir()
        numbers: set[int] = set()
        for i, (rows, positions) in enumerate(batches):
            of_part = positions // ROWS_PER_PART
            for number in np.unique(of_part).tolist():
                mine = of_part == number
                target = spool / str(number)
                target.mkdir(exist_ok=True)
                rows[mine].assign(**{_POSITION: positions[mine]}).to_parquet(_part(target, i), index=False)
                numbers.add(number)
        for number in sorted(numbers):
            rows = pd.concat([pd.read_parquet(file) for file in table_files(spool / str(number))], ignore_index=True)
            rows = rows.drop_duplicates(_POSITION, keep="last").sort_values(_POSITION, kind="stable")
            rows.drop(columns=_POSITION).to_parquet(_part(folder, number), index=False)
            shutil.rmtree(spool / str(number))
        spool.rmdir()


_POSITION = "position in the plan"


def _part(folder: Path, number: int) -> Path:
    return folder / f"part-{number:06d}.parquet"


@contextmanager
def _new_folder(path: Path) -> Iterator[Path]:
    """A folder next to ``path``, which it replaces when the block ends without an error.

    A process that is killed at any moment leaves the old table, the new one or none, never a part of one: what the
    table shows is also in the file of rows.
    """
    _remove_leftovers(path)
    folder = path.with_name(f".{path.stem}.{os.getpid()}.part")
    folder.mkdir()
    try:
        yield folder
        for file in table_files(folder):
            with file.open("r+b") as opened:
                os.fsync(opened.fileno())
        _put_aside(path)
        folder.rename(path)
    finally:
        _remove_leftovers(path)


def _put_aside(path: Path) -> None:
    """Make room for a table, which cannot replace one of another kind in one step."""
    with contextlib.suppress(FileNotFoundError):
        path.rename(path.with_name(f".{path.stem}.{os.getpid()}.old"))


def _remove_leftovers(path: Path) -> None:
    """Remove what a table replaced, and what a process that was killed had begun; the folder is locked."""
    for pattern in (f".{path.stem}.*.part", f".{path.stem}.*.old"):
        for each in path.parent.glob(pattern):
            if each.is_dir():
                shutil.rmtree(each, ignore_errors=True)
            else:
                each.unlink(missing_ok=True)
