"""Scenes of segmentations by people beside those by methods: what the viewer of a benchmark's page shows."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from studies.figures.colours import match_colours
from studies.figures.method_scenes import labels_by
from studies.figures.pictures import label_of
from studies.figures.scenes import Scene, Viewport, reduce_mesh
from studies.figures.views import view_of
from studies.reporting.text import count_of
from studies.segmenters.labels import labels_at_vertices

VERSION = 2  # raise it when a change alters scenes: they are then made again
PERSON = "person"


@dataclass(frozen=True, eq=False)
class PeopleScenes:
    """A scene for each model and person: the person's segmentation, and one of each method, made in worker processes.

    Parameters
    ----------
    shown : sequence of sequences of (Trial, str)
        for each model the trials of methods that succeeded, each with what it measured
    """

    shown: Sequence[Sequence[tuple[Any, str]]]
    slider: ClassVar[str] = PERSON

    @property
    def content(self) -> str:
        """The ids of the trials."""
        return f"{VERSION}: {[[trial.trial_id for trial, _ in of_model] for of_model in self.shown]}"

    def tasks(self) -> list[Sequence[tuple[Any, str]]]:
        """One for each model."""
        return list(self.shown)

    @staticmethod
    def function(of_model: Sequence[tuple[Any, str]]) -> list[Scene]:
        """The scenes of a model, in the colours of the first person's parts."""
        first = of_model[0][0]
        mesh, people = first.model.load(), first.model.human_segmentations()
        reduced = reduce_mesh(mesh.vertices, mesh.faces)
        surface = reduced.surface(mesh.vertices)

        def at_vertices(face_labels: np.ndarray) -> np.ndarray:
            numbers = np.unique(face_labels, return_inverse=True)[1]
            return labels_at_vertices(numbers, mesh.vertices, mesh.faces, "faces")

        of_people = [at_vertices(labels) for labels in people]
        colours = of_people[0]

        def viewport(labels: np.ndarray, title: str, note: str) -> Viewport:
            matched = match_colours(colours, labels, labels)
            return Viewport(surface, title, "", note, matched[reduced.source])

        methods = [
            viewport(
                labels_by(trial.segmenter, mesh)
                if trial.segmenter
                else at_vertices(trial.model.method_segmentation(trial.method)),
                trial.segmenter_name,
                note,
            )
            for trial, note in of_model
        ]
        axes = view_of(np.asarray(mesh.vertices)).axes
        return [
            Scene(
                {"model": label_of(first.model), PERSON: number},
                [viewport(labels, _title(number, len(people)), count_of(_parts(people[number - 1]), "part")), *methods],
                axes=axes,
                key=" ".join(trial.trial_id for trial, _ in of_model) if number == 1 else "",
            )
            for number, labels in enumerate(of_people, 1)
        ]


def _title(number: int, n_people: int) -> str:
    return f"person {number} of {n_people}" if n_people > 1 else "ground truth"


def _parts(labels: np.ndarray) -> int:
    return len(np.unique(labels))


def people_scenes(
    trials: Sequence[Any], scores: Mapping[str, float], models: Sequence[str], worst: int
) -> PeopleScenes | None:
    """The scenes of some models, and of those on which the first method agrees least with people.

    Parameters
    ----------
    trials : sequence of Trial
        of a benchmark
    scores : mapping of str to float
        trial_id -> Rand Index error, of the trials that succeeded
    models : sequence of str
        names of models that are shown
    worst : int
        how many more
    """
    by_model: dict[str, list[tuple[Any, str]]] = {}
    for trial in trials:
        if trial.trial_id in scores and (trial.segmenter or trial.method):
            note = f"Rand Index error {scores[trial.trial_id]:.3f}"
            by_model.setdefault(trial.model.name, []).append((trial, note))
    others = [name for name in by_model if name not in models]
    others.sort(key=lambda name: -scores[by_model[name][0][0].trial_id])
    shown = [by_model[name] for name in by_model if name in {*models, *others[:worst]}]
    return PeopleScenes(shown) if shown else None
