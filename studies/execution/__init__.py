"""Where trials run: one engine for this process, one for processes of this machine, one for other machines.

Each name is imported when it is first used, so that naming an engine in a configuration costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from studies.execution.dask import Dask as Dask
    from studies.execution.engine import Engine as Engine
    from studies.execution.engine import Session as Session
    from studies.execution.engine import TaskFailedError as TaskFailedError
    from studies.execution.engine import TaskFailure as TaskFailure
    from studies.execution.engine import map_ordered as map_ordered
    from studies.execution.local import Local as Local
    from studies.execution.schedule import Schedule as Schedule
    from studies.execution.schedule import run_trials as run_trials
    from studies.execution.serial import Serial as Serial

_MODULE_OF = {
    "Dask": "dask",
    "Engine": "engine",
    "Local": "local",
    "Schedule": "schedule",
    "Serial": "serial",
    "Session": "engine",
    "TaskFailedError": "engine",
    "TaskFailure": "engine",
    "map_ordered": "engine",
    "run_trials": "schedule",
}

__all__ = list(_MODULE_OF)


def __getattr__(name: str) -> Any:
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
