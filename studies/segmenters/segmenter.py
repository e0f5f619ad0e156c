"""Segmenters made from options: a method of this project, a program, or whatever ``_target_`` names."""

from __future__ import annotations

import dataclasses
import inspect
import json
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.planning.fingerprint import digest_of_code
from studies.planning.targets import check_required, construct, locate
from studies.segmenters.about import About
from studies.segmenters.heat_walk import HeatWalk
from studies.segmenters.labels import LABELS_OF, LabelError, labels_at_vertices

if TYPE_CHECKING:
    import heatwalk
    from studies.datasets import Model

MOST_WITH_MARGIN = 100_000  # vertices

TOLD = "n_segments"  # the argument of methods that are told how many segments to find

TOLD_OPTION = "told_n_segments"  # the name under which rows have that number, among the options of the method

_EXAMPLES = {"_target_": "my_package.my_method", "command": "mytool {mesh} {labels}"}


class SegmenterError(ValueError):
    """Options that do not describe a segmenter; the message names the option and shows what to type."""


@dataclass(frozen=True, eq=False)
class Labelled:
    """The labels of a mesh's vertices, and the complete result of a method that has one.

    Parameters
    ----------
    labels : (n,) int64 array
    segmentation : heatwalk.Segmentation or None
    """

    labels: NDArray[np.int64]
    segmentation: heatwalk.Segmentation | None = None

    def margin(self) -> NDArray[np.float64] | None:
        """How far each label is from another one, from 0 to 1; None where the method does not tell, or would take long.

        See `heatwalk.Segmentation.margin`.
        """
        if self.segmentation is None or len(self.labels) > MOST_WITH_MARGIN:
            return None
        return self.segmentation.margin


@dataclass(frozen=True)
class Segmenter:
    """A method with its options: a callable (vertices (n, 3), faces (m, 3)) -> labels of the vertices (n,) int64.

    Small and picklable whatever the method is: a process makes the method from its recipe when it first calls it, and
    keeps it.

    Parameters
    ----------
    name : str
        value of the column ``segmenter`` in the rows of a study
    recipe : str
        JSON of the options, including ``_target_``
    version : int or str
        what else determines the labels: a number that developers raise, or a digest of code or program
    labels_of : {"auto", "vertices", "faces"}
        what the labels of the method belong to, as in `labels_at_vertices`
    reference : Segmenter or None
        of a method that must be told how many segments to find: whose number of segments of the original mesh it is
        told if ``n_segments`` is None
    n_segments : int or None
        how many segments such a method is told to find, see `for_model`

    See Also
    --------
    make_segmenter : makes one from options
    studies.testing.check_segmenter : checks that a segmenter keeps to its contract
    """

    name: str
    recipe: str
    version: int | str
    labels_of: str = "auto"
    reference: Segmenter | None = None
    n_segments: int | None = None

    @property
    def is_told(self) -> bool:
        """Whether the method must be told how many segments to find."""
        return self.reference is not None

    @property
    def about(self) -> About | None:
        """Where the method comes from, if it declares that."""
        about = getattr(self.method, "about", None)
        return about if isinstance(about, About) else None

    @property
    def tells_margin(self) -> bool:
        """Whether its results have a margin: see `Labelled`."""
        return isinstance(self.method, HeatWalk) and type(self.method).__call__ is HeatWalk.__call__

    def for_model(self, model: Model) -> Segmenter:
        """This segmenter for a model and its variants, told the typical number of segments of the model if it has one.

        A method that finds the number itself, or a model that nobody has segmented, changes nothing.
        """
        return dataclasses.replace(self, n_segments=model.typical_n_segments()) if self.is_told else self

    def for_original(self, vertices: ArrayLike, faces: ArrayLike) -> Segmenter:
        """This segmenter for a mesh and its variants, told the reference's number of segments if it has no other."""
        if self.reference is None or self.n_segments is not None:
            return self
        return dataclasses.replace(self, n_segments=len(np.unique(self.reference(vertices, faces))))

    @property
    def fingerprint(self) -> list[Any]:
        """What determines the labels of a mesh: ``[options, version]``, plain values that are part of trial ids."""
        options = json.loads(self.recipe) | ({} if self.labels_of == "auto" else {"labels_of": self.labels_of})
        if self.reference is None:
            return [options, self.version]
        told = self.reference.fingerprint if self.n_segments is None else self.n_segments
        return [options, self.version, told]

    @property
    def options(self) -> dict[str, Any]:
        """The options of the method, those that have their default value too, without ``_target_``."""
        recipe = json.loads(self.recipe)
        told = {TOLD_OPTION: self.n_segments or f"of {self.reference.name}"} if self.reference else {}
        return _defaults(self.recipe) | {key: value for key, value in recipe.items() if not key.startswith("_")} | told

    @property
    def method(self) -> Any:
        """The callable that the recipe describes."""
        return _method(self.recipe)

    def __call__(self, vertices: ArrayLike, faces: ArrayLike) -> NDArray[np.int64]:
        """Labels of the vertices.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates; not modified
        faces : (m, 3) int array
            vertices of each face; not modified

        Returns
        -------
        (n,) int64 array
            0, 1, 2 …, or -1 for what belongs to no part

        Raises
        ------
        LabelError
            If the method does not return one integer per vertex or face.
        Exception
            Whatever the method raises.
        """
        return self.labelled(vertices, faces).labels

    def labelled(self, vertices: ArrayLike, faces: ArrayLike) -> Labelled:
        """Labels of the vertices, as from a call, with what else the method tells about them."""
        vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
        told = {TOLD: self.for_original(vertices, faces).n_segments} if self.is_told else {}
        method = self.method
        # Copies, because a method may modify its arguments.
        segmentation = None
        if self.tells_margin:
            segmentation = method.segmentation(vertices.copy(), faces.copy())
            labels: ArrayLike = method.labels_in(segmentation)
        else:
            labels = method(vertices.copy(), faces.copy(), **told)
        try:
            return Labelled(labels_at_vertices(labels, vertices, faces, self.labels_of), segmentation)
        except LabelError as error:
            raise LabelError(f"{self.name} returned {error}") from error


