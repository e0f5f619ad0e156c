"""Running a study: what is not stored yet is computed, and everything that is stored is shown."""

from __future__ import annotations

import dataclasses
from collections.abc import Collection, Mapping, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from studies import storage
from studies.columns import is_missing
from studies.experiments.experiment import row_columns
from studies.planning.plan import PlannedRows
from studies.planning.trial import failed_row, planned_row
from studies.planning.trial_ids import TrialIds
from studies.reporting.origin import MadeFrom
from studies.reporting.text import count_of

if TYPE_CHECKING:
    import pandas as pd
    from rich.console import Console

    from studies.execution.engine import Engine
    from studies.planning.configuration import Study
    from studies.planning.plan import Plan
    from studies.reporting.results import Results

INTERRUPTED = "interrupted"
STOPPED = "stopped at a trial that failed (on_error=stop)"
ERRORS_SHOWN = 5
NOT_IN_MEMORY = ("applied", "traceback")  # columns that no table needs, of which there may be millions of long texts
MOST_LISTED = 100_000  # trials among which those that pictures show are chosen; of more, the first repeats
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
    trials = study.plan_blocks()
    made = MadeFrom.of(study, trials)
    console.print(f"{made.title}, {count_of(len(trials), 'trial')}", highlight=False)
    for remark in study.remarks:
        console.print(remark, highlight=False, soft_wrap=True)
    gathers = study.experiment.gathers
    planned = PlannedRows(trials)
    place = storage.place(study.folder, made.origin, planned, study.fresh, gathers=gathers)
    _report_place(place, study, trials, console)
    further = _further_rows(study, made, planned) if gathers and not study.fresh else {}
    study = dataclasses.replace(study, folder=place.folder)
    if study.dry_run:
        _show_plan(study, trials, console)
        return Outcome(None)
    with storage.RowStore(study.folder, study.fresh) as store:
        _report_store(store, console)
        missing = _missing(study, trials, store)
        if len(missing) < len(trials):
            console.print(f"  {len(trials) - len(missing):,} of them stored already", highlight=False)
        reused = _reusable(study, missing)
        _reuse_rows(reused, missing, store, console)
        _store_table_rows(place, store)
        place = _add_further_rows(further, place, store, console)
        to_run = _missing(study, trials, store)
        _write_plan(made, place, store, reused, ran=bool(to_run))
        ended_early = _run_missing(study, to_run, store, console)
        results = _results(study, place, made, trials, store)
        if place.part != place.folder and (place.n_new or to_run):
            _write_whole(place, store)
        if len(results.rows):
            _write_results(study, results, trials, ended_early, console)
        _report_missing_metrics(results.rows, store, console)
    ours = results.rows[results.rows["trial_id"].isin(set(made.trial_ids))] if gathers else results.rows
    _report_failures(ours, ended_early, console)
    return Outcome(results, ended_early, bool((ours["status"] == "ok").all()) and len(ours) == len(trials))


def _report_place(place: storage.Place, study: Study, trials: Plan, console: Console) -> None:
    """Print where results go if that is not the usual folder, and what is there already."""
    if place.folder != study.folder:
        console.print(
            f"  {study.folder} has other results, which stay: these go to {place.folder}",
            highlight=False,
            soft_wrap=True,
        )
    if place.replaced:
        console.print(f"  {place.replaced:,} stored rows are of other meshes or code: their trials run again")
    if place.is_part and place.part == place.folder:
        console.print(
            f"  {place.folder} has {count_of(len(place.others), 'other trial')}, which stay: tables and pictures are "
            "about all of them",
            highlight=False,
            soft_wrap=True,
        )
    elif place.is_part:
        extent = ", ".join(f"{n} of {count_of(of, noun)}" for noun, (n, of) in place.extent.items() if n < of)
        console.print(
            f"  a part of what {place.folder} has{f' ({extent})' if extent else ''}: the other "
            f"{count_of(len(place.others), 'trial')} stay, and tables and pictures of the part go to {place.part}",
            highlight=False,
            soft_wrap=True,
        )


def _show_plan(study: Study, trials: Plan, console: Console) -> None:
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


def _missing(study: Study, trials: Plan, stored: storage.StoredRows | None) -> Plan:
    """The trials to run: those without a stored row, or with one that is to be replaced."""
    if stored is None or not len(stored.status):
        return trials
    codes = stored.status.of(trials.ids)
    return trials.where(codes != 0 if study.retry_failed else codes < 0)


def _reusable(study: Study, missing: Plan) -> dict[Path, set[str]]:
    """Where the rows of missing trials are stored already; nowhere if the study is to start over."""
    if study.fresh:
        return {}
    found: dict[Path, set[str]] = {}
    for source in study.sources or (study.results_dir,):
        known = set().union(*found.values()) if found else set()
        for path, trial_ids in storage.find_reusable(source, study.folder, missing.ids).items():
            if trial_ids - known:
                found[path] = trial_ids - known
    return found


