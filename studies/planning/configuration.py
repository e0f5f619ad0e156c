"""From a composed configuration to a study made of plain objects: the only module that reads OmegaConf."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

from hydra import compose
from hydra.core.global_hydra import GlobalHydra
from hydra.core.hydra_config import HydraConfig
from omegaconf import DictConfig, ListConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from studies._own_packages import CONF
from studies.datasets import make_dataset
from studies.datasets.dataset import listed_names
from studies.planning.command_line import CHOICES, swept_folder
from studies.planning.errors import StudyError
from studies.planning.fingerprint import with_version
from studies.planning.names import check_name
from studies.planning.options import check_groups_of_options, pass_to_experiment, replaced_by_levels
from studies.planning.plan import ListedBlock, Plan
from studies.planning.targets import REQUIRED, check_required, construct
from studies.planning.types import expectation, has_type
from studies.reporting.text import count_of
from studies.storage.folders import UNPUBLISHED, is_published
from studies.storage.text import encodable

if TYPE_CHECKING:
    from studies.datasets import Dataset
    from studies.execution import Engine
    from studies.experiments import Experiment
    from studies.planning.trial import Trial
    from studies.reporting.publication import Publication
    from studies.segmenters import Segmenter

ALL = "all"  # of the methods in conf/segmenter
LISTS = "methods"  # group of named lists of methods

ON_ERROR = ("continue", "stop")

# Options that are groups of options.
GROUPS = ("study", "experiment", "dataset", "segmenter", "engine", "trial", "gallery", "page")

_OTHER_GROUPS = tuple(group for group in GROUPS if group not in ("gallery", "page"))  # which are not the experiment's

_OF_METHODS = ("segmenters", "reference_segmenter")

_FOR_DATASET = ("categories",)  # what a study suggests for datasets that have such an option

# Options that belong to no class, with their types.
GENERAL_OPTIONS: dict[str, Any] = {
    "results_dir": str,
    "title": str,
    "publication": str | None,
    "on_error": str,
    "retry_failed": bool,
    "fresh": bool,
    "dry_run": bool,
}


@dataclass(frozen=True, kw_only=True)
class Study:
    """A study that can be planned and run.

    Parameters
    ----------
    name, title : str
    experiment : Experiment
    dataset : Dataset
    segmenters : tuple of Segmenter
        at least one, with different names
    engine : Engine
    results_dir : Path
        where results of all studies are
    folder : Path
        where the results of this study go, unless that folder belongs to others: see `studies.storage.placement`
    sources : tuple of Path
        where rows are looked for that need not be computed again
    remarks : tuple of str
        lines that are printed when the study starts
    on_error : {"continue", "stop"}
    retry_failed, fresh, dry_run : bool
        see conf/config.yaml
    publication : Publication or None
        whose values are shown next to the computed ones
    record : dict
        the configuration as it is stored with the results
    command : str
        the command that makes the results again
    swept : dict
        the options that a sweep varies, with their values in this job of it
    named_models : dict
        option -> the names of models that were typed for it, which must be in the study
    """

    name: str
    title: str
    experiment: Experiment
    dataset: Dataset
    segmenters: tuple[Segmenter, ...]
    engine: Engine
    results_dir: Path
    folder: Path
    sources: tuple[Path, ...] = ()
    remarks: tuple[str, ...] = ()
    on_error: str = "continue"
    retry_failed: bool = False
    fresh: bool = False
    dry_run: bool = False
    publication: Publication | None = None
    record: Mapping[str, Any]
    command: str = ""
    swept: Mapping[str, str] = field(default_factory=dict)
    named_models: Mapping[str, Sequence[str]] = field(default_factory=dict)

    def plan(self) -> list[Trial]:
        """The trials of the study, model by model; those of an experiment of the user's own depend on its code.

        Raises
        ------
        StudyError
            if there are none, or if an option names a model that is not in the study
        """
        return list(self.plan_blocks())

    def plan_blocks(self) -> Plan:
        """As `plan`, but the trials are made when they are asked for.

        Raises
        ------
        StudyError
            as for `plan`
        """
        experiment = self.experiment
        plan = Plan(experiment.blocks(self.name, self.dataset, self.segmenters))
        if not plan:
            raise StudyError(f"{self.name}: there is nothing to run: {self._why_no_trials()}")
        known = dict.fromkeys(name for trial in plan.examples() for name in trial.model_names())
        for option, names in self.named_models.items():
            for name in names:
                if name not in known:
                    raise StudyError(
                        f"{option} contains {name!r}, which is not in the study: {listed_names(list(known))}"
                    )
        first = plan[0]
        if with_version(first, experiment) is first:
            return plan
        return Plan([ListedBlock([with_version(trial, experiment) for trial in plan])])

    def _why_no_trials(self) -> str:
        n_models = len(self.dataset.models())
        if not n_models:
            return f"the dataset {self.dataset.name} has no models"
        return (
            f"the experiment {type(self.experiment).__name__} plans no trials for the "
            f"{count_of(n_models, 'model')} of the dataset {self.dataset.name}"
        )


def configure(cfg: DictConfig, overrides: Sequence[str] = (), swept: Mapping[str, str] | None = None) -> Study:
    """The study that a composed configuration defines.

    Parameters
    ----------
    cfg : DictConfig
    overrides : sequence of str
        with which ``cfg`` was composed
    swept : mapping of str to str
        the options that a sweep varies, with their values in this job: they name a folder below that of the dataset

    Raises
    ------
    StudyError
        if the configuration is not a study; other ValueErrors come from the parts that refuse their options
    """
    try:
        return _configure(cfg, overrides, swept or {})
    except OmegaConfBaseException as error:  # such as an option that refers to one that is not there
        raise StudyError(" ".join(str(error).split())) from error


def _configure(cfg: DictConfig, overrides: Sequence[str], swept: Mapping[str, str]) -> Study:
    from studies.reporting.results import publication_of

    _check_general_options(cfg, overrides)
    check_groups_of_options(cfg, overrides)
    if any(_key(option).startswith("gallery.") for option in overrides):
        from studies.experiments.change import checked_gallery

        checked_gallery(_options(cfg, "gallery"))
    if any(_key(option).startswith("page.") for option in overrides):
        from studies.experiments.change import checked_viewer

        checked_viewer(_options(cfg, "page"))
    name = check_name("study.name", cfg.study.name)
    cfg = pass_to_experiment(cfg, overrides, (*_OTHER_GROUPS, *GENERAL_OPTIONS, *_OF_METHODS, *_FOR_DATASET))
    engine = _engine(_options(cfg, "engine"))
    if not cfg.dry_run:
        engine.warm_up()  # worker processes import what they need while this process plans
    dataset = make_dataset(_options(cfg, "dataset"))
    results_dir, sources, remarks = _places(cfg, overrides)
    record = _record(cfg)
    return Study(
        name=name,
        title=encodable(cfg.title),
        experiment=_experiment(_options(cfg, "experiment")),
        dataset=dataset,
        segmenters=_segmenters(cfg, overrides),
        engine=engine,
        results_dir=results_dir,
        folder=results_dir / name / dataset.name / (swept_folder(swept) if swept else ""),
        sources=sources,
        remarks=(*remarks, *replaced_by_levels(cfg, overrides)),
        on_error=cfg.on_error,
        retry_failed=cfg.retry_failed,
        fresh=cfg.fresh,
        dry_run=cfg.dry_run,
        publication=publication_of(record),
        record=record,
        command=encodable(command_of(overrides, _root_of(cfg))),
        swept=dict(swept),
        named_models=_named_models(cfg, overrides),
    )


def _check_general_options(cfg: DictConfig, overrides: Sequence[str]) -> None:
    """Check the options that belong to no class."""
    if "study" not in cfg:
        raise StudyError(f"no study is given; type +study=NAME, NAME one of {', '.join(study_names())}")
    options: dict[str, Any] = OmegaConf.to_container(cfg, resolve=False)  # type: ignore[assignment]
    for group in GROUPS:
        if not isinstance(options.get(group), dict):
            raise StudyError(f"{group} is {cfg.get(group)!r}: it must be a mapping of options; see --help")
    if set(cfg.study) - {"name"} and any(_key(option) == "study" for option in overrides):
        file = next(option.partition("=")[2] for option in overrides if _key(option) == "study")
        raise StudyError(
            f"the first line of {file}.yaml must be `# @package _global_`: without it, everything in the file is taken "
            "for options of `study`"
        )
    if "name" not in cfg.study or OmegaConf.is_missing(cfg.study, "name"):
        raise StudyError("study.name is required: study.name=NAME, under which the results are filed")
    for option, annotation in GENERAL_OPTIONS.items():
        value = OmegaConf.select(cfg, option)
        if not has_type(value, annotation):
            raise StudyError(f"{option} is {value!r}: it must be {expectation(annotation)}")
    if not cfg.results_dir:
        raise StudyError("results_dir is empty: results_dir=PATH, the folder of all results")
    if cfg.on_error not in ON_ERROR:
        raise StudyError(f"on_error is {cfg.on_error!r}: it must be one of {', '.join(ON_ERROR)}")


def study_names() -> list[str]:
    """The studies in conf/study and in further folders of the search path."""
    loader = GlobalHydra.instance().config_loader()
    return loader.get_group_options("study")


def instantiate_experiment(record: Mapping[str, Any]) -> Experiment:
    """The experiment of a stored configuration."""
    return _experiment(_options(OmegaConf.create(dict(record)), "experiment"))


def command_of(overrides: Sequence[str], root: str = "") -> str:
    """The command that makes results again: all that was typed, but for where data and results are on this machine.

    Parameters
    ----------
    overrides : sequence of str
    root : str
        the last name of the path of the dataset, "" if it has none

    Examples
    --------
    >>> command_of(["+study=holes", "dataset=psb", "dataset.root=/data/psb.zip", "levels=[1,2]"], "psb.zip")
    "python -m studies.run +study=holes dataset=psb dataset.root=psb.zip 'levels=[1,2]'"
    """
    typed = [
        option
        for option in overrides
        if _key(option) != "dataset.root"
        and not (_key(option) == "results_dir" and Path(option.partition("=")[2].strip("'\"")).is_absolute())
    ]
    if root:
        position = next((i + 1 for i, option in enumerate(typed) if option.startswith("dataset=")), len(typed))
        typed.insert(position, f"dataset.root={root}")
    return f"python -m studies.run {shlex.join([*typed, *_config_dir()])}"


def check_own_names() -> None:
    """Refuse the name of a file of this project for one in ``--config-dir``, which Hydra would ignore.

    Raises
    ------
    StudyError
        If there is one; the message names the file.
    """
    choices = HydraConfig.get().runtime.choices
    for group in CHOICES:
        for folder in _own_folders():
            file = folder / group / f"{choices.get(group)}.yaml"
            if file.exists() and CONF.joinpath(group, file.name).is_file():
                raise StudyError(f"{file}: this project has a {group} {file.stem!r} of its own; rename the file")


def _own_folders() -> list[Path]:
    """The folders of configurations that ``--config-dir`` names."""
    sources = HydraConfig.get().runtime.config_sources if HydraConfig.initialized() else ()
    return [Path(source.path) for source in sources if source.provider == "command-line"]


def _config_dir() -> list[str]:
    """The flag with the user's own folder of configurations, relative to the current folder if it is inside."""
    folders = _own_folders()
    here = Path.cwd()
    return [
        word
        for folder in folders
        for word in ("--config-dir", str(folder.relative_to(here) if folder.is_relative_to(here) else folder))
    ]


