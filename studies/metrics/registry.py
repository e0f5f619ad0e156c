"""The metrics that the modules of this package define."""

from __future__ import annotations

import pkgutil
from functools import cache
from importlib import import_module
from typing import Any

from studies.columns import Column, of_means
from studies.metrics.metric import Comparison, Metric

# Modules whose columns precede those of all others, which follow in alphabetical order.
_LEADING_MODULES = ("change_percentage", "van_dongen", "rand_index")

# Dtypes of columns, which must hold the missing values of trials that fail.
_DTYPES = ("float64", "Float64", "Int64", "boolean", "string")


def registered() -> dict[str, Metric]:
    """Every metric of the package, in the order of its columns.

    Metrics are discovered: each is listed in ``METRICS``, a tuple of `Metric`, in one of the modules of
    `studies.metrics`. Adding a metric means adding a module.

    Returns
    -------
    dict of str to Metric
        by the name of the column

    Raises
    ------
    TypeError
        If ``METRICS`` of a module is not a tuple of `Metric`.
    ValueError
        If two metrics have the same column name, or a column cannot hold missing values or be shown.

    Examples
    --------
    >>> list(registered())[:3]
    ['change_percentage', 'van_dongen', 'rand_index_error']
    """
    return dict(_discovered())


def columns() -> tuple[Column, ...]:
    """The columns of all registered metrics, in their order.

    Returns
    -------
    tuple of Column

    Examples
    --------
    >>> [column.title for column in columns()][:3]
    ['CP %', 'van Dongen', 'Rand error']
    """
    return tuple(metric.column for metric in registered().values())


def compare(comparison: Comparison) -> dict[str, Any]:
    """Compute every registered metric.

    Parameters
    ----------
    comparison : Comparison
        the two segmentations

    Returns
    -------
    dict
        column name to value; None for a metric that needs a mesh if the comparison has none

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    Examples
    --------
    >>> import numpy as np
    >>> values = compare(Comparison(np.array([0, 0, 1, 1]), np.array([3, 3, 3, 8])))
    >>> values["change_percentage"], values["van_dongen"], values["rand_index_error"]
    (50.0, 50.0, 0.5)
    """
    return {name: metric(comparison) for name, metric in registered().items()}


@cache
def _discovered() -> dict[str, Metric]:
    """What `registered` returns, imported once per process."""
    from studies import metrics

    found: dict[str, Metric] = {}
    source: dict[str, str] = {}
    for module_name in sorted((module.name for module in pkgutil.iter_modules(metrics.__path__)), key=_rank):
        declared = getattr(import_module(f"{metrics.__name__}.{module_name}"), "METRICS", ())
        if not (isinstance(declared, tuple) and all(isinstance(metric, Metric) for metric in declared)):
            raise TypeError(f"METRICS in studies/metrics/{module_name}.py must be a tuple of Metric, got {declared!r}")
        for metric in declared:
            name = metric.column.name
            _check_column(metric.column, module_name)
            if name in found:
                raise ValueError(
                    f"the metric {name!r} is defined twice, in studies/metrics/{source[name]}.py and {module_name}.py; "
                    "give one of them another column name"
                )
            found[name], source[name] = metric, module_name
    return found


def _check_column(column: Column, module_name: str) -> None:
    """Refuse a column that could not be stored or shown at the end of a study."""
    where = f"the column {column.name!r} in studies/metrics/{module_name}.py"
    if column.dtype not in _DTYPES:
        raise ValueError(
            f"{where} has the dtype {column.dtype}; it must be one that can hold the missing values of trials that "
            f"fail: {', '.join(_DTYPES)}"
        )
    if not column.stored:
        raise ValueError(f"{where} has a template, and must have values of its own")
    example = {"string": "x", "boolean": True}.get(column.dtype, 1.5)
    try:
        of_means(column).text({column.name: example})
    except ValueError as error:
        raise ValueError(f"{where}: the format {column.format!r} cannot show {example!r}") from error


def _rank(module_name: str) -> tuple[int, str]:
    """Sorting key: the leading modules first, in their own order."""
    leading = module_name in _LEADING_MODULES
    return (_LEADING_MODULES.index(module_name) if leading else len(_LEADING_MODULES)), module_name
