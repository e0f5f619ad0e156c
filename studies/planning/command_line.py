"""What the command line of `studies.run` needs in addition to Hydra's own."""

from __future__ import annotations

import re
from collections.abc import Sequence
from contextlib import suppress

from hydra import compose, initialize_config_module
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.errors import HydraException
from omegaconf import DictConfig, OmegaConf

# Swept options that already have a folder of their own in results_dir.
OWN_FOLDER = ("study", "dataset")


def quote_command(argument: str) -> str:
    """An argument with its value in quotes, if it is ``segmenter.command=`` with an unquoted value.

    A shell turns ``segmenter.command='mytool {mesh} {labels}'`` into ``segmenter.command=mytool {mesh} {labels}``, in
    which Hydra would parse the braces. Any other argument, and quoted values, stay as they are.

    Parameters
    ----------
    argument : str
        an element of ``sys.argv``

    Examples
    --------
    >>> quote_command("segmenter.command=mytool {mesh} {labels}")
    "segmenter.command='mytool {mesh} {labels}'"
    """
    key, _, command = argument.partition("=")
    if key != "segmenter.command" or re.fullmatch(r"""(['"]).*\1""", command) or command in ("", "???"):
        return argument
    # In Hydra's quoted strings a backslash stands for itself, except before a quote, which it escapes.
    escaped = re.sub(r"(\\*)('|$)", lambda found: found[1] * 2 + found[2].replace("'", r"\'"), command)
    return f"{key}='{escaped}'"


def add_missing_options(arguments: Sequence[str]) -> list[str]:
    """The arguments, with ``++levels=…`` for ``levels=…`` in a sweep over studies that all have such an option.

    Hydra checks the options of a sweep against the configuration without what is swept: without any study.
    """
    names = next((a.partition("=")[2].split(",") for a in arguments if a.startswith("+study=")), [])
    if not {"-m", "--multirun"} & set(arguments) or len(names) < 2:
        return list(arguments)
    with initialize_config_module("conf", version_base="1.3"), suppress(HydraException):
        bare = compose("config")
        full = [compose("config", [f"+study={name}"]) for name in names]
        return [f"++{a}" if _is_option_of_studies_alone(a, bare, full) else a for a in arguments]
    return list(arguments)


def _is_option_of_studies_alone(argument: str, bare: DictConfig, full: Sequence[DictConfig]) -> bool:
    """Whether an argument overrides an option that all studies have and the bare configuration has not."""
    key = argument.partition("=")[0]
    if "=" not in argument or argument[0] in "-+~" or OmegaConf.select(bare, key) is not None:
        return False
    values = [OmegaConf.select(cfg, key) for cfg in full]
    return all(value is not None and not isinstance(value, DictConfig) for value in values)  # a DictConfig: a group


def swept_folder(arguments: Sequence[str], job: Sequence[str]) -> str:
    """The folder of one job of a sweep, named after the options that the sweep varies: ``segmenter.time=0.5``.

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
    return ",".join(f"{o.key_or_group}={o.get_value_element_as_str()}" for o in here if o.key_or_group in swept)


def option_names(arguments: Sequence[str]) -> list[str]:
    """Names of the options of the study, dataset … that the command line chooses; of the defaults if it is wrong."""
    chosen = [a for a in arguments if a.partition("=")[0] in ("+study", "dataset", "segmenter", "engine", "experiment")]
    for overrides in (chosen, []):
        with initialize_config_module("conf", version_base="1.3"), suppress(HydraException):
            cfg = compose("config", overrides)
            return [
                f"{key}.{name}" if name else key
                for key, node in ((str(key), node) for key, node in cfg.items_ex(resolve=False))
                if key not in ("study", "experiment")
                for name in (map(str, node) if isinstance(node, DictConfig) else [""])
                if not name.startswith("_")
                if not (name and OmegaConf.is_interpolation(node, name))  # it is an option elsewhere
            ]
    return []