def _root_of(cfg: DictConfig) -> str:
    """The last name of the path of the dataset, "" if it has none."""
    root = OmegaConf.select(cfg, "dataset.root")
    return Path(str(root)).name if root else ""


def _places(cfg: DictConfig, overrides: Sequence[str]) -> tuple[Path, tuple[Path, ...], tuple[str, ...]]:
    """The folder of all results, where rows are looked for, and what to say about it."""
    results_dir = Path(cfg.results_dir).expanduser()
    if "results_dir" in map(_key, overrides) or not is_published(results_dir):
        return results_dir, (results_dir,), ()
    remark = (
        f"  {results_dir} is published and stays as it is: results go to {UNPUBLISHED}; results_dir=PATH changes that"
    )
    return Path(UNPUBLISHED), (Path(UNPUBLISHED), results_dir), (remark,)


def _named_models(cfg: DictConfig, overrides: Sequence[str]) -> dict[str, list[str]]:
    """The models that were typed for pictures. Those that a shipped study names need not be in the dataset."""
    named = {}
    for option in map(_key, overrides):
        if option in ("gallery.models", "page.models") or (
            option.startswith(("plates.", "figure15.")) and option.endswith(".models")
        ):
            models = OmegaConf.select(cfg, option)
            if isinstance(models, ListConfig):
                named[option] = [str(model) for model in models]
    return named


