"""A sound perturbation, and broken ones: each violates one contract. Importing this module registers all of them."""

import dataclasses
import random
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import trimesh

import perturb

UNITS = {"unit": ("mean_edge_length",)}
_OWN_GENERATOR = np.random.default_rng(0)


@dataclass(frozen=True)
class Sound(perturb.Perturbation):
    """A perturbation without mistakes, from which the broken ones derive: random displacements."""

    amount: float = 0.1
    unit: str = "mean_edge_length"

    name, choices = "sound", UNITS

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


class BadLaterFields(Sound):
    name, later_fields = "bad_later_fields", ("amuont",)


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


class KeepsWhatItApplied(Sound):
    """Each call of an equal perturbation is right, and so is the first application by one that is kept."""

    name = "keeps_what_it_applied"

    def apply(self, mesh, parameters):
        factor = self.__dict__.setdefault("factor", [1.0])
        result = super().apply(mesh, parameters | {"directions": factor[0] * parameters["directions"]})
        factor[0] *= 2
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