def _reuse_rows(found: Mapping[Path, set[str]], missing: Plan, store: storage.RowStore, console: Console) -> None:
    """Store the rows that other studies have computed for missing trials, as rows of this study."""
    for path, trial_ids in found.items():
        by_id = missing.of_ids(trial_ids)
        store.add_all(
            row | {name: value for name, value in planned_row(by_id[row["trial_id"]]).items() if value is not None}
            for row in storage.read_reusable(path, trial_ids)
        )
        console.print(f"  {len(trial_ids):,} of them reused from {path}", highlight=False, soft_wrap=True)


def _store_table_rows(place: storage.Place, store: storage.RowStore) -> None:
    """Store the rows of trials that are not planned, if only the table has them, as in a fresh clone."""
    absent = {trial_id for trial_id in place.others if trial_id not in store.status}
    if absent and (place.folder / storage.TABLE_FILE).exists():
        store.add_all(storage.read_reusable(place.folder / storage.TABLE_FILE, absent, failed=True))


def _further_rows(study: Study, made: MadeFrom, planned: Sequence[Mapping[str, Any]]) -> dict[Path, tuple[str, ...]]:
    """Rows of other methods with the same variants, in results that are only read, as the published ones."""
    below = study.folder.relative_to(study.results_dir)
    others = [source for source in study.sources if source != study.results_dir]
    found = (storage.others_of_same_variants(source / below, made.origin, planned) for source in others)
    return {folder: trial_ids for folder, trial_ids in found if trial_ids}


def _add_further_rows(
    further: Mapping[Path, tuple[str, ...]], place: storage.Place, store: storage.RowStore, console: Console
) -> storage.Place:
    """Store rows that were found elsewhere; those of other methods that the folder has already stay."""
    for folder, trial_ids in further.items():
        listed = set(place.others)
        absent = [trial_id for trial_id in trial_ids if trial_id not in listed]
        unstored = {trial_id for trial_id in absent if trial_id not in store.status}
        file = storage.rows_file(folder)
        if unstored and file is not None:
            store.add_all(storage.read_reusable(file, unstored, failed=True))
        if absent:
            console.print(
                f"  {len(absent):,} trials of other methods are from {folder}", highlight=False, soft_wrap=True
            )
            place = dataclasses.replace(place, others=(*place.others, *absent), n_new=max(place.n_new, 1))
    return place


def _write_plan(
    made: MadeFrom, place: storage.Place, store: storage.RowStore, reused: Mapping[Path, set[str]], *, ran: bool
) -> None:
    """Write configuration, provenance and plan before anything runs, so that a killed study can be shown."""
    from studies.reporting.write import write_origin

    write_origin(made, place, [path.parent for path in reused], ran=ran)
    if place.n_new or not place.is_part:
        store.write_plan(chain(place.others, made.trial_ids))


def _run_missing(study: Study, missing: Plan, store: storage.RowStore, console: Console) -> str:
    """Run trials and store their rows; why it ended early, "" if it did not."""
    from studies.execution.imports_ahead import OF_TABLE, ImportsAhead
    from studies.execution.schedule import run_batches
    from studies.execution.serial import Serial
    from studies.reporting.progress import Progress

    if not missing:
        return ""
    try:
        _compile_ahead(study, console)
    except KeyboardInterrupt:
        return INTERRUPTED
    labels = storage.LabelStore(study.folder)
    ahead = ImportsAhead(OF_TABLE)
    meanwhile = None if isinstance(study.engine, Serial) else ahead.start  # the serial engine leaves no time for it
    declared = {column.name for column in row_columns(study.experiment)} | {"seconds"}  # which the schedule adds
    try:
        with (
            Progress(len(missing), study.engine, console) as progress,
            ahead,
            closing(run_batches(study.engine, missing, meanwhile)) as batches,
        ):
            for batch in batches:
                rows = [_declared_row(row, missing, declared) for row in batch]
                failed = next((i for i, row in enumerate(rows) if row["status"] != "ok"), None)
                if study.on_error == "stop" and failed is not None:
                    rows = rows[: failed + 1]
                _store(rows, store, labels)
                for row in rows:
                    progress.count(row["status"])
                    _show_traceback(row, study.engine, progress.console)
                if study.on_error == "stop" and failed is not None:
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


def _declared_row(row: dict[str, Any], trials: Plan, declared: Collection[str]) -> dict[str, Any]:
    """A row, which becomes one that failed if it has values that no column is declared for: they would be lost."""
    undeclared = [
        name
        for name, value in row.items()
        if name not in declared and not isinstance(value, np.ndarray) and not is_missing(value)
    ]
    if not undeclared:
        return row
    names = ", ".join(undeclared)
    trial = trials.of_ids([row["trial_id"]])[row["trial_id"]]
    return failed_row(trial, "failed", f"measure() returns {names}: declare a Column in the experiment's `columns`")


def _store(rows: Sequence[dict[str, Any]], store: storage.RowStore, labels: storage.LabelStore) -> None:
    """Store rows, all at once because waiting for the disk takes most of the time; arrays have files of their own."""
    plain = []
    for row in rows:
        arrays = {name: value for name, value in row.items() if isinstance(value, np.ndarray)}
        if arrays:
            labels.put(row["trial_id"], arrays)
        plain.append({name: value for name, value in row.items() if name not in arrays})
    store.add(*plain)


