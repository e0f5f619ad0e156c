"""What the command line of `studies.run` needs in addition to Hydra's own."""

from __future__ import annotations

import difflib
import glob
import itertools
import os
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from hydra import compose, initialize_config_dir
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Glob, QuotedString
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf

from studies._own_packages import CONF
from studies.planning.errors import StudyError
from studies.planning.names import folder_name
from studies.storage.text import parse_yaml

# Swept options that already have a folder of their own in results_dir.
OWN_FOLDER = ("study", "dataset")

# Options whose values are taken as they are typed, whatever characters they have.
TEXT_OPTIONS = ("segmenter.command", "dataset.glob", "dataset.root", "results_dir")
SWEPT_PATHS = ("dataset.glob", "dataset.root")  # those of which a sweep may have several, separated by commas

CUSTOM = "custom"  # the study that is one only with a name and an experiment, so not one of those that glob(*) matches

# Options that choose a configuration by name.
CHOICES = ("study", "experiment", "dataset", "segmenter", "engine", "perturbation")

OPTIONS_OF_PART = ("perturbation", "levels", "title", "axis", "swept")  # of a study with several parts

# Flags of Hydra that are followed by a value.
FLAGS_WITH_VALUE = (
    "--cfg", "-c", "--package", "-p", "--config-path", "-cp", "--config-name", "-cn", "--config-dir", "-cd",
    "--experimental-rerun",
)  # fmt: skip


def quote_argument(argument: str, is_sweep: bool = False) -> str:
    """An argument with its value in quotes, if it is a path or a command that Hydra would not read as it is typed.

    A shell turns ``segmenter.command='mytool {mesh} {labels}'`` into ``segmenter.command=mytool {mesh} {labels}``, in
    which Hydra would parse the braces; and ``dataset.root='My Meshes (2)'`` into what Hydra refuses. Any other
    argument, quoted values, and interpolations such as ``${oc.env:DATA}`` stay as they are.

    Parameters
    ----------
    argument : str
        an element of ``sys.argv``
    is_sweep : bool
        whether commas separate the values of a sweep, unless the whole value is the name of a file or folder

    Examples
    --------
    >>> quote_argument("segmenter.command=mytool {mesh} {labels}")
    "segmenter.command='mytool {mesh} {labels}'"
    >>> quote_argument("dataset.glob=my meshes/[ab]*.off"), quote_argument("dataset.glob=meshes/*.off")
    ("dataset.glob='my meshes/[ab]*.off'", 'dataset.glob=meshes/*.off')
    """
    key, _, value = argument.partition("=")
    option = key.lstrip("+")
    if option not in TEXT_OPTIONS:
        # Hydra refuses letters of most scripts where they are not quoted.
        is_word = not (value.isascii() or re.search(r"""[][{},'"$]""", value))
        return f"{key}={quoted(value)}" if is_word else argument
    if value in ("", "null", "???") or "${" in value:
        return argument
    if re.fullmatch(r"""(['"]).*\1""", value, re.DOTALL):
        return argument
    if is_sweep and option in SWEPT_PATHS and not _is_there(value):
        return f"{key}={','.join(map(quoted, value.split(',')))}"
    return f"{key}={quoted(value)}"


def _is_there(pattern: str) -> bool:
    """Whether a path or pattern is that of a file or folder."""
    expanded = os.path.expanduser(pattern)
    return os.path.exists(expanded) or any(glob.iglob(expanded, recursive=True))


def quoted(value: str) -> str:
    """A value that Hydra reads as it is, in quotes if it has to."""
    if re.fullmatch(r"[A-Za-z0-9_./*?-]*", value):
        with suppress(HydraException):
            if OverridesParser.create().parse_override(f"key={value}").value() == value:
                return value
    # In Hydra's quoted strings a backslash stands for itself, except before a quote, which it escapes.
    escaped = re.sub(r"(\\*)('|$)", lambda found: found[1] * 2 + found[2].replace("'", r"\'"), value)
    return f"'{escaped}'"


def check_groups(arguments: Sequence[str]) -> None:
    """Refuse a choice such as ``dataset=null``, for which Hydra has no words.

    Raises
    ------
    StudyError
        If what is chosen of a group is not a name.
    """
    for argument in arguments:
        key, is_set, value = argument.partition("=")
        if is_set and key.lstrip("+") in CHOICES and not all(map(_is_name, value.split(","))):
            raise StudyError(f"{argument}: it must be the name of a {key.lstrip('+')}; see --help")


@cache
def _is_name(value: str) -> bool:
    """Whether Hydra reads a value as text."""
    try:
        return isinstance(OverridesParser.create().parse_override(f"key={value}").value(), str | QuotedString)
    except HydraException:
        return True  # Hydra tells what is wrong with it


