"""What the ids of trials depend on."""

import pytest

from studies.planning.fingerprint import with_version

OWN = """
from dataclasses import dataclass, replace
from typing import ClassVar
from studies.experiments.anatomy import Anatomy

@dataclass(frozen=True, kw_only=True)
class Walks(Anatomy):
    pass

@dataclass(frozen=True, kw_only=True)
class Numbered(Anatomy):
    version: ClassVar[int] = 1
"""


@pytest.fixture
def ids_of(own_modules, monkeypatch, plan):
    """A function: name of a module, its code, class, options -> the trial_ids that a study of that class plans."""
    monkeypatch.chdir(own_modules)

    def ids(module, code, name):
        (own_modules / f"{module}.py").write_text(code)
        words = ("+study=custom", "study.name=anatomy", f"experiment._target_={module}.{name}", "engine=serial")
        return [trial.trial_id for trial in plan(*words)]

    return ids


def test_ids_of_an_experiment_of_ones_own_depend_on_its_code(ids_of):
    first = ids_of("first", OWN, "Walks")
    assert first == ids_of("first", OWN, "Walks")
    assert len(set(first)) == 3
    assert all(len(trial_id) == 24 for trial_id in first)
    changed = ids_of("second", OWN.replace("pass", "steps: int = 3"), "Walks")
    assert not set(first) & set(changed)


def test_ids_of_an_experiment_that_declares_a_version_depend_on_that_alone(ids_of):
    first = ids_of("first", OWN, "Numbered")
    assert first == ids_of("second", OWN + "\n\nUNRELATED = 1\n", "Numbered")
    assert not set(first) & set(ids_of("third", OWN.replace("int] = 1", "int] = 2"), "Numbered"))


def test_ids_of_shipped_experiments_are_those_that_they_plan(configured):
    study = configured("+study=anatomy", "engine=serial", "dataset.models=[cow]")
    (planned,) = study.experiment.plan(study.name, study.dataset, study.segmenters)
    assert study.plan() == [planned]
    assert with_version(planned, study.experiment) is planned
