"""Studies from Python and notebooks: `studies.run`, `studies.load` and `studies.rank`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import pandas as pd

    from studies.reporting.results import Results


def run(study: str, overrides: Sequence[str] = (), *, quiet: bool = False) -> Results:
    """Run a study as the command ``python -m studies.run +study=STUDY`` does.

    Trials that are stored already do not run again. A trial that fails is a row whose status is not "ok".

    Parameters
    ----------
    study : str
        name of a study in conf/study
    overrides : sequence of str
        options as on the command line, such as "dataset=psb" or "levels=[0.1,0.2]"
    quiet : bool
        print nothing

    Returns
    -------
    Results
        ``.rows`` and ``.tables`` as DataFrames, and the ``.folder`` with files and figures

    Raises
    ------
    ValueError
        for a mistake in the options; the message is one line
    StoreLockedError
        if another process is writing to the study's folder

    Examples
    --------
    >>> import studies
    >>> results = studies.run("scaling", ["dataset.models=[cow]", "results_dir=mine"])  # doctest: +SKIP
    >>> results.tables["table"]["mean"].max()  # doctest: +SKIP
    0.0
    """
    from hydra import compose, initialize_config_dir
    from hydra.core.global_hydra import GlobalHydra
    from hydra.errors import HydraException
    from rich.console import Console

    from studies._own_packages import CONF
    from studies.execution.study import run_study
    from studies.planning.command_line import check_groups, quote_argument
    from studies.planning.configuration import configure
    from studies.planning.errors import StudyError

    options = [f"+study={study}", *map(quote_argument, overrides)]
    check_groups(options)
    GlobalHydra.instance().clear()
    with initialize_config_dir(str(CONF), version_base="1.3"):
        try:
            cfg = compose("config", options)
        except HydraException as error:
            raise StudyError(" ".join(str(error).split())) from error
        outcome = run_study(configure(cfg, options), Console(quiet=quiet, markup=False))
    if outcome.interrupted:
        raise KeyboardInterrupt
    if outcome.results is None:
        raise StudyError("dry_run=true computes no results; type it on the command line")
    return outcome.results


def load(folder: str | Path) -> Results:
    """The stored results of a study.

    Parameters
    ----------
    folder : path
        such as "results/shot_noise/bundled"

    Returns
    -------
    Results
        ``.rows`` and ``.tables`` as DataFrames

    Raises
    ------
    ValueError
        if the folder does not contain the results of a study

    Examples
    --------
    >>> import studies
    >>> studies.load("results/shot_noise/bundled").tables["table"]  # doctest: +SKIP
    """
    from studies.reporting.results import Results

    return Results.load(folder)


def rank(results_dir: str | Path) -> pd.DataFrame:
    """The board of a leaderboard, from its stored rows alone.

    Parameters
    ----------
    results_dir : path
        the folder of a leaderboard, such as "results/leaderboard/synthetic", or one that contains a single leaderboard;
        trials.parquet alone is enough

    Returns
    -------
    pandas.DataFrame
        A row per method: rank, method, mce with mce_low and mce_high (its 95 % interval), mean_cp and control_cp (mean
        Change Percentage in percent), rand_original and rand_perturbed (Rand Index error), failed_share in percent,
        seconds, and more. Methods with a rank first; baselines and methods with missing cells have none.

    Raises
    ------
    ValueError
        If there are no rows of a leaderboard, or those of several.

    Examples
    --------
    >>> import studies
    >>> studies.rank("results/leaderboard/synthetic")[["rank", "method", "mce"]]  # doctest: +SKIP
    """
    from studies import storage
    from studies.experiments import Leaderboard
    from studies.experiments.experiment import row_columns
    from studies.planning.errors import StudyError
    from studies.reporting.results import CONFIG_FILE, Results

    found = {}
    folders = storage.result_folders(results_dir)
    if Path(results_dir) in folders:
        folders = [Path(results_dir)]
    for folder in folders:
        if (folder / CONFIG_FILE).exists():
            results = Results.load(folder)
            if isinstance(results.experiment, Leaderboard):
                found[folder] = results.experiment, results.rows
        elif folder == Path(results_dir):
            found[folder] = Leaderboard(), storage.read_rows(folder, row_columns(Leaderboard))
    if len(found) != 1:
        several = f" of several: {', '.join(folder.as_posix() for folder in found)}" if found else ""
        raise StudyError(f"{results_dir} has {'rows' if found else 'no rows'} of a leaderboard{several}")
    [(experiment, rows)] = found.values()
    return experiment.tables(rows)[0].frame
