"""Options that a study does not use are mistakes: one that is silently ignored looks as if it had an effect."""

from __future__ import annotations

import copy
import functools
import inspect
import json
import re
from collections.abc import Iterable, Sequence
from typing import Any

from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, OmegaConf

from studies.planning.command_line import hint_for
from studies.planning.errors import StudyError
from studies.planning.targets import REQUIRED, locate

# What a study without repeats, a gallery, or a viewer, does anyway.
WITHOUT_EFFECT = {"repeats": 1, "gallery.models": 0, "page.models": 0}

# Options of conf/config.yaml that are there for the experiment, whether it uses them or not.
FOR_EXPERIMENT = ("repeats", "swept", "gallery", "page", "paired_with")

# Options of groups that no class checks.
OPTIONS_OF_GROUP = {
    "study": ("name",),
    "trial": ("timeout", "memory"),
    "gallery": ("models", "columns", "style"),
    "page": ("models", "columns", "worst"),
}

_REFERENCE = re.compile(r"\$\{(?:oc\.select:)?([A-Za-z_][\w.]*)")


def pass_to_experiment(cfg: DictConfig, overrides: Sequence[str], others: Iterable[str]) -> DictConfig:
    """The configuration with options of the study passed to its experiment, which must take every one of them.

    The shipped configurations of experiments refer to the options of the study that they use, as in
    ``repeats: ${repeats}``. An experiment of the user's own is passed the option if its class has one of that name.

    Parameters
    ----------
    cfg : DictConfig
    overrides : sequence of str
        with which it was composed
    others : iterable of str
        options, and groups of options, that are not the experiment's

    Raises
    ------
    StudyError
        If an option has been given that the experiment does not take.
    """
    name = OmegaConf.to_container(cfg.experiment).get("_target_")  # type: ignore[union-attr]
    if name in (None, REQUIRED):
        return cfg  # which is a mistake that the construction of the experiment reports
    accepted = _parameters(locate("experiment", name, StudyError))
    cfg = copy.deepcopy(cfg)
    OmegaConf.set_struct(cfg, False)
    references = _references(cfg)
    for option in _given(cfg, overrides, {*others, "hydra"}):
        group = option.partition(".")[0]
        if _is_used(option, references):
            continue
        if group in accepted and group not in cfg.experiment:
            cfg.experiment[group] = f"${{{group}}}"
            references = _references(cfg)
        elif option not in WITHOUT_EFFECT or OmegaConf.select(cfg, option) != WITHOUT_EFFECT[option]:
            end = f"{_options(cfg, accepted)}{_suggestion(option, cfg)}"
            raise StudyError(f"{option} is not an option of the study {cfg.study.name}{end}")
    return cfg


def check_groups_of_options(cfg: DictConfig, overrides: Sequence[str]) -> None:
    """Refuse options that do not exist of groups whose options are known, such as ``+trial.timeot=5``.

    Raises
    ------
    StudyError
        If there is one.
    """
    for override in map(_parsed, overrides):
        group, _, option = override.key_or_group.partition(".")
        known = OPTIONS_OF_GROUP.get(group)
        if known and option and option.partition(".")[0] not in known:
            options = ", ".join(f"{group}.{name}" for name in known)
            raise StudyError(f"{override.key_or_group} is not an option; there is {options}")


def replaced_by_levels(cfg: DictConfig, overrides: Sequence[str]) -> list[str]:
    """A line for each typed option of a perturbation that has no effect, since the levels of the study replace it."""
    lines = []
    for override in map(_parsed, overrides):
        before, _, field = override.key_or_group.rpartition(".")
        if before == "perturbation" or (before.startswith("parts.") and before.endswith(".perturbation")):
            swept = OmegaConf.select(cfg, f"{before.removesuffix('perturbation')}swept") or cfg.get("swept")
            if field == swept:
                lines.append(f"  {override.key_or_group} has no effect: the levels of the study replace it")
    return lines


@functools.lru_cache(maxsize=256)
def _parsed(override: str) -> Override:
    """An option as it was typed, parsed once for all checks and for all studies of a sweep."""
    return OverridesParser.create().parse_override(override)


def _suggestion(option: str, cfg: DictConfig) -> str:
    """What may have been meant, or which study has the option, as the end of a message."""
    hint = hint_for(option, sorted({*_references(cfg), *map(str, cfg)} - {option}))
    return f"; {hint.removeprefix(': ').removeprefix(' ').replace('is an option', 'it is one')}" if hint else ""


def _given(cfg: DictConfig, overrides: Sequence[str], others: set[str]) -> list[str]:
    """Options for the experiment: those of the command line, and those that only a file of the study has."""
    typed = [override.key_or_group for override in map(_parsed, overrides)]
    in_files = [str(key) for key in cfg if key not in FOR_EXPERIMENT]
    return [option for option in dict.fromkeys([*typed, *in_files]) if option.partition(".")[0] not in others]


def _references(cfg: DictConfig) -> set[str]:
    """The options that the experiment's refer to, and those that these refer to, but for mere defaults of the page."""
    container: dict[str, Any] = OmegaConf.to_container(cfg, resolve=False)  # type: ignore[assignment]
    found: set[str] = set()
    groups = ["experiment"]
    for group in groups:
        if group == "page":  # which shows as much as the gallery, unless told otherwise, even where there is none
            continue
        for option in _REFERENCE.findall(json.dumps(container.get(group), default=str)):
            found.add(option)
            if option.partition(".")[0] not in groups:
                groups.append(option.partition(".")[0])
    return found


def _is_used(option: str, references: set[str]) -> bool:
    """Whether an option, or one that it contains or is part of, is referred to."""
    return any(f"{option}.".startswith(f"{used}.") or f"{used}.".startswith(f"{option}.") for used in references)


def _parameters(target: Any) -> list[str]:
    """The options of a class."""
    try:
        parameters = inspect.signature(target).parameters.values()
    except (TypeError, ValueError):
        return []
    kinds = (inspect.Parameter.POSITIONAL_OR_KEYWORD, inspect.Parameter.KEYWORD_ONLY)
    return [parameter.name for parameter in parameters if parameter.kind in kinds]


def _options(cfg: DictConfig, accepted: Sequence[str]) -> str:
    """What can be typed instead, as the end of a message."""
    used = sorted({reference.partition(".")[0] for reference in _references(cfg)} & {*map(str, cfg)} - {"study"})
    used += [f"experiment.{name}" for name in accepted if name not in cfg.experiment]
    return f", whose options are {', '.join(used)}" if used else ", which has none but those that every study has"
