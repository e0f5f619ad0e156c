"""Kinds of study: what is measured on a mesh, and the tables and figures made of it.

Each is imported when it is asked for, and imports what it counts and draws with when it does so: every worker process
imports what its trials are made of, and should not wait for the rest.
"""

from importlib import import_module

_MODULE_OF = {
    "Anatomy": "anatomy",
    "Benchmark": "benchmark",
    "Change": "change",
    "Experiment": "experiment",
    "Poses": "poses",
    "Times": "times",
}

__all__ = list(_MODULE_OF)


def __getattr__(name):
    if name not in _MODULE_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULE_OF[name]}"), name)
