"""Scenes of models by the time for which heat flows: what the viewer of a study of times shows."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from studies.figures.method_figures import labels_with_background
from studies.figures.method_scenes import named
from studies.figures.pictures import label_of
from studies.figures.scenes import Scene, reduce_mesh
from studies.figures.time_scenes import AtTime, Side, scenes_by_time

VERSION = 1  # raise it when a change alters scenes: they are then made again


@dataclass(frozen=True, eq=False)
class TimesScenes:
    """A scene for each model and time, a viewport for each method, made in worker processes.

    Parameters
    ----------
    shown : sequence of sequences of Trial
        for each model its trials that succeeded: one for each method and time
    first : float
        the time that is shown first
    """

    shown: Sequence[Sequence[Any]]
    first: float
    slider: ClassVar[str] = "time"

    @property
    def content(self) -> str:
        """The ids of the trials."""
        return f"{VERSION}: {[[trial.trial_id for trial in of_model] for of_model in self.shown]}"

    def tasks(self) -> list[tuple[Sequence[Any], float]]:
        """One for each model."""
        return [(of_model, self.first) for of_model in self.shown]

    @staticmethod
    def function(task: tuple[Sequence[Any], float]) -> list[Scene]:
        """The scenes of a model."""
        trials, first = task
        model = trials[0].model
        mesh = model.load()
        times = sorted({trial.level for trial in trials})
        reduced = reduce_mesh(mesh.vertices, mesh.faces)
        surface = reduced.surface(np.asarray(mesh.vertices))
        methods = {trial.segmenter_name: trial.segmenter.method for trial in trials}
        sides = [
            Side(name, "", reduced, surface, list(_at_times(method, mesh, times)), like=0 if i else None)
            for i, (name, method) in enumerate(methods.items())
        ]
        start = int(np.argmin(np.abs(np.array(times) - first)))
        ids = {time: " ".join(trial.trial_id for trial in trials if trial.level == time) for time in times}
        scenes = [replace(scene, key=ids[float(scene.at["time"])]) for scene in scenes_by_time(times, sides, start)]
        return named(scenes, "model", label_of(model))


def _at_times(method: Any, mesh: Any, times: Sequence[float]) -> Iterator[AtTime]:
    """The segments at each time, with the dissipator region of a Heat Walk as the background."""
    if hasattr(method, "segmentations"):
        labels = map(labels_with_background, method.segmentations(mesh.vertices, mesh.faces, times))
    else:
        labels = method.at_times(mesh.vertices, mesh.faces, times)
    for each in labels:
        yield AtTime(np.asarray(each), len(np.unique(each)), {})
