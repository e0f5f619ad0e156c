"""Renders the charts of the leaderboard: a matrix with its numbers, named points, and a grid of small panels."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import PowerNorm
from matplotlib.figure import Figure

from studies.figures.charts import Chart, Matrix, Panel, Points, Scatter, Series
from studies.figures.drawing import (
    LINE,
    add_heading,
    legend_columns,
    legend_labels,
    numbers,
)
from studies.figures.style import (
    FIELD_COLOURS,
    LABEL,
    MISSING_COLOUR,
    ONE_COLUMN,
    PUBLISHED_COLOUR,
    SMALL,
    SUBTITLE_COLOUR,
    TWO_COLUMNS,
    group_style,
)
from studies.figures.typography import displayable, shorten, width, wrap

LONGEST = 1.55  # of the name of a method or perturbation, in inches
CELL, ROW = 0.27, 0.165  # size of a cell of a matrix, in inches
IN_CELL = 6  # size of its number, in points
GAP = 0.35  # rows
LINES = ("-", (0, (4, 1.2)), (0, (1, 1)), (0, (4, 1, 1, 1)))
COLOURS = 6  # before they repeat with another line
PANEL_HEIGHT = 1.12
WIDE_ERRORS = 4.0  # largest over smallest Rand Index error from which on its axis is logarithmic
ERRORS = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.5, 0.8)
MARGIN = 0.06  # inches between the vertical axis and the names of points
NEARER = 0.03  # inches by which a name must be nearer to its point than to any other
SHARES = np.linspace(0, 1, 41)  # of each piece of the front, at which names are kept off it
WIDE = 6.0  # mean corruption error from which on its axis is compressed above 1


def draw(chart: Chart) -> Figure:
    """Render a chart whose parts are a matrix, a scatter plot, or panels in several rows."""
    first = chart.panels[0]
    if isinstance(first, Matrix):
        return _draw_matrix(chart, first)
    if isinstance(first, Scatter):
        return _draw_scatter(chart, first)
    return _draw_grid(chart, [panel for panel in chart.panels if isinstance(panel, Panel)])


def _draw_matrix(chart: Chart, matrix: Matrix) -> Figure:
    rows = [shorten(displayable(name), SMALL, LONGEST) for name in matrix.rows]
    columns = [shorten(displayable(name), SMALL, LONGEST) for name in matrix.columns]
    left = 0.15 + max(width(name, SMALL) for name in rows)
    below = 0.15 + max(width(name, SMALL) for name in columns)
    n_rows, n_columns = len(rows), len(columns)
    gap = GAP if 0 < matrix.first_apart < n_rows else 0.0
    cell = min(CELL, (TWO_COLUMNS - left - 0.75) / n_columns)
    inner = (cell * n_columns, ROW * (n_rows + gap))
    across = max(left + inner[0] + 0.75, ONE_COLUMN)
    figure = Figure(figsize=(across, below + inner[1] + 0.05))
    add_heading(figure, chart.title, chart.subtitle)
    high = figure.get_figheight()
    start = max(left, (across - inner[0] - 0.75 + left) / 2 if across == ONE_COLUMN else left)
    axes = figure.add_axes((start / across, below / high, inner[0] / across, inner[1] / high))
    values = numbers([value for row in matrix.values for value in row]).reshape(n_rows, n_columns)
    largest = float(np.nanmax(values)) if np.isfinite(values).any() else 1.0
    colours = matplotlib.colormaps[FIELD_COLOURS]
    # Small values are told apart although a few are large.
    norm = PowerNorm(0.5, 0, max(largest, 1.0))
    offsets = np.arange(n_rows) + gap * (np.arange(n_rows) >= matrix.first_apart)
    marked = set(matrix.marked)
    for i, j in np.ndindex(values.shape):
        value = float(values[i, j])
        colour: Any = MISSING_COLOUR if np.isnan(value) else colours(norm(value))
        top = float(offsets[i])
        axes.add_patch(matplotlib.patches.Rectangle((j, top), 1, 1, fc=colour, ec="white", lw=0.4))
        dark = not np.isnan(value) and norm(value) < 0.6
        axes.text(
            j + 0.5, top + 0.53, _in_cell(value), ha="center", va="center", fontsize=IN_CELL,
            color="white" if dark else "black",
        )  # fmt: skip
        if (i, j) in marked:
            corner = [(j + 0.72, top), (j + 1, top), (j + 1, top + 0.45)]
            axes.add_patch(matplotlib.patches.Polygon(corner, fc=PUBLISHED_COLOUR, ec="white", lw=0.3))
    axes.set_xlim(0, n_columns)
    axes.set_ylim(n_rows + gap, 0)
    axes.set_xticks(np.arange(n_columns) + 0.5, columns, rotation=90)
    axes.set_yticks(offsets + 0.5, rows)
    axes.tick_params(length=0, pad=2)
    axes.spines[:].set_visible(False)
    shown = min(inner[1], 2.2)
    bar = figure.add_axes(
        ((start + inner[0] + 0.12) / across, (below + inner[1] - shown) / high, 0.1 / across, shown / high)
    )
    ticks = [tick for tick in (0, 1, 5, 10, 20, 50, 100, 200) if tick <= largest]
    drawn = figure.colorbar(matplotlib.cm.ScalarMappable(norm, colours), cax=bar)
    drawn.set_ticks(_apart(ticks, norm, shown))
    drawn.ax.minorticks_off()
    return figure


def _apart(ticks: Sequence[float], norm: PowerNorm, inches: float) -> list[float]:
    """The ticks that are at least a line apart on a bar of this height."""
    kept: list[float] = []
    for tick in ticks:
        if not kept or (norm(tick) - norm(kept[-1])) * inches >= LINE:
            kept.append(tick)
    return kept


def _in_cell(value: float) -> str:
    if math.isnan(value):
        return "–"
    return f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"


def _draw_scatter(chart: Chart, scatter: Scatter) -> Figure:
    figure = Figure(figsize=(TWO_COLUMNS, 4.2), layout="constrained")
    heading = add_heading(figure, chart.title, chart.subtitle)
    axes = figure.subplots()
    y = [value for points in scatter.points for value in points.y]
    x = [value for points in scatter.points for value in points.x]
    if max(y) > WIDE:
        axes.set_yscale("symlog", linthresh=1)
        ticks = [tick for tick in (0, 0.5, 1, 2, 5, 10, 20, 50, 100) if tick <= 1.2 * max(y)]
        axes.set_yticks(ticks, [f"{tick:g}" for tick in ticks])
        axes.minorticks_off()
    # Room for the names.
    if min(x) > 0 and max(x) / min(x) > WIDE_ERRORS:  # one segment is far from all others
        axes.set_xscale("log")
        axes.set_xticks(ERRORS, [f"{tick:g}" for tick in ERRORS])
        axes.minorticks_off()
        axes.set_xlim(min(x) / 1.4, max(x) * 1.6)
    else:
        spread = np.ptp(x) or 0.1
        axes.set_xlim(min(x) - 0.12 * spread, max(x) + 0.25 * spread)
    top = max(y) * 1.12 if max(y) > 0 else 1.0
    axes.set_ylim(min(0.0, min(y)) - 0.04 * min(top, 1.0 if max(y) > WIDE else top), top)
    if scatter.front:
        axes.plot(*zip(*scatter.front, strict=True), color=SUBTITLE_COLOUR, lw=0.8, ls="--", zorder=1)
    handles = [_draw_points(axes, points) for points in scatter.points]
    axes.set_xlabel(scatter.x.label)
    axes.set_ylabel(scatter.y.label)
    axes.grid()
    axes.set_axisbelow(True)
    figure.legend(
        handles, [points.label for points in scatter.points], ncols=3, frameon=False, loc="outside lower center"
    )
    _reserve(figure, heading)
    figure.draw_without_rendering()  # settles the layout, on which the places of names depend
    figure.set_layout_engine("none")
    _write_names(figure, axes, scatter)
    return figure


def _reserve(figure: Figure, heading: float) -> None:
    engine: Any = figure.get_layout_engine()
    engine.set(rect=(0, 0, 1, 1 - heading / figure.get_figheight()))


def _draw_points(axes: Axes, points: Points) -> Any:
    looks: dict[str, dict[str, Any]] = {
        "method": {"marker": "o", "mfc": group_style(0).colour, "mec": "white"},
        "told": {"marker": "D", "mfc": "white", "mec": group_style(0).colour, "ms": 4.5},
        "baseline": {"marker": "X", "mfc": "#888888", "mec": "white"},
    }
    return axes.plot(points.x, points.y, ls="", **({"ms": 6, "zorder": 3, "clip_on": False} | looks[points.role]))[0]


@dataclass(frozen=True)
class _Box:
    """A rectangle in inches."""

    left: float
    bottom: float
    right: float
    top: float

    def overlap(self, other: _Box) -> float:
        """Area that two rectangles share."""
        across = min(self.right, other.right) - max(self.left, other.left)
        up = min(self.top, other.top) - max(self.bottom, other.bottom)
        return across * up if across > 0 and up > 0 else 0.0

    def distance(self, point: tuple[float, float]) -> float:
        """How far a point is from the rectangle."""
        x, y = point
        return math.dist((min(max(x, self.left), self.right), min(max(y, self.bottom), self.top)), point)


def _write_names(figure: Figure, axes: Axes, scatter: Scatter) -> None:
    """Write the name of each point next to it, where it covers neither points nor other names nor the front."""
    to_inches = (axes.transData - figure.dpi_scale_trans).transform
    named = [
        (displayable(name), *to_inches((x, y)))
        for points in scatter.points
        for name, x, y in zip(points.names, points.x, points.y, strict=True)
    ]
    frame = axes.get_position()
    wide, high = figure.get_size_inches()
    inside = _Box(frame.x0 * wide + MARGIN, frame.y0 * high, frame.x1 * wide, frame.y1 * high)
    front = [to_inches(point) for point in scatter.front]
    along = [start + share * (end - start) for start, end in itertools.pairwise(front) for share in SHARES]
    taken = [_Box(x - 0.05, y - 0.05, x + 0.05, y + 0.05) for _, x, y in named]
    taken += [_Box(x - 0.02, y - 0.02, x + 0.02, y + 0.02) for x, y in along]
    for name, x, y in sorted(named, key=lambda point: (-point[2], point[1])):
        size = (width(name, SMALL) + 0.04, 0.12)
        others = [(at_x, at_y) for _, at_x, at_y in named if (at_x, at_y) != (x, y)]
        best = min(_places(x, y, size), key=lambda place: _cost(place, (x, y), others, inside, taken))
        taken.append(best)
        at = ((best.left + best.right) / 2, (best.bottom + best.top) / 2)
        nearest = (min(max(x, best.left), best.right), min(max(y, best.bottom), best.top))
        if math.dist(nearest, (x, y)) > 0.16:
            axes.plot(
                *zip((x, y), nearest, strict=True), transform=figure.dpi_scale_trans, color=SUBTITLE_COLOUR, lw=0.4,
                zorder=2,
            )  # fmt: skip
        figure.text(*at, name, transform=figure.dpi_scale_trans, fontsize=SMALL, ha="center", va="center")


def _places(x: float, y: float, size: tuple[float, float]) -> Iterator[_Box]:
    """Where the name of a point could be: near it first, in sixteen directions."""
    across, up = size
    for reach, turn in itertools.product((0.08, 0.16, 0.26, 0.38, 0.52, 0.7, 0.9), range(16)):
        angle = turn * math.pi / 8
        at = (
            x + math.cos(angle) * (reach + across / 2 * abs(math.cos(angle))),
            y + math.sin(angle) * (reach + up / 2),
        )
        yield _Box(at[0] - across / 2, at[1] - up / 2, at[0] + across / 2, at[1] + up / 2)


def _cost(
    place: _Box, point: tuple[float, float], others: Sequence[tuple[float, float]], inside: _Box, taken: Sequence[_Box]
) -> float:
    """What speaks against a place: what it covers, what is outside, its distance, and points nearer to it."""
    area = (place.right - place.left) * (place.top - place.bottom)
    outside = area - place.overlap(inside)
    covered = sum(place.overlap(other) for other in taken)
    distance = place.distance(point)
    nearer = sum(place.distance(other) < distance + NEARER for other in others)
    return 400 * covered + 50 * outside + distance + nearer


def _draw_grid(chart: Chart, panels: Sequence[Panel]) -> Figure:
    columns = min(chart.per_row, len(panels))
    rows = math.ceil(len(panels) / columns)
    across = TWO_COLUMNS if columns > 2 else ONE_COLUMN if columns == 1 else 5.0
    figure = Figure(figsize=(across, PANEL_HEIGHT * rows + 0.3), layout="constrained")
    heading = add_heading(figure, chart.title, chart.subtitle)
    grid = figure.subplots(rows, columns, squeeze=False)
    handles: dict[str, Any] = {}
    for axes in grid.flat[len(panels) :]:
        axes.set_axis_off()
    for axes, panel in zip(grid.flat, panels, strict=False):
        for series in panel.series:
            handles.setdefault(series.label, _draw_line(axes, series))
        axes.set_title(wrap(displayable(panel.title), LABEL, across / columns - 0.3), pad=3)
        axes.set_xticks(panel.x.ticks, [f"{tick:g}" for tick in panel.x.ticks])
        axes.set_xlabel(panel.x.label, fontsize=SMALL, labelpad=1)
        axes.set_ylabel(panel.y.label, fontsize=SMALL, labelpad=1)
        axes.tick_params(pad=2)
        axes.locator_params(axis="y", nbins=4, min_n_ticks=2)
        axes.set_ylim(bottom=0, top=None if axes.dataLim.y1 > 0 and np.isfinite(axes.dataLim.y1) else 1)
        axes.grid()
        axes.set_axisbelow(True)
    labels = legend_labels(handles, across)
    n_columns = legend_columns(labels, across)
    lines = math.ceil(len(labels) / n_columns)
    figure.set_figheight(figure.get_figheight() + LINE * lines)
    figure.legend(
        handles.values(), labels, ncols=n_columns, frameon=False, loc="outside lower center", handlelength=3.2
    )
    _reserve(figure, heading)
    return figure


def _draw_line(axes: Axes, series: Series) -> Any:
    """A line whose colour and dashes, and whose marker, tell it from the others."""
    style = group_style(series.group)
    dashes = LINES[series.group // COLOURS % len(LINES)]
    return axes.plot(
        series.x, numbers(series.y), color=style.colour, ls=dashes, marker=style.marker, ms=2.5, lw=0.9, mew=0.3,
        mec="white", clip_on=False, zorder=3,
    )[0]  # fmt: skip
