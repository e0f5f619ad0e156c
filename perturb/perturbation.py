"""The base class of perturbations, the result of a perturbation, and the registry of names."""

from __future__ import annotations

import dataclasses
import math
import pkgutil
from abc import ABC, abstractmethod
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from perturb.meshes import n_components, reason_unusable

if TYPE_CHECKING:
    import trimesh

Parameters = dict[str, Any]
"""What `Perturbation.sample` draws: arrays and numbers from which `Perturbation.apply` makes the mesh."""

Scalar = str | int | float | bool | None
"""A value in `Perturbed.applied`."""

_REGISTRY: dict[str, type[Perturbation]] = {}

_NOT_SEARCHED = ("testing",)  # modules of the package that contain no perturbations for users


class PerturbationError(ValueError):
    """A perturbation cannot be built, cannot be applied to this mesh, or would leave nothing usable of it."""


@dataclass(frozen=True)
class Perturbed:
    """A perturbed mesh and its relation to the original.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        The perturbed mesh, built with ``process=False``.
    counterpart : (n_original,) int64 array
        For each original vertex the index of its counterpart in `mesh`, -1 if it has none.
    applied : dict
        What was actually done: plain Python scalars, strings and None only, so that it can be written as JSON.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> perturbed = perturb.Holes(amount=1)(trimesh.creation.box(), np.random.default_rng(0))
    >>> perturbed.applied["faces_before"], perturbed.applied["faces_after"]
    (12, 11)
    >>> perturbed.counterpart.tolist()
    [0, 1, 2, 3, 4, 5, 6, 7]
    """

    mesh: trimesh.Trimesh
    counterpart: np.ndarray
    applied: dict[str, Scalar]


