import hashlib
import itertools
import json
import random

import pytest

import perturb
from studies.planning.errors import StudyError
from studies.planning.fingerprint import digest, digest_of_code
from tests.helpers.meshes import bundled

SMALL = ("+study=shot_noise", "dataset.models=[ant,cow]", "levels=[0.1,0.2]", "repeats=2")


def test_a_plan_has_each_model_level_and_repeat_once(plan):
    trials = plan(*SMALL)
    assert [(t.model.name, t.level, t.repeat) for t in trials] == [
        (model, level, repeat) for model in ("ant", "cow") for level in (0.1, 0.2) for repeat in (0, 1)
    ]
    assert all(t.perturbation.amount == t.level for t in trials)
    assert len({t.trial_id for t in trials}) == len({t.seed for t in trials}) == len(trials)


def test_seeds_and_ids_do_not_depend_on_what_else_is_planned(plan):
    whole = {(t.model.name, t.level, t.repeat): (t.seed, t.trial_id) for t in plan(*SMALL)}
    part = plan("+study=shot_noise", "dataset.models=[cow]", "levels=[0.3,0.2]", "repeats=1")
    random.shuffle(part)
    for t in part:
        if t.level == 0.2:
            assert (t.seed, t.trial_id) == whole[("cow", 0.2, 0)]


def test_several_segmenters_are_planned_with_the_same_seeds_and_ids_as_alone(plan):
    several = plan(*SMALL, "segmenters=[heat_walk,tests.helpers.segmenting.halves]")
    alone = plan(*SMALL)
    halves = plan(*SMALL, "segmenter=custom", "segmenter._target_=tests.helpers.segmenting.halves")
    by_method = {name: [t for t in several if t.segmenter_name == name] for name in ("HeatWalk", "halves")}
    assert [t.trial_id for t in by_method["HeatWalk"]] == [t.trial_id for t in alone]
    assert [t.trial_id for t in by_method["halves"]] == [t.trial_id for t in halves]
    assert [t.seed for t in by_method["HeatWalk"]] == [t.seed for t in by_method["halves"]]


def test_trials_of_one_group_are_consecutive(plan):
    keys = [t.group_key for t in plan(*SMALL, "segmenters=[heat_walk,tests.helpers.segmenting.halves]")]
    assert sum(one != other for one, other in itertools.pairwise(keys)) == len(set(keys)) - 1


def test_options_of_a_segmenter_among_several_are_used(plan):
    several = plan(*SMALL, "segmenters=[tests.helpers.segmenting.halves,heat_walk]", "segmenter.time=2")
    assert {t.segmenter.method.time for t in several if t.segmenter_name == "HeatWalk (time=2)"} == {2}


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["segmenters=[heat_walk,heat_walk]"], "contains HeatWalk twice"),
        (
            ["segmenters=[walk]"],
            "contains 'walk', which is neither one of .*custom, .*external, .*heat_walk, .* nor a",
        ),
        (["segmenters=heat_walk"], "must be a list"),
        (["segmenters=[]"], "must be a list"),
        (["segmenters=[tests.helpers.segmenting.halves]", "segmenter.time=2"], "does not contain heat_walk"),
    ],
)
def test_segmenters_that_cannot_be_compared_are_an_error(plan, words, message):
    with pytest.raises(StudyError, match=message):
        plan(*SMALL, *words)


def test_a_digest_is_that_of_the_json():
    text = json.dumps(["holes", {"a": 0.1, "b": None}, 3])
    assert digest("holes", {"b": None, "a": 0.1}, 3) == hashlib.sha256(text.encode()).hexdigest()


def test_the_digest_of_code_is_of_the_whole_package(own_modules, monkeypatch):
    monkeypatch.syspath_prepend(own_modules)
    package = own_modules / "my_digested"
    package.mkdir()
    (package / "__init__.py").write_text("def method(vertices, faces): ...\n")
    (package / "helper.py").write_text("A = 1\n")
    import my_digested

    before = digest_of_code(my_digested.method)
    (package / "helper.py").write_text("A = 2\n")
    assert digest_of_code(my_digested.method) != before


def test_a_plan_is_the_same_every_time(plan):
    assert [t.trial_id for t in plan(*SMALL)] == [t.trial_id for t in plan(*SMALL)]


@pytest.mark.parametrize("change", ["segmenter.time=2", "perturbation.height=2", "segmenter.density=area"])
def test_whatever_changes_the_result_changes_the_id_and_leaves_the_seed(plan, change):
    before, after = plan(*SMALL), plan(*SMALL, change)
    assert not {t.trial_id for t in before} & {t.trial_id for t in after}
    assert [t.seed for t in before] == [t.seed for t in after]