def _key(override: str) -> str:
    """The name of the option that an override sets."""
    return override.partition("=")[0].lstrip("+~")


def _options(cfg: DictConfig, group: str) -> dict[str, Any]:
    """The options of a group as plain Python objects; those without a default may still be missing."""
    return OmegaConf.to_container(cfg[group], resolve=True)  # type: ignore[return-value]


def _experiment(options: Mapping[str, Any]) -> Experiment:
    from studies.experiments.experiment import Experiment

    check_required("experiment", options, {"_target_": "my_package.MyExperiment"}, StudyError)
    experiment = construct("experiment", options, StudyError)
    if not isinstance(experiment, Experiment):
        raise StudyError(
            f"experiment._target_={options['_target_']} is not a subclass of studies.experiments.Experiment"
        )
    return experiment


def _engine(options: Mapping[str, Any]) -> Engine:
    check_required("engine", options, {"_target_": "my_package.MyEngine"}, StudyError)
    return construct("engine", options, StudyError)


def _segmenters(cfg: DictConfig, overrides: Sequence[str]) -> tuple[Segmenter, ...]:
    """The segmenters: those in ``segmenters``, else the one in ``segmenter``."""
    from studies.segmenters import make_segmenter

    single = _options(cfg, "segmenter")
    if cfg.get("segmenters") is None and cfg.get("reference_segmenter") is None:
        return (make_segmenter(single),)
    listed = _listed_segmenters(cfg.get("segmenters"))
    known = _known_segmenters(listed, cfg.get("reference_segmenter"))
    reference = None
    if cfg.get("reference_segmenter") is not None:
        reference = make_segmenter(_options_of("reference_segmenter is", cfg.reference_segmenter, known))
    if cfg.get("segmenters") is None:
        return (make_segmenter(single, reference),)
    names = _names_of_segmenters(listed, known)
    chosen = next((o.partition("=")[2] for o in reversed(overrides) if o.startswith("segmenter=")), "heat_walk")
    if any(o.lstrip("+").startswith("segmenter") and not o.startswith("segmenters") for o in overrides) and (
        chosen not in names
    ):
        raise StudyError(f"segmenter={chosen} has options, and segmenters={names} does not contain {chosen}")
    found = tuple(
        make_segmenter(single if name == chosen else _options_of("segmenters contains", name, known), reference)
        for name in names
    )
    duplicates = {one.name for i, one in enumerate(found) for other in found[:i] if one.name == other.name}
    if duplicates:
        raise StudyError(f"segmenters contains {', '.join(sorted(duplicates))} twice: their names must differ")
    return found


