"""The results folders of studies, and their files."""

import os
import re
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from studies.planning.trial_ids import TrialIds

ROWS_FILE = "trials.jsonl"  # one row per line, appended as it is made
TABLE_FILE = "trials.parquet"  # the rows of the last plan, in its order; a folder of files if there are very many
PLAN_FILE = "planned.txt"  # one trial_id per line, in the order of the last plan
LOCK_FILE = "trials.lock"  # locked by the process that writes to the folder
REPORT_FILE = "report.html"  # the page of a study
INDEX_FILE = "index.html"  # the page of all studies
PLATES_FILE = "plates.html"
LABELS_FOLDER = "labels"  # arrays of single trials

# A folder of results that contains this file, whose text is on the page of the results, is written to only by a command
# that names it: by default, results go to another one then.
PUBLISHED_FILE = "PUBLISHED.md"
RESULTS, UNPUBLISHED = "results", "runs"

_BACKUP_SUFFIX = ".before-%Y%m%dT%H%M%S"
IS_BACKUP = re.compile(r"\.before-[0-9]{8}T[0-9]{6}$")


def is_published(results: Path) -> bool:
    """Whether a folder of results is written to only if it is named."""
    return (results / PUBLISHED_FILE).is_file()


def default_results() -> Path:
    """The folder of results that commands use if none is named."""
    return Path(UNPUBLISHED if is_published(Path(RESULTS)) else RESULTS)


def result_folders(results: Path | str) -> list[Path]:
    """The folders at or below ``results`` that contain rows of a study.

    Returns
    -------
    list of Path
        sorted; without the folders that earlier results were moved to
    """
    found = []
    for folder, subfolders, files in os.walk(results):
        has_rows = not {ROWS_FILE, TABLE_FILE}.isdisjoint([*files, *subfolders])
        subfolders[:] = [
            name for name in subfolders if name not in (LABELS_FOLDER, TABLE_FILE) and not IS_BACKUP.search(name)
        ]
        if has_rows:
            found.append(Path(folder))
    return sorted(found)


def planned_ids(folder: Path) -> list[str] | None:
    """The trial_ids that the last run in a folder planned.

    Returns
    -------
    list of str or None
        in the order of the plan; None if the plan is not stored, as in a fresh clone
    """
    planned = read_plan(folder)
    return None if planned is None else list(planned)


def read_plan(folder: Path) -> "TrialIds | None":
    """As `planned_ids`, in less memory."""
    from studies.planning.trial_ids import TrialIds

    try:
        return TrialIds.of_lines((folder / PLAN_FILE).read_bytes())
    except FileNotFoundError:
        return None


def table_is_current(folder: Path) -> bool:
    """Whether the table of a folder shows the rows of its last plan, so that the rows need not be read."""
    table, rows, plan = (folder / name for name in (TABLE_FILE, ROWS_FILE, PLAN_FILE))
    if not table.exists():
        return False
    if not (rows.exists() and plan.exists()):
        return True
    written = table.stat().st_mtime_ns
    return all(path.stat().st_mtime_ns < written for path in (rows, plan))


def move_to_backup(folder: Path) -> Path | None:
    """Move the files and labels of a folder into a new one next to it; other folders in it belong to other studies.

    Returns
    -------
    Path or None
        the new folder; None if nothing had to be moved
    """
    paths = [
        path
        for path in folder.iterdir()
        if (path.name in (LABELS_FOLDER, TABLE_FILE) if path.is_dir() else not path.name.startswith(LOCK_FILE))
    ]
    if not paths:
        return None
    backup = folder.with_name(folder.name + datetime.now().strftime(_BACKUP_SUFFIX))
    backup.mkdir()
    for path in paths:
        path.rename(backup / path.name)
    return backup
