"""Options whose values are of another type than the class that takes them declares."""

from __future__ import annotations

import inspect
import types
import typing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from functools import cache
from pathlib import Path
from typing import Any

OWN_PACKAGES = (
    "studies",
    "heatwalk",
    "perturb",
)  # their classes, and those derived from them, are checked

_EXPECTED: dict[Any, str] = {
    bool: "true or false",
    int: "a whole number",
    float: "a number",
    str: "text",
    Path: "a path",
    Mapping: "a mapping {name: value}",
    Sequence: "a list [a,b]",
    tuple: "a list [a,b]",
    list: "a list [a,b]",
    dict: "a mapping {name: value}",
    type(None): "null",
}
_PLURALS: dict[Any, str] = {int: "whole numbers", float: "numbers", str: "texts"}


def wrong_types(target: Callable[..., Any], options: Mapping[str, Any]) -> dict[str, str]:
    """The options whose values do not have the type that a class declares for them.

    Parameters
    ----------
    target : callable
        any class or function; only classes of this project are checked, and those derived from one, such as a dataset
        of your own
    options : mapping of str to Any
        plain values: numbers, text, lists and mappings

    Returns
    -------
    dict
        name of the option -> what it must be

    Examples
    --------
    >>> from studies.segmenters import HeatWalk
    >>> wrong_types(HeatWalk, {"time": "soon", "density": "area"})
    {'time': 'a number'}
    """
    if not (isinstance(target, type) and any(_is_own(base) for base in target.__mro__)):
        return {}
    declared = _declared(target)
    return {
        name: expectation(annotation)
        for name, value in options.items()
        if name in declared
        for annotation, default in [declared[name]]
        if not (has_type(value, annotation) or value is default)  # as in ``seed: int = None``
    }


def _is_own(target: type) -> bool:
    """Whether a class is part of this project."""
    return target.__module__.partition(".")[0] in OWN_PACKAGES


def has_type(value: Any, annotation: Any) -> bool:
    """Whether a plain value is what an annotation declares; True for annotations that are not of plain values.

    Examples
    --------
    >>> has_type(1, float), has_type(True, float), has_type([1, "a"], Sequence[int | str]), has_type("a", Sequence[str])
    (True, False, True, False)
    """
    origin, inside = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (typing.Union, types.UnionType):
        return any(has_type(value, each) for each in inside)
    if annotation is None or annotation is type(None):
        return value is None
    kind = origin or annotation
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    if kind is int:
        return isinstance(value, int) and not isinstance(value, bool)
    if kind is Path:
        return isinstance(value, str | Path)
    if kind in (bool, str):
        return isinstance(value, kind)
    if kind in (Mapping, dict):
        return isinstance(value, Mapping) and (not inside or all(has_type(each, inside[1]) for each in value.values()))
    if kind in (Sequence, list, tuple):
        if not isinstance(value, Sequence) or isinstance(value, str):
            return False
        if kind is tuple and inside and inside[-1] is not Ellipsis:
            return len(value) == len(inside) and all(map(has_type, value, inside))
        return not inside or all(has_type(each, inside[0]) for each in value)
    return True


def expectation(annotation: Any) -> str:
    """What a value must be, in words.

    Examples
    --------
    >>> expectation(int | None), expectation(Sequence[float])
    ('a whole number or null', 'a list of numbers [a,b]')
    """
    origin, inside = typing.get_origin(annotation), typing.get_args(annotation)
    if origin in (typing.Union, types.UnionType):
        return " or ".join(dict.fromkeys(expectation(each) for each in inside if each is not Path))
    kind = origin or (type(None) if annotation is None else annotation)
    words = _EXPECTED.get(kind, getattr(kind, "__name__", str(kind)))
    if kind is Sequence and inside and inside[0] in _PLURALS:
        return f"a list of {_PLURALS[inside[0]]} [a,b]"
    return words


@cache
def _declared(target: type) -> dict[str, tuple[Any, Any]]:
    """The annotations of the arguments with which a class is called, and their defaults."""
    try:
        # Those of a dataclass may be strings that each class of its ancestry means in its own module.
        hints = typing.get_type_hints(target if is_dataclass(target) else target.__init__)  # type: ignore[misc]
        parameters = inspect.signature(target).parameters
    except Exception:  # names that are imported for type checkers alone, or whatever else an annotation may raise
        return {}
    return {name: (hints[name], each.default) for name, each in parameters.items() if name in hints}