def _known_segmenters(*chosen: Any) -> dict[str, dict[str, Any]]:
    """The options of methods that are chosen, by name or in a list, from those that there are; of all if ALL is."""
    listed = [name for each in chosen for name in (each if isinstance(each, list | ListConfig) else [each])]
    names = [name for name in _names_of_methods() if ALL in listed or name in listed]
    cfg = compose(overrides=[f"+segmenter@{name}={name}" for name in names])
    return {name: _options(cfg, name) for name in names}


def _names_of_methods() -> list[str]:
    """The methods in conf/segmenter, and in further folders of the search path."""
    return GlobalHydra.instance().config_loader().get_group_options("segmenter")


def _listed_segmenters(names: Any) -> Any:
    """``segmenters`` as it was given, but with what is in the lists in conf/methods instead of their names."""
    lists = GlobalHydra.instance().config_loader().get_group_options(LISTS)
    entries = [names] if names in lists else names
    if not isinstance(entries, list | ListConfig) or not any(isinstance(e, str) and e in lists for e in entries):
        return names
    return [
        each
        for entry in entries
        for each in (compose(overrides=[f"+{LISTS}={entry}"]).segmenters if entry in lists else [entry])
    ]


def _names_of_segmenters(names: Any, known: Mapping[str, Mapping[str, Any]]) -> list[Any]:
    """The entries of ``segmenters``; "all" is every known method that needs no further options."""
    if names == ALL:
        names = [ALL]
    if not isinstance(names, list | ListConfig) or not names:
        raise StudyError(
            f"segmenters is {names!r}: it must be a list, as in 'segmenters=[heat_walk,my_package.method]', or one of "
            f"{', '.join([ALL, *GlobalHydra.instance().config_loader().get_group_options(LISTS)])}"
        )
    others = [name for name, options in known.items() if name not in names and REQUIRED not in options.values()]
    return [each for name in names for each in (others if name == ALL else [name])]


def _options_of(where: str, name: Any, known: Mapping[str, dict[str, Any]]) -> dict[str, Any]:
    """The options of a segmenter: a name in conf/segmenter, a dotted name, or options themselves."""
    if isinstance(name, DictConfig):
        return OmegaConf.to_container(name, resolve=True)  # type: ignore[return-value]
    if "." in str(name):
        return {"_target_": str(name)}
    if name not in known:
        raise StudyError(
            f"{where} {name!r}, which is neither one of {', '.join(_names_of_methods())} nor a dotted name such as "
            "my_package.method"
        )
    return known[name]


def _record(cfg: DictConfig) -> dict[str, Any]:
    """The configuration as it is stored: options once each, and not where the data are on this machine."""
    record: dict[str, Any] = OmegaConf.to_container(cfg, resolve=False)  # type: ignore[assignment]
    for group in ("dataset", "engine"):
        record[group] = OmegaConf.to_container(cfg[group], resolve=True)
    root = cfg.dataset.get("root")
    if root:
        # provenance.json identifies the data by their digests.
        record["dataset"]["root"] = Path(str(root)).name
    record["title"] = str(cfg.title)
    return record
