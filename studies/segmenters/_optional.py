"""Packages that only some methods need."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType


def optional(module: str, method: str, extra: str = "peers") -> ModuleType:
    """A module of an optional dependency.

    Parameters
    ----------
    module : str
        dotted name
    method : str
        name of the method that needs it
    extra : str
        optional dependency of this project that contains it

    Raises
    ------
    ImportError
        If it cannot be imported; the message is one line that says how to install it.

    Examples
    --------
    >>> optional("no_such_package", "my_method")
    Traceback (most recent call last):
    ImportError: segmenter=my_method needs the package no_such_package: pip install 'heatwalk[peers]'
    """
    try:
        return import_module(module)
    except ImportError as error:
        package = module.partition(".")[0]
        raise ImportError(f"segmenter={method} needs the package {package}: pip install 'heatwalk[{extra}]'") from error
