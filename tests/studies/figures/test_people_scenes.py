from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from heatwalk.io import LoadedMesh
from studies.experiments.benchmark import Benchmark
from studies.figures.people_scenes import people_scenes
from studies.reporting.html import pack, unpack

BALL = trimesh.creation.icosphere(2)
VERTICES, FACES = np.asarray(BALL.vertices), np.asarray(BALL.faces)
CENTRES = VERTICES[FACES].mean(axis=1)
HALVES, SLICES = CENTRES[:, 2] > 0, np.digitize(CENTRES[:, 0], [-0.4, 0.4])


class Ball:
    """A ball that two people have segmented, and the authors of a method."""

    category = "ball"

    def __init__(self, name):
        self.name = name

    def load(self):
        return LoadedMesh(VERTICES, FACES, ())

    def human_segmentations(self):
        return [HALVES.astype(int) + 5, SLICES]

    def method_segmentation(self, method):
        return {"Slices": SLICES}[method]


class Upper:
    """Says which vertices are above."""

    method = SimpleNamespace()

    def __call__(self, vertices, faces):
        return (vertices[:, 2] < 0).astype(int)


def trial(name, segmenter=None, method=""):
    named = {"segmenter": segmenter, "method": method, "segmenter_name": method or ("Upper" if segmenter else "Humans")}
    return SimpleNamespace(model=Ball(name), trial_id=f"{name} {named['segmenter_name']}".replace(" ", "-"), **named)


TRIALS = [each for name in "abcd" for each in (trial(name, Upper()), trial(name), trial(name, method="Slices"))]
SCORES = {each.trial_id: {"a": 0.1, "b": 0.2, "c": 0.4, "d": 0.3}[each.model.name] for each in TRIALS}


def test_every_person_is_beside_every_method_in_the_colours_of_the_first_person():
    made = people_scenes(TRIALS, SCORES, ["a"], 0)
    scenes = [scene for task in made.tasks() for scene in made.function(task)]
    assert [scene.at for scene in scenes] == [{"model": "a", "person": 1}, {"model": "a", "person": 2}]
    first, second = scenes
    assert [each.title for each in first.viewports] == ["person 1 of 2", "Upper", "Slices"]
    assert [each.title for each in second.viewports] == ["person 2 of 2", "Upper", "Slices"]
    assert [each.note for each in first.viewports] == ["2 parts", *["Rand Index error 0.100"] * 2]
    assert first.key.split() == ["a-Upper", "a-Slices"]
    person, upper, slices = (each.labels for each in first.viewports)
    away = np.abs(VERTICES[:, 2]) > 0.3  # where the halves of faces and of vertices are the same, up to their numbers
    assert (person[away] == upper[away]).all()
    assert (second.viewports[0].labels == slices).all()
    assert len(unpack(pack(scenes, slider=made.slider))) == 2


@pytest.mark.parametrize(("worst", "names"), [(0, ["b"]), (1, ["b", "c"]), (2, ["b", "c", "d"])])
def test_the_models_follow_on_which_the_first_method_agrees_least(worst, names):
    made = people_scenes(TRIALS, SCORES, ["b"], worst)
    assert [of_model[0][0].model.name for of_model in made.shown] == names


def test_without_methods_that_succeeded_or_models_that_are_wanted_there_is_no_viewer():
    import pandas as pd

    assert people_scenes(TRIALS, {}, ["a"], 1) is None
    rows = pd.DataFrame({"trial_id": [*SCORES], "rand_index_error": [*SCORES.values()], "status": "ok"})
    assert Benchmark(page={"models": 0}).scenes(TRIALS, rows, lambda _: None) is None
    assert len(Benchmark(page={"models": 1, "worst": 1}).scenes(TRIALS, rows, lambda _: None).shown) == 2
