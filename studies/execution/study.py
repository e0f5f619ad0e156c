"""Running a study: what is not stored yet is computed, and everything that is stored is shown."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies import storage
from studies.experiments.experiment import row_columns
from studies.planning.trial import planned_row
from studies.reporting.text import count_of

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console

    from studies.execution.engine import Engine
    from studies.planning.configuration import Study
    from studies.planning.trial import Trial
    from studies.reporting.results import Results

INTERRUPTED = "interrupted"
STOPPED = "stopped at a trial that failed (on_error=stop)"
ERRORS_SHOWN = 5
PLACES_SHOWN = 3  # trials of each error


@dataclass(frozen=True)
class Outcome:
    """How running a study ended.

    Parameters
    ----------
    results : Results or None
        None after a dry run
    ended_early : str
        why it ended before all trials had run, "" if it did not
    complete : bool
        whether every planned trial succeeded
    """

    results: Results | None
    ended_early: str = ""
    complete: bool = True

    @property
    def interrupted(self) -> bool:
        """Whether Ctrl-C ended it."""
        return self.ended_early == INTERRUPTED


def run_study(study: Study, console: Console) -> Outcome:
    """Run the trials of a study that are not stored yet, and write its rows, tables, charts and pictures.

    Parameters
    ----------
    study : Study
    console : rich.console.Console

    Returns
    -------
    Outcome

    Raises
    ------
    StudyError
        if the options define no trial, or nothing plans one
    StoreLockedError
        if another process is writing to the study's folder
    """
    trials = study.plan()
    console.print(f"{study.full_title}: {count_of(len(trials), 'trial')}", highlight=False)
    if study.dry_run:
        _show_plan(study, trials, console)
        return Outcome(None)
    with storage.RowStore(study.folder, study.fresh) as store:
        _report_store(store, console)
        missing = _missing(study, trials, store)
        if len(missing) < len(trials):
            console.print(f"  {len(trials) - len(missing):,} of them stored already", highlight=False)
        _reuse_rows(_reusable(study, missing), missing, store, console)
        _write_plan(study, trials, store)
        ended_early = _run_missing(study, _missing(study, trials, store), store, console)
        results = _results(study, trials, store)
        if len(results.rows):
            _write_results(study, results, trials, ended_early, console)
        _report_missing_metrics(results.rows, store, console)
    _report_failures(results, ended_early, console)
    return Outcome(results, ended_early, results.failures == 0 and len(results.rows) == len(trials))


def _show_plan(study: Study, trials: Sequence[Trial], console: Console) -> None:
    """Print what a run would do."""
    from studies.reporting.progress import show_plan

    stored = None if study.fresh else storage.StoredRows(study.folder)
    missing = _missing(study, trials, stored)
    show_plan(trials, missing, stored, _reusable(study, missing), study.engine, console)


def _report_store(store: storage.RowStore, console: Console) -> None:
    if store.moved_to:
        console.print(f"  moved to: {store.moved_to}", highlight=False, soft_wrap=True)
    if store.damaged:
        again = "its trial runs again" if store.damaged == 1 else "their trials run again"
        console.print(f"  {store.path}: {count_of(store.damaged, 'damaged row')} ignored; {again}")


def _missing(study: Study, trials: Sequence[Trial], stored: storage.StoredRows | None) -> list[Trial]:
    """The trials to run: those without a stored row, or with one that is to be replaced."""
    status = stored.status if stored else {}
    return [
        trial
        for trial in trials
        if trial.trial_id not in status or (study.retry_failed and status[trial.trial_id] != "ok")
    ]


def _reusable(study: Study, missing: Sequence[Trial]) -> dict[Path, set[str]]:
    """Where the rows of missing trials are stored already; nowhere if the study is to start over."""
    if study.fresh:
        return {}
    return storage.find_reusable(study.results_dir, study.folder, [trial.trial_id for trial in missing])


def _reuse_rows(
    found: Mapping[Path, set[str]], missing: Sequence[Trial], store: storage.RowStore, console: Console
) -> None:
    """Store the rows that other studies have computed for missing trials, as rows of this study."""
    by_id = {trial.trial_id: trial for trial in missing} if found else {}
    for path, trial_ids in found.items():
        store.add_all(
            row | {name: value for name, value in planned_row(by_id[row["trial_id"]]).items() if value is not None}
            for row in storage.read_reusable(path, trial_ids)
        )
        console.print(f"  {len(trial_ids):,} of them reused from {path}", highlight=False, soft_wrap=True)


def _write_plan(study: Study, trials: Sequence[Trial], store: storage.RowStore) -> None:
    """Write configuration, provenance and plan before anything runs, so that a killed study can be shown."""
    from studies.reporting.write import write_origin

    write_origin(study, trials)
    store.write_plan(trial.trial_id for trial in trials)


def _run_missing(study: Study, missing: Sequence[Trial], store: storage.RowStore, console: Console) -> str:
    """Run trials and store their rows; why it ended early, "" if it did not."""
    from studies.execution.schedule import run_trials
    from studies.reporting.progress import Progress

    if not missing:
        return ""
    try:
        _compile_ahead(study, console)
    except KeyboardInterrupt:
        return INTERRUPTED
    labels = storage.LabelStore(study.folder)
    try:
        with (
            Progress(len(missing), study.engine, console) as progress,
            closing(run_trials(study.engine, missing)) as rows,
        ):
            for row in rows:
                _store(row, store, labels)
                progress.count(row["status"])
                _show_traceback(row, study.engine, progress.console)
                if study.on_error == "stop" and row["status"] != "ok":
                    return STOPPED
    except KeyboardInterrupt:
        return INTERRUPTED
    return ""


def _compile_ahead(study: Study, console: Console) -> None:
    """Compile the methods of a study before its first trial, once, and say so; workers load it from the cache."""
    from studies.execution.engine import TaskFailedError, map_ordered

    if study.engine.remote:
        return
    for method in (segmenter.method for segmenter in study.segmenters):
        if hasattr(method, "compile_ahead"):
            # Where trials run, and not here: loading the result takes seconds, which a worker needs anyway. If it fails
            # there, the trials tell why.
            with suppress(TaskFailedError):
                if not map_ordered(study.engine, _is_compiled, [method])[0]:
                    console.print("  compiling the inner loops, which takes about half a minute, once")
                    map_ordered(study.engine, _compile, [method])
            return


def _is_compiled(method: Any) -> bool:
    return method.is_compiled()


def _compile(method: Any) -> None:
    method.compile_ahead()


def _show_traceback(row: Mapping[str, Any], engine: Engine, console: Console) -> None:
    """Print where a trial failed, if trials run in this process, which is how one looks for mistakes."""
    from studies.execution.serial import Serial

    if isinstance(engine, Serial) and row.get("traceback"):
        console.print(f"{_place(row)}:\n{row['traceback']}", markup=False, highlight=False, soft_wrap=True)


def _store(row: dict[str, Any], store: storage.RowStore, labels: storage.LabelStore) -> None:
    """Store a row, and its arrays in a file of their own."""
    arrays = {name: value for name, value in row.items() if isinstance(value, np.ndarray)}
    if arrays:
        labels.put(row["trial_id"], arrays)
    store.add({name: value for name, value in row.items() if name not in arrays})


def _results(study: Study, trials: Sequence[Trial], store: storage.RowStore) -> Results:
    from studies.reporting.results import Results

    return Results(
        folder=study.folder,
        name=study.name,
        title=study.full_title,
        experiment=study.experiment,
        rows=store.frame([trial.trial_id for trial in trials], row_columns(study.experiment)),
        publication=study.publication,
        command=study.command,
    )


def _write_results(study: Study, results: Results, trials: Sequence[Trial], ended_early: str, console: Console) -> None:
    from studies.reporting.write import draw_pictures, write_tables

    write_tables(results, console)
    for stem in results.experiment.unwanted_pictures():
        (study.folder / f"{stem}.png").unlink(missing_ok=True)
    if not ended_early:
        draw_pictures(results, trials, study.engine, console)
    console.print(f"written to {study.folder}", highlight=False, soft_wrap=True)


def _place(row: Mapping[Any, Any]) -> str:
    """Model, part and level of a row, for messages: "ant, holes 250"."""
    level = f" {row['level']:g}" if row["perturbation"] else ""
    return f"{row['model']}, {row['part']}{level}"


def _first_of(places: Sequence[str]) -> str:
    """A few different places, and how many others there are."""
    different = list(dict.fromkeys(places))
    others = len(different) - PLACES_SHOWN
    return "; ".join(different[:PLACES_SHOWN]) + (f"; and {others:,} more" if others > 0 else "")


def _report_missing_metrics(rows: pd.DataFrame, store: storage.RowStore, console: Console) -> None:
    """Print which metrics stored rows lack, because they are older than the metric."""
    from studies import metrics

    succeeded = rows[rows["status"] == "ok"]
    for name, metric in metrics.registered().items():
        if name not in succeeded:
            continue
        n_missing = int(succeeded[name].isna().sum())
        if n_missing and not (metric.needs_mesh and _is_stored(name, store)):
            computed = "was" if n_missing == 1 else "were"
            console.print(
                f"{count_of(n_missing, 'row')} {computed} computed before the metric {name} was added: fresh=true "
                "computes all rows again",
                highlight=False,
                soft_wrap=True,
            )


def _is_stored(name: str, store: storage.RowStore) -> bool:
    """Whether every stored row has this value, if only to say that it is missing: of comparisons without a mesh."""
    return all(name in row for row in store if row["status"] == "ok")


def _report_failures(results: Results, ended_early: str, console: Console) -> None:
    """Print how many trials failed and why, and whether the study ended early."""
    if results.failures:
        console.print(
            f"[red]{results.failures:,} of {count_of(len(results.rows), 'trial')} failed[/red]; trials.parquet has the "
            "reasons, in the column error, and where they arose, in the column traceback:"
        )
        failed = results.rows[results.rows["status"] != "ok"]
        for error in failed["error"].value_counts().head(ERRORS_SHOWN).index:
            trials = [_place(row) for row in failed[failed["error"] == error].to_dict("records")]
            console.print(
                f"  {len(trials):,} × {error} ({_first_of(trials)})", markup=False, highlight=False, soft_wrap=True
            )
    if ended_early:
        console.print(f"{ended_early}; what was done is stored, and the same command continues from there")
