"""Methods that are told how many segments to find: the number of the original, never that of the variant."""

import dataclasses
import hashlib
import pickle
from dataclasses import dataclass

import numpy as np
import pytest
import trimesh

from heatwalk.io import LoadedMesh
from studies.datasets import Dataset, Model
from studies.experiments import Change, Poses
from studies.segmenters import SegmenterError, make_segmenter
from studies.segmenters.segmenter import TOLD_OPTION
from studies.testing import check_segmenter

HELPERS = "tests.helpers.segmenting"
BY_SIZE = make_segmenter({"_target_": f"{HELPERS}.by_size"})
TOLD = make_segmenter({"_target_": f"{HELPERS}.told"}, BY_SIZE)
FREE = make_segmenter({"_target_": f"{HELPERS}.halves"})


@dataclass(frozen=True)
class Ball(Model):
    """A sphere, with people's segmentations into these numbers of segments."""

    subdivisions: int = 3
    people: tuple[int, ...] = ()

    def load(self):
        mesh = trimesh.creation.icosphere(self.subdivisions)
        return LoadedMesh(np.array(mesh.vertices), np.array(mesh.faces), ())

    def digest(self):
        return hashlib.sha256(f"ball {self.subdivisions}".encode()).hexdigest()

    def human_segmentations(self):
        return [np.arange(20 * 4**self.subdivisions) % k for k in self.people]

    def correspondence(self):
        return np.arange(100)


class Balls(Dataset):
    name = "balls"

    def __init__(self, *models):
        self._models = models

    def models(self):
        return list(self._models)


def n_segments(segmenter, model):
    mesh = model.load()
    return len(np.unique(segmenter(mesh.vertices, mesh.faces)))


def test_a_method_is_told_if_it_has_such_an_argument_and_no_such_option():
    assert TOLD.is_told
    assert not FREE.is_told
    assert FREE.reference is None
    fixed = make_segmenter({"_target_": f"{HELPERS}.told", "n_segments": 7}, BY_SIZE)
    assert not fixed.is_told
    assert n_segments(fixed, Ball("a", "")) == 7


@pytest.mark.parametrize(
    ("people", "typical"), [((), None), ((5,), 5), ((7, 5, 5, 7, 3), 5), ((9, 9, 2), 9), ((4, 3, 2), 2)]
)
def test_the_typical_number_of_a_model_is_the_most_frequent_one_and_of_several_the_smallest(people, typical):
    model = Ball("a", "", people=people)
    assert model.typical_n_segments() == typical
    assert TOLD.for_model(model) == dataclasses.replace(TOLD, n_segments=typical)
    assert FREE.for_model(model) is FREE


def test_people_come_before_the_reference():
    model, mesh = Ball("a", "", people=(5, 5, 3)), Ball("a", "").load()
    assert TOLD.for_original(mesh.vertices, mesh.faces).n_segments == len(mesh.vertices) // 100 == 6
    assert TOLD.for_model(model).for_original(mesh.vertices, mesh.faces).n_segments == 5
    assert FREE.for_original(mesh.vertices, mesh.faces) is FREE
    assert n_segments(TOLD, model) == 6  # nothing says that there are people
    assert n_segments(TOLD.for_model(model), model) == 5


def test_the_number_is_part_of_the_fingerprint_and_so_is_where_it_comes_from():
    options, version = TOLD.fingerprint[:2]
    assert TOLD.fingerprint == [options, version, BY_SIZE.fingerprint]
    assert dataclasses.replace(TOLD, n_segments=5).fingerprint == [options, version, 5]
    assert FREE.fingerprint == [{"_target_": f"{HELPERS}.halves"}, FREE.version]
    assert TOLD.options[TOLD_OPTION] == "of by_size"
    assert dataclasses.replace(TOLD, n_segments=5).options[TOLD_OPTION] == 5
    assert TOLD_OPTION not in FREE.options


def test_a_told_method_is_the_same_after_pickling():
    copy = pickle.loads(pickle.dumps(dataclasses.replace(TOLD, n_segments=5)))
    assert copy == dataclasses.replace(TOLD, n_segments=5)
    assert copy.fingerprint == dataclasses.replace(TOLD, n_segments=5).fingerprint


def test_the_reference_is_the_heat_walk_unless_another_is_named():
    assert make_segmenter({"_target_": f"{HELPERS}.told"}).reference.name == "HeatWalk"
    with pytest.raises(SegmenterError, match=r"^reference_segmenter=told must itself be told .* such as heat_walk$"):
        make_segmenter({"_target_": f"{HELPERS}.told"}, TOLD)


@pytest.mark.parametrize(("people", "expected"), [((), 6), ((3, 3), 3)])
def test_a_variant_is_segmented_with_the_number_of_the_original(people, expected, rows_of):
    change = Change(perturbation={"_target_": "perturb.Decimation"}, levels=[0.5, 0.2], repeats=1, gallery=None)
    trials = change.plan("decimation", Balls(Ball("a", "", people=people)), [TOLD, BY_SIZE])
    rows = rows_of(trials, Change)
    assert (rows["status"] == "ok").all(), rows["error"].tolist()
    of = {str(name): group for name, group in rows.groupby("segmenter")}
    assert set(of["told"]["n_segments"]) == set(of["told"]["n_segments_reference"]) == {expected}
    assert of["by_size"]["n_segments"].tolist() == (of["by_size"]["n_vertices_perturbed"] // 100).tolist() == [3, 1]
    notes = change.tables(rows)[0].notes
    assert notes == f"{Change.notes} Told how many segments to find: told."
    assert change.tables(of["by_size"])[0].notes == Change.notes


def test_another_number_of_people_is_another_trial_of_told_methods_alone():
    change = Change(perturbation={"_target_": "perturb.Decimation"}, levels=[0.5], repeats=1, gallery=None)
    ids = [
        {t.segmenter_name: (t.trial_id, t.group_key, t.seed) for t in change.plan("d", Balls(ball), [TOLD, FREE])}
        for ball in (Ball("a", "", people=(3,)), Ball("a", "", people=(4,)), Ball("a", ""))
    ]
    assert len({each["told"][:2] for each in ids}) == 3
    assert len({each["halves"] for each in ids}) == 1
    assert len({each[name][2] for each in ids for name in each}) == 1  # all under the same draws


@pytest.mark.parametrize(("people", "expected"), [((), 6), ((4,), 4)])
def test_all_poses_are_segmented_with_the_number_of_the_first(people, expected):
    poses = Balls(Ball("a", "ball", 3, people), Ball("b", "ball", 4, (9,)), Ball("c", "ball", 2, (9,)))
    trials = Poses().plan("pose", poses, [TOLD])
    prepared = trials[0].prepare()
    assert {name: pose.n_segments for name, pose in prepared.items()} == dict.fromkeys("abc", expected)
    assert [trial.measure(prepared)["n_segments"] for trial in trials] == [expected] * 3


def test_the_check_of_segmenters_tells_a_method_four_segments():
    found = []

    def method(vertices, faces, n_segments):
        found.append(n_segments)
        return np.arange(len(vertices)) % n_segments

    check_segmenter(method)
    assert set(found) == {4}
    check_segmenter(TOLD)
    numbers = iter(range(10**6))
    with pytest.raises(AssertionError, match="is not deterministic"):
        check_segmenter(lambda vertices, faces, n_segments: np.full(len(faces), next(numbers)))
