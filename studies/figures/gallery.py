"""Galleries: the segmented original of a model and some of its variants side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from studies.figures.colours import BACKGROUND, match_colours
from studies.figures.pictures import Picture, Tile
from studies.figures.surfaces import surface
from studies.figures.views import View, view_along, view_of

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

# How variants are drawn:
#   variant      segmented, all in one frame
#   on_original  the same, and above it the original with the variant's segments, in a frame of its own
#   transparent  the faces that the original does not have are black, seen through the rest
#   edges        with the edges of the triangles
#   scaled       each in a frame of its own, and laid out in proportion
STYLES = ("variant", "on_original", "transparent", "edges", "scaled")

FEW_MODELS = 3  # models that are shown if none of the named ones exists
LARGEST_SCALE = 3.0  # scale of the largest variant that is laid out in proportion
OPACITY = 0.35  # of a surface through which added faces are seen

Labels = Mapping[str, np.ndarray]
Item = TypeVar("Item")


def choose_trials(
    planned: Sequence[Any], good_ids: AbstractSet[str] | None, models: int | Sequence[Any], n_columns: int
) -> list[list[Any]]:
    """Choose the trials that a gallery shows: for some models and each segmenter, one repeat of some levels.

    Parameters
    ----------
    planned : sequence of Trial
        trials of the study, in its order
    good_ids : set of str, optional
        ids of the trials that succeeded; by default all trials are assumed to succeed
    models : int or sequence of names
        how many models, taken evenly from the study, so that a benchmark shows several categories; or the names of the
        models to show, and ``FEW_MODELS`` taken evenly if the study has none of them
    n_columns : int
        how many levels, taken evenly from the first to the last; of a study of several parts, the last level of each
        part is shown

    Returns
    -------
    list of lists of Trial
        one list per model and segmenter

    Examples
    --------
    >>> from types import SimpleNamespace as Trial
    >>> planned = [Trial(trial_id=f"{name}{level}", model=Trial(name=name), segmenter_name="HeatWalk", part="holes",
    ...                  level=level) for name in ("ant", "cow") for level in (1, 2, 3)]
    >>> [[trial.trial_id for trial in line] for line in choose_trials(planned, None, 2, 2)]
    [['ant1', 'ant3'], ['cow1', 'cow3']]
    """
    first: dict[str, dict[str, dict[tuple[str, float], Any]]] = {}  # model -> segmenter -> (part, level) -> trial
    for trial in planned:
        if good_ids is None or trial.trial_id in good_ids:
            of_segmenter = first.setdefault(trial.model.name, {}).setdefault(trial.segmenter_name, {})
            of_segmenter.setdefault((trial.part, trial.level), trial)
    named = [] if isinstance(models, int) else [str(name) for name in models if str(name) in first]
    names = named or _evenly(list(first), models if isinstance(models, int) else FEW_MODELS)
    levels = list(dict.fromkeys((trial.part, trial.level) for trial in planned))
    last_of_part = dict(levels)
    shown = _evenly(levels, n_columns) if len(last_of_part) == 1 else list(last_of_part.items())
    return [[trials[level] for level in shown if level in trials] for name in names for trials in first[name].values()]


@dataclass(frozen=True, eq=False)
class GalleryPicture(Picture):
    """Originals and variants side by side, a line for each model and segmenter.

    Parameters
    ----------
    chosen : sequence of sequences of Trial
        from `choose_trials`
    rows : DataFrame
        rows of the trials, with the columns trial_id, change_percentage, unit and segmenter
    axes : mapping
        part -> what its levels are
    style : str
        one of ``STYLES``
    title : str
        title of the study
    labels : callable, optional
        trial_id -> the arrays stored with its row, "labels" and "reference_labels", or None; a mesh is segmented only
        if its labels are not stored
    stem : str
        name of the file, without suffix

    Raises
    ------
    ValueError
        if the style is unknown

    Notes
    -----
    A trial has ``reference(labels=None)``, its original mesh and the labels of it, and
    ``variant(reference, labels=None)``, its variant; labels that are given are not computed.
    """

    chosen: Sequence[Sequence[Any]]
    rows: pd.DataFrame
    axes: Mapping[str, str]
    style: str
    title: str
    labels: Callable[[str], Labels | None] | None = None
    stem: str = "gallery"

    def __post_init__(self) -> None:
        if self.style not in STYLES:
            raise ValueError(f"gallery.style is {self.style!r}: choose one of {', '.join(STYLES)}")

    @property
    def content(self) -> str:
        """The style and the ids of the trials."""
        return " ".join([self.style, *(trial.trial_id for line in self.chosen for trial in line)])

    def tasks(self) -> list[tuple[Sequence[Any], str, list[Labels | None]]]:
        """For each line its trials, the style, and the labels that are stored."""
        stored = self.labels or (lambda trial_id: None)
        return [(line, self.style, [stored(trial.trial_id) for trial in line]) for line in self.chosen]

    @staticmethod
    def function(task: tuple[Sequence[Any], str, list[Labels | None]]) -> list[np.ndarray]:
        """Render the original and the variants of a line."""
        return draw_line(*task)

    def figure(self, results: Sequence[Sequence[np.ndarray]]) -> Figure:
        """Lay the lines out, captioned with levels and Change Percentages."""
        from studies.figures.layout import lay_out  # loads matplotlib, which no worker needs

        lines = [self._tiles(trials, pictures) for trials, pictures in zip(self.chosen, results, strict=True)]
        axis = ""
        if len(self.axes) == 1:
            units = " and ".join(self.rows["unit"].unique()).replace("_", " ")
            axis = f": {next(iter(self.axes.values()))} ({units})"
        return lay_out(lines, f"{self.title}{axis}; CP: Change Percentage")

    def _tiles(self, trials: Sequence[Any], pictures: Sequence[np.ndarray]) -> list[Tile]:
        from studies.figures.layout import shrink

        change = self.rows.set_index("trial_id")["change_percentage"]
        several_segmenters = "segmenter" in self.rows and self.rows["segmenter"].nunique() > 1
        original = f"{trials[0].model.name}: original"
        captions = [f"{original}\n{trials[0].segmenter_name}" if several_segmenters else original]
        for trial in trials:
            part = f"{trial.part} ".replace("_", " ") if len(self.axes) > 1 else ""
            captions.append(f"{part}{trial.level:g}: CP {change[trial.trial_id]:.1f} %")
        scales = [1.0, *(trial.level for trial in trials)]
        drawn = zip(pictures, captions, scales, strict=True)
        if self.style != "scaled":
            return [Tile(picture, caption) for picture, caption, _ in drawn]
        return [
            Tile(shrink(picture, scale / LARGEST_SCALE), caption)
            for picture, caption, scale in drawn
            if scale <= LARGEST_SCALE
        ]


def draw_line(trials: Sequence[Any], style: str, stored: Sequence[Labels | None]) -> list[np.ndarray]:
    """Render the original of a model and its variants from the same side.

    Parameters
    ----------
    trials : sequence of Trial
        trials of one model and one segmenter
    style : str
        one of ``STYLES``
    stored : sequence of mappings or None
        the arrays stored for each trial, see `GalleryPicture`

    Returns
    -------
    list of (height, width, 3) uint8 arrays
        the original, then each variant
    """
    of_original = next((arrays["reference_labels"] for arrays in stored if arrays is not None), None)
    reference = trials[0].reference(of_original)
    variants = [
        trial.variant(reference, None if arrays is None else arrays["labels"])
        for trial, arrays in zip(trials, stored, strict=True)
    ]
    own = common = view_of(np.asarray(reference.mesh.vertices))
    if style != "scaled":
        # Wide enough for what protrudes from the original.
        vertices = np.concatenate([reference.mesh.vertices, *(variant.mesh.vertices for variant in variants)])
        common = view_along(vertices, own.axes)
    view = own if style == "on_original" else common
    original = surface(reference.mesh, view, labels=reference.labels, edges=style == "edges")
    if style == "on_original":
        original = np.concatenate([original, np.full_like(original, 255)])
    return [original, *(_draw_variant(variant, own, common, style) for variant in variants)]


def find_added_faces(original: np.ndarray, faces: np.ndarray, counterpart: np.ndarray) -> np.ndarray:
    """The faces of a variant that its original does not have, such as those of tubes.

    Parameters
    ----------
    original : (m₀, 3) int array
        faces of the original
    faces : (m, 3) int array
        faces of the variant
    counterpart : (n₀,) int array
        the variant's vertex for each vertex of the original, -1 if it is gone

    Returns
    -------
    (m,) bool array

    Examples
    --------
    >>> faces = np.array([[0, 1, 2], [2, 1, 3]])
    >>> find_added_faces(faces[:1], faces, np.array([0, 1, 2])).tolist()
    [False, True]
    """
    kept = counterpart[original]
    kept = np.sort(kept[(kept >= 0).all(axis=1)], axis=1)
    _, number = np.unique(np.concatenate([kept, np.sort(faces, axis=1)]), axis=0, return_inverse=True)
    return np.isin(number[len(kept) :], number[: len(kept)], invert=True)


def _draw_variant(variant: Any, own: View, common: View, style: str) -> np.ndarray:
    reference, compared = variant.compared()
    labels = match_colours(reference, compared, variant.labels)
    original = variant.reference.mesh
    if style == "transparent":
        added = find_added_faces(original.faces, variant.mesh.faces, variant.counterpart)
        return surface(variant.mesh, common, labels=labels, solid=added, opacity=OPACITY)
    view = view_along(np.asarray(variant.mesh.vertices), own.axes) if style == "scaled" else common
    drawn = surface(variant.mesh, view, labels=labels, edges=style == "edges")
    if style == "on_original":
        # A vertex that is gone has no label, and is drawn in grey.
        carried = np.where(variant.counterpart < 0, BACKGROUND, labels[variant.counterpart])
        return np.concatenate([surface(original, own, labels=carried), drawn])
    return drawn


def _evenly(items: list[Item], count: int) -> list[Item]:
    if count >= len(items):
        return items
    return [items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int)] if count > 0 else []