def test_a_new_version_of_a_perturbation_changes_the_id_and_leaves_the_seed(plan, monkeypatch):
    before = plan(*SMALL)
    monkeypatch.setattr("perturb.ShotNoise.version", 99)
    after = plan(*SMALL)
    assert not {t.trial_id for t in before} & {t.trial_id for t in after}
    assert [t.seed for t in before] == [t.seed for t in after]


@pytest.mark.parametrize(
    "change", ["engine.workers=1", "engine=serial", "results_dir=other", "gallery.models=0", "publication=null"]
)
def test_what_does_not_change_the_result_leaves_the_id(plan, change):
    assert [t.trial_id for t in plan(*SMALL)] == [t.trial_id for t in plan(*SMALL, change)]


def test_another_field_than_the_amount_can_be_swept(plan):
    trials = plan("+study=shot_noise", "swept=height", "levels=[0.5,2]", "repeats=1", "perturbation.amount=0.06")
    assert {(t.perturbation.amount, t.perturbation.height, t.unit) for t in trials} == {
        (0.06, 0.5, "mean_edge_length"),
        (0.06, 2, "mean_edge_length"),
    }


@pytest.mark.parametrize(
    ("option", "message"),
    [
        ("levels=[]", "levels is empty"),
        ("levels=[0.1,0.1]", "levels contains a value twice"),
        ("levels=5", "levels is 5: it must be a list"),
        ("levels=[[5]]", r"levels contains \[5\], which is not a number"),
        ("repeats=0", "repeats is 0"),
        ("repeats=1.5", "repeats is 1.5"),
        ("gallery.style=pretty", "gallery.style is 'pretty'"),
        ("swept=width", "swept is 'width': it must be one of amount, unit, height"),
        ("publication=mine", "publication is 'mine': it must be null or one of heat_walk_2011"),
        ("on_error=stopp", "on_error is 'stopp': it must be one of continue, stop"),
    ],
)
def test_what_makes_no_trial_is_an_error(plan, option, message):
    with pytest.raises(StudyError, match=message):
        plan("+study=shot_noise", option)


def test_two_models_of_the_same_mesh_are_different_trials(plan, tmp_path):
    for name in ("one", "two"):
        bundled("ant").export(tmp_path / f"{name}.off")
    trials = plan("+study=shot_noise", "dataset=files", f"dataset.glob={tmp_path}", "levels=[0.1]", "repeats=1")
    assert len({t.mesh_digest for t in trials}) == 1
    assert len({t.trial_id for t in trials}) == len({t.seed for t in trials}) == 2


def test_options_that_came_later_change_no_trial_at_their_default_and_others_do(plan):
    def ids(*words):
        return [trial.trial_id for trial in plan("+study=short_circuits", "dataset.models=[ant]", *words)]

    usual = ids()
    assert ids("~perturbation.where") == usual
    assert ids("perturbation.where=any", "perturbation.ratio=null") == usual
    for words in (["perturbation.where=internal"], ["perturbation.ratio=1.5"], ["perturbation.bridge=triangle"]):
        assert not set(ids(*words)) & set(usual)


def test_the_two_readings_of_table_2_are_parts_beside_the_usual_one(plan):
    trials = plan("+study=table2", "dataset=bundled", "dataset.models=[ant]", "repeats=1", "gallery.models=0")
    tubes = {trial.part: trial.perturbation for trial in trials if trial.perturbation_name == "short_circuits"}
    assert list(tubes) == ["short_circuits", "internal_tubes", "single_triangles"]
    assert [(each.amount, each.near, each.ratio, each.where, each.bridge) for each in tubes.values()] == [
        (10, 0.05, None, "any", "tube"),
        (10, 0.06, 1.5, "internal", "tube"),
        (10, 0.06, 1.5, "any", "triangle"),
    ]
    assert tubes["short_circuits"] == perturb.ShortCircuits()


def test_what_the_steps_of_a_composite_are_and_their_versions_determine_its_trials(plan, monkeypatch):
    def ids(*words):
        small = ("+study=composite", "dataset.models=[ant]", "levels=[0.5,1]", "repeats=1")
        return {trial.trial_id for trial in plan(*small, *words)}

    usual = ids()
    two = "perturbation.steps=[{_target_:perturb.NormalNoise,amount:0.3},{_target_:perturb.Decimation,amount:0.5}]"
    others = [ids(two), ids(two.replace("0.5", "0.6"))]
    monkeypatch.setattr(perturb.NormalNoise, "version", 99)
    others.append(ids())
    assert len(set().union(usual, *others)) == 2 * 4
