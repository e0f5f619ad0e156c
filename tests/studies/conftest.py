"""Compose the shipped configurations as the command line does."""

import pytest
from hydra import compose, initialize_config_module


@pytest.fixture
def composed():
    """A function: overrides -> the composed configuration."""

    def compose_with(*overrides):
        with initialize_config_module("conf", version_base="1.3"):
            return compose("config", list(overrides))

    return compose_with