def flags_last(arguments: Sequence[str]) -> list[str]:
    """The arguments with all flags after the options, wherever they were: Hydra wants the options in one piece.

    Examples
    --------
    >>> flags_last(["+study=holes", "-m", "segmenter.time=1,2", "--cfg", "job"])
    ['+study=holes', 'segmenter.time=1,2', '-m', '--cfg', 'job']
    """
    options: list[str] = []
    flags: list[str] = []
    left = list(arguments)
    while left:
        argument = left.pop(0)
        if not argument.startswith("-"):
            options.append(argument)
            continue
        flags.append(argument)
        if (argument in FLAGS_WITH_VALUE and left) or (argument in ("--info", "-i") and left and left[0].isalpha()):
            flags.append(left.pop(0))
    return [*options, *flags]


def names_of(group: str) -> str:
    """The names in a folder of conf, for ``--help``."""
    return ", ".join(GlobalHydra.instance().config_loader().get_group_options(group))


OmegaConf.register_new_resolver("names_of", names_of, replace=True)


def list_globbed_studies(arguments: Sequence[str]) -> list[str]:
    """The arguments, with the studies that ``+study=glob(…)`` matches by name: all but `custom`, which is no study yet.

    Parameters
    ----------
    arguments : sequence of str
        of a sweep

    Examples
    --------
    >>> list_globbed_studies(["+study=glob(figure*,exclude=figure9)", "repeats=1"])
    ['+study=figure10,figure12', 'repeats=1']
    """
    listed = []
    for argument in arguments:
        if argument.startswith("+study=") and "glob(" in argument:
            with suppress(HydraException), initialize_config_dir(str(CONF), version_base="1.3"):
                names = set(GlobalHydra.instance().config_loader().get_group_options("study")) - {CUSTOM}
                own = _own_folder(arguments)
                names |= {path.stem for path in (own / "study").glob("*.yaml")} if own else set()
                pattern = OverridesParser.create().parse_override(argument).value()
                if isinstance(pattern, Glob):
                    argument = f"+study={','.join(pattern.filter(sorted(names)))}"
        listed.append(argument)
    return listed


def _own_folder(arguments: Sequence[str]) -> Path | None:
    """The folder that ``--config-dir`` of a command names."""
    flags = dict(itertools.pairwise(arguments))
    return next((Path(flags[flag]).absolute() for flag in ("--config-dir", "-cd") if flag in flags), None)


def _search_path(arguments: Sequence[str]) -> list[str]:
    """The override with which a configuration is composed from that folder too."""
    folder = _own_folder(arguments)
    return [] if folder is None else [f"hydra.searchpath=[{quoted(f'file://{folder}')}]"]


def add_missing_options(arguments: Sequence[str]) -> list[str]:
    """The arguments, with ``++levels=…`` for ``levels=…`` in a sweep over studies that all have such an option.

    Hydra checks the options of a sweep against the configuration without what is swept: without any study.
    """
    names = next((a.partition("=")[2].split(",") for a in arguments if a.startswith("+study=")), [])
    if not {"-m", "--multirun"} & set(arguments) or len(names) < 2:
        return list(arguments)
    own = _search_path(arguments)
    with initialize_config_dir(str(CONF), version_base="1.3"), suppress(HydraException):
        bare = compose("config")
        full = [compose("config", [f"+study={name}", *own]) for name in names]
        return [f"++{a}" if _is_option_of_studies_alone(a, bare, full) else a for a in arguments]
    return list(arguments)


def _is_option_of_studies_alone(argument: str, bare: DictConfig, full: Sequence[DictConfig]) -> bool:
    """Whether an argument overrides an option that all studies have and the bare configuration has not."""
    key = argument.partition("=")[0]
    if "=" not in argument or argument[0] in "-+~" or OmegaConf.select(bare, key) is not None:
        return False
    values = [OmegaConf.select(cfg, key) for cfg in full]
    return all(value is not None and not isinstance(value, DictConfig) for value in values)  # a DictConfig: a group


def swept_options(arguments: Sequence[str], job: Sequence[str]) -> dict[str, str]:
    """The options that a sweep varies, but for those that have a folder of their own, with their values in one job.

    Parameters
    ----------
    arguments : sequence of str
        all arguments of the command
    job : sequence of str
        the overrides of this job
    """
    parser = OverridesParser.create()
    given = parser.parse_overrides([a for a in arguments if "=" in a and a[0] != "-"])
    swept = {o.key_or_group for o in given if o.is_sweep_override()} - set(OWN_FOLDER)
    here = parser.parse_overrides(list(job))
    return {o.key_or_group: o.get_value_element_as_str() for o in here if o.key_or_group in swept}


