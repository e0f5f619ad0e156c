"""Figures of what the Heat Walk computes: its steps, its functions on a surface, and its segmentations.

Each of the functions turns a mesh and its segmentation into a `MethodFigure`: tiles, and the numbers that belong in the
caption. The pictures `AnatomyPlate`, `PosePlate` and `TimePlate` call them in a worker, for the trials of a study.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

import perturb
from heatwalk.io import label_colours
from studies.figures.colours import BACKGROUND, match_colours
from studies.figures.parts import describe_parts, match_parts, most_typical
from studies.figures.pictures import ColourBar, Picture, Row, Tile, label_of
from studies.figures.surfaces import surface
from studies.figures.views import view_of
from studies.metrics import change_percentage
from studies.reporting.text import count_of

if TYPE_CHECKING:
    import trimesh
    from matplotlib.figure import Figure

    from heatwalk import Segmentation
    from heatwalk.accumulators import HeatWalk
    from heatwalk.kernel import HeatKernel

REFERENCE_TIME = 1.0  # time of the segmentation by which the parts at other times are named
RADIUS_SHARE = 0.9  # share of the heat within the diffusion radius
FADING = 0.6  # how far the colours of groups that still walk are faded to white, 0 to 1
FACING = 0.7  # least cosine between the line of sight and the normal of a vertex that is marked
STEPS_PER_ROW = 6
SHAPES_PER_ROW = 5


@dataclass(frozen=True, eq=False)
class MethodFigure:
    """Tiles in rows, and the numbers that belong in their caption.

    Parameters
    ----------
    rows : list of Row
    numbers : dict
        name -> number or numbers; each function documents its own
    """

    rows: list[Row]
    numbers: dict[str, Any] = field(default_factory=dict)


def pipeline(mesh: trimesh.Trimesh, seg: Segmentation) -> MethodFigure:
    """The input, heat from a point, the accumulator regions, and these with the dissipator region (Figure 1).

    The point is the exemplar nearest to the viewer, which nothing hides.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    seg : heatwalk.Segmentation
        of this mesh

    Returns
    -------
    MethodFigure
        numbers: vertices, exemplar (the point), accumulator_regions, dissipator_share (of the vertices)
    """
    view = view_of(np.asarray(mesh.vertices))
    depth = np.asarray(mesh.vertices)[seg.exemplars] @ view.axes[2]
    point = int(seg.exemplars[depth.argmax()])
    heat = _heat(seg.kernel, point)
    tiles = [
        Tile(surface(mesh, view), "(a) input"),
        Tile(
            surface(mesh, view, field=heat, points=[point]), "(b) heat from a point",
            ColourBar(heat.min(), heat.max(), "heat"),
        ),
        Tile(surface(mesh, view, labels=seg.accumulator_labels), "(c) accumulator regions"),
        Tile(surface(mesh, view, labels=labels_with_background(seg)), "(d) with dissipators"),
    ]  # fmt: skip
    numbers = {
        "vertices": len(mesh.vertices),
        "exemplar": point,
        "accumulator_regions": len(seg.exemplars),
        "dissipator_share": float(seg.dissipates.mean()),
    }
    return MethodFigure([Row(tiles)], numbers)


def diffusion(mesh: trimesh.Trimesh, seg: Segmentation) -> MethodFigure:
    """Heat from a dissipator and from an accumulator at the same time, in the same colours (Figure 2).

    The line is the diffusion radius. Of the vertices that face the viewer, the dissipator is the one whose heat
    diverges least from the uniform density, and the accumulator the one whose heat diverges most.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    seg : heatwalk.Segmentation
        of this mesh

    Returns
    -------
    MethodFigure
        numbers: for "dissipator" and "accumulator" the vertex, and after the same word "_radius", the diffusion radius
        in square roots of the mesh's area, and "_area", the share of the area within this radius
    """
    view = view_of(np.asarray(mesh.vertices))
    facing = np.flatnonzero(mesh.vertex_normals @ view.axes[2] > FACING)
    divergence = seg.divergence_from_uniform[facing]
    points = {"dissipator": int(facing[divergence.argmin()]), "accumulator": int(facing[divergence.argmax()])}
    heats = {name: _heat(seg.kernel, point) for name, point in points.items()}
    hottest = max(heat.max() for heat in heats.values())
    tiles: list[Tile] = []
    numbers: dict[str, Any] = {}
    for name, point in points.items():
        radius, distance = diffusion_radius(mesh, seg.kernel, point)
        area = float(seg.kernel.mass[distance <= radius].sum() / seg.kernel.mass.sum())
        numbers |= {name: point, f"{name}_radius": radius, f"{name}_area": area}
        # A vertex of another component is beyond any distance on the mesh.
        reached = np.where(np.isfinite(distance), distance, 2 * distance[np.isfinite(distance)].max() + 1)
        picture = surface(
            mesh, view, field=heats[name], field_range=(0.0, hottest), points=[point], contour=(reached, radius)
        )
        caption = f"{name}: radius {radius:.2f}, {100 * area:.0f} % of the area"
        tiles.append(Tile(picture, caption, ColourBar(0.0, hottest, "heat")))
    return MethodFigure([Row(tiles)], numbers)


def diffusion_radius(mesh: trimesh.Trimesh, kernel: HeatKernel, point: int) -> tuple[float, np.ndarray]:
    """The geodesic distance from a point within which 90 % of its heat is.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        n vertices
    kernel : heatwalk.kernel.HeatKernel
        of this mesh
    point : int
        a vertex

    Returns
    -------
    radius : float
        in square roots of the mesh's area
    distance : (n,) float array
        geodesic distance from the point in the same unit, infinite on another component

    Notes
    -----
    The heat in a region is the integral of h(point, ·) over it: the sum of mass times h, which is 1 over the whole
    surface. Source: Benjamin et al. 2011, section 3.
    """
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(np.asarray(mesh.vertices) / np.sqrt(mesh.area), np.asarray(mesh.faces)))
    meshes.compute_scalar_by_geodesic_distance_from_given_point_per_vertex(
        startpoint=meshes.current_mesh().vertex_matrix()[point],
        maxdistance=pymeshlab.PureValue(1e6),  # farther than any two points of a surface of area 1 in practice
    )
    distance = meshes.current_mesh().vertex_scalar_array().copy()
    distance[kernel.component != kernel.component[point]] = np.inf
    order = np.argsort(distance, kind="stable")
    within = np.cumsum((kernel.mass * _heat(kernel, point))[order])
    return float(distance[order[np.searchsorted(within, RADIUS_SHARE * within[-1])]]), distance


def walk(mesh: trimesh.Trimesh, seg: Segmentation) -> MethodFigure:
    """The groups after each step of the walk (Figure 3).

    A group whose exemplar is a root of the walk has the colour of its segment; the colours of the others are faded.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    seg : heatwalk.Segmentation
        of this mesh

    Returns
    -------
    MethodFigure
        numbers: settled, the share of vertices that have reached their exemplar, and exemplars, how many are left, each
        after 0, 1, 2 … steps
    """
    view = view_of(np.asarray(mesh.vertices))
    shares = seg.walk.settled_shares()
    tiles, left = [], []
    for step, (groups, share) in enumerate(zip(seg.walk.steps, shares, strict=True)):
        left.append(len(np.unique(groups)))
        caption = f"step {step}: {left[-1]:,} groups\n{100 * share:.1f} % settled"
        tiles.append(Tile(surface(mesh, view, colours=_group_colours(seg.walk, groups)), caption))
    return MethodFigure(_in_rows(tiles, STEPS_PER_ROW), {"settled": shares.tolist(), "exemplars": left})


def divergences(mesh: trimesh.Trimesh, seg: Segmentation) -> MethodFigure:
    """The heat kernel signature, and the divergences from the uniform density and from the region's heat (Figure 4).

    Each has its own colours, from its smallest value to its largest.

    Parameters
    ----------
    mesh : trimesh.Trimesh
    seg : heatwalk.Segmentation
        of this mesh

    Returns
    -------
    MethodFigure
        numbers: for signature, from_uniform and from_region the (smallest, largest) value, divergences in nats
    """
    view = view_of(np.asarray(mesh.vertices))
    functions = {
        "signature": (seg.kernel.diagonal(), "(a) heat kernel signature", "h(x, x)"),
        "from_uniform": (seg.divergence_from_uniform, "(b) divergence from uniform", "nats"),
        "from_region": (seg.divergence_from_region, "(c) divergence from region", "nats"),
    }
    tiles = [
        Tile(surface(mesh, view, field=values), caption, ColourBar(values.min(), values.max(), unit))
        for values, caption, unit in functions.values()
    ]
    numbers = {name: (float(values.min()), float(values.max())) for name, (values, _, _) in functions.items()}
    return MethodFigure([Row(tiles)], numbers)


def showcase(
    items: Iterable[tuple[trimesh.Trimesh, np.ndarray, str]],
    columns: int = SHAPES_PER_ROW,
    upright: int = 1,
    label: str = "",
) -> MethodFigure:
    """Segmented models or poses, each in a frame of its own (Figures 5, 6 and 7).

    Parameters
    ----------
    items : iterable of (mesh, labels, caption)
        labels are (n,) int arrays, -1 for the background; the number of segments is added to the caption. Colours mean
        the same part in two pictures only if the labels do, see `studies.figures.colours.match_colours`.
    columns : int
        most pictures in a row
    upright : {1, 2}
        the vertical axis, see `studies.figures.views.view_of`
    label : str
        above the first row

    Returns
    -------
    MethodFigure
        numbers: segments, dict of caption -> the number of segments, the background included
    """
    tiles, counts = [], {}
    for mesh, labels, caption in items:
        counts[caption] = len(np.unique(labels))
        picture = surface(mesh, view_of(np.asarray(mesh.vertices), upright), labels=labels)
        tiles.append(Tile(picture, f"{caption} ({counts[caption]})"))
    return MethodFigure(_in_rows(tiles, columns, label), {"segments": counts})


def over_time(mesh: trimesh.Trimesh, segs: Iterable[Segmentation], reference: Segmentation) -> MethodFigure:
    """One model segmented at several times (Figure 15).

    Parameters
    ----------
    mesh : trimesh.Trimesh
    segs : iterable of heatwalk.Segmentation
        of this mesh, by time
    reference : heatwalk.Segmentation
        of this mesh, at the time by which the parts are named

    Returns
    -------
    MethodFigure
        numbers: segments, dict of time -> the number of segments; change, dict of time -> Change Percentage from the
        reference
    """
    view = view_of(np.asarray(mesh.vertices))
    named = labels_with_background(reference)
    tiles, counts, change = [], {}, {}
    for seg in segs:
        labels = labels_with_background(seg)
        time = round(seg.time, 10)  # as requested, without the rounding of the factor of its unit
        counts[time], change[time] = len(np.unique(labels)), change_percentage(named, labels)
        picture = surface(mesh, view, labels=match_colours(named, labels, labels))
        tiles.append(Tile(picture, f"t = {time:g}: {count_of(counts[time], 'segment')}"))
    return MethodFigure([Row(tiles)], {"segments": counts, "change": change})


def labels_with_background(seg: Segmentation) -> np.ndarray:
    """The labels of a segmentation, with the dissipator region as the background.

    Parameters
    ----------
    seg : heatwalk.Segmentation

    Returns
    -------
    (n,) int array
        -1 for the dissipator region
    """
    return np.where(seg.dissipates, BACKGROUND, seg.labels)


COUNTED = "in parentheses: number of segments"
SAME_COLOURS = f"a part keeps its colour; {COUNTED}"


class _Plate(Picture):
    """A picture with one task, which computes and renders all of it."""

    title: str

    @property
    @abstractmethod
    def subtitle(self) -> str:
        """What is shown."""

    def figure(self, results: Sequence[MethodFigure]) -> Figure:
        """Lay the tiles out."""
        from studies.figures.layout import lay_out  # loads matplotlib, which no worker needs

        return lay_out(results[0].rows, self.title, self.subtitle)


@dataclass(frozen=True, eq=False)
class AnatomyPlate(_Plate):
    """What happens inside the Heat Walk, or what it makes of shapes.

    Parameters
    ----------
    stem : str
        name of the file, without suffix
    shows : str
        one of ``PLATES``
    trials : sequence of Trial
        trials with a model and a segmenter that is a Heat Walk; "showcase" and "class" show all of them, the others
        the first
    title : str
        of the study

    Raises
    ------
    ValueError
        if ``shows`` is unknown
    """

    stem: str
    shows: str
    trials: Sequence[Any]
    title: str = ""

    def __post_init__(self) -> None:
        if self.shows not in PLATES:
            raise ValueError(f"plates.{self.stem}.shows is {self.shows!r}: choose one of {', '.join(PLATES)}")

    @property
    def content(self) -> str:
        """The title, what is shown, and the ids of the trials."""
        return " ".join([self.title, self.shows, *(trial.trial_id for trial in self.trials)]).strip()

    @property
    def subtitle(self) -> str:
        """What the tiles show, and of which model."""
        if self.shows in OF_MODELS:
            return OF_MODELS[self.shows]
        return f"{label_of(self.trials[0].model)}: {_OF_ONE_MODEL[self.shows][1]}"

    def tasks(self) -> list[tuple[str, Sequence[Any]]]:
        """One task: what is shown, and the trials."""
        return [(self.shows, self.trials)]

    @staticmethod
    def function(task: tuple[str, Sequence[Any]]) -> MethodFigure:
        """Segment the models and render them."""
        shows, trials = task
        if shows in OF_MODELS:
            return _showcase_of_models(trials, same_colours=shows == "class")
        draw, _ = _OF_ONE_MODEL[shows]
        return draw(*_segment(trials[0]))


@dataclass(frozen=True, eq=False)
class PosePlate(_Plate):
    """Segmented poses side by side; a part has the colour that it has in the first pose shown of its shape.

    Parameters
    ----------
    stem : str
        name of the file, without suffix
    shown : sequence of (Trial, str)
        a trial that has the pose among its ``poses``, and the name of the pose
    upright : {1, 2}
        the vertical axis, see `studies.figures.views.view_of`
    title : str
        of the study
    """

    stem: str
    shown: Sequence[tuple[Any, str]]
    upright: int = 1
    title: str = ""

    @property
    def content(self) -> str:
        """The title, the poses, and what determines their segmentations."""
        return " ".join([self.title, *(f"{name} {trial.group_key}" for trial, name in self.shown)]).strip()

    @property
    def subtitle(self) -> str:
        """How to read the colours and captions."""
        return SAME_COLOURS

    def tasks(self) -> list[tuple[Sequence[tuple[Any, str]], int]]:
        """One task: the poses, and their vertical axis."""
        return [(self.shown, self.upright)]

    @staticmethod
    def function(task: tuple[Sequence[tuple[Any, str]], int]) -> MethodFigure:
        """Segment the poses and render them: rows for each shape, and for each segmenter."""
        shown, upright = task
        several_segmenters = len({trial.segmenter_name for trial, _ in shown}) > 1
        items: dict[str, list[tuple[trimesh.Trimesh, np.ndarray, str]]] = {}
        first: dict[str, np.ndarray] = {}
        for trial, name in shown:
            model = next(model for model in trial.poses if model.name == name)
            mesh = _load(model)
            labels = trial.segmenter_of_shape()(mesh.vertices, mesh.faces)
            common = labels[model.correspondence()]
            reference = first.setdefault(trial.part, common)
            label = f"{trial.part}, {trial.segmenter_name}" if several_segmenters else trial.part
            items.setdefault(label, []).append((mesh, match_colours(reference, common, labels), name))
        figures = [showcase(poses, upright=upright, label=label) for label, poses in items.items()]
        return MethodFigure(
            [row for figure in figures for row in figure.rows],
            {"segments": {label: figure.numbers["segments"] for label, figure in zip(items, figures, strict=True)}},
        )


@dataclass(frozen=True, eq=False)
class TimePlate(_Plate):
    """One model at several times.

    Parameters
    ----------
    stem : str
        name of the file, without suffix
    trial : Trial
        has a model and a segmenter that is a Heat Walk
    times : sequence of float
        in the unit of the segmenter
    title : str
        of the study
    """

    stem: str
    trial: Any
    times: Sequence[float]
    title: str = ""

    @property
    def content(self) -> str:
        """The title, the model, what determines its segmentations, and the times."""
        return f"{self.title} {self.trial.model.name} {self.trial.group_key} {list(self.times)}".strip()

    @property
    def subtitle(self) -> str:
        """Which model is shown."""
        return f"{label_of(self.trial.model)} at several times t; a part keeps its colour"

    def tasks(self) -> list[tuple[Any, list[float]]]:
        """One task: the trial, and the times."""
        return [(self.trial, list(self.times))]

    @staticmethod
    def function(task: tuple[Any, list[float]]) -> MethodFigure:
        """Segment the model at all times and render it."""
        trial, times = task
        mesh = _load(trial.model)
        segment_at_times = trial.segmenter.method.segmentations
        reference, *segmentations = segment_at_times(mesh.vertices, mesh.faces, [REFERENCE_TIME, *times])
        return over_time(mesh, segmentations, reference)


# What each plate shows, and how to read it.
_OF_ONE_MODEL: dict[str, tuple[Callable[[trimesh.Trimesh, Segmentation], MethodFigure], str]] = {
    "pipeline": (pipeline, "from the mesh to its segments"),
    "diffusion": (diffusion, "heat from a point; the line is the radius that contains 90 % of it"),
    "walk": (walk, "groups after each step of the walk; faded: still walking"),
    "divergences": (divergences, "the functions that decide on the segments"),
}
OF_MODELS = {"showcase": COUNTED, "class": SAME_COLOURS}
PLATES = (*_OF_ONE_MODEL, *OF_MODELS)


def _load(model: Any) -> trimesh.Trimesh:
    loaded = model.load()
    return perturb.as_trimesh(loaded.vertices, loaded.faces)


def _segment(trial: Any) -> tuple[trimesh.Trimesh, Segmentation]:
    mesh = _load(trial.model)
    return mesh, trial.segmenter.method.segmentation(mesh.vertices, mesh.faces)


def _showcase_of_models(trials: Sequence[Any], same_colours: bool) -> MethodFigure:
    """Models captioned by their categories if these differ, else by their names."""
    categories = [trial.model.category for trial in trials]
    by_category = all(categories) and len(set(categories)) == len(categories)
    captions = [trial.model.category if by_category else label_of(trial.model) for trial in trials]
    segmented = [_segment(trial) for trial in trials]
    labels = _labels_of_class(segmented) if same_colours else [labels_with_background(seg) for _, seg in segmented]
    return showcase((mesh, each, caption) for (mesh, _), each, caption in zip(segmented, labels, captions, strict=True))


def _labels_of_class(segmented: Sequence[tuple[trimesh.Trimesh, Segmentation]]) -> list[np.ndarray]:
    """The labels of several shapes of a class, in which a part has the same number in each."""
    all_labels = [labels_with_background(seg) for _, seg in segmented]
    all_parts = [
        describe_parts(mesh, labels, seg.exemplars, view_of(np.asarray(mesh.vertices)))
        for (mesh, seg), labels in zip(segmented, all_labels, strict=True)
    ]
    reference = all_parts[most_typical(all_parts)]
    numbers = [match_parts(reference, parts) for parts in all_parts]
    return [
        np.where(labels == BACKGROUND, BACKGROUND, number[labels])
        for labels, number in zip(all_labels, numbers, strict=True)
    ]


def _heat(kernel: HeatKernel, point: int) -> np.ndarray:
    """h(point, ·), a (n,) array, 0 on the components that its heat does not reach."""
    return np.where(kernel.component == kernel.component[point], kernel.factor @ kernel.factor[point], 0.0)


def _group_colours(walk: HeatWalk, groups: np.ndarray) -> np.ndarray:
    """The colour of each vertex by the exemplar of its group: (n, 3) uint8 array."""
    settled = groups == walk.steps[-1]
    # Neighbouring vertices have neighbouring numbers: multiplied by a prime, so that neighbours differ in colour.
    scattered = label_colours(groups * 7919 % 20)[:, :3]
    faded = np.rint(scattered + FADING * (255.0 - scattered)).astype(np.uint8)
    return np.where(settled[:, None], label_colours(walk.labels)[:, :3], faded)


def _in_rows(tiles: list[Tile], most: int, label: str = "") -> list[Row]:
    """Rows of about the same length, the first with a label."""
    columns = math.ceil(len(tiles) / math.ceil(len(tiles) / most)) if tiles else most
    return [Row(tiles[i : i + columns], "" if i else label) for i in range(0, len(tiles), columns)]
