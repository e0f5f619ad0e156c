"""``python -m studies.report [RESULTS]``: tables, charts and pages of results, from stored rows alone."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from studies.storage import default_results
from studies.terminal import MISTAKE, SUCCESS, one_line, run_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="studies.report", description=__doc__)
    parser.add_argument("results", nargs="?", type=Path, help="folder (default: where studies.run writes)")
    root = parser.parse_args(arguments).results or default_results()

    from rich.console import Console

    from studies.reporting.html.index_page import write_index
    from studies.reporting.html.page import INDEX_FILE
    from studies.reporting.html.study_page import write_study_page
    from studies.reporting.page import page, sorted_by_section, study_folders
    from studies.reporting.results import Results
    from studies.reporting.sweeps import sweeps_of, write_sweep
    from studies.reporting.text import count_of
    from studies.reporting.write import write_tables
    from studies.storage import atomic_write, encodable
    from studies.storage.folders import table_is_current

    console = Console(markup=False)
    found, unreadable = [], []
    for folder in study_folders(root):
        try:
            study = Results.load(folder)
            if not study.rows.empty:
                write_tables(study, console, rows=not table_is_current(folder))
                write_study_page(study, root=root)
                page([study], root)
                found.append(study)
        except Exception as error:  # whatever a file leads to that a study did not write
            unreadable.append(f"{folder.relative_to(root).as_posix()}: cannot be read: {one_line(error)}")
    for line in unreadable:
        print(line)
    sweeps = sweeps_of(found)
    for sweep in sweeps:
        write_sweep(sweep, console)
    if not found:
        print(f"studies.report: error: no rows of a study that can be read under {root}", file=sys.stderr)
        return MISTAKE
    in_order = sorted_by_section(found)
    try:
        with atomic_write(root / "README.md") as path:
            path.write_text(encodable(page(in_order, root, sweeps)), "utf-8")
        write_index(in_order, root)
    except OSError as error:
        print(f"studies.report: error: {one_line(error)}", file=sys.stderr)
        return MISTAKE
    console.print(
        f"{count_of(len(found), 'study', 'studies')}; the pages are {root / 'README.md'} and {root / INDEX_FILE}",
        highlight=False,
        soft_wrap=True,
    )
    return SUCCESS


if __name__ == "__main__":
    run_command(main)
