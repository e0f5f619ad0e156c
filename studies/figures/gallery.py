"""Galleries: the segmented original of a model and some of its variants side by side."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np

from studies.figures.colours import BACKGROUND, match_colours
from studies.figures.pictures import Picture, Row, Tile, label_of
from studies.figures.surfaces import TILE, pixel_length, surface, visible_faces
from studies.figures.views import View, view_along, view_of

if TYPE_CHECKING:
    import pandas as pd
    import trimesh
    from matplotlib.figure import Figure

# How variants are drawn:
#   variant      segmented, all in one frame; where a part is gone, it is drawn faintly
#   on_original  the original with the variant's segments, and below it the variant, in a frame of its own
#   transparent  the faces that the original does not have are black, seen through the rest
#   edges        the same as variant, and below it a detail with the edges of the triangles
#   scaled       each in a frame of its own, with a scale bar
STYLES = ("variant", "on_original", "transparent", "edges", "scaled")

SAME_LENGTH = "every bar has the same length on its surface"
# What the rows of a model contain besides its variants, and how to read the pictures: by style.
ROWS = {
    "on_original": (": the variants' segments on the original", f": the variants; {SAME_LENGTH}"),
    "edges": ("", ": a detail, with the edges of the triangles"),
}
REMARKS = {"scaled": f"each in a frame of its own: {SAME_LENGTH}", "transparent": "black: what was added"}

GONE = "faint: what is missing"

FEW_MODELS = 3  # models that are shown if none of the named ones exists
OPACITY = 0.35  # of a surface through which added faces are seen
RULER = 0.5  # length of the longest scale bar, as a share of the smaller side of a picture
DETAIL_EDGES = 24  # mean edge lengths across a detail
LARGEST_DETAIL = 0.5  # of the shape
DENSE = 12.0  # pixels; with shorter edges, a surface that shows them would be black

# Degrees by which the camera is moved if the usual view hides what is missing.
TURNS = (0.0, 180.0, 45.0, -45.0, 135.0, -135.0)
MUCH_GONE = 0.01  # share of the faces from which on it matters where they were
VISIBLE_ENOUGH = 0.7  # of what the best view shows

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
    names = choose_models(list(first), models)
    levels = list(dict.fromkeys((trial.part, trial.level) for trial in planned))
    last_of_part = dict(levels)
    shown = _evenly(levels, n_columns) if len(last_of_part) == 1 else list(last_of_part.items())
    return [[trials[level] for level in shown if level in trials] for name in names for trials in first[name].values()]


def choose_models(names: Iterable[str], models: int | Sequence[Any]) -> list[str]:
    """The names of the models that a gallery shows; see `choose_trials`."""
    known = list(dict.fromkeys(names))
    named = [] if isinstance(models, int) else [str(name) for name in models if str(name) in known]
    return named or _evenly(known, models if isinstance(models, int) else FEW_MODELS)


@dataclass(frozen=True, eq=False)
class GalleryPicture(Picture):
    """Originals and variants side by side, a line for each model and segmenter.

    Parameters
    ----------
    chosen : sequence of sequences of Trial
        from `choose_trials`
    rows : DataFrame
        rows of the study, with the columns trial_id, part, level, change_percentage, unit and segmenter
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
        """The title, the style and the ids of the trials."""
        return " ".join([self.title, self.style, *(trial.trial_id for line in self.chosen for trial in line)])

    def tasks(self) -> list[tuple[Sequence[Any], str, list[Labels | None]]]:
        """For each line its trials, the style, and the labels that are stored."""
        stored = self.labels or (lambda trial_id: None)
        return [(line, self.style, [stored(trial.trial_id) for trial in line]) for line in self.chosen]

    @staticmethod
    def function(task: tuple[Sequence[Any], str, list[Labels | None]]) -> list[Strip]:
        """Render the original and the variants of a line."""
        return draw_line(*task)

    def figure(self, results: Sequence[Sequence[Strip]]) -> Figure:
        """Lay the lines out, captioned with levels and Change Percentages."""
        from studies.figures.layout import lay_out  # loads matplotlib, which no worker needs

        rows = [row for trials, strips in zip(self.chosen, results, strict=True) for row in self._rows(trials, strips)]
        axis = "the last level of each part"
        if len(self.axes) == 1:
            units = " and ".join(self.rows["unit"].unique()).replace("_", " ")
            axis = f"{next(iter(self.axes.values()))} ({units})"
        of_strips = dict.fromkeys(strip.remark for strips in results for strip in strips)
        remarks = (axis, "CP: Change Percentage", REMARKS.get(self.style, ""), *of_strips)
        return lay_out(rows, self.title, "; ".join(filter(None, remarks)))

    def _rows(self, trials: Sequence[Any], strips: Sequence[Strip]) -> Iterator[Row]:
        """The rows of a line: a tile for each level that any line shows, empty if there is no result here."""
        several_segmenters = "segmenter" in self.rows and self.rows["segmenter"].nunique() > 1
        label = label_of(trials[0].model) + (f", {trials[0].segmenter_name}" if several_segmenters else "")
        at = {(trial.part, trial.level): i for i, trial in enumerate(trials, start=1)}
        for number, strip in enumerate(strips):
            tiles = [Tile(strip.pictures[0], "original" if number == 0 else "", ruler=strip.rulers[0])]
            for level in self._levels():
                i = at.get(level)
                if i is None:
                    tiles.append(Tile(np.full_like(strip.pictures[0], 255), self._caption(*level, None)))
                else:
                    caption = self._caption(*level, trials[i - 1]) if number == 0 else ""
                    tiles.append(Tile(strip.pictures[i], caption, ruler=strip.rulers[i]))
            yield Row(tiles, label + ROWS.get(self.style, ("",))[number])

    def _levels(self) -> list[tuple[str, float]]:
        """Parts and levels that are shown, in the order of the study."""
        shown = {(trial.part, trial.level) for line in self.chosen for trial in line}
        in_order = dict.fromkeys(zip(self.rows["part"], self.rows["level"], strict=True))
        return [level for level in in_order if level in shown]

    def _caption(self, part: str, level: float, trial: Any) -> str:
        named = f"{part} ".replace("_", " ") if len(self.axes) > 1 else ""
        between = "\n" if named else " "
        if trial is None:
            return f"{named}{level:g}:{between}failed"
        change = self.rows.set_index("trial_id")["change_percentage"]
        return f"{named}{level:g}:{between}CP {change[trial.trial_id]:.1f} %"


