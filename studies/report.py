"""``python -m studies.report [RESULTS]``: tables, charts and the page of results, from stored rows alone."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="studies.report", description=__doc__)
    parser.add_argument("results", nargs="?", type=Path, default=Path("results"), help="folder (default: results)")
    root = parser.parse_args(arguments).results

    from rich.console import Console

    from studies.reporting.page import page, stored_results
    from studies.reporting.write import write_tables
    from studies.storage import atomic_write

    try:
        found = stored_results(root)
        if not found:
            raise ValueError(f"no rows of a study under {root}")
    except ValueError as error:
        print(f"studies.report: error: {error}", file=sys.stderr)
        return 2
    console = Console()
    for study in found:
        write_tables(study, console)
    with atomic_write(root / "README.md") as path:
        path.write_text(page(found, root), "utf-8")
    console.print(f"{len(found)} studies; the page is {root / 'README.md'}", highlight=False, soft_wrap=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
