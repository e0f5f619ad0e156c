"""``python -m studies.serve [RESULTS]``: the results in a browser, live while a study runs.

Read only, and on this machine alone unless ``--host`` names another interface.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Sequence
from pathlib import Path

from studies.serving import server
from studies.storage import default_results
from studies.storage.folders import RESULTS
from studies.terminal import MISTAKE, one_line, run_command


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command until Ctrl-C; returns its exit code."""
    parser = argparse.ArgumentParser(prog="studies.serve", description=(__doc__ or "").split("\n\n")[0])
    parser.add_argument("results", nargs="?", type=Path, help="folder (default: where studies.run writes, or results)")
    parser.add_argument(
        "--port", type=int, default=server.DEFAULT_PORT, help="default: %(default)s; 0 for any that is free"
    )
    parser.add_argument(
        "--host", default=server.LOCALHOST, help="interface, such as 0.0.0.0 for all (default: this machine alone)"
    )
    parser.add_argument("--open", action="store_true", help="open a browser")
    options = parser.parse_args(arguments)
    root = options.results
    if root is None:
        root = default_results() if default_results().exists() else Path(RESULTS)
    if not root.is_dir():
        return _mistake(f"{root} is not a folder")
    try:
        listening = server.bind(options.host, options.port)
    except (OSError, OverflowError) as error:
        return _mistake(
            f"cannot listen on port {options.port} of {options.host} ({one_line(error)}): choose another by --port, "
            "0 for any that is free"
        )
    local = server.is_local(options.host)
    if not local:
        print(
            f"studies.serve: warning: whoever reaches this machine through {options.host} can read all of {root}",
            file=sys.stderr,
        )
    print(f"{root} is at {server.address(listening)}; Ctrl-C ends this", flush=True)
    with listening:
        server.run(root, listening, local=local, browser=options.open)


def _mistake(message: str) -> int:
    print(f"studies.serve: error: {message}", file=sys.stderr)
    return MISTAKE


if __name__ == "__main__":
    run_command(main)
