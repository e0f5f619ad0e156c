"""``python -m studies.merge A B [--into C]``: join the results of a study that was made in parts, on two machines.

A and B are results folders, such as results/table2/psb. Their rows are joined in A, or in C, which must not contain
results. The tables and charts are made again.
"""

import argparse
import sys
from pathlib import Path

from studies.terminal import MISTAKE, SUCCESS, one_line, run_command


def merge_folders(first: Path, second: Path, into: Path) -> None:
    """Merge two results folders and write the tables and charts of the whole."""
    from rich.console import Console

    from studies.experiments.experiment import row_columns
    from studies.planning.configuration import instantiate_experiment
    from studies.reporting.html.study_page import write_study_page
    from studies.reporting.results import Results
    from studies.reporting.text import count_of
    from studies.reporting.write import write_tables
    from studies.storage import merging

    merging.check_folders(first, second, into)
    console = Console(markup=False)
    columns = row_columns(instantiate_experiment(merging.read_options(first)))

    def write(merged: merging.Merged) -> None:
        results = Results.of_record(into, merged.options, merged.rows)
        write_tables(results, console)
        write_study_page(results)

    merged = merging.merge(first, second, into, columns, write)
    console.print(
        f"{count_of(merged.n_first, 'row')} of {first} and {merged.n_second:,} of {second} are {len(merged.rows):,} in "
        f"{into}",
        highlight=False,
        soft_wrap=True,
    )


def main(arguments: list[str] | None = None) -> int:
    """The command; returns its exit code."""
    parser = argparse.ArgumentParser(prog="studies.merge", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("first", type=Path, metavar="A", help="results folder")
    parser.add_argument("second", type=Path, metavar="B", help="results folder")
    parser.add_argument("--into", type=Path, metavar="C", help="folder without results (default: A)")
    options = parser.parse_args(arguments)
    try:
        merge_folders(options.first, options.second, options.into or options.first)
    except Exception as error:  # whatever a file leads to that a study did not write
        print(f"studies.merge: error: {one_line(error)}", file=sys.stderr)
        return MISTAKE
    return SUCCESS


if __name__ == "__main__":
    run_command(main)
