"""A study that needs what a dataset does not have says so before it runs."""

import pytest

from studies.planning.errors import StudyError
from tests.studies.conftest import typed

CUSTOM = """
import hashlib
import numpy as np
import trimesh
from dataclasses import dataclass
from heatwalk.io import LoadedMesh
from studies.datasets import Dataset, Model

@dataclass(frozen=True)
class Ball(Model):
    def load(self):
        mesh = trimesh.creation.icosphere(1)
        return LoadedMesh(np.array(mesh.vertices), np.array(mesh.faces), ())

    def digest(self):
        return hashlib.sha256(self.name.encode()).hexdigest()

@dataclass(frozen=True)
class Posed(Ball):
    def correspondence(self):
        return np.arange(42)

    def human_segmentations(self):
        return [np.zeros(80, int), np.arange(80) % 2]

class Balls(Dataset):
    name = "balls"

    def models(self):
        return [Ball("a", "ball"), Ball("b", "ball")]

class Poses(Dataset):
    name = "poses"

    def models(self):
        return [Posed("a", "ball"), Posed("b", "ball")]
"""


@pytest.fixture
def datasets(here, own_modules):
    """The options of datasets: bundled meshes, files, and one of the user's own, without anything but meshes."""
    (own_modules / "own_balls.py").write_text(CUSTOM)
    return {
        "bundled": ["dataset=bundled"],
        "files": ["dataset=files", "dataset.glob=*.off"],
        "balls": ["dataset=custom", "dataset._target_=own_balls.Balls"],
    }


@pytest.mark.parametrize("name", ["bundled", "files", "balls"])
@pytest.mark.parametrize(
    ("study", "needs"),
    [("pose", "the corresponding points of two poses of a shape"), ("table1", "segmentations by people")],
)
def test_a_study_says_what_a_dataset_does_not_have(plan, datasets, study, needs, name):
    with pytest.raises(StudyError, match=rf"^the study {study} needs {needs}, which the dataset {name} does not have"):
        plan(f"+study={study}", *datasets[name], "engine=serial")


def test_a_benchmark_without_poses_and_poses_without_people(plan, psb_zip, tosca_zip):
    lacking = "which the dataset {} does not have; {}$"
    with pytest.raises(StudyError, match=lacking.format("psb", "dataset=tosca and dataset=synthetic have them")):
        plan("+study=pose", "dataset=psb", f"dataset.root={psb_zip}", "dataset.models=[1,2]", "engine=serial")
    exact = "dataset=psb has them, and dataset=synthetic has exact ones"
    with pytest.raises(StudyError, match=lacking.format("tosca", exact)):
        plan("+study=table1", "dataset=tosca", f"dataset.root={tosca_zip}", "engine=serial")


@pytest.mark.parametrize("study", ["pose", "table1"])
def test_a_dataset_of_ones_own_that_has_it_is_planned(plan, datasets, study):
    words = ("dataset=custom", "dataset._target_=own_balls.Poses", "engine=serial")
    assert plan(f"+study={study}", *words, *(["plates={}"] if study == "pose" else []))


def test_it_is_one_line_and_nothing_is_written(here):
    done = typed(here, "+study=pose", "dataset=files", "dataset.glob=*.off")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert not done.stdout
    assert [path.name for path in here.iterdir()] == ["ant.off"]


def test_table_1_is_about_the_non_rigid_categories_of_the_benchmark_unless_others_are_given(composed, monkeypatch):
    assert composed("+study=table1").dataset.categories == "non_rigid"
    assert composed("+study=table1", "dataset.categories=[Ant]").dataset.categories == ["Ant"]
    assert composed("+study=holes", "dataset=psb").dataset.categories is None
    assert "categories" not in composed("+study=table1", "dataset=bundled").dataset
