import random

import pytest

from studies.planning.plan import StudyError, digest, digests, plan
from tests.helpers.meshes import bundled


def small(composed, *overrides):
    return composed("+study=shot_noise", "dataset.models=[ant,cow]", "levels=[0.1,0.2]", "repeats=2", *overrides)


def test_a_plan_has_each_model_level_and_repeat_once(composed):
    trials = plan(small(composed))
    assert [(t.model.name, t.level, t.repeat) for t in trials] == [
        (model, level, repeat) for model in ("ant", "cow") for level in (0.1, 0.2) for repeat in (0, 1)
    ]
    assert all(t.perturbation.amount == t.level for t in trials)
    assert len({t.trial_id for t in trials}) == len({t.seed for t in trials}) == len(trials)


def test_seeds_and_ids_do_not_depend_on_what_else_is_planned(composed):
    whole = {(t.model.name, t.level, t.repeat): (t.seed, t.trial_id) for t in plan(small(composed))}
    part = plan(composed("+study=shot_noise", "dataset.models=[cow]", "levels=[0.3,0.2]", "repeats=1"))
    random.shuffle(part)
    for t in part:
        if t.level == 0.2:
            assert (t.seed, t.trial_id) == whole[("cow", 0.2, 0)]


def test_digests_that_differ_in_numbers_are_those_of_the_whole():
    what, rest = ("holes", ["ant", "π"], {"b": None, "a": 0.1}), ({"b": [1.5, "é"], "a": {}}, 4, "x")
    assert digests(what, rest)(3, 10**17) == digest(*what, 3, 10**17, *rest)
    assert digests(what)(5) == digest("holes", ["ant", "π"], {"a": 0.1, "b": None}, 5)


def test_a_plan_is_the_same_every_time(composed):
    assert [t.trial_id for t in plan(small(composed))] == [t.trial_id for t in plan(small(composed))]


@pytest.mark.parametrize("change", ["segmenter.time=2", "perturbation.height=2", "segmenter.density=area"])
def test_whatever_changes_the_result_changes_the_id_and_leaves_the_seed(composed, change):
    before, after = plan(small(composed)), plan(small(composed, change))
    assert not {t.trial_id for t in before} & {t.trial_id for t in after}
    assert [t.seed for t in before] == [t.seed for t in after]


def test_a_new_version_of_a_perturbation_changes_the_id_and_leaves_the_seed(composed, monkeypatch):
    before = plan(small(composed))
    monkeypatch.setattr("perturb.ShotNoise.version", 2)
    after = plan(small(composed))
    assert not {t.trial_id for t in before} & {t.trial_id for t in after}
    assert [t.seed for t in before] == [t.seed for t in after]


@pytest.mark.parametrize("change", ["engine.workers=1", "engine=serial", "results_dir=elsewhere", "gallery.models=0"])
def test_what_does_not_change_the_result_leaves_the_id(composed, change):
    assert [t.trial_id for t in plan(small(composed))] == [t.trial_id for t in plan(small(composed, change))]


def test_another_field_than_the_amount_can_be_swept(composed):
    trials = plan(
        composed("+study=shot_noise", "swept=height", "levels=[0.5,2]", "repeats=1", "perturbation.amount=0.06")
    )
    assert {(t.perturbation.amount, t.perturbation.height, t.unit) for t in trials} == {
        (0.06, 0.5, "mean_edge_length"),
        (0.06, 2, "mean_edge_length"),
    }


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("levels=[]", "levels is empty"),
        ("levels=[0.1,0.1]", "levels holds a value twice"),
        ("repeats=0", "repeats is 0"),
        ("repeats=1.5", "repeats is 1.5"),
    ],
)
def test_what_makes_no_trial_is_an_error(composed, option, message):
    with pytest.raises(StudyError, match=message):
        plan(composed("+study=shot_noise", option))


def test_two_models_of_the_same_mesh_are_different_trials(composed, tmp_path):
    for name in ("one", "two"):
        bundled("ant").export(tmp_path / f"{name}.off")
    trials = plan(
        composed("+study=shot_noise", "dataset=files", f"dataset.glob={tmp_path}", "levels=[0.1]", "repeats=1")
    )
    assert len({t.mesh for t in trials}) == 1
    assert len({t.trial_id for t in trials}) == len({t.seed for t in trials}) == 2
