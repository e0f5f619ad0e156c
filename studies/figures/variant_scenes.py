"""Scenes of originals and their segmented variants, remade from trials: what the viewer of a study shows."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from studies.figures.colours import match_colours
from studies.figures.pictures import label_of
from studies.figures.scenes import Field, Reduced, Scene, Surface, Viewport, reduce_mesh
from studies.figures.views import view_of
from studies.metrics import match_labels

if TYPE_CHECKING:
    import pandas as pd

MOST_SECONDS = 10.0  # that trials took whose segmentation is not stored, to be computed again for a scene

MOST_SECONDS_OF_ALL = 120.0  # of a leaderboard

VERSION = 2  # raise it when a change alters scenes: they are then made again

Arrays = Mapping[str, np.ndarray]

MARGIN = "margin"
MARGIN_UNIT = "margin: how far a label is from another one"


@dataclass(frozen=True, eq=False)
class Draw:
    """A variant of a model, as every method has segmented it.

    Parameters
    ----------
    trials : sequence of Trial
        one for each method, of the same model, part, level and repeat
    stored : sequence of mappings or None
        the arrays stored for each trial: "labels", "reference_labels", and the margins if there are any
    notes : sequence of str
        for each trial, what it measured
    at : mapping
        what is picked to see it
    text : str
        what it shows, in one line
    value : float
        the largest Change Percentage
    """

    trials: Sequence[Any]
    stored: Sequence[Arrays | None]
    notes: Sequence[str]
    at: Mapping[str, str | int | float]
    text: str
    value: float

    @property
    def key(self) -> str:
        """The ids of the trials."""
        return " ".join(trial.trial_id for trial in self.trials)


@dataclass(frozen=True, eq=False)
class VariantScenes:
    """The scenes of some trials, made in worker processes model by model.

    Parameters
    ----------
    draws : sequence of Draw
        in the order of the study
    """

    draws: Sequence[Draw]
    slider: ClassVar[str] = "level"

    @property
    def content(self) -> str:
        """The ids of the trials, and the version of the code that makes the scenes."""
        return f"{VERSION}: {'; '.join(draw.key for draw in self.draws)}"

    def tasks(self) -> list[list[Draw]]:
        """The draws of each model."""
        of_model: dict[str, list[Draw]] = {}
        for draw in self.draws:
            of_model.setdefault(draw.trials[0].model.name, []).append(draw)
        return list(of_model.values())

    @staticmethod
    def function(draws: Sequence[Draw]) -> list[Scene]:
        """The scenes of a model."""
        return scenes_of_model(draws)


def choose_draws(
    planned: Sequence[Any],
    rows: pd.DataFrame,
    chosen: Sequence[Sequence[Any]],
    worst: int,
    labels: Callable[[str], Arrays | None],
) -> list[Draw]:
    """The variants that a viewer shows: those of some trials as all methods segmented them, and the worst of all.

    Parameters
    ----------
    planned : sequence of Trial
        trials of the study, in its order
    rows : DataFrame
        rows of the study
    chosen : sequence of sequences of Trial
        from `studies.figures.gallery.choose_trials`
    worst : int
        how many more variants to show, those whose segmentation changed most
    labels : callable
        trial_id -> the arrays stored for it, or None
    """
    good = rows[rows["status"] == "ok"].set_index("trial_id")
    changes = good["change_percentage"].astype(float)
    by_draw: dict[tuple[Any, ...], list[Any]] = {}
    for trial in planned:
        of_draw = by_draw.setdefault(_draw_of(trial), [])
        if trial.trial_id in changes.index:
            of_draw.append(trial)
    by_draw = {draw: trials for draw, trials in by_draw.items() if trials}
    highest = {draw: max(changes[trial.trial_id] for trial in trials) for draw, trials in by_draw.items()}
    wanted = dict.fromkeys(_draw_of(trial) for line in chosen for trial in line if trial.trial_id in changes.index)
    seconds = good[["seconds_perturb", "seconds_segment"]].sum(axis=1)
    quick = {
        draw
        for draw, trials in by_draw.items()
        if sum(seconds[trial.trial_id] for trial in trials if labels(trial.trial_id) is None) <= MOST_SECONDS
    }
    others = sorted((draw for draw in quick - {*wanted} if highest[draw] > 0), key=lambda draw: -highest[draw])
    wanted |= dict.fromkeys(others[:worst])
    several_parts = len({trial.part for trial in planned}) > 1
    return [
        _draw(trials, [changes[trial.trial_id] for trial in trials], several_parts, labels)
        for draw, trials in by_draw.items()
        if draw in wanted
    ]


def worst_draws(
    planned: Sequence[Any], rows: pd.DataFrame, worst: int, reference: str, titles: Mapping[str, str]
) -> list[Draw]:
    """The variants that each method changed most, each of another perturbation, with the reference beside the method.

    Labels are computed again, so that variants that took more than `MOST_SECONDS` are left out, and all together take
    no more than `MOST_SECONDS_OF_ALL`, the first cases of all methods before the second ones.

    Parameters
    ----------
    planned : sequence of Trial
        trials of a leaderboard
    rows : DataFrame
        its rows
    worst : int
        how many variants of each method
    reference : str
        name of the method that is shown beside the others
    titles : mapping of str to str
        of the perturbations, by name
    """
    good = rows[(rows["status"] == "ok") & (rows["change_percentage"] > 0)].set_index("trial_id")
    changes, seconds = good["change_percentage"].astype(float), good[["seconds_perturb", "seconds_segment"]].sum(axis=1)
    of_reference = {trial.draw: trial for trial in planned if trial.segmenter_name == reference}
    by_method: dict[str, list[Any]] = {}
    for trial in planned:
        if trial.trial_id in changes.index and seconds[trial.trial_id] <= MOST_SECONDS:
            by_method.setdefault(trial.segmenter_name, []).append(trial)
    cases: list[tuple[int, Any]] = []
    for trials in by_method.values():
        parts: dict[str, Any] = {}
        for trial in sorted(trials, key=lambda trial: -changes[trial.trial_id]):
            parts.setdefault(trial.part, trial)
        cases += list(enumerate(parts.values()))[:worst]
    draws, spent = [], 0.0
    for _, trial in sorted(cases, key=lambda case: case[0]):
        beside = of_reference.get(trial.draw)
        both = [trial] if beside is None or beside is trial or beside.trial_id not in changes.index else [trial, beside]
        spent += 2 * sum(seconds[each.trial_id] for each in both)  # the original, too
        if spent > MOST_SECONDS_OF_ALL:
            break
        draws.append(_draw(both, [changes[each.trial_id] for each in both], True, lambda _: None))
    return [
        replace(
            draw, at={"method": draw.trials[0].segmenter_name, **draw.at, "perturbation": titles[draw.trials[0].part]}
        )
        for draw in draws
    ]


def _draw_of(trial: Any) -> tuple[Any, ...]:
    return trial.model.name, trial.part, trial.level, trial.repeat


def _draw(
    trials: Sequence[Any],
    changes: Sequence[float],
    several_parts: bool,
    labels: Callable[[str], Arrays | None],
) -> Draw:
    first = trials[0]
    part = {"perturbation": first.part.replace("_", " ")} if several_parts else {}
    at = {"model": label_of(first.model), **part, "repeat": first.repeat, "level": first.level}
    notes = [f"CP {change:.1f} %" for change in changes]
    level = f"{part['perturbation']} {first.level:g}" if part else f"{first.level:g}"
    place = f"{label_of(first.model)}, {level}, repeat {first.repeat}"
    worst = int(np.argmax(changes))
    by = f" ({trials[worst].segmenter_name})" if len(trials) > 1 else ""
    return Draw(
        trials=trials,
        stored=[labels(trial.trial_id) for trial in trials],
        notes=notes,
        at=at,
        text=f"{place}: {notes[worst]}{by}",
        value=changes[worst],
    )


def scenes_of_model(draws: Sequence[Draw]) -> list[Scene]:
    """The scenes of a model: its original and each variant, a row of viewports for each method.

    A part has the colour of the part of the original that it is matched with; parts of the original are matched
    between methods. Meshes are segmented only where labels are not stored.
    """
    references: dict[str, Any] = {}
    stored = [(trial, arrays) for draw in draws for trial, arrays in zip(draw.trials, draw.stored, strict=True)]
    for trial, arrays in sorted(stored, key=lambda each: each[1] is None):
        if trial.segmenter_name not in references:
            references[trial.segmenter_name] = trial.reference(None if arrays is None else arrays["reference_labels"])
    margins = {
        name: trial.segmenter.labelled(*_arrays(references[name].mesh)).margin()
        for name, trial in {trial.segmenter_name: trial for draw in draws for trial in draw.trials}.items()
        if trial.segmenter.tells_margin
    }
    mesh = next(iter(references.values())).mesh
    reduced = reduce_mesh(mesh.vertices, mesh.faces)
    original = reduced.surface(np.asarray(mesh.vertices))
    axes = view_of(np.asarray(mesh.vertices)).axes
    colours = _matched_originals({name: references[name].labels for name in references})
    scenes = []
    for draw in draws:
        viewports: list[Viewport] = []
        made = draw.trials[0].perturbed(mesh)[0]
        shown = _reduced_variant(reduced, mesh, made.mesh)
        surface = shown.surface(np.asarray(made.mesh.vertices))
        for trial, arrays, note in zip(draw.trials, draw.stored, draw.notes, strict=True):
            name = trial.segmenter_name
            labels = None if arrays is None else arrays["labels"]
            variant = replace(trial, keep_labels=True).variant(references[name], labels, made)
            viewports += _side_by_side(
                variant, colours[name], reduced, original, shown, surface, name, note,
                margins.get(name), _margin_of(variant, arrays),
            )  # fmt: skip
        scenes.append(Scene(draw.at, viewports, draw.text, draw.value, axes, draw.key))
    return scenes


def _arrays(mesh: Any) -> tuple[np.ndarray, np.ndarray]:
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def _margin_of(variant: Any, arrays: Arrays | None) -> np.ndarray | None:
    """The margin of a variant, as stored or as it was computed now."""
    if arrays is not None:
        return arrays.get(MARGIN)
    return variant.labelled.margin() if variant.labelled else None


def _matched_originals(labels: Mapping[str, np.ndarray]) -> dict[str, np.ndarray]:
    """The segmentations of an original by several methods, in the colours of the first."""
    first = next(iter(labels.values()))
    return {name: each if each is first else match_colours(first, each, each) for name, each in labels.items()}


def _reduced_variant(reduced: Reduced, original: Any, mesh: Any) -> Reduced:
    """The vertices of a variant that are shown: those of the original if it has the same faces."""
    same = len(mesh.vertices) == len(original.vertices) and np.array_equal(mesh.faces, original.faces)
    return reduced if same else reduce_mesh(mesh.vertices, mesh.faces)


def _side_by_side(
    variant: Any,
    colours: np.ndarray,
    reduced: Reduced,
    original: Surface,
    shown: Reduced,
    surface: Surface,
    name: str,
    note: str,
    margin_before: np.ndarray | None,
    margin_after: np.ndarray | None,
) -> tuple[Viewport, Viewport]:
    """The original and a variant, in the colours of the original's parts."""
    before, after = variant.compared()
    kept = variant.counterpart >= 0
    moved = match_labels(before, after) != before
    changed_before = np.zeros(len(kept), bool)
    changed_before[kept] = moved
    changed_after = np.zeros(len(variant.labels), bool)
    changed_after[variant.counterpart[kept][moved]] = True
    labels = match_colours(colours[kept], after, variant.labels)
    return (
        Viewport(
            original, "original", name, "", colours[reduced.source], changed_before[reduced.source],
            _margin(margin_before, reduced),
        ),
        Viewport(
            surface, "variant", name, note, labels[shown.source], changed_after[shown.source],
            _margin(margin_after, shown),
        ),
    )  # fmt: skip


def _margin(margin: np.ndarray | None, reduced: Reduced) -> dict[str, Field]:
    return {} if margin is None else {MARGIN: Field(np.asarray(margin, float)[reduced.source], 0, 1, MARGIN_UNIT)}
