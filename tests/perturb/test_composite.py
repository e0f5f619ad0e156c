"""Composites: steps in a row, their draws, counterparts and amounts."""

import dataclasses
import pickle

import hydra
import numpy as np
import pytest

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

ANT = bundled("ant")
STEPS = (
    perturb.MissingParts(0.1),
    perturb.NormalNoise(0.2),
    perturb.Holes(30),
    perturb.Floaters(5, "count"),
    perturb.Decimation(0.6),
)


def test_it_equals_the_steps_one_after_the_other_with_the_same_generator():
    result = perturb.Composite(steps=STEPS)(ANT, rng())
    mesh, generator = ANT, rng()
    counterparts = []
    for number, step in enumerate(STEPS, start=1):
        done = step(mesh, generator)
        for key, value in done.applied.items():
            assert result.applied[f"step_{number}_{key}"] == value
        mesh = done.mesh
        counterparts.append(done.counterpart.tolist())
    np.testing.assert_array_equal(result.mesh.vertices, mesh.vertices)
    np.testing.assert_array_equal(result.mesh.faces, mesh.faces)
    for vertex, found in enumerate(result.counterpart.tolist()):
        for counterpart in counterparts:
            vertex = counterpart[vertex] if vertex >= 0 else -1
        assert found == vertex
    assert (result.counterpart == -1).any()
    assert result.applied["counterpart_by"] == "collapses"


def test_a_composite_of_one_step_is_that_step():
    step = perturb.ShotNoise(0.2)
    alone, composed = step(ANT, rng(3)), perturb.Composite(steps=[step])(ANT, rng(3))
    np.testing.assert_array_equal(composed.mesh.vertices, alone.mesh.vertices)
    assert "counterpart_by" not in composed.applied
    nested = perturb.Composite(steps=[perturb.Composite(steps=[step])])(ANT, rng(3))
    np.testing.assert_array_equal(nested.mesh.vertices, alone.mesh.vertices)
    assert nested.applied["step_1_step_1_amount"] == 0.2


@pytest.mark.parametrize(
    ("share", "amounts"), [(0.0, (0, 0, 0, 0, 1)), (0.5, (0.05, 0.1, 15, 2, 0.8)), (1.0, (0.1, 0.2, 30, 5, 0.6))]
)
def test_amounts_are_between_the_neutral_one_and_that_of_the_step(share, amounts):
    scaled = perturb.Composite(share, steps=STEPS).scaled_steps()
    assert [step.amount for step in scaled] == pytest.approx(amounts)
    for step, before in zip(scaled, STEPS, strict=True):
        assert dataclasses.replace(step, amount=before.amount) == before


def test_steps_can_be_a_list_in_yaml():
    steps = [{"_target_": "perturb.Holes", "amount": 7}, {"_target_": "perturb.Scaling", "amount": 2.0}]
    config = {"_target_": "perturb.Composite", "_convert_": "all", "amount": 0.5, "steps": steps}
    made = hydra.utils.instantiate(config)
    assert made == perturb.Composite(0.5, steps=[perturb.Holes(7), perturb.Scaling(2.0)])
    assert hash(made) == hash(pickle.loads(pickle.dumps(made)))


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        ([], "steps is empty"),
        ("holes", "steps is 'holes'; it must be a list of perturbations"),
        (perturb.Holes(3), "it must be a list of perturbations"),
        ([perturb.Holes(3), {"amount": 1}], "step 2 is .*; it must be a perturbation"),
    ],
)
def test_steps_that_are_no_perturbations_are_refused(steps, message):
    with pytest.raises(PerturbationError, match=message):
        perturb.Composite(steps=steps)


def test_a_step_that_cannot_have_its_share_is_refused_when_built():
    with pytest.raises(PerturbationError, match=r"tessellation: amount is 2, but subdivision makes 4, 16, 64"):
        perturb.Composite(0.5, steps=[perturb.Tessellation(4, method="subdivision")])


def test_a_step_that_the_mesh_does_not_allow_is_named():
    with pytest.raises(PerturbationError, match=r"holes: 10000 triangles were requested, but the mesh has 91\d"):
        perturb.Composite(steps=[perturb.NormalNoise(0.1), perturb.Holes(10000)])(ANT, rng())
