"""Compose the shipped configurations as the command line does, and run what they plan."""

import pandas as pd
import pytest
from hydra import compose, initialize_config_module

from studies.engine import Serial
from studies.schedule import Schedule, execute
from studies.trial import COLUMNS


@pytest.fixture
def composed():
    """A function: overrides -> the composed configuration."""

    def compose_with(*overrides):
        with initialize_config_module("conf", version_base="1.3"):
            return compose("config", list(overrides))

    return compose_with


@pytest.fixture
def run_trials():
    """A function: planned trials, an experiment's own columns -> the DataFrame of their rows, run in this process."""

    def run(planned, further=None):
        schedule = Schedule(planned)
        rows = [row for task, outcome in Serial().run(execute, schedule) for row in schedule.rows(task, outcome)]
        columns = COLUMNS | (further or {})
        return pd.DataFrame(rows, columns=list(columns)).astype(columns)

    return run