@dataclass(frozen=True, eq=False)
class Strip:
    """Pictures of an original and its variants, side by side.

    Parameters
    ----------
    pictures : list of (height, width, 3) uint8 arrays
        of one size
    rulers : list of float
        for each, how many pixels a certain length has; 0 if all are in one frame
    remark : str
        how to read these pictures
    """

    pictures: list[np.ndarray]
    rulers: list[float]
    remark: str = ""


def draw_line(trials: Sequence[Any], style: str, stored: Sequence[Labels | None]) -> list[Strip]:
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
    list of Strip
        the original and each variant; two strips of the styles in ``ROWS``
    """
    of_original = next((arrays["reference_labels"] for arrays in stored if arrays is not None), None)
    reference = trials[0].reference(of_original)
    variants = [
        trial.variant(reference, None if arrays is None else arrays["labels"])
        for trial, arrays in zip(trials, stored, strict=True)
    ]
    own = choose_view(reference.mesh, [variant.counterpart for variant in variants])
    # The original and each variant, in the colours of the original's parts.
    meshes = [reference.mesh, *(variant.mesh for variant in variants)]
    labels = [reference.labels, *map(_colours_of_original, variants)]
    # Wide enough for what protrudes from the original.
    common = view_along(np.concatenate([mesh.vertices for mesh in meshes]), own.axes)
    if style == "scaled":
        return [_framed_strip(meshes, labels, own)]
    if style == "on_original":
        # A vertex that is gone has no label, and is drawn in grey.
        carried = [
            np.where(variant.counterpart < 0, BACKGROUND, of_variant[variant.counterpart])
            for variant, of_variant in zip(variants, labels[1:], strict=True)
        ]
        upper = [surface(reference.mesh, own, labels=each) for each in (reference.labels, *carried)]
        return [_strip(upper), _framed_strip(meshes, labels, own)]
    if style == "edges":
        return _strips_with_edges(meshes, labels, common)
    if style == "transparent":
        added = [_added_faces(variant) for variant in variants]
        seen_through = [
            surface(mesh, common, labels=each, solid=solid, opacity=OPACITY)
            for mesh, each, solid in zip(meshes[1:], labels[1:], added, strict=True)
        ]
        return [_strip([surface(reference.mesh, common, labels=reference.labels), *seen_through])]
    ghosts = [None, *map(_cut_off, variants)]
    pictures = [
        surface(mesh, common, labels=each, ghost=ghost)
        for mesh, each, ghost in zip(meshes, labels, ghosts, strict=True)
    ]
    return [_strip(pictures, GONE if any(ghost is not None for ghost in ghosts) else "")]


def choose_view(mesh: trimesh.Trimesh, counterparts: Sequence[np.ndarray]) -> View:
    """The view that shows what the variants of a shape lack: the usual one, unless that hides it.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        n vertices, the original
    counterparts : sequence of (n,) int arrays
        for each variant, its vertex for each vertex of the original, -1 if it is gone

    Returns
    -------
    View
        framed on the original
    """
    vertices = np.asarray(mesh.vertices)
    gone = [faces for faces in (_gone_faces(mesh, each) for each in counterparts) if faces.mean() > MUCH_GONE]
    views = [view_of(vertices, turn=turn) for turn in TURNS]
    if not gone:
        return views[0]
    shares = np.array([_visible_shares(mesh, view, gone) for view in views])
    # What is least visible counts, relative to the view that shows most of it.
    score = (shares / np.maximum(shares.max(axis=0), 1e-9)).min(axis=1)
    return views[0] if score[0] >= VISIBLE_ENOUGH * score.max() else views[int(score.argmax())]


def _gone_faces(mesh: trimesh.Trimesh, counterpart: np.ndarray) -> np.ndarray:
    """The faces of an original of which no corner is left: (m,) bool array."""
    return np.all(counterpart[mesh.faces] < 0, axis=1)


def _cut_off(variant: Any) -> trimesh.Trimesh | None:
    """What a variant lacks, up to its border; None if that is little."""
    original = variant.reference.mesh
    if _gone_faces(original, variant.counterpart).mean() <= MUCH_GONE:
        return None
    touched = np.any(variant.counterpart[original.faces] < 0, axis=1)
    return original.submesh([np.flatnonzero(touched)], append=True, repair=False)


def _visible_shares(mesh: trimesh.Trimesh, view: View, gone: Sequence[np.ndarray]) -> list[float]:
    """The share of a picture of the original that each set of faces takes."""
    seen = visible_faces(mesh, view)
    seen = seen[seen >= 0]
    return [float(faces[seen].mean()) for faces in gone]


def detail_view(mesh: trimesh.Trimesh, labels: np.ndarray, view: View) -> View:
    """A frame of some triangles that face the camera, with a boundary between segments in it if there is one.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        n vertices
    labels : (n,) int array
    view : View
        of the whole shape

    Returns
    -------
    View
        along the same axes, ``DETAIL_EDGES`` mean edge lengths wide, and at most half as large as the shape
    """
    from scipy.ndimage import uniform_filter  # here, because it takes long to import

    size = (180, 150)
    seen = visible_faces(mesh, view, size)
    extent = min(DETAIL_EDGES * float(mesh.edges_unique_length.mean()), LARGEST_DETAIL * float(view.extent.max()))
    window = max(round(extent / pixel_length(view, size)), 3)
    facing = np.where(seen >= 0, (mesh.face_normals @ view.axes[2])[seen], 0.0).clip(0)
    label = np.where(seen >= 0, labels[mesh.faces[:, 0]][seen], BACKGROUND - 1)
    boundary = np.zeros(seen.shape)
    boundary[:, 1:] += (label[:, 1:] != label[:, :-1]) & (seen[:, 1:] >= 0) & (seen[:, :-1] >= 0)
    score = uniform_filter(facing, window, mode="constant")
    score = score + 0.3 * (uniform_filter(boundary, max(window // 2, 1), mode="constant") > 1e-9)
    row, column = np.unravel_index(np.where(seen >= 0, score, -1.0).argmax(), seen.shape)
    centre = np.asarray(mesh.triangles_center[seen[row, column]])
    return View(view.axes, centre, np.array([extent, extent * size[1] / size[0]]))


def _strip(pictures: list[np.ndarray], remark: str = "") -> Strip:
    return Strip(pictures, [0.0] * len(pictures), remark)


def _framed_strip(meshes: Sequence[trimesh.Trimesh], labels: Sequence[np.ndarray], own: View) -> Strip:
    """Each mesh in a frame of its own, with a scale bar."""
    views = [view_along(np.asarray(mesh.vertices), own.axes) for mesh in meshes]
    units = [pixel_length(view) for view in views]
    pictures = [surface(mesh, view, labels=each) for mesh, view, each in zip(meshes, views, labels, strict=True)]
    return Strip(pictures, [RULER * min(TILE) * min(units) / unit for unit in units])


def _strips_with_edges(meshes: Sequence[trimesh.Trimesh], labels: Sequence[np.ndarray], common: View) -> list[Strip]:
    """The whole shapes, with edges only where these are far enough apart, and a detail of each."""
    detail = detail_view(meshes[0], labels[0], common)
    whole = [
        surface(mesh, common, labels=each, edges=mesh.edges_unique_length.mean() > DENSE * pixel_length(common))
        for mesh, each in zip(meshes, labels, strict=True)
    ]
    close = [surface(mesh, detail, labels=each, edges=True) for mesh, each in zip(meshes, labels, strict=True)]
    return [_strip(whole), _strip(close)]


def _colours_of_original(variant: Any) -> np.ndarray:
    before, after = variant.compared()
    return match_colours(before, after, variant.labels)


def _added_faces(variant: Any) -> np.ndarray:
    return find_added_faces(variant.reference.mesh.faces, variant.mesh.faces, variant.counterpart)


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


def _evenly(items: list[Item], count: int) -> list[Item]:
    if count >= len(items):
        return items
    return [items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int)] if count > 0 else []
