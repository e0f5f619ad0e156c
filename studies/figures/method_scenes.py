"""Scenes of what the Heat Walk computes: heat, the steps of the walk, its functions on a surface, poses, variants.

`studies.figures.method_figures` has the same as pictures for print.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

import perturb
from heatwalk import Segmentation, segment, segment_at_times
from heatwalk.io import LoadedMesh
from studies.figures.colours import BACKGROUND, match_colours
from studies.figures.method_figures import labels_with_background
from studies.figures.parts import describe_parts, match_parts, most_typical
from studies.figures.pictures import label_of
from studies.figures.scenes import MOST_FACES, Field, Heat, Reduced, Scene, Surface, Viewport, reduce_mesh
from studies.figures.time_scenes import Side, scenes_by_time, segmentations, times_around
from studies.figures.views import view_of
from studies.metrics import change_percentage, match_labels
from studies.reporting.text import count_of

if TYPE_CHECKING:
    from studies.experiments.named_perturbations import NamedPerturbation

VERSION = 2  # raise it when a change alters scenes: they are then made again
POSITION = "position"  # of the slider
TIMES = (0.1, 0.2, 0.35, 0.6, 1.0, 1.6, 2.7, 4.5, 7.5, 12.0)
FIRST = TIMES.index(1.0)
MIN_WEIGHT = 1e-6  # of an eigenpair in the heat at the shortest time; a colour has 254 steps
MOST_DIVERGENCES = 12000  # vertices of a mesh whose divergences are shown: they take O(n²) time
FACING = 0.7  # least cosine between the line of sight and the normal of a vertex that heat starts from
SCATTER, COLOURS = 7919, 20  # so that neighbouring groups, whose numbers are near, differ in colour
CROWD = 24000  # faces displayed of all meshes that are shown side by side
ENDS = (1, 99)  # percentiles at the ends of the colours


@dataclass(frozen=True, eq=False)
class Shape:
    """A mesh, and how it is displayed.

    Parameters
    ----------
    name : str
    mesh : LoadedMesh
    upright : {1, 2}
        the vertical axis, see `studies.figures.views.view_of`
    most_faces : int
        that are displayed
    method : optional
        a Heat Walk with options of its own, with the methods ``segmentation`` and ``segmentations`` of
        `studies.segmenters.heat_walk.HeatWalk`; by default that of the paper at time 1
    """

    name: str
    mesh: LoadedMesh
    upright: int = 1
    most_faces: int = MOST_FACES
    method: Any = None

    @cached_property
    def reduced(self) -> Reduced:
        """The vertices that are displayed."""
        return reduce_mesh(self.mesh.vertices, self.mesh.faces, self.most_faces)

    @cached_property
    def surface(self) -> Surface:
        """The displayed mesh."""
        return self.reduced.surface(np.asarray(self.mesh.vertices, np.float64))

    @cached_property
    def axes(self) -> np.ndarray:
        """The directions from which it is seen first."""
        return view_of(np.asarray(self.mesh.vertices), self.upright).axes

    @cached_property
    def over_time(self) -> list[Segmentation]:
        """Its segmentations at all of `TIMES`."""
        at_times = segment_at_times if self.method is None else self.method.segmentations
        return list(at_times(self.mesh.vertices, self.mesh.faces, TIMES))

    @cached_property
    def segmentation(self) -> Segmentation:
        """That at time 1, or with the options of the method."""
        if self.method is not None:
            return self.method.segmentation(self.mesh.vertices, self.mesh.faces)
        return self.over_time[FIRST] if "over_time" in self.__dict__ else segment(self.mesh.vertices, self.mesh.faces)

    @cached_property
    def facing(self) -> np.ndarray:
        """The displayed vertices that face the viewer, all of them if none does."""
        mesh = perturb.as_trimesh(self.mesh.vertices, self.mesh.faces)
        faces_viewer = np.flatnonzero((mesh.vertex_normals @ self.axes[2])[self.reduced.source] > FACING)
        return faces_viewer if len(faces_viewer) else np.arange(len(self.reduced.source))

    def heat(self, seg: Segmentation, point: int) -> Heat:
        """Heat from a displayed vertex at the time of one of its segmentations."""
        eigenvalues = seg.spectrum.eigenvalues
        shortest = TIMES[0] / seg.time * seg.standard_time
        with np.errstate(invalid="ignore"):
            counted = (np.exp(-eigenvalues * shortest) >= MIN_WEIGHT).any(axis=0)
        return Heat(
            eigenvalues[:, counted],
            seg.spectrum.eigenvectors[self.reduced.source][:, counted],
            seg.spectrum.component[self.reduced.source],
            seg.standard_time,
            point,
        )

    def viewport(self, labels: np.ndarray | None, title: str = "", note: str = "") -> Viewport:
        """The displayed mesh with labels of all vertices."""
        return Viewport(self.surface, title, "", note, None if labels is None else labels[self.reduced.source])


def _upright(shape: Shape, viewport: Viewport) -> Viewport:
    """A viewport beside those of other shapes, each of which is seen from its own direction."""
    return replace(viewport, axes=shape.axes)


def _in_order(scenes: Sequence[Scene], first: int = FIRST) -> list[Scene]:
    """Scenes over time, that which is shown first before the others."""
    return [scenes[first], *scenes[:first], *scenes[first + 1 :]]


def pipeline_scenes(shape: Shape) -> list[Scene]:
    """The mesh, heat from a vertex, the accumulator regions, and these with the dissipator region, by time (Figure 1).

    Heat starts from the displayed exemplar, or the displayed vertex next to it, that is nearest to the viewer.
    """
    towards = np.asarray(shape.mesh.vertices) @ shape.axes[2]
    exemplars = shape.segmentation.exemplars
    exemplar = np.asarray(shape.mesh.vertices)[exemplars[towards[exemplars].argmax()]]
    point = int(np.linalg.norm(shape.surface.vertices - exemplar, axis=1).argmin())
    named = shape.segmentation.accumulator_labels
    scenes = []
    for time, seg in zip(TIMES, shape.over_time, strict=True):
        regions = match_colours(named, seg.accumulator_labels, seg.accumulator_labels)
        with_dissipators = np.where(seg.dissipates, BACKGROUND, regions)
        viewports = [
            shape.viewport(None, "mesh", f"{len(shape.mesh.vertices):,} vertices"),
            replace(shape.viewport(None, "heat from a vertex"), heat=shape.heat(seg, point)),
            shape.viewport(regions, "accumulator regions", count_of(len(seg.exemplars), "region")),
            shape.viewport(with_dissipators, "with dissipators", f"{100 * seg.dissipates.mean():.0f} % dissipate"),
        ]
        scenes.append(Scene({POSITION: time}, viewports, axes=shape.axes, slider="time"))
    return _in_order(scenes)


def diffusion_scenes(shape: Shape) -> list[Scene]:
    """Heat from a dissipator and from an accumulator, by time (Figure 2).

    Of the displayed vertices that face the viewer, those of the smallest and of the largest heat kernel signature.
    """
    signature = shape.segmentation.kernel.diagonal()[shape.reduced.source][shape.facing]
    points = {
        "from a dissipator": int(shape.facing[signature.argmin()]),
        "from an accumulator": int(shape.facing[signature.argmax()]),
    }
    scenes = [
        Scene(
            {POSITION: time},
            [replace(shape.viewport(None, title), heat=shape.heat(seg, point)) for title, point in points.items()],
            axes=shape.axes,
            slider="time",
        )
        for time, seg in zip(TIMES, shape.over_time, strict=True)
    ]
    return _in_order(scenes)


def walk_scenes(shape: Shape) -> list[Scene]:
    """The groups after each step of the walk, beside the regions (Figure 3); those that still walk are pale."""
    seg = shape.segmentation
    scenes = []
    for step, (groups, settled) in enumerate(zip(seg.walk.steps, seg.walk.settled_shares(), strict=True)):
        walking = groups != seg.walk.steps[-1]
        labels = np.where(walking, groups * SCATTER % COLOURS, seg.walk.labels)
        note = f"{count_of(len(np.unique(groups)), 'group')}, {100 * settled:.1f} % settled"
        after = replace(
            shape.viewport(labels, f"after {count_of(step, 'step')}", note), faded=walking[shape.reduced.source]
        )
        regions = shape.viewport(seg.walk.labels, "regions", count_of(len(seg.exemplars), "exemplar"))
        scenes.append(Scene({POSITION: step}, [after, regions], axes=shape.axes, slider="steps"))
    return _in_order(scenes, min(1, len(scenes) - 1))


def divergence_scenes(shape: Shape) -> list[Scene]:
    """The heat kernel signature, the two divergences, and their difference, which is the dissipator test (Figure 4)."""
    source, scenes = shape.reduced.source, []
    small = len(shape.mesh.vertices) <= MOST_DIVERGENCES
    for time, seg in zip(TIMES, shape.over_time, strict=True):
        functions = {"heat kernel signature": (seg.kernel.diagonal(), "h(x, x)")}
        if small:
            functions["divergence from uniform"] = (seg.divergence_from_uniform, "nats")
            functions["divergence from region"] = (seg.divergence_from_region, "nats")
        fields = {}
        for name, (values, unit) in functions.items():
            low, high = np.percentile(values, ENDS).tolist()
            fields[name] = Field(values[source], low, high, unit)
        excess = seg.relative_entropy_excess
        reach = float(np.abs(np.percentile(excess, ENDS)).max())
        fields["dissipator test"] = Field(excess[source], -reach, reach, "nats", diverging=True)
        viewports = [
            replace(shape.viewport(None, name), fields={name: field}, shows=name) for name, field in fields.items()
        ]
        scenes.append(Scene({POSITION: time}, viewports, axes=shape.axes, slider="time"))
    return _in_order(scenes)


def time_scenes(shape: Shape) -> list[Scene]:
    """The segments at twenty times around 1 (Figure 15), with the functions that lead to them."""
    times = times_around(1.0)
    at_times = segmentations(shape.mesh.vertices, shape.mesh.faces, times, shape.reduced.source)
    side = Side(shape.name, "", shape.reduced, shape.surface, at_times)
    return [
        replace(scene, at={POSITION: scene.at["time"]}, axes=shape.axes, slider="time", text="")
        for scene in scenes_by_time(times, [side])
    ]


def showcase_scene(shapes: Sequence[Shape]) -> list[Scene]:
    """Shapes side by side (Figure 5)."""
    viewports = []
    for shape in shapes:
        seg = shape.segmentation
        viewports.append(
            _upright(
                shape, shape.viewport(labels_with_background(seg), shape.name, count_of(seg.n_segments, "segment"))
            )
        )
    return [Scene({}, viewports, axes=shapes[0].axes)]


def pose_scenes(shapes: Sequence[Sequence[tuple[Shape, np.ndarray]]]) -> list[Scene]:
    """Poses side by side, a part in the colour that it has in the first pose of its shape (Figure 6).

    Parameters
    ----------
    shapes : sequence of sequences of (Shape, (p,) int array)
        the poses of each shape: its vertices at the p points that all of its poses have in common
    """
    viewports = [viewport for poses in shapes for viewport in pose_viewports(poses)]
    return [Scene({}, viewports, axes=shapes[0][0][0].axes)]


def pose_viewports(
    poses: Sequence[tuple[Shape, np.ndarray]], labels: Sequence[np.ndarray] | None = None
) -> list[Viewport]:
    """The poses of a shape with labels of all vertices, -1 for the background, by default those of the Heat Walk."""
    if labels is None:
        labels = [labels_with_background(shape.segmentation) for shape, _ in poses]
    viewports: list[Viewport] = []
    reference = labels[0][poses[0][1]]
    for (shape, common), each in zip(poses, labels, strict=True):
        coloured = match_colours(reference, each[common], each) if viewports else each
        note = count_of(len(np.unique(each)), "segment")
        if viewports:
            note += f", CP {change_percentage(reference, each[common]):.1f} %"
        # All poses are seen as the first one: a pose may be thinnest in another direction.
        viewports.append(replace(shape.viewport(coloured, shape.name, note), axes=poses[0][0].axes))
    return viewports


def class_scene(shapes: Sequence[Shape]) -> list[Scene]:
    """Shapes of one class side by side, a part in the same colour in each (Figure 7)."""
    segs = [shape.segmentation for shape in shapes]
    all_labels = [labels_with_background(seg) for seg in segs]
    parts = [
        describe_parts(
            perturb.as_trimesh(shape.mesh.vertices, shape.mesh.faces),
            labels,
            seg.exemplars,
            view_of(np.asarray(shape.mesh.vertices), shape.upright),
        )
        for shape, seg, labels in zip(shapes, segs, all_labels, strict=True)
    ]
    reference = parts[most_typical(parts)]
    viewports = []
    for shape, seg, labels, of_shape in zip(shapes, segs, all_labels, parts, strict=True):
        numbers = match_parts(reference, of_shape)
        coloured = np.where(labels == BACKGROUND, BACKGROUND, numbers[labels])
        viewports.append(_upright(shape, shape.viewport(coloured, shape.name, count_of(seg.n_segments, "segment"))))
    return [Scene({}, viewports, axes=shapes[0].axes)]


def perturbed_scenes(shape: Shape, named: NamedPerturbation, seed: int = 0) -> list[Scene]:
    """The mesh beside its variants, by the level of a perturbation's study (Figures 8 to 14)."""
    before = labels_with_background(shape.segmentation)
    mesh = perturb.as_trimesh(shape.mesh.vertices, shape.mesh.faces)
    return [_perturbed(shape, before, mesh, named, level, seed) for level in named.levels]