def swept_folder(swept: Mapping[str, str]) -> str:
    """The folder of one job of a sweep.

    See `studies.planning.names.folder_name` for long values and those with characters that no folder may have.

    Examples
    --------
    >>> swept_folder({"segmenter.time": "0.5", "repeats": "2"})
    'segmenter.time=0.5,repeats=2'
    """
    return folder_name(",".join(f"{key}={value}" for key, value in swept.items()))


def hints(arguments: Sequence[str]) -> list[str]:
    """A line for each typed option that the study does not have: what may be meant, or where there is such an option.

    Parameters
    ----------
    arguments : sequence of str
        all arguments of the command
    """
    names = option_names(arguments)
    typed = [a.partition("=")[0] for a in arguments if "=" in a and a[0] not in "-+~"]
    unknown = [name for name in typed if name not in names and name not in CHOICES and not name.startswith("hydra")]
    return [f"{name}{hint}" for name in unknown if (hint := hint_for(name, names))]


def hint_for(name: str, names: Sequence[str]) -> str:
    """What may be meant by an option that is not among ``names``, as the end of a sentence; "" if nothing is near."""
    where = where_is(name)
    if where:
        here = name.split(".", 2)[2] if name.startswith("parts.") and name.count(".") > 1 else ""
        return f" is an option of {where}{f'; here it is {here}' if here in names else ''}"
    close = difflib.get_close_matches(name, names, n=1, cutoff=0.75)
    return f": did you mean {close[0]}?" if close else ""


def where_is(name: str) -> str:
    """The shipped studies, datasets and so on that have an option, "" if none has.

    Examples
    --------
    >>> where_is("parts.holes.perturbation.unit"), where_is("dataset.categories"), where_is("repeat")
    ('the studies leaderboard, table2', 'dataset=psb, dataset=tosca', '')
    """
    group, _, option = name.partition(".")
    if group in CHOICES and group != "study":
        found = [file for file, content in _shipped(group) if option in content]
        return ", ".join(f"{group}={file}" for file in found)
    if group in parse_yaml(CONF.joinpath("config.yaml").read_text("utf-8")):
        return ""  # every study has it
    part, _, below = option.partition(".")
    if group == "parts" and below.partition(".")[0] not in OPTIONS_OF_PART:
        return ""
    found = [file for file, content in _shipped("study") if _has_option(content, group, part)]
    return f"the {'study' if len(found) == 1 else 'studies'} {', '.join(found)}" if found else ""


def _has_option(study: Mapping[str, Any], group: str, part: str) -> bool:
    """Whether the file of a study has an option, or a part of this name."""
    if group == "parts" and part:
        packages = [str(key).partition("@")[2] for entry in study.get("defaults", ()) for key in entry
                    if isinstance(entry, dict)]  # fmt: skip
        return part in (study.get("parts") or {}) or any(name.startswith(f"parts.{part}") for name in packages)
    return group in study and group not in ("defaults", "study", "title")


def _shipped(group: str) -> list[tuple[str, Mapping[str, Any]]]:
    """The name and the content of every file of a group of the shipped configuration."""
    folder = CONF.joinpath(group)
    files = sorted(file.name for file in folder.iterdir() if file.name.endswith(".yaml"))
    return [(name[:-5], parse_yaml(folder.joinpath(name).read_text("utf-8")) or {}) for name in files]


def _is_option_elsewhere(node: DictConfig, name: str) -> bool:
    """Whether the value of an option is that of another option of the study, as ``engine.timeout``."""
    text = str(OmegaConf.to_container(node, resolve=False)[name])  # type: ignore[index,call-overload]
    return text.startswith("${") and not text.startswith(("${oc.env:", "${oc.select:"))


def option_names(arguments: Sequence[str]) -> list[str]:
    """Names of the options of the study, dataset … that the command line chooses; of the defaults if it is wrong."""
    chosen = [a for a in arguments if a.partition("=")[0] in ("+study", "dataset", "segmenter", "engine", "experiment")]
    for overrides in ([*chosen, *_search_path(arguments)], []):
        with initialize_config_dir(str(CONF), version_base="1.3"), suppress(HydraException):
            cfg = compose("config", overrides)
            return [
                f"{key}.{name}" if name else key
                for key, node in ((str(key), node) for key, node in cfg.items_ex(resolve=False))
                if key not in ("study", "experiment")
                for name in (map(str, node) if isinstance(node, DictConfig) else [""])
                if not name.startswith("_")
                if not (name and _is_option_elsewhere(node, name))
            ]
    return []
