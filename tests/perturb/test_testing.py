"""The conformance suite finds every kind of mistake and reports what, where and why."""

import dataclasses
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import trimesh

import perturb
from perturb import testing
from perturb.testing import check_perturbation, default_meshes
from tests.helpers.meshes import bundled

UNITS = {"unit": ("mean_edge_length",)}
_OWN_GENERATOR = np.random.default_rng(0)


@dataclass(frozen=True)
class Sound(perturb.Perturbation):
    """A perturbation without mistakes, from which the broken ones derive: random displacements."""

    amount: float = 0.1
    unit: str = "mean_edge_length"

    name, choices = "sound_of_a_test", UNITS

    def sample(self, mesh, rng):
        return {"directions": rng.standard_normal((len(mesh.vertices), 3))}

    def displacement(self, mesh, parameters):
        return self.amount * perturb.LENGTHS["mean_edge_length"](mesh) * parameters["directions"]

    def apply(self, mesh, parameters):
        return self.finish(mesh, *perturb.moved(mesh, self.displacement(mesh, parameters)))


class NameInherited(Sound):
    pass


class UnitNotListed(Sound):
    name, choices = "unit_not_listed", {}


class BadVersion(Sound):
    name, version = "bad_version", 0


class BadNeutral(Sound):
    name, neutral = "bad_neutral", float("nan")


@dataclass(frozen=True)
class NotPicklable(Sound):
    function: Callable[[Any], Any] = lambda value: value

    name = "not_picklable"


@dataclass(frozen=True, eq=False)
class NotComparable(Sound):
    name = "not_comparable"

    def __eq__(self, other):
        return self is other

    __hash__ = object.__hash__


class UncheckedAmount(Sound):
    name = "unchecked_amount"

    def __post_init__(self):
        pass


@dataclass(frozen=True)
class UncheckedField(Sound):
    extent: float = 1.0

    name = "unchecked_field"


@dataclass(frozen=True)
class FieldRaisesAnotherError(Sound):
    style: str = "plain"

    name, choices = "field_raises_another_error", {**UNITS, "style": ("plain",)}

    def __post_init__(self):
        {"plain": 1}[self.style]
        super().__post_init__()


class UnusableMeshAccepted(Sound):
    name = "unusable_mesh_accepted"

    def __call__(self, mesh, rng):
        return perturb.Perturbed(mesh, np.arange(len(mesh.vertices)), {})


class UnusableMeshRaisesAnotherError(Sound):
    name = "unusable_mesh_raises_another_error"

    def __call__(self, mesh, rng):
        mesh.faces[0]
        return super().__call__(mesh, rng)


class RaisesAnotherError(Sound):
    name = "raises_another_error"

    def apply(self, mesh, parameters):
        raise KeyError("something")


class Refuses(Sound):
    name = "refuses"

    def apply(self, mesh, parameters):
        raise perturb.PerturbationError("refuses: too little")


class ReturnsTuple(Sound):
    name = "returns_tuple"

    def apply(self, mesh, parameters):
        return perturb.moved(mesh, self.displacement(mesh, parameters))


@dataclass(frozen=True)
class BreaksResult(Sound):
    """Changes a sound result after `finish` has checked it."""

    name = "breaks_result"

    def apply(self, mesh, parameters):
        result = super().apply(mesh, parameters)
        return dataclasses.replace(result, **self.change(mesh, result))

    def change(self, mesh, result):
        raise NotImplementedError


class MeshOfAnotherType(BreaksResult):
    name = "mesh_of_another_type"

    def change(self, mesh, result):
        return {"mesh": trimesh.PointCloud(result.mesh.vertices)}


class NotFinite(BreaksResult):
    name = "not_finite"

    def change(self, mesh, result):
        vertices = np.array(result.mesh.vertices)
        vertices[3, 1] = np.nan
        return {"mesh": perturb.as_trimesh(vertices, mesh.faces)}


class NoFaces(BreaksResult):
    name = "no_faces"

    def change(self, mesh, result):
        return {"mesh": perturb.as_trimesh(mesh.vertices, np.empty((0, 3)))}


class FacesOutOfRange(BreaksResult):
    name = "faces_out_of_range"

    def change(self, mesh, result):
        return {"mesh": perturb.as_trimesh(mesh.vertices, mesh.faces + 1)}


class InputChanged(Sound):
    name = "input_changed"

    def apply(self, mesh, parameters):
        result = super().apply(mesh, parameters)
        mesh.vertices += self.amount
        return result


