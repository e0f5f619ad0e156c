"""Kinds of study: what is measured on a mesh, and the tables, charts and pictures made of it.

Each is imported when it is asked for, and imports what it draws with when it draws: every worker process imports what
its trials are made of, and should not wait for the rest.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from studies.experiments.anatomy import Anatomy
    from studies.experiments.benchmark import Benchmark
    from studies.experiments.change import Change
    from studies.experiments.experiment import Experiment
    from studies.experiments.leaderboard import Leaderboard
    from studies.experiments.poses import Poses
    from studies.experiments.times import Times

__all__ = ["Anatomy", "Benchmark", "Change", "Experiment", "Leaderboard", "Poses", "Times"]


def __getattr__(name: str) -> Any:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{name.lower()}"), name)
