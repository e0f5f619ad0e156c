"""Conformance suite: checks a perturbation against everything that this project requires of one.

Run it in the tests of your own perturbation::

    import perturb.testing

    def test_stretch_is_a_perturbation():
        perturb.testing.check_perturbation(Stretch(amount=0.5))
"""

import dataclasses
import hashlib
import json
import math
import pickle
import random
from collections.abc import Callable, Iterable, Mapping
from typing import Any, NoReturn, Self

import numpy as np
import trimesh

from perturb._odd_meshes import odd_meshes
from perturb.meshes import LENGTHS, as_trimesh
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed, get, recorded_fields

__all__ = ["check_perturbation", "default_meshes", "odd_meshes"]

SEEDS = (0, 1)

BAD_AMOUNTS = (-1, math.nan, math.inf, "much", None)

# Powers of two, so that scaling a mesh by them does not round its coordinates.
SCALES = (2.0**-100, 2.0**100)

# How far vertices may differ between a mesh and a scaled copy of it, as a share of the bounding-box diagonal.
SCALING_TOLERANCE = 1e-12


def check_perturbation(
    perturbation: Perturbation, meshes: Mapping[str, trimesh.Trimesh] | Iterable[trimesh.Trimesh] | None = None
) -> None:
    """Check that a perturbation fulfils the contracts of this project.

    Parameters
    ----------
    perturbation : Perturbation
        An instance that changes the meshes: its amount is not the neutral one.
    meshes : dict of str to trimesh.Trimesh, or iterable of trimesh.Trimesh, optional
        Meshes that the perturbation can be applied to; `default_meshes()` if omitted.

    Raises
    ------
    AssertionError
        For the first contract that is violated. The message names the perturbation, the mesh, what happened, and why
        it matters.
    ValueError
        If `meshes` is empty.

    Notes
    -----
    The contracts:

    - The class has a name under which it is registered, valid units, a version and a neutral amount.
    - A field out of range raises PerturbationError when the perturbation is built, as does an unusable mesh when it is
      called.
    - Perturbations, their parameters and their results can be pickled; equal perturbations are interchangeable.
    - The input is neither changed nor shared with the result.
    - `sample` draws everything that is random and `apply` nothing, so that parameters can be applied again.
    - The generator that is passed in is the only source of randomness: equal seeds yield equal results, and the global
      generators of `random` and NumPy are neither used nor changed.
    - At the neutral amount the mesh remains exactly as it is, including duplicate and unreferenced vertices.
    - Amounts are relative or counts: a scaled mesh is perturbed alike.
    - The result is a mesh with finite coordinates and valid faces.
    - `counterpart` has one int64 per original vertex: an index into the result, or -1. No two vertices have the same
      counterpart, unless ``applied["counterpart_by"]`` specifies how counterparts were found.
    - `applied` survives JSON and contains the name, all fields that are numbers or text, and the numbers of vertices
      and faces.

    Examples
    --------
    >>> import perturb.testing
    >>> perturb.testing.check_perturbation(perturb.Scaling(amount=2.0))

    See Also
    --------
    odd_meshes : Meshes that are no clean surfaces, on which a perturbation may raise PerturbationError.
    """
    if not isinstance(perturbation, Perturbation):
        raise AssertionError(f"{perturbation!r} is not an instance of a subclass of perturb.Perturbation")
    for check in _CHECKS_WITHOUT_A_MESH:
        check(perturbation)
    labelled = _labelled(default_meshes() if meshes is None else meshes)
    if not labelled:
        raise ValueError("meshes is empty; pass at least one mesh, or None for the default ones")
    cases = [_Case(perturbation, label, mesh) for label, mesh in labelled.items()]
    for check_case in _CHECKS_ON_A_MESH:
        for case in cases:
            check_case(case)


