"""``python -m studies.run +study=NAME``: compose, plan, run, show.

Numerical and drawing libraries are imported inside the functions that need them: every worker process imports this
module again, and `--help` should not wait for them.
"""

import sys
from contextlib import suppress
from pathlib import Path

import hydra
from hydra import compose, initialize_config_module
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException, InstantiationException
from omegaconf import DictConfig

from studies.quoting import quoted

# Swept options that already have a folder of their own in results_dir.
OWN_FOLDER = ("study", "dataset")


class TrialsFailed(SystemExit):
    """The study is done, and some of its trials gave no figure."""


def main() -> None:
    """Hydra's own command line; where it refuses the options, the names that exist are said too."""
    sys.argv[1:] = map(quoted, sys.argv[1:])
    try:
        run()
    except SystemExit as stop:
        if stop.code == 1 and not isinstance(stop, TrialsFailed):
            print(f"\nOptions there are: {', '.join(_options())}.\nSee also --help.", file=sys.stderr)
        raise


@hydra.main(version_base="1.3", config_path="pkg://conf", config_name="config")
def run(cfg: DictConfig) -> None:
    if "study" not in cfg:
        names = hydra.core.global_hydra.GlobalHydra.instance().config_loader().get_group_options("study")
        _stop(f"no study is named; type +study=NAME, NAME one of {', '.join(names)}")
    try:
        complete = run_study(cfg, _swept())
    except InstantiationException as error:
        _stop(_message(error.__cause__ or error))
    except (ValueError, OSError) as error:
        _stop(_message(error))
    if not complete:
        raise TrialsFailed(1)


def run_study(cfg, subfolder=""):
    """Run what is not stored yet of a study, and write its table, pictures and provenance.

    Parameters
    ----------
    cfg : the composed configuration
    subfolder : str, of results_dir/study/dataset, where to write

    Returns
    -------
    bool, whether every trial gave a figure
    """
    from rich.console import Console

    from studies import show
    from studies.plan import plan
    from studies.store import Store

    console = Console()
    experiment = hydra.utils.instantiate(cfg.experiment)
    trials = plan(cfg)
    title = f"{cfg.title} on {trials[0].dataset}"
    folder = Path(str(cfg.results_dir)) / trials[0].study / trials[0].dataset / subfolder
    engine = hydra.utils.instantiate(cfg.engine)
    with Store(folder) as store:
        if store.damaged:
            console.print(f"{store.path}: {store.damaged} damaged rows left out; their trials run again")
        missing = [trial for trial in trials if trial.trial_id not in store.rows]
        console.print(
            f"{title}: {len(trials)} trials"
            + (f", {len(trials) - len(missing)} of them stored already" if len(missing) < len(trials) else "")
        )
        interrupted = _run_missing(engine, missing, store, console)
        rows = store.frame([trial.trial_id for trial in trials], experiment.columns)
    if rows.empty:
        _stop("interrupted before the first trial was done")
    show.write(experiment, cfg, folder, rows, console)
    show.write_origin(cfg, folder, trials)
    if not interrupted:
        show.draw(experiment, cfg, folder, trials, rows, engine, console)
    console.print(f"written to {folder}", highlight=False, soft_wrap=True)
    failures = int((rows["status"] != "ok").sum())
    if failures:
        console.print(
            f"[red]{failures} of {len(rows)} trials failed[/red]; the column error of trials.parquet says why:"
        )
        for error, count in rows["error"].value_counts().head(5).items():
            console.print(f"  {count} × {error}", markup=False, highlight=False, soft_wrap=True)
    if interrupted:
        console.print("interrupted; what was done is stored, and the same command goes on from there")
        sys.exit(130)
    return failures == 0


def _run_missing(engine, missing, store, console):
    """Run the trials that are not stored; True if interrupted by Ctrl-C."""
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    from studies import schedule

    columns = (
        TextColumn("trials"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("[red]{task.fields[failures]}"),
    )
    if not missing:
        return False
    failed = 0
    try:
        with Progress(*columns, console=console) as progress:
            bar = progress.add_task("trials", total=len(missing), rate="", failures="")
            tasks = schedule.Schedule(missing)
            for task, outcome in engine.run(schedule.execute, tasks):
                for row in tasks.rows(task, outcome):
                    store.add(row)
                    failed += row["status"] != "ok"
                    speed = progress.tasks[bar].finished_speed or progress.tasks[bar].speed
                    progress.update(
                        bar,
                        advance=1,
                        rate=f"{speed:.1f}/s" if speed else "",
                        failures=f"{failed} failed" if failed else "",
                    )
    except KeyboardInterrupt:
        return True
    return False


def _swept():
    """The folder of one job of a sweep, from the options that the sweep varies: ``segmenter.time=0.5``."""
    arguments = OverridesParser.create().parse_overrides([a for a in sys.argv[1:] if "=" in a and a[0] != "-"])
    swept = {o.key_or_group for o in arguments if o.is_sweep_override()} - set(OWN_FOLDER)
    here = OverridesParser.create().parse_overrides(list(HydraConfig.get().overrides.task))
    return ",".join(f"{o.key_or_group}={o.get_value_element_as_str()}" for o in here if o.key_or_group in swept)


def _options():
    """Names of the options of the study, dataset … that the command line chooses; of the defaults if it names none."""
    chosen = [a for a in sys.argv[1:] if a.partition("=")[0] in ("+study", "dataset", "segmenter", "engine")]
    for overrides in (chosen, []):
        with initialize_config_module("conf", version_base="1.3"), suppress(HydraException):
            cfg = compose("config", overrides)
            return [
                f"{key}.{name}" if name else key
                for key, node in cfg.items_ex(resolve=False)
                if key != "study"
                for name in (node if isinstance(node, DictConfig) else [""])
                if not name.startswith("_")
            ]


def _message(error):
    return " ".join(str(error).split()) or type(error).__name__


def _stop(message):
    print(f"studies.run: error: {message}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