def _perturbed(shape: Shape, before: np.ndarray, mesh: Any, named: NamedPerturbation, level: float, seed: int) -> Scene:
    """The mesh beside a variant, a part in the same colour in both."""
    made = named.at(level)(mesh, np.random.default_rng(seed))
    varied = _varied(shape, made.mesh)
    after = labels_with_background(varied.segmentation)
    kept = made.counterpart >= 0
    place = made.counterpart[kept]
    coloured = match_colours(before[kept], after[place], after)
    moved = match_labels(before[kept], after[place]) != before[kept]
    changed, changed_after = np.zeros(len(before), bool), np.zeros(len(after), bool)
    changed[kept], changed_after[place[moved]] = moved, True
    note = f"{count_of(len(np.unique(after)), 'segment')}, CP {change_percentage(before[kept], after[place]):.1f} %"
    original = shape.viewport(before, "original", count_of(len(np.unique(before)), "segment"))
    viewports = [
        replace(original, changed=changed[shape.reduced.source]),
        replace(varied.viewport(coloured, "variant", note), changed=changed_after[varied.reduced.source]),
    ]
    return Scene({POSITION: level}, viewports, axes=shape.axes, slider=named.unit)


def _varied(shape: Shape, mesh: Any) -> Shape:
    """A variant, displayed by the same vertices if it has the same faces."""
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    varied = replace(shape, mesh=LoadedMesh(vertices, faces, ()))
    if len(vertices) == len(shape.mesh.vertices) and np.array_equal(faces, shape.mesh.faces):
        varied.__dict__["reduced"] = shape.reduced
    return varied


