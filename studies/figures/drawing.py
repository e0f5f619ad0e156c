"""Renders charts with matplotlib, as wide as one or two columns of a paper, with text of 7 to 9 points.

Figures are made without pyplot, so that the backend that is chosen, and a notebook's own figures, are left alone.
"""

import logging
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.text import Text
from matplotlib.ticker import LogLocator, MaxNLocator, NullFormatter
from matplotlib.transforms import ScaledTranslation

from studies.figures.charts import Axis, Bars, Chart, Dots, HeatMap, Number, Panel, Series, round_values
from studies.figures.style import (
    DPI,
    FIELD_COLOURS,
    LETTER,
    MISSING_COLOUR,
    ONE_COLUMN,
    PUBLISHED_COLOUR,
    PUBLISHED_MARKERS,
    RC,
    SPAN_COLOURS,
    TWO_COLUMNS,
    group_style,
)
from studies.storage import atomic_write, encodable

# Embedding a font in a PDF logs what is left out of it.
logging.getLogger("fontTools").setLevel(logging.WARNING)

DODGE = 2.5  # points between the values of two segmenters at the same level
SLANTED = 0.2  # inches that slanted numbers at the ticks need below the axes
LINE = 0.15  # height of a line of the legend, in inches
HANDLE = 0.5  # width of a symbol in the legend and the gaps around it, in inches

# matplotlib's own defaults first, whatever the user's matplotlibrc contains.
styled = matplotlib.style.context(["default", RC])


@styled
def draw(chart: Chart) -> Figure:
    """Render a chart.

    Parameters
    ----------
    chart : Chart
        from the builders of `studies.figures.charts`

    Returns
    -------
    matplotlib.figure.Figure
        3.4 or at most 7 inches wide

    Examples
    --------
    >>> from studies.figures.charts import Axis, Panel, Series
    >>> line = Series("mean", x=(1.0, 2.0), y=(3.0, 5.0))
    >>> figure = draw(Chart("Holes", (Panel(Axis("holes"), Axis("Change Percentage"), series=(line,)),)))
    >>> float(figure.get_figwidth()), figure.axes[0].get_title()
    (3.4, 'Holes')
    """
    if not chart.panels:
        figure = Figure(figsize=(ONE_COLUMN, 0.5))
        figure.suptitle(f"{chart.title}: no data")
        return figure
    if any(isinstance(panel, HeatMap) for panel in chart.panels):
        return _draw_heat_maps(chart, [panel for panel in chart.panels if isinstance(panel, HeatMap)])
    return _draw_panels(chart, [panel for panel in chart.panels if isinstance(panel, Panel)])


@styled
def save(figure: Figure, path: Path, content: str | None = None) -> None:
    """Write a figure as PNG of 300 dots per inch and, if ``content`` is None, as PDF next to it.

    The same figure always gives the same bytes: neither dates nor versions of the software are written.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
    path : Path
        the PNG file, which is replaced when it is complete
    content : str, optional
        fingerprint of what the figure shows, written into the PNG's metadata; see `studies.figures.pictures.is_drawn`

    Raises
    ------
    OSError
        if a file cannot be written
    """
    for text in figure.findobj(Text):  # matplotlib cannot draw lone surrogates
        text.set_text(encodable(text.get_text()))
    with atomic_write(path) as part:
        figure.savefig(part, dpi=DPI, metadata={"Software": None} | ({} if content is None else {"Shows": content}))
    if content is None:
        with atomic_write(path.with_suffix(".pdf")) as part:
            figure.savefig(part, metadata={"CreationDate": None, "Creator": None, "Producer": None})