class InputReordered(Sound):
    name = "input_reordered"

    def apply(self, mesh, parameters):
        result = super().apply(mesh, parameters)
        mesh.faces = np.roll(mesh.faces, 1, axis=1)
        return result


class FacesShared(BreaksResult):
    name = "faces_shared"

    def change(self, mesh, result):
        return {"mesh": trimesh.Trimesh(result.mesh.vertices, mesh.faces, process=False)}


class VerticesShared(BreaksResult):
    name = "vertices_shared"

    def change(self, mesh, result):
        return {"mesh": trimesh.Trimesh(mesh.vertices, mesh.faces.copy(), process=False)}


class CounterpartOfAnotherType(BreaksResult):
    name = "counterpart_of_another_type"

    def change(self, mesh, result):
        return {"counterpart": result.counterpart.astype(np.int32)}


class CounterpartOfTheResult(BreaksResult):
    name = "counterpart_of_the_result"

    def change(self, mesh, result):
        return {"counterpart": result.counterpart[1:]}


class CounterpartOutOfRange(BreaksResult):
    name = "counterpart_out_of_range"

    def change(self, mesh, result):
        return {"counterpart": result.counterpart + 1}


class CounterpartBelowMinusOne(BreaksResult):
    name = "counterpart_below_minus_one"

    def change(self, mesh, result):
        return {"counterpart": result.counterpart - 2}