def make_segmenter(options: Mapping[str, Any], reference: Segmenter | None = None) -> Segmenter:
    """The segmenter that the options ``segmenter.*`` describe.

    ``_target_`` names a class, whose instances are called with (vertices, faces), or any other callable, which is
    itself called with them. The other options are passed to the class, or to every call. Modules are looked for in the
    current folder too. Two attributes of an instance are used if it has them: ``name``, by default the last part of
    ``_target_``, to which options with another value than their default are added unless it is a property; and
    ``algorithm_version``, by default a digest of the code of the package, or of the module, that
    defines the target. Targets inside ``studies`` must declare ``algorithm_version``: the digest would change with
    every file of this project. Two attributes of a class are used if it has them: ``labels_of``, what its labels belong
    to, and ``about``.

    A method that takes a third argument ``n_segments``, for which there is no option, is told how many segments to
    find: the typical number of people's segmentations of the model, or else that of ``reference`` on the original; for
    a variant the same as for the original.

    Parameters
    ----------
    options : mapping
        ``_target_``; optionally ``labels_of``, see `labels_at_vertices`; and the options of the method. Plain values
        that JSON can represent.
    reference : Segmenter, optional
        whose number of segments such a method is told; by default that of the Heat Walk

    Returns
    -------
    Segmenter

    Raises
    ------
    SegmenterError
        If an option is missing, unknown to the target, or refused by it, or if the target cannot be imported or called,
        or lacks a version.

    Examples
    --------
    >>> segmenter = make_segmenter({"_target_": "studies.segmenters.HeatWalk", "time": 0.5})
    >>> segmenter.name, segmenter.fingerprint[0]
    ('HeatWalk (time=0.5)', {'_target_': 'studies.segmenters.HeatWalk', 'time': 0.5})
    """
    check_required("segmenter", options, _EXAMPLES, SegmenterError)
    options = dict(options)
    labels_of = options.pop("labels_of", None)
    if labels_of not in (None, *LABELS_OF):
        raise SegmenterError(f"segmenter.labels_of is {labels_of!r}: choose one of {', '.join(LABELS_OF)}")
    name = options["_target_"]
    target = locate("segmenter", name, SegmenterError)
    if not (isinstance(target, type) and issubclass(target, HeatWalk)):
        options = _without_heat_walk_options(options, target)
    try:
        recipe = json.dumps(options, sort_keys=True)
    except TypeError as error:
        raise SegmenterError(f"options of segmenter._target_={name} must be plain values: {error}") from error
    method = _method(recipe)
    if not callable(method):
        raise SegmenterError(f"segmenter._target_={name}: a {name} cannot be called with (vertices, faces)")
    is_told = TOLD not in options and TOLD in signature(method).parameters
    if not isinstance(target, type):
        _check_options(name, target, options | ({TOLD: 2} if is_told else {}))
    return Segmenter(
        name=_full_name(name, target, method, options),
        recipe=recipe,
        version=_version(name, target, method),
        labels_of=labels_of or getattr(method, "labels_of", "auto"),
        reference=_reference(reference) if is_told else None,
    )