def _draw_panels(chart: Chart, panels: Sequence[Panel]) -> Figure:
    widths = [panel.width for panel in panels]
    width = TWO_COLUMNS if sum(widths) > 1.5 else ONE_COLUMN
    figure = Figure(figsize=(width, _height(panels)), layout="constrained")
    rows = bool(panels[0].dots)
    row = figure.subplots(1, len(panels), squeeze=False, width_ratios=widths, sharey=rows)[0]
    handles: dict[str, Any] = {}
    for axes, panel in zip(row, panels, strict=True):
        inches = width * panel.width / sum(widths) - 0.5
        of_panel = _draw_panel(axes, panel, inches)
        if panel.own_legend:
            # Below the numbers at the ticks and the lines of the label.
            down = ScaledTranslation(0, -0.22 - 0.16 * (1 + panel.x.label.count("\n")), figure.dpi_scale_trans)
            axes.legend(
                of_panel.values(), of_panel.keys(), title=panel.legend_title or None, frameon=False,
                ncols=_legend_columns(of_panel, inches + 0.3), loc="upper center", bbox_to_anchor=(0.5, 0),
                bbox_transform=axes.transAxes + down,
            )  # fmt: skip
        else:
            handles |= {label: handle for label, handle in of_panel.items() if label not in handles}
    if len(panels) > 1:
        figure.suptitle(chart.title)
    else:
        row[0].set_title(chart.title)
    if any(label.get_rotation() for axes in row for label in axes.get_xticklabels()):
        figure.set_figheight(figure.get_figheight() + SLANTED)
    if handles:
        columns = _legend_columns(handles, width)
        lines = math.ceil(len(handles) / columns) + bool(chart.legend_title)
        figure.set_figheight(figure.get_figheight() + LINE * max(lines - 2, 0))
        figure.legend(
            handles.values(), handles.keys(), title=chart.legend_title or None, ncols=columns, frameon=False,
            loc="outside lower center",
        )  # fmt: skip
    return figure


def _height(panels: Sequence[Panel]) -> float:
    """Height of a figure of panels, in inches, with a legend of two lines."""
    if panels[0].dots:
        return 0.9 + 0.2 * len(panels[0].y.categories)
    if any(panel.own_legend for panel in panels):
        most = max(len(panel.bands) + len(panel.series) + len(panel.spans) + len(panel.bars) for panel in panels)
        return 2.5 + LINE * most
    return 2.2 if len(panels) > 1 else 2.6


def _draw_panel(axes: Axes, panel: Panel, inches: float) -> dict[str, Any]:
    """Draw the contents of a panel on axes of about this width: handles of the legend, by their labels."""
    handles: dict[str, Any] = {}
    shades = _span_colours(max(len(panel.spans), 1 + max((bars.span or 0 for bars in panel.bars), default=0)))
    for span, shade in zip(panel.spans, shades, strict=False):
        handles.setdefault(span.label, axes.axvspan(span.start, span.end, color=shade, lw=0, zorder=0.5))
    for band in panel.bands:
        colour = group_style(band.group).colour
        drawn = axes.fill_between(band.x, _array(band.low), _array(band.high), color=colour, alpha=0.2, lw=0)
        handles.setdefault(band.label, drawn)
    n_groups = len({series.group for series in panel.series if series.role == "mean"})
    for series in panel.series:
        handles.setdefault(series.label, _draw_series(axes, series, n_groups))
    for i, bars in enumerate(panel.bars):
        handles.setdefault(bars.label, _draw_bars(axes, bars, i, len(panel.bars), panel.x.categories, shades))
    for i, dots in enumerate(panel.dots):
        handles.setdefault(dots.label, _draw_dots(axes, dots, i, panel.dots, panel.y.categories))
    axes.set_title(panel.title)
    _set_x_axis(axes, panel.x, inches)
    _set_y_axis(axes, panel.y)
    axes.grid(axis="x" if panel.dots else "y" if panel.bars else "both")
    axes.set_axisbelow(True)
    return handles


def _draw_series(axes: Axes, series: Series, n_groups: int) -> Any:
    style = group_style(series.group)
    x, y = np.array(series.x), _array(series.y)
    if series.role == "model":
        return axes.plot(x, y, color=style.colour, alpha=0.35, lw=0.7)[0]
    if series.role == "median":
        return axes.plot(x, y, color=style.colour, marker="_", ls=":", lw=0.8, ms=5)[0]
    if series.role == "published":
        return axes.plot(
            x, y, color=PUBLISHED_COLOUR, marker=PUBLISHED_MARKERS[0], ms=3, ls="--", lw=1.0, zorder=4, clip_on=False
        )[0]
    line: dict[str, Any] = {
        "color": style.colour,
        "marker": style.marker,
        "ms": 3,
        "ls": style.line,
        "lw": 1.2,
        "zorder": 3,
    }
    if not series.low:
        return axes.plot(x, y, **line)[0]
    # Next to each other where several segmenters have the same levels, so that no interval hides another.
    if n_groups > 1:
        shift = DODGE * (series.group - (n_groups - 1) / 2) / 72
        line["transform"] = axes.transData + ScaledTranslation(shift, 0, axes.figure.dpi_scale_trans)
    reach = _reach(y, series.low, series.high)
    # What is drawn with a transform does not count for the limits of the axes.
    axes.update_datalim(np.column_stack([np.tile(x, 2), np.concatenate([y - reach[0], y + reach[1]])]))
    return axes.errorbar(x, y, yerr=reach, capsize=2, **line)


