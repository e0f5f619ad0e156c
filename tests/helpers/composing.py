"""Composing many configurations that differ in a few values."""

import copy
import functools

from hydra import compose
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig

_compose_groups = functools.cache(lambda *words: compose("config", list(words)))
_parsed = functools.cache(lambda word: OverridesParser.create().parse_overrides([word])[0])


def composition(words: list[str]) -> DictConfig:
    """What ``compose("config", words)`` gives; files that the same words have chosen before are not read again.

    Hydra reads the files that the choices of groups name, which takes most of the time, and then sets the other options
    in what it has read. The first is done once for all configurations with the same choices, the second by Hydra too.
    """
    overrides = list(map(_parsed, words))
    if any(override.is_sweep_override() or override.is_hydra_override() for override in overrides):
        return compose("config", list(words))
    is_choice = list(map(_is_choice, overrides))
    choices = [word for word, chooses in zip(words, is_choice, strict=True) if chooses]
    cfg = copy.deepcopy(_compose_groups(*choices))
    ConfigLoaderImpl._apply_overrides_to_config(
        [override for override, chooses in zip(overrides, is_choice, strict=True) if not chooses], cfg
    )
    return cfg


def _is_choice(override: Override) -> bool:
    """Whether an override chooses from a group, in which case Hydra reads other files."""
    repository = GlobalHydra.instance().config_loader().repository
    return repository.group_exists(override.key_or_group) and not isinstance(override.value(), dict)
