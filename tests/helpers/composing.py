"""Composing many configurations that differ in a few values."""

import functools
import pickle
from contextlib import ExitStack, contextmanager, suppress
from unittest.mock import patch

import omegaconf.base
from hydra import compose, initialize_config_dir
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra._internal.config_repository import ConfigRepository
from hydra.core.global_hydra import GlobalHydra
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.override_parser.types import Override
from omegaconf import DictConfig, grammar_parser

from studies._own_packages import CONF

SHIPPED = {"hydra", "main", "schema"}  # providers of configurations that no test changes
HYDRAS_OWN = {
    ConfigRepository: ("load_config", ConfigRepository.load_config),
    ConfigLoaderImpl: ("_compose_config_from_defaults_list", ConfigLoaderImpl._compose_config_from_defaults_list),
}

_compose_groups = functools.cache(lambda *words: pickle.dumps(compose("config", list(words))))
_parse_value = functools.cache(grammar_parser.parse)
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
    cfg = pickle.loads(_compose_groups(*choices))
    ConfigLoaderImpl._apply_overrides_to_config(
        [override for override, chooses in zip(overrides, is_choice, strict=True) if not chooses], cfg
    )
    return cfg


def _is_choice(override: Override) -> bool:
    """Whether an override chooses from a group, in which case Hydra reads other files."""
    repository = GlobalHydra.instance().config_loader().repository
    return repository.group_exists(override.key_or_group) and not isinstance(override.value(), dict)


@contextmanager
def files_read_once():
    """Hydra reads and merges the same files of this project once, in this process and in those forked from it.

    So does OmegaConf with the grammar of equal values, such as ``${repeats}``. Copies are unpickled, which takes a
    quarter of the time that deepcopy takes.
    """
    loaded, merged = {}, {}

    def load_config(self, config_path):
        _, load = HYDRAS_OWN[ConfigRepository]
        found = [source for source in self.sources if source.is_config(config_path)][:1]
        if not found or found[0].provider not in SHIPPED:
            return load(self, config_path)
        key = found[0].path, config_path
        if key not in loaded:
            loaded[key] = pickle.dumps(load(self, config_path))
        return pickle.loads(loaded[key])

    def merge(self, defaults, repo):
        _, compose_from = HYDRAS_OWN[ConfigLoaderImpl]
        sources = repo.get_sources()
        if not {source.provider for source in sources} <= SHIPPED:
            return compose_from(self, defaults, repo)
        key = (*(source.path for source in sources), *((repr(default), default.primary) for default in defaults))
        if key not in merged:
            merged[key] = pickle.dumps(compose_from(self, defaults, repo))
        return pickle.loads(merged[key])

    with (
        patch.object(ConfigRepository, "load_config", load_config),
        patch.object(ConfigLoaderImpl, "_compose_config_from_defaults_list", merge),
        patch.object(omegaconf.base, "parse", _parse_value),
        patch.object(omegaconf._utils, "parse", _parse_value),
    ):
        yield


@contextmanager
def as_hydra_does():
    """Within `files_read_once`, Hydra as it is."""
    with ExitStack() as stack:
        for owner, (name, function) in HYDRAS_OWN.items():
            stack.enter_context(patch.object(owner, name, function))
        yield


@functools.cache
def read_ahead(*words: str) -> None:
    """Read the files that a command with these words chooses, for the processes that are forked from this one."""
    with suppress(Exception), initialize_config_dir(str(CONF), version_base="1.3"):
        compose("config", list(words))
