"""``python -m studies.run +study=NAME``: the command line of studies.

Hydra and all other libraries are imported inside the functions that need them: every worker process imports this module
again, and the process that workers are forked from starts before them.
"""

from __future__ import annotations

import os
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from typing import TYPE_CHECKING, Any, NoReturn

from studies._own_packages import CONF
from studies.execution.fork_server import start_for_command
from studies.execution.interruption import is_ctrl_c, watch_ctrl_c
from studies.terminal import INTERRUPTED, MISTAKE, SOME_FAILED, one_line, run_command

if TYPE_CHECKING:
    from omegaconf import DictConfig

    from studies.reporting.results import Results

# The jobs of a sweep that failed: their options, and the exit codes that they would have had alone.
_failed_jobs: list[tuple[str, int]] = []

# The folders that the jobs of a sweep wrote to.
_swept_folders: list[Path] = []


class TrialsFailed(SystemExit):
    """The study is done, and some of its trials failed."""


def main() -> None:
    """Run the command with Hydra; its own exit code for mistakes, 1, becomes 2."""
    start_for_command(sys.argv[1:])
    from studies.planning.command_line import flags_last
    from studies.planning.help import HELP_FLAGS, help_text

    arguments = flags_last(sys.argv[1:])
    if not {*HELP_FLAGS}.isdisjoint(arguments) and not {"--config-dir", "-cd"} & {*arguments}:
        print(help_text(arguments))
        return
    if not {"--shell-completion", "-sc"}.isdisjoint(arguments):
        _fail("shell completion is not available for python -m studies.run; --help lists all names and options")
    with _folder_of_dry_sweep(arguments) as folder:
        _run_command([*folder, *arguments])


@contextmanager
def _folder_of_dry_sweep(arguments: Sequence[str]) -> Iterator[list[str]]:
    """The option that has Hydra write its record of a sweep to a folder that is deleted, if it is a dry run."""
    from studies.planning.command_line import quoted

    is_sweep = bool({"-m", "--multirun"} & {*arguments})
    if not is_sweep or not any(a.lstrip("+").lower() == "dry_run=true" for a in arguments):
        yield []
        return
    with TemporaryDirectory(prefix="studies") as folder:
        yield [f"hydra.sweep.dir={quoted(folder)}"]


def _run_command(arguments: list[str]) -> None:
    """Run the studies that the arguments define."""
    import hydra

    from studies.planning.command_line import (
        add_missing_options,
        check_groups,
        hints,
        list_globbed_studies,
        option_names,
        quote_argument,
    )

    try:
        check_groups(arguments)
    except ValueError as error:
        _fail(one_line(error))
    is_sweep = bool({"-m", "--multirun"} & set(arguments))
    quoted = [quote_argument(argument, is_sweep) for argument in arguments]
    sys.argv[1:] = add_missing_options(list_globbed_studies(quoted) if is_sweep else quoted)
    try:
        hydra.main(version_base="1.3", config_path=str(CONF), config_name="config")(_run_job)()
    except SystemExit as stop:
        if stop.code != SOME_FAILED or isinstance(stop, TrialsFailed):
            raise
        print(f"\nAvailable options: {', '.join(option_names(sys.argv[1:]))}.\nSee also --help.", file=sys.stderr)
        for line in hints(sys.argv[1:]):
            print(line, file=sys.stderr)
        sys.exit(MISTAKE)
    _write_sweeps()
    if _failed_jobs:
        print(f"\n{len(_failed_jobs)} of the sweep's studies failed, see above:", file=sys.stderr)
        for options, code in _failed_jobs:
            print(f"  {options}: {'some trials failed' if code == SOME_FAILED else 'did not run'}", file=sys.stderr)
        sys.exit(max(code for _, code in _failed_jobs))


def _run_job(cfg: DictConfig) -> None:
    """Run the study of one job of a sweep, or that of a command that is none."""
    from hydra.core.hydra_config import HydraConfig
    from hydra.types import RunMode

    try:
        _run(cfg)
    except SystemExit as stop:
        # Hydra would end the sweep here, and skip the other studies.
        if HydraConfig.get().mode is not RunMode.MULTIRUN or stop.code not in (SOME_FAILED, MISTAKE):
            raise
        _failed_jobs.append((" ".join(HydraConfig.get().overrides.task), int(stop.code)))


def _run(cfg: DictConfig) -> None:
    """Run the study of one job, and exit with its code."""
    from hydra.core.hydra_config import HydraConfig
    from rich.console import Console

    from studies.datasets.dataset import DatasetError
    from studies.execution.study import run_study
    from studies.planning.command_line import swept_options
    from studies.planning.configuration import check_own_names, configure

    overrides = list(HydraConfig.get().overrides.task)
    with watch_ctrl_c():
        try:
            check_own_names()
            study = configure(cfg, overrides, swept_options(sys.argv[1:], overrides))
            outcome = run_study(study, Console(markup=False, emoji=False))
        except DatasetError as error:  # its message has a line for each file that the data consist of
            _fail(str(error))
        except (ValueError, OSError) as error:
            _fail(one_line(error))
        except BaseException as error:  # whatever code of others raises while the study is planned
            if is_ctrl_c(error):
                print("interrupted", file=sys.stderr)
                sys.exit(INTERRUPTED)
            if os.environ.get("HYDRA_FULL_ERROR") == "1":
                traceback.print_exception(error)
            _fail(f"{one_line(error)} (HYDRA_FULL_ERROR=1 shows where)")
    if study.swept and outcome.results is not None:
        _swept_folders.append(outcome.results.folder)
    if outcome.interrupted:
        sys.exit(INTERRUPTED)
    if not outcome.complete:
        raise TrialsFailed(SOME_FAILED)


def _write_sweeps() -> None:
    """Write what the studies of a sweep found together: all in their folders, those of earlier commands too."""
    if not _swept_folders:
        return
    from rich.console import Console

    from studies.reporting.page import study_folders
    from studies.reporting.sweeps import read_sweeps, write_sweep

    around = dict.fromkeys(folder.parent for folder in _swept_folders)
    folders = [each for parent in around for each in study_folders(parent) if each.parent == parent]
    try:
        for sweep in read_sweeps(folders):
            if sweep.folders & set(_swept_folders):
                write_sweep(sweep, Console(markup=False))
    except (ValueError, OSError) as error:
        _fail(one_line(error))


def _fail(message: str) -> NoReturn:
    print(f"studies.run: error: {message}", file=sys.stderr)
    sys.exit(MISTAKE)


class _CallableModule(ModuleType):
    """Importing this module as ``studies.run`` must not hide the function `studies.run`: the module acts as it."""

    def __call__(self, study: str, overrides: Sequence[str] = (), **options: Any) -> Results:
        from studies.api import run

        return run(study, overrides, **options)


sys.modules[__name__].__class__ = _CallableModule

if __name__ == "__main__":
    run_command(main)
