"""Renders charts with matplotlib, as wide as one or two columns of a paper, with text of 7 to 9 points.

Figures are made without pyplot, so that the backend that is chosen, and a notebook's own figures, are left alone.
"""

import dataclasses
import logging
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import matplotlib
import matplotlib.style
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.transforms import ScaledTranslation

from studies.figures.charts import (
    Axis,
    Bars,
    Chart,
    Dots,
    HeatMap,
    Number,
    Panel,
    Series,
    logarithmic_ticks,
    round_values,
)
from studies.figures.pictures import stamp
from studies.figures.style import (
    DPI,
    FIELD_COLOURS,
    LABEL,
    MISSING_COLOUR,
    ONE_COLUMN,
    PUBLISHED_COLOUR,
    PUBLISHED_MARKERS,
    RC,
    SMALL,
    SPAN_COLOURS,
    SUBTITLE,
    SUBTITLE_COLOUR,
    TITLE,
    TWO_COLUMNS,
    group_style,
)
from studies.figures.typography import displayable, families, shorten, width, wrap
from studies.storage import atomic_write

# Embedding a font in a PDF logs what is left out of it.
logging.getLogger("fontTools").setLevel(logging.WARNING)

DODGE = 2.5  # points between the values of two segmenters at the same level
SLANTED = 0.2  # inches that slanted numbers at the ticks need below the axes
LINE = 0.15  # height of a line of the legend, in inches
HANDLE = 0.5  # width of a symbol in the legend and the gaps around it, in inches
LONGEST_NAME = 1.3  # of a row or column, in inches
LONGEST_ROW = 1.8  # of a row of dots, in inches
FEWEST_FROM_COMMA = 1_000  # numbers from here on have their digits grouped
NOTHING = "no trial succeeded"
NO_CHANGE = "0 at every level"
LAYOUT_TABLES = ("GDEF", "GPOS", "GSUB", "kern")  # of a font: ligatures, kerning and other choices of glyphs

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
    >>> float(figure.get_figwidth()), figure.texts[0].get_text()
    (3.4, 'Holes')
    """
    with matplotlib.rc_context({"font.family": families(map(displayable, _texts(chart)))}):
        if not chart.panels:
            figure = Figure(figsize=(ONE_COLUMN, 0.1))
            add_heading(figure, chart.title, NOTHING)
            return figure
        if chart.panels[0].kind in ("matrix", "scatter") or (chart.per_row and chart.panels[0].kind == "panel"):
            from studies.figures import board_drawing

            return board_drawing.draw(chart)
        if any(isinstance(panel, HeatMap) for panel in chart.panels):
            return _draw_heat_maps(chart, [panel for panel in chart.panels if isinstance(panel, HeatMap)])
        return _draw_panels(chart, [panel for panel in chart.panels if isinstance(panel, Panel)])


def add_heading(figure: Figure, title: str, subtitle: str = "") -> float:
    """Make room at the top of a figure for its title, and for a line in smaller type below it.

    Every figure has its title in this form.

    Parameters
    ----------
    figure : matplotlib.figure.Figure
        becomes higher
    title, subtitle : str
        wrapped to the width of the figure; nothing is added for an empty one

    Returns
    -------
    float
        height of the heading in inches

    Examples
    --------
    >>> figure = Figure(figsize=(3.4, 2))
    >>> height = add_heading(figure, "Holes on bundled", "lower is better")
    >>> [text.get_text() for text in figure.texts], bool(np.isclose(figure.get_figheight(), 2 + height))
    (['Holes on bundled', 'lower is better'], True)
    """
    height = 0.0
    for text, size, colour in ((title, TITLE, "black"), (subtitle, SUBTITLE, SUBTITLE_COLOUR)):
        if not text:
            continue
        height = height or 0.06
        lines = wrap(displayable(text), size, figure.get_figwidth() - 0.1)
        down = ScaledTranslation(0, -height, figure.dpi_scale_trans)
        figure.text(
            0.5, 1, lines, ha="center", va="top", fontsize=size, color=colour, transform=figure.transFigure + down
        )  # fmt: skip
        height += 1.35 * size / 72 * (1 + lines.count("\n"))
    height += 0.06 if height else 0.0
    figure.set_figheight(figure.get_figheight() + height)
    return height


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
    shows = {} if content is None else {"Shows": stamp(content)}
    with atomic_write(path) as part:
        figure.savefig(part, dpi=DPI, metadata={"Software": None} | shows)
    if content is None:
        nameless = {"CreationDate": None, "Creator": None, "Producer": None}
        with atomic_write(path.with_suffix(".pdf")) as part, _as_laid_out(figure), _without_layout_tables():
            figure.savefig(part, metadata=nameless)


@contextmanager
def _as_laid_out(figure: Figure) -> Iterator[None]:
    """Leave the parts of a figure where they were when it was last drawn; finding places for them takes long."""
    engine = figure.get_layout_engine()
    if engine is None:
        yield
        return
    figure.set_layout_engine(None)  # the default of matplotlib, which is no engine
    try:
        yield
    finally:
        figure.set_layout_engine(engine)


@contextmanager
def _without_layout_tables() -> Iterator[None]:
    """Embed fonts without what only lays out text, which a PDF does not use: a smaller file in half of the time."""
    from fontTools.subset import Options

    dropped = Options._drop_tables_default
    Options._drop_tables_default = [*dropped, *LAYOUT_TABLES]
    try:
        yield
    finally:
        Options._drop_tables_default = dropped


def _texts(chart: Any) -> list[str]:
    """Every text of a chart or of a part of it."""
    if isinstance(chart, str):
        return [chart]
    if dataclasses.is_dataclass(chart):
        return _texts(tuple(vars(chart).values()))
    return [text for part in chart for text in _texts(part)] if isinstance(chart, tuple) else []


def _below_heading(figure: Figure, height: float) -> None:
    """Keep what is drawn below a heading of this height in inches."""
    engine: Any = figure.get_layout_engine()
    engine.set(rect=(0, 0, 1, 1 - height / figure.get_figheight()))


def _draw_panels(chart: Chart, panels: Sequence[Panel]) -> Figure:
    widths = [panel.width for panel in panels]
    across = TWO_COLUMNS if sum(widths) > 1.5 else ONE_COLUMN
    figure = Figure(figsize=(across, _height(panels)), layout="constrained")
    heading = add_heading(figure, chart.title, chart.subtitle)
    rows = bool(panels[0].dots)
    row = figure.subplots(1, len(panels), squeeze=False, width_ratios=widths, sharey=rows)[0]
    handles: dict[str, Any] = {}
    for axes, panel in zip(row, panels, strict=True):
        inches = across * panel.width / sum(widths) - 0.5
        of_panel = _draw_panel(axes, panel, inches)
        if rows and axes is not row[0]:  # their names are those of the first panel
            axes.tick_params(left=False)
        if panel.own_legend:
            # Below the numbers at the ticks and the lines of the label.
            down = ScaledTranslation(0, -0.22 - 0.16 * (1 + panel.x.label.count("\n")), figure.dpi_scale_trans)
            labels = legend_labels(of_panel, inches + 0.3)
            axes.legend(
                of_panel.values(), labels, title=panel.legend_title or None, frameon=False,
                ncols=legend_columns(labels, inches + 0.3), loc="upper center", bbox_to_anchor=(0.5, 0),
                bbox_transform=axes.transAxes + down,
            )  # fmt: skip
        else:
            handles |= {label: handle for label, handle in of_panel.items() if label not in handles}
    if any(label.get_rotation() for axes in row for label in axes.get_xticklabels()):
        figure.set_figheight(figure.get_figheight() + SLANTED)
    if handles:
        labels = legend_labels(handles, across)
        columns = legend_columns(labels, across)
        lines = math.ceil(len(handles) / columns) + bool(chart.legend_title)
        figure.set_figheight(figure.get_figheight() + LINE * max(lines - 2, 0))
        figure.legend(
            handles.values(), labels, title=chart.legend_title or None, ncols=columns, frameon=False,
            loc="outside lower center",
        )  # fmt: skip
    _below_heading(figure, heading)
    return figure


def _height(panels: Sequence[Panel]) -> float:
    """Height of a figure of panels, in inches, with a legend of two lines."""
    if panels[0].dots:
        return 0.85 + 0.2 * len(panels[0].y.categories)
    if any(panel.own_legend for panel in panels):
        most = max(len(panel.bands) + len(panel.series) + len(panel.spans) + len(panel.bars) for panel in panels)
        return 2.5 + LINE * most
    return 2.1 if len(panels) > 1 else 2.35


def _draw_panel(axes: Axes, panel: Panel, inches: float) -> dict[str, Any]:
    """Draw the contents of a panel on axes of about this width: handles of the legend, by their labels."""
    handles: dict[str, Any] = {}
    shades = _span_colours(max(len(panel.spans), 1 + max((bars.span or 0 for bars in panel.bars), default=0)))
    for span, shade in zip(panel.spans, shades, strict=False):
        handles.setdefault(span.label, axes.axvspan(span.start, span.end, color=shade, lw=0, zorder=0.5))
    for band in panel.bands:
        colour = group_style(band.group).colour
        drawn = axes.fill_between(band.x, numbers(band.low), numbers(band.high), color=colour, alpha=0.2, lw=0)
        handles.setdefault(band.label, drawn)
    n_groups = len({series.group for series in panel.series if series.role == "mean"})
    for series in panel.series:
        handles.setdefault(series.label, _draw_series(axes, series, n_groups))
    for i, bars in enumerate(panel.bars):
        handles.setdefault(bars.label, _draw_bars(axes, bars, i, len(panel.bars), panel.x.categories, shades))
    for i, dots in enumerate(panel.dots):
        handles.setdefault(dots.label, _draw_dots(axes, dots, i, panel.dots, panel.y.categories))
    axes.set_title(wrap(displayable(panel.title), LABEL, inches + 0.4))
    _set_x_axis(axes, panel.x, inches)
    _set_y_axis(axes, panel.y)
    if panel.dots and not panel.x.logarithmic:
        axes.locator_params(axis="x", nbins=4, min_n_ticks=3)
    values = _computed(panel)
    remark = NOTHING if not values else NO_CHANGE if panel.x.ticks and set(values) == {0.0} else ""
    axes.text(0.5, 0.9, remark, ha="center", va="top", transform=axes.transAxes, color=SUBTITLE_COLOUR)
    axes.grid(axis="x" if panel.dots else "y" if panel.bars else "both")
    axes.set_axisbelow(True)
    return handles


def _computed(panel: Panel) -> list[float]:
    """The values that are not published ones."""
    computed = [
        *(series.y for series in panel.series if series.role != "published"),
        *(bars.values for bars in panel.bars),
        *(dots.values for dots in panel.dots if dots.role != "published"),
    ]
    return [value for values in computed for value in values if value is not None]


def _draw_series(axes: Axes, series: Series, n_groups: int) -> Any:
    style = group_style(series.group)
    x, y = np.array(series.x), numbers(series.y)
    if series.role == "model":
        return axes.plot(x, y, color=style.colour, alpha=0.35, lw=0.7)[0]
    if series.role == "median":
        return axes.plot(x, y, color=style.colour, marker="_", ls=":", lw=0.8, ms=5)[0]
    if series.role == "published":
        # Open markers behind the computed ones, which stay visible where both are the same.
        return axes.plot(
            x, y, color=PUBLISHED_COLOUR, marker=PUBLISHED_MARKERS[0], ms=5.5, mfc="white", mew=1.0, ls="--", lw=1.0,
            zorder=2.5, clip_on=False,
        )[0]  # fmt: skip
    line: dict[str, Any] = {
        "color": style.colour,
        "marker": style.marker,
        "ms": 3,
        "ls": style.line,
        "lw": 1.2,
        "zorder": 3,
        "clip_on": False,
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
    return axes.bar(at, numbers(bars.values), width, color=colour, hatch=hatch, edgecolor=edge, lw=0.3)


def _draw_dots(axes: Axes, dots: Dots, number: int, all_dots: Sequence[Dots], categories: Sequence[str]) -> Any:
    """Dots, above or below those of the same row that another source has."""
    at = []
    for name in dots.categories:
        sources = [i for i, other in enumerate(all_dots) if name in other.categories]
        at.append(categories.index(name) + 0.36 * (sources.index(number) - (len(sources) - 1) / 2))
    values = numbers(dots.values)
    style = group_style(dots.group)
    look: dict[str, Any] = {"color": style.colour, "marker": style.marker, "ms": 3.5, "ls": ""}
    if dots.role == "published":
        look |= {"color": PUBLISHED_COLOUR, "marker": PUBLISHED_MARKERS[dots.group % len(PUBLISHED_MARKERS)]}
    if all(low is None for low in dots.low):
        return axes.plot(values, at, **look)[0]
    return axes.errorbar(values, at, xerr=_reach(values, dots.low, dots.high), lw=1, capsize=2, **look)


def _set_x_axis(axes: Axes, axis: Axis, inches: float) -> None:
    axes.set_xlabel("\n".join(wrap(line, LABEL, inches + 0.2) for line in displayable(axis.label).split("\n")))
    if axis.categories:
        longest = max(width(displayable(name), SMALL) for name in axis.categories) + 0.06
        axes.set_xticks(*_few_names(axis.categories, max(int(inches / longest), 1)))
    elif axis.logarithmic:
        axes.set_xscale("log")
        _set_logarithmic_ticks(axes, axis.ticks, inches)
    elif axis.ticks:
        _set_level_ticks(axes, np.array(axis.ticks), inches)
    elif axis.from_zero:
        axes.set_xlim(left=0)


def _set_y_axis(axes: Axes, axis: Axis) -> None:
    axes.set_ylabel(displayable(axis.label))
    if axis.categories:
        names = [shorten(displayable(name), SMALL, LONGEST_ROW) for name in axis.categories]
        axes.set_yticks(range(len(names)), names)
        axes.set_ylim(len(names) - 0.5, -0.5)
    elif axis.logarithmic and np.isfinite(axes.dataLim.minposy):  # matplotlib has no logarithmic scale without data
        axes.set_yscale("log")
        limits = axes.get_ylim()
        axes.set_yticks((ticks := logarithmic_ticks(*limits)), list(map(_number, ticks)))
        axes.set_ylim(limits)
        axes.minorticks_off()
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
        axes.set_xticks(ticks, list(map(_number, ticks)))
    axes.minorticks_off()


def _set_level_ticks(axes: Axes, levels: np.ndarray, inches: float) -> None:
    """A tick at every level, with its number."""
    if len(levels) == 1:
        axes.set_xlim(levels[0] - 1, levels[0] + 1)
        axes.set_xticks(levels, list(map(_number, levels)))
    else:
        _label_ticks(axes, levels, levels, inches)


def _label_ticks(axes: Axes, levels: np.ndarray, positions: np.ndarray, inches: float) -> None:
    """A tick with its number at every level: slanted if numbers would touch, and none if it still would."""
    texts = list(map(_number, levels))
    places = (positions - positions[0]) / np.ptp(positions) * 0.9 * inches
    lengths = np.array([width(text, SMALL) for text in texts])
    slanted = bool((np.diff(places) < (lengths[1:] + lengths[:-1]) / 2 + 0.04).any())
    shown: list[int] = []
    for i, place in enumerate(places):
        if not slanted or not shown or place - places[shown[-1]] >= LINE:
            shown.append(i)
    axes.set_xticks(levels[shown], [texts[i] for i in shown])
    if slanted:
        for text in axes.get_xticklabels():
            text.set(rotation=45, ha="right", rotation_mode="anchor")


def _number(value: float) -> str:
    return f"{value:,.0f}" if value >= FEWEST_FROM_COMMA and value == round(value) else f"{value:g}"


def legend_labels(labels: Iterable[str], inches: float) -> list[str]:
    """Labels of a legend of this width in inches."""
    return [shorten(displayable(label), SMALL, inches - HANDLE) for label in labels]


def legend_columns(labels: Iterable[str], inches: float) -> int:
    """How many columns of the legend fit on a width in inches: at most four."""
    lengths = [HANDLE + width(label, SMALL) for label in labels]
    for columns in range(min(len(lengths), 4), 1, -1):
        rows = math.ceil(len(lengths) / columns)
        if sum(max(lengths[i : i + rows]) for i in range(0, len(lengths), rows)) < inches:
            return columns
    return 1


def _draw_heat_maps(chart: Chart, heat_maps: Sequence[HeatMap]) -> Figure:
    columns = chart.per_row or len(heat_maps)
    rows = math.ceil(len(heat_maps) / columns)
    room = min((TWO_COLUMNS - 0.7) / columns, 2.4)
    longest = min(room / 3, LONGEST_NAME)
    names = 0.1 + max(width(_name(name, longest), SMALL) for heat_map in heat_maps for name in heat_map.rows)
    # Next to each square the names of its rows, below it those of its columns, above it its title.
    square = min(1.6, room - names)
    headings = [
        "\n".join(wrap(line, LABEL, square + names) for line in displayable(heat_map.title).split("\n"))
        for heat_map in heat_maps
    ]
    titles = 0.1 + LINE * (1 + max(heading.count("\n") for heading in headings))
    size = (0.7 + (square + names) * columns, 0.1 + (titles + square + names) * rows)
    figure = Figure(figsize=(max(size[0], ONE_COLUMN), size[1]), layout="constrained")
    heading = add_heading(figure, chart.title, chart.subtitle)
    grid = figure.subplots(rows, columns, squeeze=False)
    colours = matplotlib.colormaps[FIELD_COLOURS].with_extremes(bad=MISSING_COLOUR)
    for axes in grid.flat[len(heat_maps) :]:
        axes.set_axis_off()
    for axes, heat_map, above in zip(grid.flat, heat_maps, headings, strict=False):
        values = np.ma.masked_invalid([numbers(row) for row in heat_map.values])
        n_rows, n_columns = values.shape
        shown = axes.pcolormesh(
            np.arange(n_columns + 1) - 0.5, np.arange(n_rows + 1) - 0.5, values, cmap=colours, vmin=heat_map.low,
            vmax=heat_map.high,
        )  # fmt: skip
        axes.set_aspect("equal")
        axes.invert_yaxis()
        axes.spines[:].set_visible(False)
        axes.set_xticks(*_few_names(heat_map.columns, longest=longest), rotation=90)
        axes.set_yticks(*_few_names(heat_map.rows, longest=longest))
        axes.set_title(above)
    figure.colorbar(shown, ax=grid, label=heat_maps[0].label, shrink=0.8 / rows, pad=0.02)
    _below_heading(figure, heading)
    return figure


def _few_names(names: Sequence[str], most: int = 12, longest: float = LONGEST_NAME) -> tuple[list[int], list[str]]:
    """Positions and texts of evenly spaced names: at most this many, none longer than this many inches."""
    at = list(range(0, len(names), -(-len(names) // most)))
    return at, [_name(names[i], longest) for i in at]


def _name(name: str, inches: float) -> str:
    return shorten(displayable(name), SMALL, inches)


def _span_colours(count: int) -> np.ndarray:
    return matplotlib.colormaps[SPAN_COLOURS](np.linspace(0.12, 0.36, count))


def numbers(values: Sequence[Number]) -> np.ndarray:
    """Values as an array, NaN for those that are missing."""
    return np.array([math.nan if value is None else value for value in values], dtype=float)


def _reach(values: np.ndarray, low: Sequence[Number], high: Sequence[Number]) -> np.ndarray:
    """How far intervals reach below and above values: (2, p) array, 0 without an interval.

    A percentile interval need not be centred on the mean, nor contain it.
    """
    return np.nan_to_num(np.abs([values - numbers(low), numbers(high) - values]))