OF_ONE: Mapping[str, Callable[[Shape], list[Scene]]] = {
    "pipeline": pipeline_scenes,
    "diffusion": diffusion_scenes,
    "walk": walk_scenes,
    "divergences": divergence_scenes,
    "times": time_scenes,
}
OF_SEVERAL: Mapping[str, Callable[[Sequence[Shape]], list[Scene]]] = {"showcase": showcase_scene, "class": class_scene}


@dataclass(frozen=True, eq=False)
class AnatomyScenes:
    """The scenes of some pictures of the method, made in worker processes.

    Parameters
    ----------
    shown : sequence of (str, str, sequence of Trial)
        a name, what it shows (a key of `OF_ONE` or `OF_SEVERAL`), and trials with a model and a Heat Walk
    """

    shown: Sequence[tuple[str, str, Sequence[Any]]]
    slider: ClassVar[str] = POSITION

    @property
    def content(self) -> str:
        """What is shown, and the ids of the trials."""
        return f"{VERSION}: {[(name, shows, [each.trial_id for each in trials]) for name, shows, trials in self.shown]}"

    def tasks(self) -> list[tuple[str, str, Sequence[Any]]]:
        """One for each picture."""
        return list(self.shown)

    @staticmethod
    def function(task: tuple[str, str, Sequence[Any]]) -> list[Scene]:
        """The scenes of a picture."""
        name, shows, trials = task
        most_faces = MOST_FACES if shows in OF_ONE else CROWD // len(trials)
        shapes = [
            Shape(label_of(each.model), each.model.load(), 1, most_faces, each.segmenter.method) for each in trials
        ]
        return named(OF_ONE[shows](shapes[0]) if shows in OF_ONE else OF_SEVERAL[shows](shapes), "picture", name)


