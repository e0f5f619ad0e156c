"""``python -m studies.status [RESULTS]``: what is stored of every study, and which of them are running."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING

from studies.storage import default_results, result_folders, summarize
from studies.storage.folders import RESULTS
from studies.terminal import MISTAKE, SUCCESS, one_line, run_command

if TYPE_CHECKING:
    from studies.storage.summary import FolderSummary

STATUSES = ("ok", "failed", "timeout", "crashed")
HEADINGS = ("study", "planned", *STATUSES, "seconds", "last written", "state")
CAPTION = "seconds: time that perturbing and segmenting took in all trials together"


def cells(name: str, summary: "FolderSummary") -> tuple[str, ...]:
    """The line of the table for a results folder: a text for each of ``HEADINGS``.

    Parameters
    ----------
    name : str
        how the folder is called
    summary : FolderSummary
        what it contains
    """
    return (
        name,
        f"{summary.n_planned:,}",
        *(f"{summary.statuses[status]:,}" for status in STATUSES),
        f"{summary.seconds:,.0f}",
        summary.written.isoformat(" ", "minutes"),
        summary.state,
    )


def print_table(lines: list[tuple[str, ...]]) -> None:
    """Print lines as a table whose cells are never cut.

    It is as wide as it has to be: a line that the terminal wraps can be read, a number that is cut cannot.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(caption=CAPTION)
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in ("study", "state") else "right", no_wrap=True)
    for line in lines:
        table.add_row(*map(Text, line))
    console = Console(markup=False)
    width = console.width
    console.width = 100_000  # or the measure would be limited by the terminal
    console.width = max(width, console.measure(table).maximum)
    console.print(table)


def main(arguments: list[str] | None = None) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="studies.status", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("results", nargs="?", type=Path, help="folder (default: where studies.run writes, or results)")
    results = parser.parse_args(arguments).results
    if results is None:
        # The first look at a fresh clone is at the published results.
        results = default_results() if default_results().exists() else Path(RESULTS)
    folders = result_folders(results)
    if not folders:
        print(f"studies.status: error: no results of a study in {results}", file=sys.stderr)
        return MISTAKE
    lines, unreadable = [], []
    for folder in folders:
        name = folder.relative_to(results).as_posix()
        try:
            lines.append(cells(name, summarize(folder)))
        except Exception as error:  # whatever a file leads to that a study did not write
            unreadable.append(f"{name}: cannot be read: {one_line(error)}")
    if lines:
        print_table(lines)
    for line in unreadable:
        print(line)
    return SUCCESS


if __name__ == "__main__":
    run_command(main)