def _draw_bars(axes: Axes, bars: Bars, number: int, n_bars: int, categories: Sequence[str], shades: np.ndarray) -> Any:
    width = 0.8 / n_bars
    at = np.array([categories.index(name) for name in bars.categories]) + (number - (n_bars - 1) / 2) * width
    style = group_style(bars.group)
    colour = style.colour if bars.span is None else shades[bars.span]
    hatch = style.hatch if bars.span is None else ""
    edge = "white" if hatch else "0.4"
    return axes.bar(at, _array(bars.values), width, color=colour, hatch=hatch, edgecolor=edge, lw=0.3)


def _draw_dots(axes: Axes, dots: Dots, number: int, all_dots: Sequence[Dots], categories: Sequence[str]) -> Any:
    """Dots, above or below those of the same row that another source has."""
    at = []
    for name in dots.categories:
        sources = [i for i, other in enumerate(all_dots) if name in other.categories]
        at.append(categories.index(name) + 0.36 * (sources.index(number) - (len(sources) - 1) / 2))
    values = _array(dots.values)
    style = group_style(dots.group)
    look: dict[str, Any] = {"color": style.colour, "marker": style.marker, "ms": 3.5, "ls": ""}
    if dots.role == "published":
        look |= {"color": PUBLISHED_COLOUR, "marker": PUBLISHED_MARKERS[dots.group % len(PUBLISHED_MARKERS)]}
    if all(low is None for low in dots.low):
        return axes.plot(values, at, **look)[0]
    return axes.errorbar(values, at, xerr=_reach(values, dots.low, dots.high), lw=1, capsize=2, **look)


def _set_x_axis(axes: Axes, axis: Axis, inches: float) -> None:
    axes.set_xlabel(axis.label)
    if axis.categories:
        longest = max(map(len, axis.categories)) * LETTER + 0.06
        axes.set_xticks(*_few_names(axis.categories, int(inches / longest)))
    elif axis.logarithmic:
        axes.set_xscale("log")
        _set_logarithmic_ticks(axes, axis.ticks, inches)
    elif axis.ticks:
        _set_level_ticks(axes, np.array(axis.ticks), inches)
    elif axis.from_zero:
        axes.set_xlim(left=0)


def _set_y_axis(axes: Axes, axis: Axis) -> None:
    axes.set_ylabel(axis.label)
    if axis.categories:
        axes.set_yticks(range(len(axis.categories)), axis.categories)
        axes.set_ylim(len(axis.categories) - 0.5, -0.5)
    elif axis.logarithmic and np.isfinite(axes.dataLim.minposy):  # matplotlib has no logarithmic scale without data
        axes.set_yscale("log")
        drawn = (max(axes.dataLim.y0, axes.dataLim.minposy), axes.dataLim.y1)
        few = len(set(round_values(drawn)) - set(drawn)) < 2
        axes.yaxis.set_major_locator(MaxNLocator(4) if few else LogLocator(subs=(1, 2, 5)))
        axes.yaxis.set_major_formatter("{x:g}")
        axes.yaxis.set_minor_formatter(NullFormatter())
    elif axis.from_zero:
        # With room above, even if every value is 0 or missing.
        axes.set_ylim(bottom=0, top=None if axes.dataLim.y1 > 0 and np.isfinite(axes.dataLim.y1) else 1)


def _set_logarithmic_ticks(axes: Axes, ticks: Sequence[float], inches: float) -> None:
    """A tick at every given value, else at 1, 2 and 5 times powers of ten, else at every value that is drawn."""
    if not ticks:
        drawn = sorted({float(x) for line in axes.lines for x in np.atleast_1d(line.get_xdata()) if x > 0})
        ticks = round_values(drawn) or drawn
    if len(ticks) > 1 and ticks[0] > 0:
        _label_ticks(axes, np.array(ticks), np.log(ticks), inches)
    else:
        axes.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    axes.minorticks_off()


