"""``python -m studies COMMAND``: the same as ``python -m studies.COMMAND``."""

import sys
from importlib import import_module

from studies.terminal import MISTAKE, SUCCESS, run_command

COMMANDS = {
    "run": "run a study: python -m studies run --help lists the studies and their options",
    "status": "what is stored of every study, and which of them are running",
    "report": "tables, charts and the page of results, from stored rows alone",
    "serve": "the results in a browser, live while a study runs",
    "merge": "the results of one study from several folders as one",
}


def main() -> int:
    """Run the command that the first argument names; returns the exit code."""
    name, arguments = (sys.argv[1:2] or [""])[0], sys.argv[2:]
    if name in COMMANDS:
        sys.argv = [f"studies.{name}", *arguments]
        return import_module(f"studies.{name}").main() or SUCCESS
    listed = "\n".join(f"  {command:<8}{help}" for command, help in COMMANDS.items())
    usage = f"usage: python -m studies COMMAND ...\n\n{listed}"
    if name in ("-h", "--help"):
        print(usage)
        return SUCCESS
    problem = f"{name!r} is no command" if name else "a command is required"
    print(f"studies: error: {problem}: one of {', '.join(COMMANDS)}", file=sys.stderr)
    return MISTAKE


if __name__ == "__main__":
    run_command(main)
