"""Objects that an option ``_target_`` names: a class or function in an installed package or in the current folder."""

from __future__ import annotations

import os
import pkgutil
import sys
from collections.abc import Callable, Mapping
from functools import partial
from importlib import import_module
from typing import Any

from studies.execution.interruption import is_ctrl_c, keep_ctrl_c, reason
from studies.planning.types import wrong_types

REQUIRED = "???"  # the value of an option that has no default

# Keys that are not options. Hydra's ``_convert_`` has no effect: lists and mappings are plain Python objects anyway.
_INSTRUCTIONS = ("_target_", "_convert_", "_recursive_")


def check_required(
    group: str, options: Mapping[str, Any], examples: Mapping[str, str], error: type[ValueError]
) -> None:
    """Check that every option without default has been given a value.

    Parameters
    ----------
    group : str
        name of the options' group, such as "segmenter"
    options : mapping
        the options of the group; `REQUIRED` is the value of those that are missing
    examples : mapping of str to str
        an example of a value, by the name of the option
    error : type of ValueError
        raised if an option is missing

    Examples
    --------
    >>> check_required("segmenter", {"command": "???"}, {"command": "mytool {mesh} {labels}"}, ValueError)
    Traceback (most recent call last):
    ValueError: segmenter.command is required: segmenter.command='mytool {mesh} {labels}'
    """
    for key, value in options.items():
        if isinstance(value, str) and value == REQUIRED:
            example = examples.get(key, "…")
            quoted = f"'{example}'" if " " in example else example
            raise error(f"{group}.{key} is required: {group}.{key}={quoted}")


def locate(group: str, name: Any, error: type[ValueError]) -> Callable[..., Any]:
    """The class or function with a dotted name. Modules are looked for in the current folder last.

    Parameters
    ----------
    group : str
        name of the options' group, for messages
    name : str
        dotted name, such as "my_package.my_method"
    error : type of ValueError
        raised if there is no such name, or it cannot be called

    Returns
    -------
    callable

    Notes
    -----
    Adds the current folder to ``sys.path``, which worker processes inherit: they unpickle instances of what is
    defined there.

    Examples
    --------
    >>> locate("segmenter", "collections.Counter", ValueError)
    <class 'collections.Counter'>
    """
    if not isinstance(name, str):
        raise error(f"{group}._target_ is {name!r}: it must be a dotted name, such as my_package.{group.capitalize()}")
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        with keep_ctrl_c():
            _import_module_of(name)  # what importing it raises says more than that there is no such attribute
            target = pkgutil.resolve_name(name)
    except BaseException as raised:  # whatever importing the user's module raises
        if is_ctrl_c(raised):
            raise
        raise error(f"{group}._target_={name}: {reason(raised)}") from raised
    if not callable(target):
        raise error(f"{group}._target_={name} is a {type(target).__name__} and cannot be called")
    return target


def _import_module_of(name: str) -> None:
    """Import the module in which a dotted name is defined, if there is one; a class may be inside another."""
    module = name.rpartition(".")[0]
    if module:
        try:
            import_module(module)
        except ModuleNotFoundError as error:
            if not (error.name and module.startswith(error.name)):
                raise  # an import inside the module


def construct(group: str, options: Mapping[str, Any], error: type[ValueError]) -> Any:
    """An instance of the class that ``_target_`` names; of a function, the function with its options bound.

    Parameters
    ----------
    group : str
        name of the options' group, for messages
    options : mapping
        ``_target_``, and keyword arguments of the class or function. A value that is itself a mapping with
        ``_target_`` becomes an instance of what it names, unless ``_recursive_`` is false.
    error : type of ValueError
        raised if there is no such target or it refuses the options. A ValueError of the target keeps its message,
        which names the option.

    Returns
    -------
    object

    Examples
    --------
    >>> construct("dataset", {"_target_": "fractions.Fraction", "numerator": 3}, ValueError)
    Fraction(3, 1)
    """
    name = options.get("_target_")
    target = locate(group, name, error)
    keywords = {key: value for key, value in options.items() if key not in _INSTRUCTIONS}
    if options.get("_recursive_", True):
        keywords = {key: _instantiated(group, value, error) for key, value in keywords.items()}
    if not isinstance(target, type):
        return partial(target, **keywords)
    wrong = [
        f"{option_name(group, key)} is {keywords[key]!r}: it must be {expected}"
        for key, expected in wrong_types(target, keywords).items()
    ]
    try:
        constructed = target(**keywords)
    except ValueError as refused:  # says more than that a type is wrong
        raise error(" ".join(str(refused).split())) from refused
    except BaseException as raised:  # whatever the user's class raises
        if is_ctrl_c(raised):
            raise
        raise error(wrong[0] if wrong else f"{group}._target_={name}: {reason(raised)}") from raised
    if wrong:
        raise error(wrong[0])
    return constructed


def option_name(group: str, key: str) -> str:
    """How an option is typed. Those of an experiment are, in the shipped studies, options of the study itself.

    Examples
    --------
    >>> option_name("segmenter", "time"), option_name("experiment", "levels"), option_name("engine", "timeout")
    ('segmenter.time', 'levels', 'trial.timeout')
    """
    if group == "experiment":
        return key
    return f"trial.{key}" if group == "engine" and key in ("timeout", "memory") else f"{group}.{key}"


def _instantiated(group: str, value: Any, error: type[ValueError]) -> Any:
    """A value in which every mapping with ``_target_`` is replaced by what it constructs."""
    if isinstance(value, Mapping):
        if "_target_" in value:
            return construct(group, value, error)
        return {key: _instantiated(group, each, error) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [_instantiated(group, each, error) for each in value]
    return value