@dataclass(frozen=True)
class Perturbation(ABC):
    """Base class of perturbations: functions (mesh, rng) → `Perturbed` that leave their input unchanged.

    Drawing the random parameters (`sample`) is separate from using them (`apply`): parameters that were drawn once can
    be applied again and yield the same result.

    Parameters
    ----------
    amount : float
        How much, in `unit`. At `neutral` the perturbation is the identity.
    unit : str
        What `amount` measures, one of ``choices["unit"]``.

    Attributes
    ----------
    name : str
        Class variable; the name under which the class is registered. A class that inherits its name is not registered.
    choices : dict of str to tuple of str
        Class variable; for each field with a fixed set of valid values, these values. ``choices["unit"]`` is required.
    version : int
        Class variable; to be increased whenever a seed yields another result, so that stored results are not reused.
    neutral : float
        Class variable; the amount at which the perturbation is the identity.
    later_fields : tuple of str
        Class variable; fields that were added when results had been stored, and that change nothing at their default:
        stored results are still found.

    Raises
    ------
    PerturbationError
        When built, for a field that is out of range. When called, for an amount that the mesh does not allow, for an
        unusable mesh, and for an unusable result.

    See Also
    --------
    perturb.testing.check_perturbation : Checks a new perturbation against everything that is required of one.

    Notes
    -----
    A new perturbation is a frozen dataclass with a name, valid units and `apply`::

        @dataclass(frozen=True)
        class Stretch(perturb.Perturbation):
            amount: float = 0.1
            unit: str = "factor"

            name: ClassVar[str] = "stretch"
            choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("factor",)}

            def apply(self, mesh, parameters):
                return self.finish(mesh, *perturb.moved(mesh, mesh.vertices * [self.amount, 0, 0]))

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> noise = perturb.NormalNoise(amount=0.2)
    >>> parameters = noise.sample(sphere, np.random.default_rng(7))
    >>> once, again = noise.apply(sphere, parameters), noise(sphere, np.random.default_rng(7))
    >>> bool((once.mesh.vertices == again.mesh.vertices).all())
    True
    """

    amount: float
    unit: str

    name: ClassVar[str]
    choices: ClassVar[dict[str, tuple[str, ...]]]
    version: ClassVar[int] = 1
    neutral: ClassVar[float] = 0.0
    later_fields: ClassVar[tuple[str, ...]] = ()

    def __init_subclass__(cls) -> None:
        super().__init_subclass__()
        if "name" in cls.__dict__:
            _register(cls)

    def __post_init__(self) -> None:
        for class_variable in ("name", "choices"):
            if not hasattr(self, class_variable):
                raise PerturbationError(f"the class {type(self).__qualname__} does not define {class_variable!r}")
        for field in dataclasses.fields(self):
            value = getattr(self, field.name)
            if isinstance(value, np.generic):  # `applied` contains plain Python scalars
                object.__setattr__(self, field.name, value.item())
        for field_name, valid in self.choices.items():
            value = getattr(self, field_name)
            if value not in valid:
                raise PerturbationError(f"{self.name}: {field_name} is {value!r}; choose one of {', '.join(valid)}")
        self.check_number("amount")

    def __call__(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Perturbed:
        """Perturb a mesh at random.

        Parameters
        ----------
        mesh : trimesh.Trimesh
            Left unchanged.
        rng : numpy.random.Generator
            The only source of randomness.

        Returns
        -------
        Perturbed

        Raises
        ------
        PerturbationError
            For an unusable mesh, an amount that the mesh does not allow, and an unusable result.
        """
        _check_usable(mesh, f"{self.name}: the input mesh")
        return self.apply(mesh, self.sample(mesh, rng))

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw the random parameters.

        Parameters
        ----------
        mesh : trimesh.Trimesh
            The mesh to which the parameters will be applied. Left unchanged.
        rng : numpy.random.Generator
            The only source of randomness.

        Returns
        -------
        dict
            Arrays and numbers by name; empty for a deterministic perturbation.

        Raises
        ------
        PerturbationError
            If the mesh does not allow the amount.
        """
        return {}

    @abstractmethod
    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        """Perturb a mesh with given parameters. Nothing is random here.

        Parameters
        ----------
        mesh : trimesh.Trimesh
            Left unchanged.
        parameters : dict
            What `sample` returned for this mesh. Left unchanged.

        Returns
        -------
        Perturbed
            Made by `finish`.

        Raises
        ------
        PerturbationError
            If the mesh does not allow the amount, or the result is unusable.
        """

    def check_number(
        self, field: str, *, maximum: float = math.inf, positive: bool = False, whole: bool = False
    ) -> None:
        """Check that a field is a finite number of at least 0. To be called in ``__post_init__``.

        ``amount`` is always checked; call this for further numeric fields, or if ``amount`` is limited further.

        Parameters
        ----------
        field : str
            Name of the field.
        maximum : float, optional
            The largest valid value.
        positive : bool, optional
            Whether 0 is refused.
        whole : bool, optional
            Whether only whole numbers are valid.

        Raises
        ------
        PerturbationError
            If the value is out of range.

        Examples
        --------
        >>> import perturb
        >>> perturb.Holes(amount=2.5)
        Traceback (most recent call last):
        perturb.perturbation.PerturbationError: holes: amount is 2.5; it must be a whole number
        """
        value = getattr(self, field)
        if not isinstance(value, int | float) or not math.isfinite(value) or value < 0 or value > maximum:
            upper = "" if math.isinf(maximum) else f" and at most {maximum:g}"
            raise PerturbationError(f"{self.name}: {field} is {value!r}; it must be a number of at least 0{upper}")
        if positive and value == 0:
            raise PerturbationError(f"{self.name}: {field} is {value!r}; it must be above 0")
        if whole and value != int(value):
            raise PerturbationError(f"{self.name}: {field} is {value!r}; it must be a whole number")

    def finish(
        self, original: trimesh.Trimesh, mesh: trimesh.Trimesh, counterpart: np.ndarray, **facts: Scalar | np.generic
    ) -> Perturbed:
        """Check a perturbed mesh and record what was done. To be called at the end of `apply`.

        Parameters
        ----------
        original : trimesh.Trimesh
            The mesh before.
        mesh : trimesh.Trimesh
            The mesh after, which shares no memory with `original`; see `perturb.as_trimesh`.
        counterpart : (n_original,) int array
            For each original vertex the index of its counterpart in `mesh`, -1 if it has none. No two vertices have
            the same counterpart unless ``counterpart_by`` is among the facts.
        **facts : str, int, float, bool or None
            What else `Perturbed.applied` is to contain. ``counterpart_by`` specifies how counterparts were found if
            they do not follow from the perturbation itself, for example "nearest_vertex".

        Returns
        -------
        Perturbed
            With, in `applied`: the name, all fields that are numbers or text, the facts, and the numbers of vertices,
            faces and connected components before and after.

        Raises
        ------
        PerturbationError
            If the resulting mesh is unusable: it has no faces, fewer than 4 vertices, only degenerate triangles, or
            coordinates that are not finite.
        ValueError
            If `counterpart` does not fit the meshes: a mistake in `apply`, not in the mesh.
        """
        _check_usable(mesh, f"{self.name}, {self.amount:g} {self.unit}: the result")
        counterpart = np.asarray(counterpart)  # of trimesh's own class, if it comes from a mesh
        _check_counterpart(counterpart, len(original.vertices), len(mesh.vertices), self.name)
        applied = {
            "name": self.name,
            **recorded_fields(self),
            **{key: value.item() if isinstance(value, np.generic) else value for key, value in facts.items()},
            "vertices_before": len(original.vertices),
            "vertices_after": len(mesh.vertices),
            "faces_before": len(original.faces),
            "faces_after": len(mesh.faces),
            "components_before": n_components(original),
            "components_after": n_components(mesh),
        }
        return Perturbed(mesh, counterpart.astype(np.int64, copy=False), applied)


def recorded_fields(perturbation: Perturbation) -> dict[str, Scalar]:
    """Return the fields of a perturbation that `Perturbed.applied` contains: numbers, text and None."""
    values = {field.name: getattr(perturbation, field.name) for field in dataclasses.fields(perturbation)}
    return {name: value for name, value in values.items() if value is None or isinstance(value, str | int | float)}


def names() -> list[str]:
    """List the names of all registered perturbations, sorted.

    Returns
    -------
    list of str
        Names of the perturbations in this package, and of all others that have been imported.

    Examples
    --------
    >>> import perturb
    >>> "holes" in perturb.names()
    True
    """
    return sorted(_registered())


def get(name: str) -> type[Perturbation]:
    """Look up a perturbation by its name.

    Parameters
    ----------
    name : str
        One of `names()`.

    Returns
    -------
    type
        The class, a subclass of `Perturbation`.

    Raises
    ------
    PerturbationError
        For an unknown name; the message lists the registered ones.

    Examples
    --------
    >>> import perturb
    >>> perturb.get("holes") is perturb.Holes
    True
    """
    registered = _registered()
    if name not in registered:
        raise PerturbationError(f"unknown perturbation {name!r}; choose one of {', '.join(sorted(registered))}")
    return registered[name]


def shipped_classes() -> dict[str, type[Perturbation]]:
    """Import every public module of this package and return the perturbations defined there, by class name."""
    import perturb

    classes = {}
    for module_name in sorted(found.name for found in pkgutil.iter_modules(perturb.__path__)):
        if module_name.startswith("_") or module_name in _NOT_SEARCHED:
            continue
        module = import_module(f"perturb.{module_name}")
        for value in list(vars(module).values()):
            defined_here = isinstance(value, type) and value.__module__ == module.__name__
            if defined_here and issubclass(value, Perturbation) and value is not Perturbation:
                classes[value.__name__] = value
    return classes


def _registered() -> dict[str, type[Perturbation]]:
    """Return all perturbations by name, after importing those of this package."""
    for cls in shipped_classes().values():
        if "name" in cls.__dict__:
            _REGISTRY.setdefault(cls.name, cls)
    return _REGISTRY


def _register(cls: type[Perturbation]) -> None:
    """Register a class under its name, which no other class may have."""
    known = _REGISTRY.get(cls.name)
    if known is not None and not _same_definition(known, cls):
        raise PerturbationError(
            f"{_full_name(cls)} cannot have the name {cls.name!r}: it belongs to {_full_name(known)}; choose another"
        )
    _REGISTRY[cls.name] = cls


def _same_definition(first: type, second: type) -> bool:
    """Return whether two classes are one that was defined twice: reloaded, or imported while also run as a script."""
    same_module = first.__module__ == second.__module__ or "__main__" in (first.__module__, second.__module__)
    return same_module and first.__qualname__ == second.__qualname__


def _full_name(cls: type) -> str:
    return f"{cls.__module__}.{cls.__qualname__}"


def _check_usable(mesh: trimesh.Trimesh, what: str) -> None:
    """Raise PerturbationError if a mesh can be neither perturbed nor segmented."""
    if reason := reason_unusable(mesh):
        raise PerturbationError(f"{what} {reason}")


def _check_counterpart(counterpart: np.ndarray, n_before: int, n_after: int, name: str) -> None:
    """Raise ValueError unless counterpart has shape (n_before,) and values in -1 … n_after-1."""
    if counterpart.shape != (n_before,) or counterpart.dtype.kind not in "iu":
        raise ValueError(
            f"{name}: counterpart is an array of shape {counterpart.shape} and type {counterpart.dtype}; "
            f"expected shape ({n_before},) and integers, one per original vertex"
        )
    if counterpart.min() < -1 or counterpart.max() >= n_after:
        raise ValueError(
            f"{name}: counterpart has values from {counterpart.min()} to {counterpart.max()}; "
            f"they must be indices of the {n_after} vertices of the result, or -1"
        )