def _reference(reference: Segmenter | None) -> Segmenter:
    """The method whose number of segments others are told."""
    if reference is None:
        return make_segmenter({"_target_": "studies.segmenters.HeatWalk"})
    if reference.is_told:
        raise SegmenterError(
            f"reference_segmenter={reference.name} must itself be told how many segments to find; choose a method that "
            "finds their number, such as heat_walk"
        )
    return reference


@lru_cache(maxsize=8)
def _method(recipe: str) -> Callable[..., ArrayLike]:
    """The callable that a recipe describes, made once per process: it may read the weights of a network."""
    return construct("segmenter", json.loads(recipe), SegmenterError)


@lru_cache(maxsize=64)
def _defaults(recipe: str) -> dict[str, Any]:
    """The default values of the options of a method, found once per process: every row has them."""
    target = locate("segmenter", json.loads(recipe)["_target_"], SegmenterError)
    plain = (str, int, float, bool, list, tuple, type(None))
    parameters = signature(target).parameters.items()
    return {name: parameter.default for name, parameter in parameters if isinstance(parameter.default, plain)}


def _full_name(
    name: str, target: Callable[..., Any], method: Callable[..., ArrayLike], options: Mapping[str, Any]
) -> str:
    """The name of a method with the options that do not have their default value, which tell it from others."""
    base = str(getattr(method, "name", name.rsplit(".", 1)[-1]))
    if isinstance(getattr(type(method), "name", None), property | cached_property):
        return base  # the method itself says what tells it apart
    parameters = signature(target).parameters
    changed = [
        f"{key}={value}"
        for key, value in options.items()
        if not key.startswith("_") and not (key in parameters and parameters[key].default == value)
    ]
    return f"{base} ({', '.join(changed)})" if changed else base


def _version(name: str, target: Callable[..., Any], method: Callable[..., ArrayLike]) -> int | str:
    """The version that a method declares, by default a digest of its code."""
    declared = getattr(method, "algorithm_version", getattr(target, "algorithm_version", None))
    if declared is not None:
        return declared
    module = getattr(target, "__module__", None) or type(target).__module__
    if module.partition(".")[0] == "studies":
        raise SegmenterError(
            f"segmenter._target_={name} is part of this project and must declare algorithm_version, "
            "a number that is raised whenever its labels change"
        )
    return digest_of_code(target)


def _without_heat_walk_options(options: dict[str, Any], target: Callable[..., Any]) -> dict[str, Any]:
    """The options without those of the Heat Walk, the default that ``segmenter._target_=…`` alone is combined with."""
    defaults = {field.name: field.default for field in dataclasses.fields(HeatWalk)}
    if not defaults.keys() <= options.keys():
        return options
    accepted = signature(target).parameters
    ambiguous = [key for key, value in defaults.items() if options[key] != value or key in accepted]
    if ambiguous:
        raise SegmenterError(
            f"segmenter.{ambiguous[0]} is an option of the Heat Walk; to pass one of this name to "
            f"{options['_target_']}, add segmenter=custom, and +segmenter.{ambiguous[0]}=…"
        )
    return {key: value for key, value in options.items() if key not in defaults}


def _check_options(name: str, function: Callable[..., Any], options: Mapping[str, Any]) -> None:
    """Refuse options that a function does not have, before any trial is run."""
    keywords = {key: value for key, value in options.items() if not key.startswith("_")}
    try:
        signature(function).bind("vertices", "faces", **keywords)
    except TypeError as error:
        raise SegmenterError(
            f"segmenter._target_={name} cannot be called with (vertices, faces"
            f"{''.join(f', {key}={value!r}' for key, value in keywords.items())}): {error}"
        ) from error


def signature(function: Callable[..., Any]) -> inspect.Signature:
    """The signature of a function; some compiled functions have none, and refuse unknown options themselves."""
    try:
        return inspect.signature(function)
    except ValueError:
        return inspect.signature(lambda *_, **__: None)
