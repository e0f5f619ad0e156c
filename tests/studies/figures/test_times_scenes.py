from types import SimpleNamespace

import numpy as np
import pandas as pd

import heatwalk
from heatwalk.io import LoadedMesh
from heatwalk.segmentation import bent_torus
from studies.experiments import Times
from studies.figures.colours import BACKGROUND
from studies.metrics import change_percentage
from studies.reporting.html import pack, unpack
from studies.segmenters import HeatWalk

TIMES = (0.5, 1.0, 3.0)


class Torus:
    category, name = "torus", "torus"

    def load(self):
        return LoadedMesh(*bent_torus(), ())


class Halves:
    """A method that tells no segmentations, but labels at each time."""

    def at_times(self, vertices, faces, times):
        for time in times:
            yield (vertices[:, 0] > time).astype(int)


def trials(*methods):
    return [
        SimpleNamespace(
            model=Torus(),
            level=time,
            segmenter=SimpleNamespace(method=method),
            segmenter_name=type(method).__name__,
            trial_id=f"{type(method).__name__}-{time:g}",
        )
        for method in methods
        for time in TIMES
    ]


def test_the_viewer_shows_the_segments_of_every_method_at_every_time_the_usual_one_first():
    planned = trials(HeatWalk(), Halves())
    rows = pd.DataFrame({"trial_id": [each.trial_id for each in planned], "status": "ok"})
    study = Times(times={"first": 0.5, "last": 3.0, "count": 2}, page={"models": 3})
    made = study.scenes(planned, rows, lambda _: None)
    scenes = [scene for task in made.tasks() for scene in made.function(task)]
    assert [scene.at["time"] for scene in scenes] == [1.0, 0.5, 3.0]
    assert scenes[1].key.split() == ["HeatWalk-0.5", "Halves-0.5"]
    vertices, faces = bent_torus()
    for scene in scenes:
        walk, halves = scene.viewports
        assert (walk.title, halves.title) == ("HeatWalk", "Halves")
        segmentation = heatwalk.segment(vertices, faces, scene.at["time"])
        expected = np.where(segmentation.dissipates, BACKGROUND, segmentation.labels)
        assert change_percentage(expected, walk.labels) == 0  # the same parts, whatever their colours
        assert ((walk.labels == BACKGROUND) == segmentation.dissipates).all()
        assert change_percentage((vertices[:, 0] > scene.at["time"]).astype(int), halves.labels) == 0
    assert len(unpack(pack(scenes, slider=made.slider))) == len(TIMES)


def test_trials_that_failed_are_not_shown_and_no_model_means_no_viewer():
    planned = trials(Halves())
    rows = pd.DataFrame({"trial_id": [each.trial_id for each in planned], "status": ["ok", "failed", "ok"]})
    study = Times(times={"first": 0.5, "last": 3.0, "count": 2})
    [of_model] = study.scenes(planned, rows, lambda _: None).shown
    assert [each.level for each in of_model] == [0.5, 3.0]
    assert Times(times=study.times, page={"models": 0}).scenes(planned, rows, lambda _: None) is None
    assert study.scenes(planned, rows.assign(status="failed"), lambda _: None) is None
