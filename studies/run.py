"""``python -m studies.run +study=NAME``: compose, plan, run, show.

Numerical and drawing libraries are imported inside the functions that need them: every worker process imports this
module again, and `--help` should not wait for them.
"""

import sys
from contextlib import closing, suppress
from pathlib import Path

import hydra
from hydra import compose, initialize_config_module
from hydra.core.hydra_config import HydraConfig
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException, InstantiationException
from hydra.types import RunMode
from omegaconf import DictConfig, OmegaConf

from studies.planning.quoting import quoted

# Swept options that already have a folder of their own in results_dir.
OWN_FOLDER = ("study", "dataset")

ON_ERROR = ("continue", "stop")
INTERRUPTED = "interrupted"


# The jobs of a sweep that failed: their options, and the exit codes that they would have had alone.
_failed_jobs = []


class TrialsFailed(SystemExit):
    """The study is done, and some of its trials gave no figure."""


def main() -> None:
    """Hydra's own command line; where it refuses the options, the names that exist are said too."""
    sys.argv[1:] = _of_swept_studies([quoted(argument) for argument in sys.argv[1:]])
    try:
        run()
    except SystemExit as stop:
        if stop.code == 1 and not isinstance(stop, TrialsFailed):
            print(f"\nOptions there are: {', '.join(_options())}.\nSee also --help.", file=sys.stderr)
        raise
    if _failed_jobs:
        print(f"\n{len(_failed_jobs)} of the sweep's studies failed, as said above:", file=sys.stderr)
        for options, code in _failed_jobs:
            print(f"  {options}: {'some trials failed' if code == 1 else 'could not be run'}", file=sys.stderr)
        sys.exit(max(code for _, code in _failed_jobs))


@hydra.main(version_base="1.3", config_path="pkg://conf", config_name="config")
def run(cfg: DictConfig) -> None:
    try:
        _run(cfg)
    except SystemExit as stop:
        # Hydra would end the sweep here, and leave the other studies.
        if HydraConfig.get().mode is not RunMode.MULTIRUN or stop.code not in (1, 2):
            raise
        _failed_jobs.append((" ".join(HydraConfig.get().overrides.task), stop.code))


def _run(cfg):
    if "study" not in cfg:
        names = hydra.core.global_hydra.GlobalHydra.instance().config_loader().get_group_options("study")
        _stop(f"no study is named; type +study=NAME, NAME one of {', '.join(names)}")
    try:
        complete = run_study(cfg, _swept())
    except InstantiationException as error:
        _stop(_message(error.__cause__ or error))
    except (ValueError, OSError) as error:
        _stop(_message(error))
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        sys.exit(130)
    if not complete:
        raise TrialsFailed(1)


def run_study(cfg, subfolder=""):
    """Run what is not stored yet of a study, and write its table, pictures and provenance; or print what that would be.

    Parameters
    ----------
    cfg : the composed configuration
    subfolder : str, of results_dir/study/dataset, where to write

    Returns
    -------
    bool, whether every trial gave a figure
    """
    from rich.console import Console

    from studies.planning.plan import plan
    from studies.planning.trial import columns_of
    from studies.reporting import progress, show
    from studies.storage import RowStore, StoredRows

    if cfg.on_error not in ON_ERROR:
        raise ValueError(f"on_error is {cfg.on_error!r}: give one of {', '.join(ON_ERROR)}")
    console = Console()
    engine = hydra.utils.instantiate(cfg.engine)
    if not cfg.dry_run:
        engine.warm_up()
    experiment = hydra.utils.instantiate(cfg.experiment)
    trials = plan(cfg)
    folder = Path(str(cfg.results_dir)) / trials[0].study / trials[0].dataset / subfolder
    console.print(f"{cfg.title} on {trials[0].dataset}: {len(trials):,} trials", highlight=False)
    if cfg.dry_run:
        stored = None if cfg.fresh else StoredRows(folder)
        missing = _missing(trials, stored, cfg.retry_failed)
        progress.show_plan(trials, missing, stored, _elsewhere(cfg, folder, missing), engine, console)
        return True
    with RowStore(folder, cfg.fresh) as store:
        if store.moved_to:
            console.print(f"  moved aside: {store.moved_to}", highlight=False, soft_wrap=True)
        if store.damaged:
            console.print(f"  {store.path}: {store.damaged} damaged rows left out; their trials run again")
        missing = _missing(trials, store, cfg.retry_failed)
        if len(missing) < len(trials):
            console.print(f"  {len(trials) - len(missing):,} of them stored already", highlight=False)
        _take_over(_elsewhere(cfg, folder, missing), missing, store, console)
        # Now and not at the end, so that a study that is killed can be shown.
        show.write_origin(cfg, folder, trials)
        store.write_plan(trial.trial_id for trial in trials)
        end = _run_missing(engine, _missing(trials, store, cfg.retry_failed), store, console, cfg.on_error == "stop")
        rows = store.frame([trial.trial_id for trial in trials], columns_of(experiment))
        if not rows.empty:
            show.write(experiment, cfg, folder, rows, console)
            if not end:
                show.draw(experiment, cfg, folder, trials, rows, engine, console)
            console.print(f"written to {folder}", highlight=False, soft_wrap=True)
    failures = int((rows["status"] != "ok").sum())
    if failures:
        console.print(
            f"[red]{failures} of {len(rows)} trials failed[/red]; the column error of trials.parquet says why:"
        )
        for error, count in rows["error"].value_counts().head(5).items():
            console.print(f"  {count} × {error}", markup=False, highlight=False, soft_wrap=True)
    if end:
        console.print(f"{end}; what was done is stored, and the same command goes on from there")
    if end == INTERRUPTED:
        sys.exit(130)
    return failures == 0 and len(rows) == len(trials)