@dataclass(frozen=True, eq=False)
class PoseScenes:
    """A scene for each shape: some of its poses, a row for each method, made in worker processes.

    Parameters
    ----------
    shown : sequence of (str, sequence of (Trial, sequence of str))
        a shape, and for each method a trial and the names of the poses that are shown
    upright : {1, 2}
        the vertical axis, see `studies.figures.views.view_of`
    """

    shown: Sequence[tuple[str, Sequence[tuple[Any, Sequence[str]]]]]
    upright: int = 1
    slider: ClassVar[str] = POSITION

    @property
    def content(self) -> str:
        """The poses, and what determines their segmentations."""
        groups = [(shape, [(trial.group_key, list(names)) for trial, names in rows]) for shape, rows in self.shown]
        return f"{VERSION}: {groups}"

    def tasks(self) -> list[tuple[str, Sequence[tuple[Any, Sequence[str]]], int]]:
        """One for each shape."""
        return [(shape, rows, self.upright) for shape, rows in self.shown]

    @staticmethod
    def function(task: tuple[str, Sequence[tuple[Any, Sequence[str]]], int]) -> list[Scene]:
        """The scene of a shape."""
        shape, rows, upright = task
        shapes: dict[str, tuple[Shape, np.ndarray]] = {}
        viewports: list[Viewport] = []
        for trial, names in rows:
            models = {model.name: model for model in trial.poses}
            for name in names:
                if name not in shapes:
                    posed = Shape(label_of(models[name]), models[name].load(), upright, CROWD // len(names))
                    shapes[name] = posed, models[name].correspondence()
            poses = [shapes[name] for name in names]
            segmenter = trial.segmenter_of_shape()
            labels = [labels_by(segmenter, posed.mesh) for posed, _ in poses]
            row = trial.segmenter_name if len(rows) > 1 else ""
            viewports += [replace(each, row=row) for each in pose_viewports(poses, labels)]
        first = next(iter(shapes.values()))[0]
        return [Scene({"shape": shape}, viewports, axes=first.axes)]


def labels_by(segmenter: Any, mesh: LoadedMesh) -> np.ndarray:
    """The labels of a method, with the dissipator region of a Heat Walk as the background."""
    if hasattr(segmenter.method, "segmentation"):
        return labels_with_background(segmenter.method.segmentation(mesh.vertices, mesh.faces))
    return np.asarray(segmenter(mesh.vertices, mesh.faces))


def named(scenes: Iterable[Scene], key: str, value: str) -> list[Scene]:
    """Scenes that are picked by one more value, before the others."""
    return [replace(scene, at={key: value, **scene.at}) for scene in scenes]
