"""Scenes of one mesh by the time for which heat flows: segments, and the functions on the surface that lead to them."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from heatwalk import Segmentation, segment_at_times
from heatwalk.robust.segmentation import RobustSegmentation, segment_robust_at_times
from studies.figures.colours import BACKGROUND, match_colours
from studies.figures.scenes import Field, Reduced, Scene, Surface, Viewport, reduce_mesh
from studies.figures.views import view_of
from studies.metrics import change_percentage, match_labels

TIMES = 20
BEFORE = 10  # how many of them are shorter than the time that was asked for
PER_OCTAVE = 5
# Of a mesh with more vertices than these, fewer times are shown, so that its page takes little longer than segmenting
# it: the shorter the shortest time, the more eigenpairs are needed, and each time is another walk.
MANY_VERTICES, FEW_STEPS = 100_000, (-2, 0, 2)
VERY_MANY_VERTICES = 400_000  # of these, one time only, without margins

MOST_FACES = 30000  # of a surface: a page with four of them has less than 15 MB
MOST_DIVERGENCES = 5000  # vertices of a mesh up to which the two divergences are shown: they take O(n²) time

HKS = "heat kernel signature"
TEST = "dissipator test"
FROM_UNIFORM = "divergence from uniform"
FROM_REGION = "divergence from region"
MARGIN = "margin"

UNITS = {
    HKS: "h(x, x) on the mesh of area 1",
    TEST: "nats, from region − from uniform; above 0 it dissipates",
    FROM_UNIFORM: "nats",
    FROM_REGION: "nats",
    MARGIN: "(0: another label ties with this one)",
}
ENDS = (5, 95)  # percentiles of a function on the first surface at the ends of the colours


@dataclass(frozen=True, eq=False)
class AtTime:
    """The segmentation of a mesh with n vertices at one time.

    Parameters
    ----------
    labels : (n,) int32 array
        as of `heatwalk.segment`, with `BACKGROUND` for the dissipator region
    n_segments : int
    fields : mapping of str to (k,) float array
        functions at the vertices that are displayed, by name
    chosen : float, optional
        the time that the robust variant chose
    """

    labels: np.ndarray
    n_segments: int
    fields: Mapping[str, np.ndarray]
    chosen: float | None = None


@dataclass(frozen=True, eq=False)
class Side:
    """A mesh as it is displayed, and how one method segments it over time.

    Parameters
    ----------
    title, row : str
        of its viewports
    reduced : Reduced
    surface : Surface
        the reduced mesh
    at_times : sequence of AtTime
    like : int, optional
        number of the side, before this one, whose colours matching parts have
    counterpart : (n,) int array, optional
        the vertex for each vertex of that side, -1 if there is none
    compared : bool
        whether the change from that side is measured and can be highlighted
    """

    title: str
    row: str
    reduced: Reduced
    surface: Surface
    at_times: Sequence[AtTime]
    like: int | None = None
    counterpart: np.ndarray | None = None
    compared: bool = False


def times_around(time: float, n_vertices: int = 0) -> list[float]:
    """Twenty times, ascending, from a quarter of a time to 3.5 times it; the time itself is the eleventh.

    Of meshes with more than `MANY_VERTICES` vertices three, and with more than `VERY_MANY_VERTICES` the time itself.

    Examples
    --------
    >>> times_around(1.0)[:3], times_around(1.0)[10:12]
    ([0.25, 0.287, 0.33], [1.0, 1.15])
    >>> times_around(1.0, 200_000)
    [0.758, 1.0, 1.32]
    """
    numbers: Sequence[int] = [i - BEFORE for i in range(TIMES)]
    if n_vertices > MANY_VERTICES:
        numbers = [0] if n_vertices > VERY_MANY_VERTICES else FEW_STEPS
    steps = [number / PER_OCTAVE for number in numbers]
    return [float(f"{time * 2**step:.3g}") if step else float(time) for step in steps]


def displayed(vertices: np.ndarray, faces: np.ndarray) -> tuple[Reduced, Surface]:
    """A mesh as it is displayed."""
    reduced = reduce_mesh(vertices, faces, MOST_FACES)
    return reduced, reduced.surface(np.asarray(vertices, np.float64))


def segmentations(
    vertices: np.ndarray,
    faces: np.ndarray,
    times: Sequence[float],
    shown: np.ndarray,
    robust: bool = False,
) -> list[AtTime]:
    """Segmentations at several times, from a single spectrum.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    times : sequence of float
        in the unit of the paper
    shown : (k,) int array
        vertices at which functions are wanted
    robust : bool
        whether those of `heatwalk.segment_robust` instead of `heatwalk.segment`

    Returns
    -------
    list of AtTime

    Raises
    ------
    heatwalk.MeshError, heatwalk.SpectrumError
        as `heatwalk.segment`

    Examples
    --------
    >>> import trimesh
    >>> mesh = trimesh.creation.icosphere(3).apply_scale([4, 1.2, 1])
    >>> few, many = segmentations(mesh.vertices, mesh.faces, [10, 0.3], np.arange(5))
    >>> few.n_segments < many.n_segments, many.fields[HKS].shape
    (True, (5,))
    """
    at_times: Iterator[Segmentation] = (segment_robust_at_times if robust else segment_at_times)(vertices, faces, times)
    return [_at_time(segmentation, shown) for segmentation in at_times]


def _at_time(segmentation: Segmentation, shown: np.ndarray) -> AtTime:
    """What is kept of a segmentation, whose kernel is large."""
    excess = segmentation.relative_entropy_excess[shown]
    rows = segmentation.kernel.factor[shown]
    fields = {
        HKS: np.einsum("ij,ij->i", rows, rows),
        TEST: excess,
    }
    if len(segmentation.labels) <= VERY_MANY_VERTICES:
        fields[MARGIN] = segmentation.margin[shown]
    if len(segmentation.labels) <= MOST_DIVERGENCES:
        fields[FROM_UNIFORM] = segmentation.divergence_from_uniform[shown]
        fields[FROM_REGION] = fields[FROM_UNIFORM] + excess
    labels = np.where(segmentation.dissipates, BACKGROUND, segmentation.labels).astype(np.int32)
    is_robust = isinstance(segmentation, RobustSegmentation)
    return AtTime(labels, segmentation.n_segments, fields, segmentation.time if is_robust else None)


def scenes_by_time(times: Sequence[float], sides: Sequence[Side], first: int = BEFORE) -> list[Scene]:
    """The scenes of a viewer with a slider over times.

    Parameters
    ----------
    times : sequence of float
        ascending
    sides : sequence of Side
        each with a segmentation for each time; the first is where ranges of colours come from
    first : int
        number of the time that is shown first

    Returns
    -------
    list of Scene
        one for each time, that which is shown first before the others
    """
    colours = [_colours_over_time([each.labels for each in sides[0].at_times], first)]
    for side in sides[1:]:
        colours.append(_colours_like(side, sides, colours))
    axes = view_of(np.asarray(sides[0].surface.vertices)).axes
    order = [first, *(i for i in range(len(times)) if i != first)]
    return [_scene(times[i], i, sides, [each[i] for each in colours], axes) for i in order]


def _colours_over_time(labels: Sequence[np.ndarray], first: int) -> list[np.ndarray]:
    """Parts of a mesh in the colours that they have at the next time on the way to the first."""
    colours = list(labels)
    for i in (*range(first - 1, -1, -1), *range(first + 1, len(labels))):
        nearer = colours[i + 1 if i < first else i - 1]
        colours[i] = _in_free_colours(match_colours(nearer, labels[i], labels[i]), nearer)
    return colours


def _colours_like(side: Side, sides: Sequence[Side], colours: Sequence[Sequence[np.ndarray]]) -> list[np.ndarray]:
    """Parts of a side in the colours of those of another that they are matched with."""
    if side.like is None:
        return [each.labels for each in side.at_times]
    made = []
    for reference, at_time in zip(colours[side.like], side.at_times, strict=True):
        kept, place = _kept(side, len(reference))
        matched = match_colours(reference[kept], at_time.labels[place], at_time.labels)
        made.append(_in_free_colours(matched, reference))
    return made


def _in_free_colours(colours: np.ndarray, reference: np.ndarray) -> np.ndarray:
    """Colours without counterpart in a reference as the smallest numbers that are free."""
    taken = set(np.unique(reference).tolist())
    new = [number for number in np.unique(colours).tolist() if number >= 0 and number not in taken]
    free = (number for number in range(len(taken) + len(new) + 1) if number not in taken)
    table = np.arange(max(colours.max(initial=0), 0) + 1)
    table[new] = [next(free) for _ in new]
    return np.where(colours >= 0, table[colours], BACKGROUND).astype(np.int32)


def _kept(side: Side, n_vertices: int) -> tuple[np.ndarray, np.ndarray]:
    """Which vertices of the side that it is like have a counterpart, and the counterparts."""
    counterpart = np.arange(n_vertices) if side.counterpart is None else side.counterpart
    kept = counterpart >= 0
    return kept, counterpart[kept]


def _scene(time: float, i: int, sides: Sequence[Side], colours: Sequence[np.ndarray], axes: np.ndarray) -> Scene:
    """What is seen at one time."""
    changed: list[np.ndarray | None] = [None] * len(sides)
    notes = []
    for number, side in enumerate(sides):
        at_time = side.at_times[i]
        note = f"{at_time.n_segments} segment{'' if at_time.n_segments == 1 else 's'}"
        if at_time.chosen is not None:
            note += f" at time {at_time.chosen:.3g}"
        if side.compared and side.like is not None:
            before, after = sides[side.like].at_times[i].labels, at_time.labels
            kept, place = _kept(side, len(before))
            note += f", CP {change_percentage(before[kept], after[place]):.1f} %"
            moved = match_labels(before[kept], after[place]) != before[kept]
            changed[side.like], changed[number] = np.zeros(len(before), bool), np.zeros(len(after), bool)
            changed[side.like][kept], changed[number][place[moved]] = moved, True  # type: ignore[index]
        notes.append(note)
    viewports = []
    for number, side in enumerate(sides):
        moved_here, source = changed[number], side.reduced.source
        viewports.append(
            Viewport(
                side.surface,
                side.title,
                side.row,
                notes[number],
                colours[number][source],
                None if moved_here is None else moved_here[source],
                _fields(side.at_times[i].fields, sides[0].at_times[i].fields),
            )
        )
    return Scene({"time": time}, viewports, f"time {time:g}", axes=axes)


def _fields(fields: Mapping[str, np.ndarray], first: Mapping[str, np.ndarray]) -> dict[str, Field]:
    """Functions with the ends of their colours, which are those on the first surface."""
    made = {}
    for name, values in fields.items():
        low, high = np.percentile(first.get(name, values), ENDS).tolist()
        if name == MARGIN:
            low = 0.0
        if name == TEST:
            high = max(abs(low), abs(high))
            low = -high
        made[name] = Field(values, low, high, UNITS[name], diverging=name == TEST)
    return made


def sides_of(
    original: tuple[np.ndarray, np.ndarray],
    variant: tuple[np.ndarray, np.ndarray, np.ndarray] | None,
    times: Sequence[float],
    methods: Mapping[str, bool],
    done: Callable[[Side], None] = lambda side: None,
) -> list[Side]:
    """All combinations of a mesh and its variant with the methods that segment them.

    Parameters
    ----------
    original : vertices (n, 3) and faces (m, 3)
    variant : vertices, faces, and for each vertex of the original its counterpart, -1 if it has none; optional
    times : sequence of float
    methods : mapping of str to bool
        whether it is the robust variant, by name
    done : callable
        called with each side once it is complete

    Returns
    -------
    list of Side
        the original first; a row for each method if there is a variant
    """
    before = displayed(*original)
    after = before
    if variant is not None:
        same_faces = len(variant[0]) == len(original[0]) and np.array_equal(variant[1], original[1])
        # Of a variant with the same triangles the same vertices are shown.
        after = (before[0], before[0].surface(variant[0])) if same_faces else displayed(variant[0], variant[1])
    sides: list[Side] = []

    def add(side: Side) -> None:
        sides.append(side)
        done(side)

    for number, (method, robust) in enumerate(methods.items()):
        several = variant is not None and len(methods) > 1
        add(
            Side(
                "original" if variant is not None else method,
                method if several else "",
                *before,
                segmentations(*original, times, before[0].source, robust),
                like=0 if number else None,
                compared=number > 0 and variant is None,
            )
        )
        if variant is not None:
            add(
                Side(
                    "variant",
                    method if several else "",
                    *after,
                    segmentations(variant[0], variant[1], times, after[0].source, robust),
                    like=len(sides) - 1,
                    counterpart=variant[2],
                    compared=True,
                )
            )
    return sides