def _missing(trials, stored, retry_failed):
    """The trials that are to be run, of which ``stored`` (StoredRows, or None) has no row, or none that will do."""
    status = stored.status if stored else {}
    return [t for t in trials if t.trial_id not in status or (retry_failed and status[t.trial_id] != "ok")]


def _elsewhere(cfg, folder, missing):
    """Where rows of missing trials stand already; nowhere for who wants to start over."""
    from studies.storage import find_reusable

    return {} if cfg.fresh else find_reusable(str(cfg.results_dir), folder, [trial.trial_id for trial in missing])


def _take_over(found, missing, store, console):
    """Store the rows of missing trials that other studies had run, as this study's."""
    from studies.planning.trial import planned_row
    from studies.storage import read_reusable

    by_id = {trial.trial_id: trial for trial in missing} if found else {}
    for path, trial_ids in found.items():
        store.add_all(
            row | {key: value for key, value in planned_row(by_id[row["trial_id"]]).items() if value is not None}
            for row in read_reusable(path, trial_ids)
        )
        console.print(f"  {len(trial_ids):,} of them taken over from {path}", highlight=False, soft_wrap=True)


def _run_missing(engine, missing, store, console, stop):
    """Run trials and store their rows; why it ended before all were run, if it did.

    stop : bool, whether to end at the first trial that fails
    """
    from studies.execution import run_trials
    from studies.reporting.progress import Progress

    if not missing:
        return ""
    try:
        with Progress(len(missing), engine, console) as progress, closing(run_trials(engine, missing)) as rows:
            for row in rows:
                store.add(row)
                progress.count(row["status"])
                if stop and row["status"] != "ok":
                    return "stopped at a trial that failed (on_error=stop)"
    except KeyboardInterrupt:
        return INTERRUPTED
    return ""


def _of_swept_studies(arguments):
    """The arguments, with ``++levels=…`` for ``levels=…`` in a sweep of studies that all have such an option.

    Hydra checks the options of a sweep against the configuration without what is swept: without any study.
    """
    names = next((a.partition("=")[2].split(",") for a in arguments if a.startswith("+study=")), [])
    if not {"-m", "--multirun"} & set(arguments) or len(names) < 2:
        return arguments
    with initialize_config_module("conf", version_base="1.3"), suppress(HydraException):
        bare, *full = (compose("config", [f"+study={name}"] if name else []) for name in ("", *names))

        def theirs(argument):
            key = argument.partition("=")[0]
            return (
                "=" in argument
                and argument[0] not in "-+~"
                and OmegaConf.select(bare, key) is None
                and all(OmegaConf.select(cfg, key) is not None for cfg in full)
                and not any(isinstance(OmegaConf.select(cfg, key), DictConfig) for cfg in full)  # a choice of a group
            )

        return [f"++{argument}" if theirs(argument) else argument for argument in arguments]
    return arguments


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
                if not str(name).startswith("_")
                if not (name and OmegaConf.is_interpolation(node, name))  # it is an option elsewhere
            ]


def _message(error):
    return " ".join(str(error).split()) or type(error).__name__


def _stop(message):
    print(f"studies.run: error: {message}", file=sys.stderr)
    sys.exit(2)


if __name__ == "__main__":
    main()
