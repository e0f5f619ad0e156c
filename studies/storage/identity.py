"""What a results folder is about: the options that its rows have in common, and those that only choose some of them."""

from __future__ import annotations

import hashlib
import inspect
import json
from collections.abc import Mapping
from typing import Any

from studies.planning.targets import locate

# Options about where and how trials run, and how results are shown; and `categories`, to which `dataset.categories`
# refers, so that a study may choose them for the datasets that have some.
INCIDENTAL = (
    "engine", "results_dir", "trial", "gallery", "page", "on_error", "retry_failed", "fresh", "dry_run", "hydra",
    "title", "axis", "publication", "plates", "figure15", "counted", "criterion", "paired_with", "study",
    "categories",
)  # fmt: skip
# Options that choose which trials there are. Rows for different values of them belong together.
SELECTING = ("levels", "repeats", "times", "models_drawn", "seed")
SELECTING_IN_DATASET = ("root", "glob", "models", "categories")

# Options of an experiment, in the shipped studies references to options of the study, that are not its identity.
_SELECTING_IN_EXPERIMENT = (
    *SELECTING, "gallery", "page", "title", "axis", "plates", "plate", "columns_shown", "counted", "criterion",
    "paired_with",
)  # fmt: skip

# Options of a study whose folder gathers rows of several methods, as its experiment declares them.
_DECLARED = ("selecting", "presenting")

Options = dict[str, Any]


def identity(record: Mapping[str, Any]) -> Options:
    """The options that all rows of a results folder have in common: method, perturbation, dataset, kind of study.

    Parameters
    ----------
    record : mapping
        a configuration as in config.yaml

    Returns
    -------
    dict
        values by dotted names; options that have their default value are there even if the record lacks them

    Examples
    --------
    >>> record = {"study": {"name": "holes"}, "levels": [1], "repeats": 3, "dataset": {"models": ["cow"]},
    ...           "segmenter": {"_target_": "studies.segmenters.HeatWalk", "time": 2}}
    >>> found = identity(record)
    >>> found["segmenter.time"], found["segmenter.density"], "levels" in found, "dataset.models" in found
    (2, 'vertices', False, False)
    """
    declared = [name for kind in _DECLARED for name in declared_options(record, kind)]
    kept = _without(record, (*INCIDENTAL, *SELECTING, *declared))
    kept["dataset"] = _without(_with_defaults(record.get("dataset") or {}), SELECTING_IN_DATASET)
    kept["experiment"] = _without(record.get("experiment") or {}, (*_SELECTING_IN_EXPERIMENT, *declared))
    if "segmenter" not in declared:
        kept["segmenter"] = _with_defaults(record.get("segmenter") or {})
    kept.update(_perturbation(kept))
    if isinstance(kept.get("parts"), Mapping):
        kept["parts"] = {name: _of_part(part) for name, part in kept["parts"].items()}
    return {key: value for key, value in flat(kept).items() if value not in (None, {}, [])}


def declared_options(record: Mapping[str, Any], kind: str) -> tuple[str, ...]:
    """The options that the experiment of a record declares as ``selecting`` or ``presenting``."""
    try:
        return tuple(getattr(locate("", record["experiment"]["_target_"], ValueError), kind, ()))
    except (KeyError, ValueError, TypeError):  # what a stored record names need not be there any more
        return ()


def selection(record: Mapping[str, Any]) -> Options:
    """The options that choose which trials there are, by dotted names.

    Examples
    --------
    >>> selection({"levels": [1], "repeats": 3, "dataset": {"models": ["cow"], "weld": None}, "title": "Holes"})
    {'dataset.models': ['cow'], 'levels': [1], 'repeats': 3}
    """
    dataset = record.get("dataset") or {}
    chosen = {f"dataset.{key}": dataset[key] for key in SELECTING_IN_DATASET if dataset.get(key) is not None}
    for key in SELECTING:
        if record.get(key) is not None:
            chosen |= flat(record[key], key)
    for name, part in (record.get("parts") or {}).items():
        if isinstance(part, Mapping) and part.get("levels") is not None:
            chosen[f"parts.{name}.levels"] = part["levels"]
    return chosen


