import hashlib
import json

import numpy as np
import pytest

from studies.experiments.change import Change, ChangeTrial
from studies.planning.plan import ListedBlock, Plan
from studies.planning.trial_ids import TrialIds


def example_ids(n, seed=0):
    packed = np.random.default_rng(seed).integers(0, 256, (n, 12), dtype=np.uint8)
    packed[:, :8] = packed[:, :8] % 2  # many have the same first eight bytes
    return [each.tobytes().hex() for each in packed]


@pytest.mark.parametrize("ids", [example_ids(2000), [], ["a", "b"], [*example_ids(5), "x"]])
def test_ids_are_the_sequence_that_they_were_made_of(ids):
    made = TrialIds(ids)
    text = "".join(f"{each}\n" for each in ids).encode()
    assert list(made) == ids == list(TrialIds.of_lines(text))
    assert len(made) == len(ids)
    assert b"".join(made.lines()) == text
    assert list(TrialIds.joined([made, TrialIds(ids[:3])])) == [*ids, *ids[:3]]
    assert list(made[1:3]) == ids[1:3]
    assert [made[i] for i in range(len(ids))] == ids


@pytest.mark.parametrize("others", [example_ids(900, 1), ["text"]])
def test_positions_are_those_of_a_dict(others):
    ids = example_ids(2000) + example_ids(300)
    asked = others + ids[::7]
    position = {each: i for i, each in enumerate(ids)}
    assert TrialIds(ids).positions(TrialIds(asked)).tolist() == [position.get(each, -1) for each in asked]


@pytest.mark.parametrize("overrides", [
    ("+study=normal_noise", "repeats=3"),
    ("+study=table2", "repeats=2", "segmenters=[heat_walk,kmeans]"),
    ("+study=holes", "dataset.models=[ant]"),
])  # fmt: skip
def test_ids_and_seeds_of_a_plan_are_those_of_each_trial_digested_alone(configured, overrides):
    study = configured(*overrides)
    plan = study.plan_blocks()
    trials = list(plan)
    assert list(plan.ids) == [trial.trial_id for trial in trials]
    assert len(set(plan.ids)) == len(plan)
    levels = [
        (name, level, perturbation, part.recipe(perturbation))
        for name, part in study.experiment.named_parts(study.name).items()
        for level, perturbation in part.at_levels(name)
    ]
    expected = []
    for model in study.dataset.models():
        for segmenter in study.segmenters:
            for name, level, perturbation, recipe in levels:
                for repeat in range(study.experiment.repeats):
                    identity = [model.name, model.digest()]
                    seed = int(sha([name, identity, perturbation.name, level, repeat])[:15], 16)
                    method = segmenter.for_model(model).fingerprint
                    trial_id = sha([name, identity, recipe, level, repeat, seed, *method])[:24]
                    draw = sha([name, identity, recipe, level, repeat, seed])[:24]
                    expected.append((model.name, segmenter.name, name, level, repeat, seed, draw, trial_id))
    assert expected == [
        (t.model.name, t.segmenter_name, t.part, t.level, t.repeat, t.seed, t.draw, t.trial_id) for t in trials
    ]
    assert all(isinstance(trial, ChangeTrial) for trial in trials)
    assert isinstance(study.experiment, Change)


def test_a_part_of_a_plan_has_the_trials_and_the_groups_of_that_part(configured):
    plan = configured("+study=normal_noise", "repeats=3").plan_blocks()
    trials = list(plan)
    mask = np.random.default_rng(0).random(len(plan)) < 0.4
    chosen = [trial for trial, keep in zip(trials, mask, strict=True) if keep]
    some = plan.where(mask)
    for part in (some, Plan([ListedBlock(trials)]).where(mask), some.where(np.ones(len(some), bool))):
        assert list(part) == chosen
        assert [part[i] for i in range(len(part))] == chosen
        assert list(part.ids) == [trial.trial_id for trial in chosen]
        groups = list(part.groups())
        assert [trial for group in groups for trial in group] == chosen
        assert all(len({trial.group_key for trial in group}) == 1 for group in groups)
        assert [group[0] for group in groups] == [next(iter(group)) for group in groups]


def sha(parts):
    return hashlib.sha256(json.dumps(parts, sort_keys=True).encode()).hexdigest()
