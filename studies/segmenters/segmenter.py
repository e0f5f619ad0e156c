"""From a configuration to a segmenter: a method of this project, a program, or whatever ``_target_`` names."""

import dataclasses
import inspect
import json
import os
import pkgutil
import sys
from dataclasses import dataclass
from functools import lru_cache

import hydra.utils
import numpy as np
from omegaconf import OmegaConf

from studies.planning.code import digest_of_code
from studies.segmenters.heat_walk import HeatWalk
from studies.segmenters.labels import LABELS_OF, LabelError, at_vertices


class SegmenterError(ValueError):
    """A configuration that gives no segmenter; the message says which option, and what to type."""


@dataclass(frozen=True)
class Segmenter:
    """A method with its options: a callable (vertices (n, 3), faces (m, 3)) -> labels of the vertices (n,) int64.

    Small and picklable whatever the method is: a process makes the method from its recipe when it is first called
    there, and keeps it.

    name : stands in the rows of a study
    recipe : JSON of the options, ``_target_`` among them
    version : what else determines the labels: a number that developers raise, or a digest of code or program
    labels_of : whether the method labels vertices or faces, as in `at_vertices`
    """

    name: str
    recipe: str
    version: int | str
    labels_of: str = "auto"

    @property
    def identity(self):
        """What determines the labels of a mesh, to be digested: a list of plain values."""
        options = json.loads(self.recipe) | ({} if self.labels_of == "auto" else {"labels_of": self.labels_of})
        return [options, self.version]

    @property
    def method(self):
        """What is called."""
        return _method(self.recipe)

    def __call__(self, vertices, faces):
        vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
        # Copies: a method may write into what it is given.
        labels = self.method(vertices.copy(), faces.copy())
        try:
            return at_vertices(labels, vertices, faces, self.labels_of)
        except LabelError as error:
            raise LabelError(f"{self.name} gave {error}") from error


def make(config):
    """The segmenter of a configuration.

    ``_target_`` names a class, whose instances are called with (vertices, faces), or any other callable, which is
    called so itself; the options beside it are handed to the class, or to every call. Modules are looked for in the
    current folder too. Two attributes of an instance are used where it has them: ``name``, else the last part of
    ``_target_``; and ``algorithm_version``, else a digest of the code of the package, or of the module, that the
    target is defined in.

    Parameters
    ----------
    config : mapping with ``_target_``, ``labels_of`` if need be (see `at_vertices`), and the options

    Returns
    -------
    Segmenter

    Raises
    ------
    SegmenterError
        for options that are missing, unknown to the target, or refused by it, and a target that cannot be imported
    """
    options = OmegaConf.to_container(config, resolve=True) if OmegaConf.is_config(config) else dict(config)
    for key, value in options.items():
        if value == "???":
            raise SegmenterError(f"segmenter.{key} is not said: type 'segmenter.{key}={EXAMPLES.get(key, '…')}'")
    labels_of = options.pop("labels_of", "auto")
    if labels_of not in LABELS_OF:
        raise SegmenterError(f"segmenter.labels_of is {labels_of!r}: give one of {', '.join(LABELS_OF)}")
    name = options["_target_"]
    target = _locate(name)
    if target is not HeatWalk:
        options = _without_heat_walk(options, target)
    recipe = json.dumps(options, sort_keys=True)
    method = _method(recipe)
    if not callable(method):
        raise SegmenterError(f"segmenter._target_={name}: a {name} cannot be called with (vertices, faces)")
    if not isinstance(target, type):
        _check_options(name, target, options)
    return Segmenter(
        name=str(getattr(method, "name", name.rsplit(".", 1)[-1])),
        recipe=recipe,
        version=method.algorithm_version if hasattr(method, "algorithm_version") else digest_of_code(target),
        labels_of=labels_of,
    )


EXAMPLES = {"_target_": "my_package.my_method", "command": "mytool {mesh} {labels}"}


@lru_cache(maxsize=8)
def _method(recipe):
    """The callable of a recipe, made once a process: it may read the weights of a network."""
    options = json.loads(recipe)
    target = _locate(options["_target_"])
    options = {"_convert_": "all", "_partial_": not isinstance(target, type)} | options
    try:
        return hydra.utils.instantiate(options)
    except hydra.errors.InstantiationException as error:
        # What the target itself says of its options, in its own words.
        said = error
        while said.__cause__ is not None:
            said = said.__cause__
        if isinstance(said, ValueError):
            raise SegmenterError(str(said)) from error
        raise SegmenterError(f"segmenter._target_={options['_target_']}: {type(said).__name__}: {said}") from error


def _locate(name):
    """What a dotted name names, also below the current folder."""
    if os.getcwd() not in sys.path:
        sys.path.append(os.getcwd())
    try:
        target = pkgutil.resolve_name(name)
    except Exception as error:
        raise SegmenterError(f"segmenter._target_={name}: {type(error).__name__}: {error}") from error
    if not callable(target):
        raise SegmenterError(f"segmenter._target_={name} is a {type(target).__name__} and cannot be called")
    return target


def _without_heat_walk(options, target):
    """The options without those of the Heat Walk, which is what ``segmenter._target_=…`` alone is laid over."""
    defaults = {field.name: field.default for field in dataclasses.fields(HeatWalk)}
    if not defaults.keys() <= options.keys():
        return options
    unclear = [key for key, value in defaults.items() if options[key] != value or key in _signature(target).parameters]
    if unclear:
        raise SegmenterError(
            f"segmenter.{unclear[0]} is an option of the Heat Walk; to hand one of this name to "
            f"{options['_target_']}, add segmenter=custom, and +segmenter.{unclear[0]}=…"
        )
    return {key: value for key, value in options.items() if key not in defaults}


def _check_options(name, function, options):
    """Refuse options that a function does not have, before any trial is run."""
    keywords = {key: value for key, value in options.items() if not key.startswith("_")}
    try:
        _signature(function).bind("vertices", "faces", **keywords)
    except TypeError as error:
        raise SegmenterError(
            f"segmenter._target_={name} cannot be called with (vertices, faces"
            f"{''.join(f', {key}={value!r}' for key, value in keywords.items())}): {error}"
        ) from error


def _signature(function):
    try:
        return inspect.signature(function)
    except ValueError:  # some compiled functions have none; what they do not take, they refuse themselves
        return inspect.signature(lambda *_, **__: None)