def differences(a: Mapping[str, Any], b: Mapping[str, Any]) -> Options:
    """The options of ``b`` that differ from those of ``a``, in their order; None for those that ``b`` lacks.

    Of another method than that of ``a``, whose options are all others, the options that have a value are named.

    Examples
    --------
    >>> differences({"segmenter.time": 1.0}, {"segmenter.time": 2})
    {'segmenter.time': 2}
    """
    changed = {key: b.get(key) for key in dict.fromkeys([*b, *a]) if a.get(key) != b.get(key)}
    replaced = {key.removesuffix("_target_") for key in changed if key.endswith("._target_")}
    return {
        key: value
        for key, value in changed.items()
        if not (value is None and any(key.startswith(prefix) for prefix in replaced))
    }


def words(options: Mapping[str, Any]) -> str:
    """Options as they are typed, for the name of a folder: ``segmenter.time=2,levels=[0.1,0.2]``.

    Examples
    --------
    >>> words({"segmenter._target_": "my_package.my_method", "segmenter.k": 5, "levels": [0.1, 0.2]})
    'segmenter=my_method,segmenter.k=5,levels=[0.1,0.2]'
    >>> words({"segmenters": ["heat_walk", {"_target_": "my_package.my_method", "k": 5}]})
    'segmenters=[heat_walk,my_method(k=5)]'
    """
    return ",".join(f"{key.removesuffix('._target_')}={_word(key, value)}" for key, value in options.items())


def _word(key: str, value: Any) -> str:
    if key.endswith("._target_"):
        return str(value).rpartition(".")[2]
    if isinstance(value, list | tuple):
        return f"[{','.join(_word('', each) for each in value)}]"
    if isinstance(value, Mapping):
        options = ",".join(f"{name}={_word('', each)}" for name, each in value.items() if name != "_target_")
        return f"{str(value.get('_target_', '')).rpartition('.')[2]}({options})"
    if value is None or isinstance(value, bool):
        return json.dumps(value)
    return f"{value:g}" if isinstance(value, float) else str(value)


def short_digest(value: Any) -> str:
    """The first digits of the SHA-256 of plain values, to tell folders apart."""
    return hashlib.sha256(json.dumps(value, sort_keys=True, default=str).encode()).hexdigest()[:10]


def flat(options: Any, prefix: str = "") -> Options:
    """Nested dicts as one, keyed by dotted names.

    Examples
    --------
    >>> flat({"dataset": {"models": [1], "weld": None}})
    {'dataset.models': [1], 'dataset.weld': None}
    """
    if not isinstance(options, Mapping) or not options:
        return {prefix: options}
    found: Options = {}
    for key, value in options.items():
        found |= flat(value, f"{prefix}.{key}" if prefix else str(key))
    return found


def _of_part(part: Any) -> Any:
    """What a part of a study has in common with no others: its perturbation, without its levels."""
    if not isinstance(part, Mapping):
        return part
    return {key: value for key, value in _perturbation(part).items() if value is not None}


def _perturbation(options: Mapping[str, Any]) -> Options:
    """The perturbation with its options, but for the one that the levels replace."""
    perturbation, swept = options.get("perturbation"), options.get("swept", "amount")
    if not isinstance(perturbation, Mapping):
        return {"perturbation": perturbation, "swept": None}
    return {"perturbation": _without(_with_defaults(perturbation), (swept,)), "swept": swept}


def _without(options: Mapping[str, Any], names: tuple[str, ...]) -> Options:
    return {key: value for key, value in options.items() if key not in names}


def _with_defaults(options: Mapping[str, Any]) -> Options:
    """Options of a class or function, with those that have their default: a record may be older than an option."""
    try:
        parameters = inspect.signature(locate("", options["_target_"], ValueError)).parameters
    except (KeyError, ValueError, TypeError):  # what a stored record names need not be there any more
        return dict(options)
    plain = (str, int, float, bool, list, tuple)
    defaults = {name: each.default for name, each in parameters.items() if isinstance(each.default, plain)}
    return {**defaults, **options}