def default_meshes() -> dict[str, trimesh.Trimesh]:
    """Make the meshes on which `check_perturbation` runs.

    Returns
    -------
    dict of str to trimesh.Trimesh
        "pipe", a closed surface with a thin wall; "two spheres", with a small gap between them; "torn pipe", with a
        boundary, two components that touch along duplicate vertices, and a vertex without faces.

    Examples
    --------
    >>> import perturb.testing
    >>> meshes = perturb.testing.default_meshes()
    >>> {label: (mesh.body_count, mesh.is_watertight) for label, mesh in meshes.items()}
    {'pipe': (1, True), 'two spheres': (2, True), 'torn pipe': (3, False)}
    """
    pipe = _pipe()
    sphere = trimesh.creation.icosphere(subdivisions=3)
    other = sphere.copy()
    other.apply_translation([2.1, 0.0, 0.0])
    return {
        "pipe": pipe,
        "two spheres": as_trimesh(
            np.concatenate([sphere.vertices, other.vertices]),
            np.concatenate([sphere.faces, other.faces + len(sphere.vertices)]),
        ),
        "torn pipe": _torn(pipe),
    }


def _pipe() -> trimesh.Trimesh:
    """A pipe of height 2 with a wall 0.1 thick."""
    coarse = trimesh.creation.annulus(r_min=0.8, r_max=0.9, height=2.0, sections=16)
    fine = trimesh.Trimesh(*trimesh.remesh.subdivide_to_size(coarse.vertices, coarse.faces, max_edge=0.4))
    return as_trimesh(fine.vertices, fine.faces)