def _set_level_ticks(axes: Axes, levels: np.ndarray, inches: float) -> None:
    """A tick at every level, with its number."""
    if len(levels) == 1:
        axes.set_xlim(levels[0] - 1, levels[0] + 1)
        axes.set_xticks(levels, [f"{level:g}" for level in levels])
    else:
        _label_ticks(axes, levels, levels, inches)


def _label_ticks(axes: Axes, levels: np.ndarray, positions: np.ndarray, inches: float) -> None:
    """A tick at every level, with its number: slanted if numbers would touch, left out if they still would."""
    texts = [f"{level:g}" for level in levels]
    places = (positions - positions[0]) / np.ptp(positions) * 0.9 * inches
    lengths = np.array([len(text) for text in texts]) * LETTER
    slanted = bool((np.diff(places) < (lengths[1:] + lengths[:-1]) / 2 + 0.04).any())
    last = -np.inf
    for i, place in enumerate(places):
        if slanted and place - last < LINE:
            texts[i] = ""
        else:
            last = place
    axes.set_xticks(levels, texts)
    if slanted:
        for text in axes.get_xticklabels():
            text.set(rotation=45, ha="right", rotation_mode="anchor")


def _legend_columns(labels: Iterable[str], width: float) -> int:
    """How many columns of the legend fit on a width in inches: at most four."""
    lengths = [HANDLE + LETTER * len(label) for label in labels]
    for columns in range(min(len(lengths), 4), 1, -1):
        rows = math.ceil(len(lengths) / columns)
        if sum(max(lengths[i : i + rows]) for i in range(0, len(lengths), rows)) < width:
            return columns
    return 1


def _draw_heat_maps(chart: Chart, heat_maps: Sequence[HeatMap]) -> Figure:
    columns = chart.per_row or len(heat_maps)
    rows = math.ceil(len(heat_maps) / columns)
    names = max(len(name) for heat_map in heat_maps for name in heat_map.rows) * LETTER + 0.1
    titles = 0.1 + LINE * (1 + max(heat_map.title.count("\n") for heat_map in heat_maps))
    # Next to each square the names of its rows, below it those of its columns, above it its title.
    square = min(1.6, (TWO_COLUMNS - 0.7) / columns - names)
    size = (0.7 + (square + names) * columns, 0.3 + (titles + square + names) * rows)
    figure = Figure(figsize=size, layout="constrained")
    grid = figure.subplots(rows, columns, squeeze=False)
    colours = matplotlib.colormaps[FIELD_COLOURS].with_extremes(bad=MISSING_COLOUR)
    for axes in grid.flat[len(heat_maps) :]:
        axes.set_axis_off()
    for axes, heat_map in zip(grid.flat, heat_maps, strict=False):
        values = np.ma.masked_invalid([_array(row) for row in heat_map.values])
        height, width = values.shape
        shown = axes.pcolormesh(
            np.arange(width + 1) - 0.5, np.arange(height + 1) - 0.5, values, cmap=colours, vmin=heat_map.low,
            vmax=heat_map.high,
        )  # fmt: skip
        axes.set_aspect("equal")
        axes.invert_yaxis()
        axes.spines[:].set_visible(False)
        axes.set_xticks(*_few_names(heat_map.columns), rotation=90)
        axes.set_yticks(*_few_names(heat_map.rows))
        axes.set_title(heat_map.title)
    figure.suptitle(chart.title)
    figure.colorbar(shown, ax=grid, label=heat_maps[0].label, shrink=0.8 / rows, pad=0.02)
    return figure


def _few_names(names: Sequence[str], most: int = 12) -> tuple[list[int], list[str]]:
    """Positions and texts of evenly spaced names: at most this many."""
    at = list(range(0, len(names), -(-len(names) // most)))
    return at, [names[i] for i in at]


def _span_colours(count: int) -> np.ndarray:
    return matplotlib.colormaps[SPAN_COLOURS](np.linspace(0.12, 0.36, count))


def _array(values: Sequence[Number]) -> np.ndarray:
    return np.array([math.nan if value is None else value for value in values], dtype=float)


def _reach(values: np.ndarray, low: Sequence[Number], high: Sequence[Number]) -> np.ndarray:
    """How far intervals reach below and above values: (2, p) array, 0 without an interval.

    A percentile interval need not be centred on the mean, nor contain it.
    """
    return np.nan_to_num(np.abs([values - _array(low), _array(high) - values]))
