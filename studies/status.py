"""``python -m studies.status [RESULTS]``: what is stored of every study, and which of them runs."""

import argparse
import sys
from datetime import datetime
from pathlib import Path

from rich.console import Console
from rich.table import Table

from studies.planning.trial import TIMINGS
from studies.storage import store

STATES = ("ok", "failed", "timeout", "crashed")
WIDTH = 130  # in characters, at least: a line that the terminal wraps is clearer than a cell that is
HEADINGS = ("study", "planned", *STATES, "seconds", "when", "state")


def status(folder):
    """A line of the table of a results folder: a dict with the keys of ``HEADINGS``."""
    rows = store.stored(folder)
    planned = store.planned(folder) or rows.index
    holder = store.holder(folder)
    written = max(path.stat().st_mtime for path in (folder / store.ROWS, folder / store.TABLE) if path.exists())
    counts = rows["status"].value_counts()
    left = f"{len(planned) - len(rows):,} to go" if len(rows) < len(planned) else ""
    return {
        "planned": f"{len(planned):,}",
        **{state: f"{counts.get(state, 0):,}" for state in STATES},
        "seconds": f"{rows[list(TIMINGS)].sum(axis=None):,.0f}",
        "when": datetime.fromtimestamp(written).isoformat(" ", "minutes"),
        "state": f"runs: {holder}" if holder else left,
    }


def main(arguments=None):
    parser = argparse.ArgumentParser(prog="studies.status", description=__doc__.split("\n\n")[0])
    parser.add_argument("results", nargs="?", type=Path, default=Path("results"), help="folder (default: results)")
    results = parser.parse_args(arguments).results
    folders = store.folders(results)
    if not folders:
        print(f"studies.status: error: there are no rows of a study under {results}", file=sys.stderr)
        return 2
    table = Table(caption="seconds: of perturbing and segmenting, in all trials together")
    for heading in HEADINGS:
        table.add_column(heading, justify="left" if heading in ("study", "state") else "right", overflow="fold")
    for folder in folders:
        table.add_row(folder.relative_to(results).as_posix(), *(status(folder)[key] for key in HEADINGS[1:]))
    console = Console()
    console.width = max(console.width, WIDTH)
    console.print(table)
    return 0


if __name__ == "__main__":
    sys.exit(main())