def _torn(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """The mesh without its top, cut lengthwise into two components, and with a vertex 0 that has no face."""
    vertices = np.asarray(mesh.vertices)
    x, _, z = mesh.triangles_center.T
    below_top = z < z.max()
    faces = np.asarray(mesh.faces)[below_top]
    separated = np.where(x[below_top, None] < 0, faces, faces + len(vertices))
    used, renumbered = np.unique(separated, return_inverse=True)
    kept = np.concatenate([vertices, vertices])[used]
    return as_trimesh(np.concatenate([[[0.0, 0.0, 5.0]], kept]), renumbered.reshape(-1, 3) + 1)


class _Case:
    """A perturbation on a mesh, and its result with the first seed."""

    def __init__(self, perturbation: Perturbation, label: str, mesh: trimesh.Trimesh) -> None:
        self.perturbation = perturbation
        self.where = f"{perturbation!r} on the mesh {label!r}"
        self._mesh = mesh
        self.input = self.copy()
        with _GlobalGenerators() as self.global_generators:
            self.result = self.run(self.input)

    def copy(self, scale: float = 1.0) -> trimesh.Trimesh:
        """A copy of the mesh, with nothing cached."""
        return as_trimesh(np.asarray(self._mesh.vertices) * scale, self._mesh.faces)

    def run(
        self, mesh: trimesh.Trimesh | None = None, seed: int = SEEDS[0], perturbation: Perturbation | None = None
    ) -> Perturbed:
        """Perturb a mesh, by default a copy of the case's own by an equal perturbation."""
        mesh = self.copy() if mesh is None else mesh
        perturbation = perturbation or dataclasses.replace(self.perturbation)
        return self.attempt(lambda: perturbation(mesh, np.random.default_rng(seed)))

    def attempt(self, action: Callable[[], Any]) -> Any:
        """Return the result of an action; an exception violates a contract."""
        try:
            return action()
        except PerturbationError as error:
            self.fail(
                f"raised PerturbationError: {error}", "choose another amount, or pass meshes that allow it", error
            )
        except Exception as error:
            why = "a mesh or an amount that it cannot handle must raise PerturbationError, and no other must raise"
            self.fail(f"raised {type(error).__name__}: {error}", why, error)

    def require(self, condition: object, what: str, why: str) -> None:
        if not condition:
            self.fail(what, why)

    def fail(self, what: str, why: str, cause: BaseException | None = None) -> NoReturn:
        raise AssertionError(f"{self.where}: {what}; {why}") from cause


def _check_declarations(perturbation: Perturbation) -> None:
    cls = type(perturbation)

    def require(condition: object, what: str) -> None:
        if not condition:
            raise AssertionError(f"{perturbation!r}: {what}")

    require(
        "name" in cls.__dict__ and isinstance(cls.name, str) and cls.name,
        "the class has no name of its own; define the class variable 'name', a string, to register it",
    )
    require(get(cls.name) is cls, f"the name {cls.name!r} is registered for another class; choose another name")
    require(
        perturbation.unit in cls.choices.get("unit", ()),
        f"the unit {perturbation.unit!r} is not in choices['unit'], so mistyped units would be accepted; list it there",
    )
    require(
        isinstance(cls.version, int) and cls.version >= 1,
        f"version is {cls.version!r}; it must be a whole number of at least 1, because stored results depend on it",
    )
    require(
        isinstance(cls.neutral, int | float) and math.isfinite(cls.neutral),
        f"neutral is {cls.neutral!r}; it must be the amount at which the perturbation is the identity",
    )
    optional = {field.name for field in dataclasses.fields(perturbation) if field.default is not dataclasses.MISSING}
    require(
        optional.issuperset(cls.later_fields),
        f"later_fields is {cls.later_fields!r}; it must be a tuple of names of fields that have a default",
    )
    require(
        perturbation.amount != cls.neutral,
        f"the amount {perturbation.amount!r} is the neutral one, at which there is nothing to check; choose another",
    )
    again = dataclasses.replace(perturbation)
    require(again == perturbation and hash(again) == hash(perturbation), "it differs from a perturbation equal to it")
    try:
        restored = pickle.loads(pickle.dumps(perturbation))
    except Exception as error:
        message = "it cannot be pickled, as needed for worker processes; define the class at the top of a module"
        raise AssertionError(f"{perturbation!r}: {message} ({error})") from error
    require(restored == perturbation, f"pickling turns it into {restored!r}")


def _check_bad_fields(perturbation: Perturbation) -> None:
    bad_values: list[tuple[str, Any]] = [("amount", value) for value in BAD_AMOUNTS]
    for field in dataclasses.fields(perturbation):
        if field.name in perturbation.choices:
            bad_values.append((field.name, "no such choice"))
        elif type(getattr(perturbation, field.name)) in (int, float):
            bad_values.append((field.name, math.nan))
    for name, value in bad_values:
        where = f"{type(perturbation).__name__} with {name}={value!r}"
        try:
            dataclasses.replace(perturbation, **{name: value})
        except PerturbationError:
            continue
        except Exception as error:
            raise AssertionError(
                f"{where}: raised {type(error).__name__}: {error}; it must raise PerturbationError"
            ) from error
        raise AssertionError(
            f"{where}: was accepted; it must raise PerturbationError when built. Call super().__post_init__(), and "
            f"self.check_number({name!r}) or list the valid values in 'choices'"
        )


def _check_bad_meshes(perturbation: Perturbation) -> None:
    corners = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    bad_meshes = {
        "without faces": as_trimesh(corners, np.empty((0, 3))),
        "with 3 vertices": as_trimesh(corners[:3], [[0, 1, 2]]),
        "with a NaN coordinate": as_trimesh([*corners[:3], [0, 0, math.nan]], [[0, 1, 2], [0, 2, 3]]),
        "with only degenerate triangles": as_trimesh([corners[0]] * 4, [[0, 1, 2], [1, 2, 3]]),
    }
    for label, mesh in bad_meshes.items():
        try:
            perturbation(mesh, np.random.default_rng(SEEDS[0]))
        except PerturbationError:
            continue
        except Exception as error:
            raise AssertionError(
                f"{perturbation!r} on a mesh {label}: raised {type(error).__name__}: {error}; "
                "it must raise PerturbationError, as Perturbation.__call__ does"
            ) from error
        raise AssertionError(
            f"{perturbation!r} on a mesh {label}: was accepted; it must raise PerturbationError, as "
            "Perturbation.__call__ does"
        )


def _check_input_is_unchanged(case: _Case) -> None:
    case.require(
        _digest(case.input) == _digest(case.copy()),
        "the input mesh was changed",
        "every variant of a study is made from the same mesh; change a copy",
    )
    for name in ("vertices", "faces"):
        case.require(
            not np.shares_memory(getattr(case.result.mesh, name), getattr(case.input, name)),
            f"the result shares its {name} with the input mesh",
            "changing one would change the other; perturb.as_trimesh copies its arguments",
        )


def _check_result(case: _Case) -> None:
    result = case.result
    case.require(isinstance(result, Perturbed), f"returned a {type(result).__name__}", "return self.finish(...)")
    case.require(
        isinstance(result.mesh, trimesh.Trimesh),
        f"the resulting mesh is a {type(result.mesh).__name__}",
        "it must be a trimesh.Trimesh; perturb.as_trimesh makes one",
    )
    vertices, faces = np.asarray(result.mesh.vertices), np.asarray(result.mesh.faces)
    case.require(
        np.isfinite(vertices).all(),
        f"{np.count_nonzero(~np.isfinite(vertices).all(axis=1))} vertices of the result are not finite",
        "self.finish(...) reports this as PerturbationError",
    )
    case.require(len(faces) > 0, "the result has no face", "self.finish(...) reports this as PerturbationError")
    case.require(
        faces.min() >= 0 and faces.max() < len(vertices),
        f"faces of the result refer to vertices {faces.min()} to {faces.max()}, but it has {len(vertices)} vertices",
        "faces are indices into the vertices",
    )


def _check_counterpart(case: _Case) -> None:
    counterpart, n_after = case.result.counterpart, len(case.result.mesh.vertices)
    n_before = len(case.input.vertices)
    case.require(
        isinstance(counterpart, np.ndarray) and counterpart.dtype == np.int64,
        f"counterpart is not an int64 array but {getattr(counterpart, 'dtype', type(counterpart).__name__)}",
        "self.finish(...) converts integers",
    )
    case.require(
        counterpart.shape == (n_before,),
        f"counterpart has the shape {counterpart.shape}, expected {(n_before,)}",
        "it has one entry per original vertex, -1 for those removed",
    )
    case.require(
        counterpart.min() >= -1 and counterpart.max() < n_after,
        f"counterpart has values from {counterpart.min()} to {counterpart.max()}; the result has {n_after} vertices",
        "build meshes with perturb.as_trimesh: trimesh.Trimesh merges and removes vertices unless process=False",
    )
    kept = counterpart[counterpart >= 0]
    case.require(
        "counterpart_by" in case.result.applied or len(np.unique(kept)) == len(kept),
        f"{len(kept)} vertices have a counterpart, but these are only {len(np.unique(kept))} different vertices",
        "if this is intended, state how counterparts are found: self.finish(..., counterpart_by='nearest_vertex')",
    )


def _check_applied(case: _Case) -> None:
    applied, perturbation = case.result.applied, case.perturbation
    plain = (str, int, float, bool, type(None))
    for key, value in applied.items():
        case.require(
            type(value) in plain,
            f"applied[{key!r}] is {value!r}, a {type(value).__name__}",
            "applied contains plain scalars and strings only, so that it can be stored as JSON",
        )
    try:
        restored = json.loads(json.dumps(applied, allow_nan=False))
    except ValueError as error:
        case.fail(f"applied cannot be written as JSON ({error})", "NaN and infinity are not valid JSON", error)
    case.require(restored == applied, "applied does not survive JSON", "its keys must be strings")
    expected = {
        "name": perturbation.name,
        **recorded_fields(perturbation),
        "vertices_before": len(case.input.vertices),
        "vertices_after": len(case.result.mesh.vertices),
        "faces_before": len(case.input.faces),
        "faces_after": len(case.result.mesh.faces),
    }
    for key, value in expected.items():
        case.require(
            key in applied and applied[key] == value,
            f"applied[{key!r}] is {applied.get(key, 'missing')!r}, expected {value!r}",
            "self.finish(...) records it; no further fact may have this key",
        )


def _check_result_can_be_pickled(case: _Case) -> None:
    restored = case.attempt(lambda: pickle.loads(pickle.dumps(case.result)))
    case.require(
        _same(restored, case.result), "pickling changes the result", "results are sent between worker processes"
    )


def _check_global_generators_are_untouched(case: _Case) -> None:
    used = case.global_generators.used
    case.require(
        not used,
        f"used the global random numbers of {' and '.join(used)}",
        "draw from the rng that sample receives: nothing else is determined by the seed",
    )


def _check_equal_seeds_yield_equal_results(case: _Case) -> None:
    case.run(seed=SEEDS[1])
    case.require(
        _same(case.run(), case.result),
        f"two runs with the seed {SEEDS[0]} yield different results",
        "everything random is drawn from the rng that sample receives, and nothing is kept from one call to the next",
    )


def _check_parameters_can_be_applied_again(case: _Case) -> None:
    parameters: Parameters = case.attempt(
        lambda: case.perturbation.sample(case.copy(), np.random.default_rng(SEEDS[0]))
    )
    case.require(
        isinstance(parameters, dict), f"sample returned a {type(parameters).__name__}", "it must return a dict"
    )
    before = case.attempt(lambda: pickle.dumps(parameters))
    for _ in range(2):
        applied = case.attempt(lambda: case.perturbation.apply(case.copy(), parameters))
        case.require(
            pickle.dumps(parameters) == before,
            "apply changed its parameters",
            "parameters can be applied again; change a copy",
        )
        case.require(
            _same(applied, case.result),
            "apply with the parameters of sample yields another result than calling the perturbation",
            "draw everything random in sample and nothing in apply",
        )


def _check_neutral_amount_is_the_identity(case: _Case) -> None:
    neutral = case.attempt(lambda: dataclasses.replace(case.perturbation, amount=case.perturbation.neutral))
    original = case.copy()
    result = case.run(original, perturbation=neutral)
    case.require(
        _digest(result.mesh) == _digest(original)
        and np.array_equal(result.counterpart, np.arange(len(original.vertices))),
        f"at the neutral amount {neutral.amount!r} the mesh or its order of vertices and faces changes",
        "it must remain exactly as it is, duplicate and unreferenced vertices included",
    )


def _check_amounts_are_relative(case: _Case) -> None:
    tolerance = SCALING_TOLERANCE * LENGTHS["bounding_box_diagonal"](case.copy())
    for scale in SCALES:
        scaled = case.run(case.copy(scale))
        alike = (
            np.array_equal(scaled.mesh.faces, case.result.mesh.faces)
            and np.array_equal(scaled.counterpart, case.result.counterpart)
            and scaled.mesh.vertices.shape == case.result.mesh.vertices.shape
            and np.abs(scaled.mesh.vertices / scale - case.result.mesh.vertices).max() <= tolerance
        )
        case.require(
            alike,
            f"the mesh scaled by {scale:g} is perturbed differently",
            "express lengths in one of perturb.LENGTHS, so that results do not depend on the unit of the mesh",
        )


_CHECKS_WITHOUT_A_MESH: tuple[Callable[[Perturbation], None], ...] = (
    _check_declarations,
    _check_bad_fields,
    _check_bad_meshes,
)

_CHECKS_ON_A_MESH: tuple[Callable[[_Case], None], ...] = (
    _check_result,
    _check_input_is_unchanged,
    _check_counterpart,
    _check_applied,
    _check_result_can_be_pickled,
    _check_global_generators_are_untouched,
    _check_equal_seeds_yield_equal_results,
    _check_parameters_can_be_applied_again,
    _check_neutral_amount_is_the_identity,
    _check_amounts_are_relative,
)


def _labelled(meshes: Mapping[str, trimesh.Trimesh] | Iterable[trimesh.Trimesh]) -> dict[str, trimesh.Trimesh]:
    """Meshes by label; those without one are numbered from 0."""
    if isinstance(meshes, Mapping):
        return dict(meshes)
    return {str(number): mesh for number, mesh in enumerate(meshes)}


def _digest(mesh: trimesh.Trimesh) -> str:
    """Return a hash of the vertices and faces: equal for meshes that are equal bit by bit."""
    digest = hashlib.sha256()
    for array in (np.asarray(mesh.vertices), np.asarray(mesh.faces)):
        digest.update(f"{array.dtype} {array.shape}".encode() + array.tobytes())
    return digest.hexdigest()


def _same(first: Perturbed, second: Perturbed) -> bool:
    """Return whether two results are equal bit by bit."""
    return (
        _digest(first.mesh) == _digest(second.mesh)
        and np.array_equal(first.counterpart, second.counterpart)
        and first.applied == second.applied
    )


class _GlobalGenerators:
    """Finds out whether the global random generators are used or seeded in its context, and restores them."""

    def __init__(self) -> None:
        self.used: list[str] = []

    def __enter__(self) -> Self:
        self._original = random.getstate(), np.random.get_state()  # noqa: NPY002
        # A step further, so that seeding them with the value that they were seeded with before is noticed.
        random.random()
        np.random.random()  # noqa: NPY002
        self._entered = self._states()
        return self

    def __exit__(self, *exception: object) -> None:
        left = self._states()
        self.used = [module for module in left if left[module] != self._entered[module]]
        random.setstate(self._original[0])
        np.random.set_state(self._original[1])  # noqa: NPY002

    @staticmethod
    def _states() -> dict[str, bytes]:
        return {
            "random": pickle.dumps(random.getstate()),
            "numpy.random": pickle.dumps(np.random.get_state()),  # noqa: NPY002
        }