def _results(
    study: Study,
    place: storage.Place,
    made: MadeFrom,
    trials: Plan,
    store: storage.RowStore,
) -> Results:
    """The results of what was planned, which may be a part of what the folder has."""
    from studies.reporting.results import Results
    from studies.storage.merging import in_order

    columns = row_columns(study.experiment)
    if _is_large(int(np.count_nonzero(store.status.of(trials.ids) >= 0)), study):
        path = place.part / storage.TABLE_FILE
        batches = store.batches(trials.ids, columns)
        storage.write_in_order(path, ((_with_methods(rows, trials), positions) for rows, positions in batches))
        rows = storage.read_table(path, columns, without=NOT_IN_MEMORY)
    else:
        shown = TrialIds(chain(place.others, made.trial_ids)) if study.experiment.gathers else made.trial_ids
        rows = _with_methods(store.frame(shown, columns), trials)
    if study.experiment.gathers:
        rows = in_order(rows).reset_index(drop=True)
    return Results(
        folder=place.part,
        name=study.name,
        base_title=study.title,
        experiment=study.experiment,
        rows=rows,
        publication=study.publication,
        command=study.command,
        n_models_of=max(made.n_models_of or 0, place.extent.get("model", (0, 0))[1]) or None,
    )


def _is_large(n_rows: int, study: Study) -> bool:
    """Whether the rows are so many that their table is written before they are read."""
    return n_rows > storage.MOST_ROWS and not study.experiment.gathers


def _with_methods(rows: pd.DataFrame, trials: Plan) -> pd.DataFrame:
    """Rows with the methods of their trials: those of earlier versions lack options, or have another name for them."""
    import pandas as pd

    methods = trials.methods(TrialIds(rows["trial_id"]))
    for i, column in enumerate(("segmenter", "segmenter_options")):
        known = pd.Series([method[i] for method in methods], index=rows.index, dtype="string")
        rows[column] = known.fillna(rows[column])
    return rows


def _write_whole(place: storage.Place, store: storage.RowStore) -> None:
    """Write the tables and curves of all that a folder has, of which a part was planned."""
    from rich.console import Console

    from studies.reporting.html.study_page import write_study_page
    from studies.reporting.results import Results
    from studies.reporting.write import write_tables
    from studies.storage.merging import in_order

    record = storage.read_config(place.folder)
    whole = Results.of_record(place.folder, record)
    rows = in_order(whole.rows)
    store.write_plan(dict.fromkeys([*rows["trial_id"], *(storage.planned_ids(place.folder) or ())]))
    whole = dataclasses.replace(whole, rows=rows)
    write_tables(whole, Console(quiet=True))
    write_study_page(whole)


def _write_results(study: Study, results: Results, plan: Plan, ended_early: str, console: Console) -> None:
    from studies.reporting.write import draw_pictures, make_scenes, write_tables

    write_tables(results, console, rows=not _is_large(len(results.rows), study))
    from studies.reporting.html.study_page import write_study_page  # takes half a second to load: the table comes first

    scenes = None
    for stem in results.experiment.unwanted_pictures():
        (study.folder / f"{stem}.png").unlink(missing_ok=True)
    if not ended_early:
        labels = storage.LabelStore(study.folder).get
        trials = list(plan) if len(plan) <= MOST_LISTED else list(plan.variants())
        draw_pictures(results, trials, labels, study.engine, console)
        scenes = make_scenes(results, trials, labels, study.engine, console)
    write_study_page(results, scenes, study.results_dir)
    console.print(f"written to {results.folder}", highlight=False, soft_wrap=True)


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
        # A metric of meshes can be stored as missing, of comparisons without a mesh, or without borders.
        n_missing = _count_without(name, store) if metric.needs_mesh else int(succeeded[name].isna().sum())
        if n_missing:
            computed = "was" if n_missing == 1 else "were"
            console.print(
                f"{count_of(n_missing, 'row')} {computed} computed before the metric {name} was added: fresh=true "
                "computes all rows again",
                highlight=False,
                soft_wrap=True,
            )


def _count_without(name: str, store: storage.RowStore) -> int:
    """How many stored rows of trials that succeeded lack a value, even one that says that it is missing."""
    return sum(name not in row for row in store if row["status"] == "ok")


def _report_failures(rows: pd.DataFrame, ended_early: str, console: Console) -> None:
    """Print how many trials failed and why, and whether the study ended early."""
    failed = rows[rows["status"] != "ok"]
    if len(failed):
        console.print(
            f"[red]{len(failed):,} of {count_of(len(rows), 'trial')} failed[/red]; trials.parquet has the "
            "reasons, in the column error, and where they arose, in the column traceback:",
            markup=True,
        )
        for error in failed["error"].value_counts().head(ERRORS_SHOWN).index:
            trials = [_place(row) for row in failed[failed["error"] == error].to_dict("records")]
            console.print(
                f"  {len(trials):,} × {error} ({_first_of(trials)})", markup=False, highlight=False, soft_wrap=True
            )
    if ended_early:
        console.print(f"{ended_early}; what was done is stored, and the same command continues from there")