class CounterpartNotInjective(BreaksResult):
    name = "counterpart_not_injective"

    def change(self, mesh, result):
        return {"counterpart": result.counterpart // 2}


class Processed(Sound):
    """Lets trimesh merge vertices."""

    name = "processed"

    def apply(self, mesh, parameters):
        vertices = mesh.vertices + self.amount * perturb.LENGTHS["mean_edge_length"](mesh)
        return self.finish(mesh, trimesh.Trimesh(vertices, mesh.faces), np.arange(len(mesh.vertices)))


class AppliedWithArray(BreaksResult):
    name = "applied_with_array"

    def change(self, mesh, result):
        return {"applied": {**result.applied, "indices": np.arange(3)}}


class AppliedWithNumpyScalar(BreaksResult):
    name = "applied_with_numpy_scalar"

    def change(self, mesh, result):
        return {"applied": {**result.applied, "share": np.float64(0.5)}}


class AppliedWithNan(BreaksResult):
    name = "applied_with_nan"

    def change(self, mesh, result):
        return {"applied": {**result.applied, "share": float("nan")}}


class AppliedWithIntegerKey(BreaksResult):
    name = "applied_with_integer_key"

    def change(self, mesh, result):
        return {"applied": {**result.applied, 1: "one"}}


class AppliedWithoutUnit(BreaksResult):
    name = "applied_without_unit"

    def change(self, mesh, result):
        return {"applied": {key: value for key, value in result.applied.items() if key != "unit"}}


class AppliedWithAnotherAmount(BreaksResult):
    name = "applied_with_another_amount"

    def change(self, mesh, result):
        return {"applied": {**result.applied, "amount": 7.0}}


class AppliedWithWrongCount(BreaksResult):
    name = "applied_with_wrong_count"

    def change(self, mesh, result):
        return {"applied": {**result.applied, "faces_after": 1}}


class ResultNotPicklable(BreaksResult):
    name = "result_not_picklable"

    def change(self, mesh, result):
        copied = perturb.as_trimesh(result.mesh.vertices, mesh.faces)
        copied.metadata["function"] = lambda: None
        return {"mesh": copied}


class GlobalNumpyUsed(Sound):
    name = "global_numpy_used"

    def sample(self, mesh, rng):
        return {"directions": np.random.standard_normal((len(mesh.vertices), 3))}  # noqa: NPY002


class GlobalRandomSeeded(Sound):
    name = "global_random_seeded"

    def sample(self, mesh, rng):
        random.seed(0)
        return super().sample(mesh, rng)


class RandomApply(Sound):
    name = "random_apply"

    def apply(self, mesh, parameters):
        directions = _OWN_GENERATOR.standard_normal((len(mesh.vertices), 3))
        return super().apply(mesh, {"directions": directions})


class SeedIgnored(Sound):
    name = "seed_ignored"

    def sample(self, mesh, rng):
        return super().sample(mesh, np.random.default_rng())


class DependsOnEarlierCalls(Sound):
    name, calls = "depends_on_earlier_calls", []

    def sample(self, mesh, rng):
        self.calls.append(len(mesh.vertices))
        return {"directions": len(self.calls) * rng.standard_normal((len(mesh.vertices), 3))}


class CallIsNotSampleAndApply(Sound):
    name = "call_is_not_sample_and_apply"

    def __call__(self, mesh, rng):
        rng.random()
        return super().__call__(mesh, rng)


class ParametersChanged(Sound):
    name = "parameters_changed"

    def apply(self, mesh, parameters):
        result = super().apply(mesh, parameters)
        parameters["directions"] *= 2
        return result


class ParametersNotADict(Sound):
    name = "parameters_not_a_dict"

    def sample(self, mesh, rng):
        return rng.standard_normal((len(mesh.vertices), 3))

    def displacement(self, mesh, parameters):
        return super().displacement(mesh, {"directions": parameters})


class NotNeutral(Sound):
    name = "not_neutral"

    def displacement(self, mesh, parameters):
        return perturb.LENGTHS["mean_edge_length"](mesh) * parameters["directions"]


class ReordersWhenNeutral(Sound):
    name = "reorders_when_neutral"

    def apply(self, mesh, parameters):
        moved = mesh.vertices + self.displacement(mesh, parameters)
        return self.finish(
            mesh, perturb.as_trimesh(moved[::-1], len(moved) - 1 - mesh.faces), np.arange(len(moved))[::-1]
        )


class Absolute(Sound):
    name = "absolute"

    def displacement(self, mesh, parameters):
        return 0.01 * self.amount * parameters["directions"]


BROKEN = [
    (NameInherited, "has no name of its own"),
    (BadVersion, r"version is 0; it must be a whole number of at least 1"),
    (BadNeutral, "neutral is nan"),
    (UnitNotListed, r"the unit 'mean_edge_length' is not in choices\['unit'\]"),
    (NotPicklable, "cannot be pickled, as needed for worker processes"),
    (NotComparable, "differs from a perturbation equal to it"),
    (UncheckedAmount, r"UncheckedAmount with amount=-1: was accepted; it must raise PerturbationError"),
    (UncheckedField, r"UncheckedField with extent=nan: was accepted.*self\.check_number\('extent'\)"),
    (FieldRaisesAnotherError, r"style='no such choice': raised KeyError: .*it must raise PerturbationError"),
    (UnusableMeshAccepted, "on a mesh without faces: was accepted"),
    (UnusableMeshRaisesAnotherError, "on a mesh without faces: raised IndexError"),
    (RaisesAnotherError, "on the mesh 'pipe': raised KeyError: 'something'"),
    (Refuses, "raised PerturbationError: refuses: too little; choose another amount, or pass meshes that allow it"),
    (ReturnsTuple, r"returned a tuple; return self\.finish"),
    (MeshOfAnotherType, "the resulting mesh is a PointCloud"),
    (NotFinite, "1 vertices of the result are not finite"),
    (NoFaces, "the result has no face"),
    (FacesOutOfRange, "faces of the result refer to vertices 1 to 896, but it has 896 vertices"),
    (InputChanged, "the input mesh was changed"),
    (InputReordered, "the input mesh was changed"),
    (FacesShared, "shares its faces with the input mesh"),
    (VerticesShared, "shares its vertices with the input mesh"),
    (CounterpartOfAnotherType, "counterpart is not an int64 array but int32"),
    (CounterpartOfTheResult, r"counterpart has the shape \(895,\), expected \(896,\)"),
    (CounterpartOutOfRange, "counterpart has values from 1 to 896; the result has 896 vertices"),
    (CounterpartBelowMinusOne, "counterpart has values from -2 to 893"),
    (CounterpartNotInjective, "896 vertices have a counterpart, but these are only 448 different vertices"),
    (Processed, "on the mesh 'torn pipe': raised ValueError: processed: counterpart has values from 0 to 932"),
    (AppliedWithArray, r"applied\['indices'\] is array\(\[0, 1, 2\]\), a ndarray"),
    (AppliedWithNumpyScalar, r"applied\['share'\] is np\.float64\(0\.5\), a float64"),
    (AppliedWithNan, "applied cannot be written as JSON"),
    (AppliedWithIntegerKey, "applied does not survive JSON; its keys must be strings"),
    (AppliedWithoutUnit, r"applied\['unit'\] is 'missing', expected 'mean_edge_length'"),
    (AppliedWithAnotherAmount, r"applied\['amount'\] is 7\.0, expected 0\.1"),
    (AppliedWithWrongCount, r"applied\['faces_after'\] is 1, expected 1792"),
    (ResultNotPicklable, "raised .*lambda"),
    (GlobalNumpyUsed, r"the global generator of numpy\.random was used"),
    (GlobalRandomSeeded, "the global generator of random was used"),
    (SeedIgnored, "two runs with the seed 0 yield different results"),
    (DependsOnEarlierCalls, "two runs with the seed 0 yield different results"),
    (RandomApply, "two runs with the seed 0 yield different results"),
    (CallIsNotSampleAndApply, "apply with the parameters of sample yields another result than calling"),
    (ParametersChanged, "apply changed its parameters"),
    (ParametersNotADict, "sample returned a ndarray"),
    (NotNeutral, r"at the neutral amount 0\.0 the mesh or its order of vertices and faces changes"),
    (ReordersWhenNeutral, r"at the neutral amount 0\.0 the mesh or its order of vertices and faces changes"),
    (Absolute, "the mesh scaled by 9.09495e-13 is perturbed differently"),
]


def test_a_sound_perturbation_passes():
    check_perturbation(Sound())


@pytest.mark.parametrize(("cls", "message"), BROKEN, ids=lambda value: getattr(value, "__name__", ""))
def test_a_mistake_is_found_and_described(cls, message):
    with pytest.raises(AssertionError, match=message) as error:
        check_perturbation(cls())
    assert cls.__name__ in str(error.value)
    assert "\n" not in str(error.value)


def test_every_contract_is_violated_by_a_broken_perturbation():
    checks = {check.__name__ for check in (*testing._CHECKS_WITHOUT_A_MESH, *testing._CHECKS_ON_A_MESH)}
    failing = set()
    for cls, _ in BROKEN:
        with pytest.raises(AssertionError) as error:
            check_perturbation(cls())
        failing |= {entry.name for entry in error.traceback}
    assert checks <= failing


def test_a_function_is_not_a_perturbation():
    with pytest.raises(AssertionError, match=r"is not an instance of a subclass of perturb\.Perturbation"):
        check_perturbation(lambda mesh, rng: mesh)


def test_the_neutral_amount_is_refused_because_it_shows_nothing():
    with pytest.raises(AssertionError, match="the amount 0 is the neutral one"):
        check_perturbation(Sound(0))


def test_a_class_whose_name_was_taken_over_is_found(own_registry):
    perturb.perturbation._REGISTRY["sound_of_a_test"] = perturb.Holes
    with pytest.raises(AssertionError, match="the name 'sound_of_a_test' is registered for another class"):
        check_perturbation(Sound())


def test_shared_counterparts_are_allowed_if_applied_specifies_how_they_were_found():
    check_perturbation(perturb.Decimation(0.4, backend="pymeshlab"))


def test_meshes_can_be_passed_with_and_without_labels():
    tetrahedron = perturb.as_trimesh(np.eye(4, 3), [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    with pytest.raises(AssertionError, match=r"on the mesh '1': .*58 triangles were requested, but the mesh has 4"):
        check_perturbation(perturb.Holes(58), [bundled("ant"), tetrahedron])
    with pytest.raises(AssertionError, match="on the mesh 'small': "):
        check_perturbation(perturb.Holes(58), {"small": tetrahedron})


def test_an_empty_collection_of_meshes_is_refused():
    with pytest.raises(ValueError, match="meshes is empty"):
        check_perturbation(Sound(), [])


def test_the_passed_meshes_are_left_unchanged_even_by_a_broken_perturbation():
    mesh = bundled("ant")
    before = np.array(mesh.vertices)
    with pytest.raises(AssertionError, match="the input mesh was changed"):
        check_perturbation(InputChanged(), [mesh])
    np.testing.assert_array_equal(mesh.vertices, before)


def test_the_default_meshes_have_a_boundary_components_duplicates_and_an_unreferenced_vertex():
    pipe, spheres, torn = default_meshes().values()
    assert pipe.is_watertight
    assert pipe.euler_number == 0
    assert (spheres.is_watertight, spheres.euler_number) == (True, 4)
    assert not torn.is_watertight
    assert np.setdiff1d(np.arange(len(torn.vertices)), torn.faces).tolist() == [0]
    assert len(np.unique(torn.vertices, axis=0)) < len(torn.vertices)
    assert len(trimesh.graph.connected_components(torn.edges_unique)) == 2


def test_the_default_meshes_are_the_same_every_time():
    for first, second in zip(default_meshes().values(), default_meshes().values(), strict=True):
        np.testing.assert_array_equal(first.vertices, second.vertices)
        np.testing.assert_array_equal(first.faces, second.faces)
