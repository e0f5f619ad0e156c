"""Charts as plain data: what a curve, bars, dots with intervals or a heat map show, without how they are drawn.

The builders turn tables and rows of a study into a `Chart`: frozen dataclasses that contain numbers and strings only.
`studies.figures.drawing` renders a chart for print. `dataclasses.asdict` turns it into what JSON can represent (missing
values are None), from which a web page can render the same data.
"""

from __future__ import annotations

import math
import re
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from studies.columns import AUTHORS, COMPUTED, Column, Table
from studies.reporting.text import count_of, options_of_variants

if TYPE_CHECKING:
    import pandas as pd

MOST_MODEL_LINES = 10  # models that are drawn as a line each; quartiles are drawn for more models
MOST_HEAT_MAPS_PER_ROW = 4
MOST_METHODS = 4  # whose curves or matrices can be told apart in a chart; of more, means are shown
MOST_CURVES = 8  # methods whose curves over levels can be told apart; of more, a matrix has the numbers
MOST_PANELS_OF_MEANS = 5
FEWEST_ROUND_VALUES = 3  # which label an axis well; with fewer, every value is labelled
NARROW_PANEL = 0.45  # relative width of a panel with a single level
WIDE_RANGE = 8  # largest over smallest value of an option from which on its axis is logarithmic
CHANGE = "Change Percentage (%)"
OWN_SCALES = "each panel has a scale of its own"
LOWER_IS_BETTER = "lower is better"
CROWDED = 0.04  # share of a linear axis below which its levels are too close together to be told apart
FEWEST_TICKS = 3
MEAN = "mean, 95 % interval"

Number = float | None  # None if the value is missing


@dataclass(frozen=True)
class Axis:
    """An axis of a panel.

    Parameters
    ----------
    label : str
        what is shown along the axis, with its unit
    ticks : tuple of float
        values to label; if empty, the renderer chooses them
    categories : tuple of str
        names of the positions on an axis without numbers, from left to right or from top to bottom
    logarithmic : bool
        whether the scale is logarithmic
    from_zero : bool
        whether the axis begins at 0
    """

    label: str = ""
    ticks: tuple[float, ...] = ()
    categories: tuple[str, ...] = ()
    logarithmic: bool = False
    from_zero: bool = False


@dataclass(frozen=True)
class Series:
    """Values by x, optionally with intervals, drawn as a line.

    Parameters
    ----------
    label : str
        text in the legend, which contains equal labels once
    x, y : tuple of float
        coordinates of p points; a missing y is None
    low, high : tuple of float
        ends of the p intervals around y; empty without intervals
    role : str
        what the values are: "mean", "median", "model" (one of many models) or "published"
    group : int
        number of the segmenter within the study, from 0
    name : str
        name of the single series, such as that of a model
    """

    label: str
    x: tuple[float, ...]
    y: tuple[Number, ...]
    low: tuple[Number, ...] = ()
    high: tuple[Number, ...] = ()
    role: str = "mean"
    group: int = 0
    name: str = ""


@dataclass(frozen=True)
class Band:
    """A shaded band between two lines, such as quartiles.

    Parameters
    ----------
    label : str
        text in the legend
    x, low, high : tuple of float
        coordinates of the p points of both lines
    group : int
        number of the segmenter within the study, from 0
    """

    label: str
    x: tuple[float, ...]
    low: tuple[Number, ...]
    high: tuple[Number, ...]
    group: int = 0


@dataclass(frozen=True)
class Span:
    """A shaded interval of the x axis.

    Parameters
    ----------
    label : str
        text in the legend
    start, end : float
        ends of the interval
    """

    label: str
    start: float
    end: float


@dataclass(frozen=True)
class Bars:
    """Bars, next to those of the other `Bars` of the panel.

    Parameters
    ----------
    label : str
        text in the legend
    categories : tuple of str
        positions, from the categories of the x axis
    values : tuple of float
        height of each bar
    group : int
        number of the segmenter within the study, from 0
    span : int or None
        number of the interval that the bars are about, drawn in the colour of that `Span`
    """

    label: str
    categories: tuple[str, ...]
    values: tuple[Number, ...]
    group: int = 0
    span: int | None = None


@dataclass(frozen=True)
class Dots:
    """Dots with horizontal intervals, in rows named by the categories of the y axis.

    Parameters
    ----------
    label : str
        text in the legend
    categories : tuple of str
        row of each dot, from the categories of the y axis
    values : tuple of float
        x of each dot
    low, high : tuple of float
        ends of the intervals; None if there is no interval
    role : str
        "mean" or "published"
    group : int
        number among the computed values, from 0
    """

    label: str
    categories: tuple[str, ...]
    values: tuple[Number, ...]
    low: tuple[Number, ...]
    high: tuple[Number, ...]
    role: str = "mean"
    group: int = 0


@dataclass(frozen=True)
class Panel:
    """One pair of axes and what is drawn in it.

    Parameters
    ----------
    x, y : Axis
        the axes
    title : str
        text above the panel
    series, bands, spans, bars, dots : tuples
        contents
    width : float
        relative width among the panels of a row
    own_legend : bool
        whether the legend of the contents is below the panel, instead of in the legend of the chart
    legend_title : str
        text above the panel's own legend
    kind : str
        "panel", which distinguishes it from a heat map in JSON
    """

    x: Axis
    y: Axis
    title: str = ""
    series: tuple[Series, ...] = ()
    bands: tuple[Band, ...] = ()
    spans: tuple[Span, ...] = ()
    bars: tuple[Bars, ...] = ()
    dots: tuple[Dots, ...] = ()
    width: float = 1.0
    own_legend: bool = False
    legend_title: str = ""
    kind: str = "panel"


@dataclass(frozen=True)
class HeatMap:
    """A matrix of values, drawn as coloured cells.

    Parameters
    ----------
    title : str
        text above the matrix
    rows, columns : tuple of str
        names of the r rows and c columns
    values : tuple of r tuples of c floats
        the matrix; a missing value is None
    low, high : float
        values at the ends of the colours, the same for all heat maps of a chart
    label : str
        what the values are
    kind : str
        "heat_map", which distinguishes it from a panel in JSON
    """

    title: str
    rows: tuple[str, ...]
    columns: tuple[str, ...]
    values: tuple[tuple[Number, ...], ...]
    low: float
    high: float
    label: str = ""
    kind: str = "heat_map"


@dataclass(frozen=True)
class Matrix:
    """A matrix of values with the number in every cell, drawn with all names of its rows and columns.

    Parameters
    ----------
    rows, columns : tuple of str
        names of the r rows and c columns
    values : tuple of r tuples of c floats
        the matrix; a missing value is None
    marked : tuple of (int, int)
        cells with a mark in their corner
    first_apart : int
        number of the first row below a gap; r if all rows belong together
    label : str
        what the values are
    kind : str
        "matrix", which distinguishes it from a panel in JSON
    """

    rows: tuple[str, ...]
    columns: tuple[str, ...]
    values: tuple[tuple[Number, ...], ...]
    marked: tuple[tuple[int, int], ...] = ()
    first_apart: int = 0
    label: str = ""
    kind: str = "matrix"


@dataclass(frozen=True)
class Points:
    """Points of one kind in a scatter plot.

    Parameters
    ----------
    label : str
        text in the legend
    names : tuple of str
        what is written next to each point
    x, y : tuple of float
        their coordinates
    role : str
        "method", "told" (drawn open) or "baseline" (drawn faintly)
    """

    label: str
    names: tuple[str, ...]
    x: tuple[float, ...]
    y: tuple[float, ...]
    role: str = "method"


@dataclass(frozen=True)
class Scatter:
    """Named points, and the line through those that no other is better than in both coordinates.

    Parameters
    ----------
    x, y : Axis
        the axes
    points : tuple of Points
        the points, by kind
    front : tuple of (float, float)
        the points on the front, from left to right
    kind : str
        "scatter", which distinguishes it from a panel in JSON
    """

    x: Axis
    y: Axis
    points: tuple[Points, ...]
    front: tuple[tuple[float, float], ...] = ()
    kind: str = "scatter"


@dataclass(frozen=True)
class Chart:
    """A figure of a study: panels, or heat maps, in a row or in several rows.

    Parameters
    ----------
    title : str
        text above everything
    panels : tuple of Panel, HeatMap, Matrix or Scatter
        parts of the figure, row by row
    legend_title : str
        text above the legend
    per_row : int
        number of panels in a row; 0 if all are in one row
    subtitle : str
        how to read the chart, below the title

    Examples
    --------
    >>> import json
    >>> from dataclasses import asdict
    >>> line = Series("mean", x=(1.0, 2.0), y=(3.5, None))
    >>> chart = Chart("Holes", (Panel(Axis("holes"), Axis("Change Percentage"), series=(line,)),))
    >>> json.dumps(asdict(chart)["panels"][0]["series"][0]["y"])
    '[3.5, null]'
    """

    title: str
    panels: tuple[Panel, ...] | tuple[HeatMap, ...] | tuple[Matrix, ...] | tuple[Scatter, ...]
    legend_title: str = ""
    per_row: int = 0
    subtitle: str = ""


def level_curve(table: Table, rows: pd.DataFrame, axis: str, title: str) -> Chart:
    """Mean Change Percentage by level with its 95 % interval, for each segmenter.

    With a single segmenter, the models behind the mean are shown as well: up to ``MOST_MODEL_LINES`` models as a line
    each, more as the band between the quartiles of their means. For more than ``MOST_CURVES``, see `level_matrix`.

    Parameters
    ----------
    table : Table
        ``frame`` has the columns level, unit, mean, ci_low, ci_high, optionally segmenter
    rows : DataFrame
        rows of the trials, with the columns model, level, change_percentage, optionally segmenter
    axis : str
        what the levels are; their unit is added
    title : str
        title of the chart

    Returns
    -------
    Chart
        one panel

    Examples
    --------
    >>> import pandas as pd
    >>> level = {"level": [1.0, 2.0], "unit": "count"}
    >>> frame = pd.DataFrame({**level, "mean": [3.0, 4.0], "ci_low": [2.0, 3.0], "ci_high": [5.0, 6.0]})
    >>> rows = pd.DataFrame({**level, "model": "cow", "change_percentage": [3.0, 4.0]})
    >>> chart = level_curve(Table("table", frame), rows, "tubes", "Short circuits")
    >>> chart.panels[0].x.label
    'tubes (count)'
    >>> [(series.label, series.y) for series in chart.panels[0].series]
    [('each model', (3.0, 4.0)), ('mean, 95 % interval (1 model)', (3.0, 4.0))]
    """
    if len(_segmenters(table.frame)) > MOST_CURVES:
        return level_matrix(table, {}, title, f"mean Change Percentage by {axis} ({_units(table.frame)})")
    several = _has_several_segmenters(table.frame)
    n_models = rows.loc[rows["change_percentage"].notna(), "model"].nunique()
    mean_label = f"{MEAN} ({count_of(n_models, 'model')})"
    models, bands = ((), ()) if several else _behind_the_mean(rows)
    panel = Panel(
        x=_level_axis(f"{axis} ({_units(table.frame)})", _levels(table.frame)),
        y=Axis(CHANGE, from_zero=True),
        series=(*models, *_mean_series(table.frame, mean_label), *_published_series(table, table.frame)),
        bands=bands,
    )
    return Chart(title, (panel,), legend_title=mean_label if several else "")


def part_panels(table: Table, named: Mapping[str, tuple[str, str]], title: str) -> Chart:
    """Change Percentage by level, a panel for each part of the study.

    Each panel has its own scale of Change Percentage, since one perturbation changes ten times as much as another.
    Medians are shown only with a single segmenter. For more than ``MOST_CURVES``, see `level_matrix`.

    Parameters
    ----------
    table : Table
        ``frame`` has the columns part, level, unit, mean, ci_low, ci_high, median, optionally segmenter
    named : mapping
        part -> (its title, what its levels are); the unit is added below
    title : str
        title of the chart

    Returns
    -------
    Chart
        panels in one row; a part with a single level is narrower

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"part": ["holes"], "level": [58.0], "unit": ["triangles"], "mean": [1.0],
    ...                       "ci_low": [0.5], "ci_high": [1.5], "median": [0.9]})
    >>> chart = part_panels(Table("table", frame), {"holes": ("Holes", "removed")}, "Table 2")
    >>> chart.panels[0].title, chart.panels[0].x.label, chart.panels[0].width
    ('Holes', 'removed\\n(triangles)', 0.45)
    """
    segmenters = _segmenters(table.frame)
    if len(segmenters) > MOST_CURVES:
        headings = {part: heading for part, (heading, _) in named.items()}
        return level_matrix(table, headings, title, "mean Change Percentage by level; lower is better")
    several = len(segmenters) > 1
    panels: list[Panel] = []
    for part, frame in table.frame.groupby("part", sort=False):
        heading, axis = named[str(part)]
        levels = _levels(frame)
        medians = (
            () if several else (Series("median", _floats(frame["level"]), _numbers(frame["median"]), role="median"),)
        )
        panels.append(
            Panel(
                x=_level_axis(f"{axis}\n({_units(frame)})", levels),
                y=Axis("" if panels else CHANGE, from_zero=True),
                title=heading,
                series=(*_mean_series(frame, MEAN, segmenters), *medians, *_published_series(table, frame)),
                width=1.0 if len(levels) > 1 else NARROW_PANEL,
            )
        )
    subtitle = OWN_SCALES if len(panels) > 1 else ""
    return Chart(title, tuple(panels), legend_title=MEAN if several else "", subtitle=subtitle)


def level_matrix(table: Table, headings: Mapping[str, str], title: str, subtitle: str = "") -> Chart:
    """The mean Change Percentage of each of many segmenters at each level, as numbers; those published in a column.

    Parameters
    ----------
    table : Table
        ``frame`` has the columns segmenter, part, level, mean
    headings : mapping of str to str
        titles of parts, which stand before their levels
    title, subtitle : str
        above the chart

    Returns
    -------
    Chart
        a matrix: a row per level, a column per segmenter

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"segmenter": ["A", "B"], "part": "holes", "level": 58.0, "mean": [1.0, 2.5]})
    >>> (matrix,) = level_matrix(Table("table", frame), {"holes": "Holes"}, "Table 2").panels
    >>> matrix.rows, matrix.columns, matrix.values
    (('Holes 58',), ('A', 'B'), ((1.0, 2.5),))
    """
    means = table.frame.pivot(index=["part", "level"], columns="segmenter", values="mean")
    means = means.reindex(
        index=list(dict.fromkeys(zip(table.frame["part"], table.frame["level"], strict=True))),
        columns=_segmenters(table.frame),
    )
    short = options_of_variants(means.columns)
    columns = [short.get(name, name) for name in means.columns]
    known = table.frame.dropna(subset=[table.published.column]) if table.published else table.frame.iloc[:0]
    if table.published and not known.empty:
        known = known.drop_duplicates(["part", "level"])
        means["published"] = known.set_index(["part", "level"])[table.published.column]
        columns.append(table.published.label)
    matrix = Matrix(
        rows=tuple(f"{headings.get(part, '')} {level:g}".strip() for part, level in means.index),
        columns=tuple(columns),
        values=tuple(_numbers(row) for row in means.to_numpy(dtype=float)),
        first_apart=len(means),
        label=CHANGE,
    )
    return Chart(title, (matrix,), subtitle=subtitle)


def swept_curve(table: Table, options: Sequence[str], title: str) -> Chart | None:
    """The mean by the value of an option that a sweep varied: a line per level, and a panel per part of the study.

    Parameters
    ----------
    table : Table
        ``frame`` has a column for each of the options, and mean, ci_low and ci_high (or ``table.value``); further
        columns such as part, level, unit and segmenter tell the lines apart
    options : sequence of str
        the varied options; the first is on the horizontal axis, the others tell lines apart
    title : str
        title of the chart

    Returns
    -------
    Chart or None
        None if the table has no such values

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"segmenter.time": [0.5, 2.0], "part": "holes", "level": 58.0, "unit": "triangles",
    ...                       "mean": [3.0, 1.0], "ci_low": [2.0, 0.5], "ci_high": [4.0, 1.5]})
    >>> chart = swept_curve(Table("table", frame), ["segmenter.time"], "Holes")
    >>> [(series.label, series.x, series.y) for series in chart.panels[0].series]
    [('58 triangles', (0.5, 2.0), (3.0, 1.0))]
    """
    frame = table.frame
    value = table.value or "mean"
    if not {value, "ci_low", "ci_high"} <= set(frame.columns):
        return None
    shown = next((column for column in table.columns if column.name == value), Column(name=value))
    option, *others = options
    is_number = frame[option].map(lambda each: isinstance(each, int | float)).all()
    values: list[Any] = sorted(frame[option].unique()) if is_number else list(dict.fromkeys(map(str, frame[option])))
    positions = {each: float(each) if is_number else float(i) for i, each in enumerate(values)}
    is_logarithmic = bool(is_number and values[0] > 0 and values[-1] / values[0] >= WIDE_RANGE)
    keys = [*others, *(name for name in ("segmenter", "shape", "what", "counted", "low", "level") if name in frame)]
    parts = list(frame.groupby("part", sort=False)) if "part" in frame else [("", frame)]
    panels: list[Panel] = []
    for part, of_part in parts:
        groups = list(of_part.groupby(keys, sort=False)) if keys else [((), of_part)]
        named = [name for name in keys if of_part[name].nunique() > 1] or keys[-1:]
        series = tuple(
            Series(
                label=_line_label(group, named),
                x=tuple(positions[each if is_number else str(each)] for each in group[option]),
                y=_numbers(group[value]),
                low=_numbers(group["ci_low"]),
                high=_numbers(group["ci_high"]),
                group=i,
            )
            for i, (_, group) in enumerate(groups)
        )
        panels.append(
            Panel(
                x=Axis(option, ticks=tuple(positions.values()), logarithmic=is_logarithmic)
                if is_number
                else Axis(option, categories=tuple(map(str, values))),
                y=Axis("" if panels else CHANGE if value == "mean" else shown.title, from_zero=True),
                title=str(part).replace("_", " ") if len(parts) > 1 else "",
                series=series,
                own_legend=True,
            )
        )
    return Chart(title, tuple(panels))


def _line_label(group: pd.DataFrame, keys: Sequence[str]) -> str:
    """What tells a line of a chart apart: the values of the keys, a level with its unit."""
    first = group.iloc[0]
    words = []
    for key in keys:
        text = f"{first[key]:g}" if isinstance(first[key], float | int) else str(first[key])
        unit = f" {str(first['unit']).replace('_', ' ')}" if key == "level" and "unit" in group else ""
        words.append(f"{text}{unit}")
    return ", ".join(words)


def segment_counts(rows: pd.DataFrame, intervals: Sequence[tuple[float, float]], title: str) -> Chart:
    """How the number of segments depends on time.

    The left panel shows the median over models by time, with quartiles for a single segmenter, and the intervals
    shaded. Right of it, bars show how many different numbers of segments a model has within each interval; the first
    bar is the share of models whose number does not change. A single segmenter has one such panel, several
    have one per interval.

    Parameters
    ----------
    rows : DataFrame
        rows of the successful trials: model, level (the time), unit, n_segments, optionally segmenter; every model at
        the same times
    intervals : sequence of (first, last)
        intervals of time
    title : str
        title of the chart

    Returns
    -------
    Chart
        two panels, or one and one per interval

    Examples
    --------
    >>> import pandas as pd
    >>> rows = pd.DataFrame({"model": ["ant", "ant", "cow", "cow"], "level": [0.5, 2.0] * 2, "unit": "paper",
    ...                      "n_segments": [9, 7, 5, 5]})
    >>> chart = segment_counts(rows, [(0.5, 2.0)], "Times")
    >>> chart.panels[0].series[0].y
    (7.0, 6.0)
    >>> chart.panels[1].bars[0].label, chart.panels[1].bars[0].values
    ('times 0.5 to 2: 50.0 % unchanged', (50.0, 50.0))
    """
    counts = {
        name: frame.pivot(index="model", columns="level", values="n_segments").astype(float)
        for name, frame in _by_segmenter(rows)
    }
    names = [f"times {first:g} to {last:g}" for first, last in intervals]
    several = len(counts) > 1
    n_models = rows["model"].nunique()
    left = Panel(
        x=Axis(f"time ({_units(rows)} units)", ticks=round_values(_levels(rows)), logarithmic=True),
        y=Axis("segments", logarithmic=True),
        title=f"Segments of {count_of(n_models, 'model')}{' (median)' if several else ''}",
        series=tuple(
            Series(name if several else "median", _floats(count.columns), _numbers(count.median()), group=group)
            for group, (name, count) in enumerate(counts.items())
        ),
        bands=() if several else tuple(_quartiles(count) for count in counts.values()),
        spans=tuple(Span(name, *interval) for name, interval in zip(names, intervals, strict=True)),
        width=1.3,
        own_legend=True,
    )
    shares = _change_shares(counts, intervals)
    most = max((len(share) for of_segmenters in shares for share in of_segmenters.values()), default=1)
    categories = tuple(str(number) for number in range(1, most + 1))
    x = Axis(
        "different numbers\nof segments" if several else "different numbers of segments of a model", (), categories
    )
    if several:
        right = [
            Panel(
                x=x,
                y=Axis("" if i else "models (%)", from_zero=True),
                title=f"Within {name}",
                bars=tuple(
                    _share_bars(f"{segmenter}: {{:.1f}} %", share, categories, group=group)
                    for group, (segmenter, share) in enumerate(of_segmenters.items())
                ),
                own_legend=True,
                legend_title="models that do not change",
            )
            for i, (name, of_segmenters) in enumerate(zip(names, shares, strict=True))
        ]
    else:
        bars = tuple(
            _share_bars(f"{name}: {{:.1f}} % unchanged", share, categories, span=i)
            for i, (name, of_segmenters) in enumerate(zip(names, shares, strict=True))
            for share in of_segmenters.values()
        )
        right = [Panel(x, Axis("models (%)", from_zero=True), "Change within an interval", bars=bars, own_legend=True)]
    return Chart(title, (left, *right))


def pair_matrices(changes: Mapping[Any, pd.DataFrame], title: str) -> Chart:
    """Change Percentage between all pairs of poses: a matrix for each shape, or for each shape and segmenter.

    Parameters
    ----------
    changes : mapping
        shape, or (shape, segmenter) -> square DataFrame whose rows and columns are the poses; empty ones are left out
    title : str
        title of the chart

    Returns
    -------
    Chart
        heat maps with common colours, the shapes of one segmenter after those of another

    Examples
    --------
    >>> import pandas as pd
    >>> change = pd.DataFrame([[0.0, 3.0], [3.0, 0.0]], index=["cat0", "cat1"], columns=["cat0", "cat1"])
    >>> chart = pair_matrices({"cat": change}, "Poses")
    >>> chart.panels[0].title, chart.panels[0].values, chart.panels[0].high
    ('cat: mean 3.0 %', ((0.0, 3.0), (3.0, 0.0)), 3.0)
    """
    named = {_shape_and_segmenter(key): change for key, change in changes.items() if change.size}
    shapes = dict.fromkeys(shape for shape, _ in named)
    segmenters = list(dict.fromkeys(segmenter for _, segmenter in named))
    largest = max(map(_largest, named.values()), default=0.0) or 1.0
    heat_maps = tuple(
        _heat_map(f"{segmenter}\n{shape}" if len(segmenters) > 1 else shape, named[shape, segmenter], largest)
        for shape, segmenter in sorted(named, key=lambda key: segmenters.index(key[1]))
    )
    # Rows of about the same length, as few as possible.
    n_rows = math.ceil(len(shapes) / MOST_HEAT_MAPS_PER_ROW)
    return Chart(title, heat_maps, per_row=math.ceil(len(shapes) / max(n_rows, 1)))


def method_means(means: Mapping[str, pd.DataFrame], title: str, subtitle: str = "", published: str = "") -> Chart:
    """The means of each method with their intervals, a panel for each quantity; for more methods than curves show.

    Parameters
    ----------
    means : mapping of str to DataFrame
        what a panel shows, with its unit -> the columns segmenter, mean, ci_low and ci_high, and optionally published
    title, subtitle : str
        above the chart
    published : str
        whose the published values are, for the legend

    Returns
    -------
    Chart
        at most ``MOST_PANELS_OF_MEANS`` panels, the first ones, whose rows are the methods, in their order

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"segmenter": ["A", "B"], "mean": [3.0, 9.0], "ci_low": [2.0, 7.0], "ci_high": [4.0, 9.5]})
    >>> (panel,) = method_means({"all shapes": frame}, "Poses").panels
    >>> panel.x.label, panel.y.categories, panel.dots[0].values
    ('all shapes', ('A', 'B'), (3.0, 9.0))
    """
    methods = dict.fromkeys(name for frame in means.values() for name in frame["segmenter"].astype(str))
    short = {name: name for name in methods} | options_of_variants(methods)
    panels = []
    for label, frame in list(means.items())[:MOST_PANELS_OF_MEANS]:
        names = tuple(short[name] for name in frame["segmenter"].astype(str))
        known_ends = frame[["ci_low", "ci_high"]].notna().any(axis=None)
        computed = Dots(
            MEAN if known_ends else "mean",
            names,
            _numbers(frame["mean"]),
            _numbers(frame["ci_low"]),
            _numbers(frame["ci_high"]),
        )
        dots = [computed]
        if published and "published" in frame and not (known := frame[frame["published"].notna()]).empty:
            named = tuple(short[name] for name in known["segmenter"].astype(str))
            missing = (None,) * len(known)
            dots.append(Dots(published, named, _numbers(known["published"]), missing, missing, role="published"))
        panels.append(Panel(Axis(label, from_zero=True), Axis(categories=tuple(short.values())), dots=tuple(dots)))
    return Chart(title, tuple(panels), subtitle=subtitle)


def method_scores(table: Table, metrics: Sequence[Column], title: str) -> Chart:
    """The scores of each method, a panel for each metric: computed ones with their intervals, and published ones.

    Parameters
    ----------
    table : Table
        ``frame`` has the columns method, source (``COMPUTED``, ``AUTHORS`` or another word), and for each metric
        METRIC, METRIC_low and METRIC_high (missing if there is no interval)
    metrics : sequence of Column
        the metrics; one whose heading is an abbreviation is named by the beginning of its help
    title : str
        title of the chart

    Returns
    -------
    Chart
        panels whose rows are the methods; values of another source are labelled with ``table.published.label`` if that
        is set, else with the source

    Examples
    --------
    >>> import pandas as pd
    >>> frame = pd.DataFrame({"method": ["HeatWalk"], "source": ["computed"], "gce": [0.22], "gce_low": [0.20],
    ...                       "gce_high": [0.23]})
    >>> metric = Column(name="gce", heading="GCE", help="Global consistency error, by area.")
    >>> chart = method_scores(Table("table", frame), [metric], "Table 1")
    >>> chart.panels[0].x.label, chart.panels[0].dots[0].values
    ('Global consistency error', (0.22,))
    """
    frame = table.frame
    methods = dict.fromkeys(frame["method"].astype(str))
    short = {name: name for name in methods} | options_of_variants(frame.loc[frame["source"] == COMPUTED, "method"])
    ours = [COMPUTED, AUTHORS]
    sources = [source for source in ours if (frame["source"] == source).any()]
    others = [source for source in dict.fromkeys(frame["source"].astype(str)) if source not in ours]
    sources += others
    labels = {source: source for source in sources} | {AUTHORS: "computed from the authors' segmentations"}
    if table.published is not None and len(others) == 1:
        labels[others[0]] = table.published.label
    panels: list[Panel] = []
    for metric in metrics:
        dots = []
        for source in sources:
            of_source = frame[frame["source"] == source]
            dots.append(
                Dots(
                    label=labels[source],
                    categories=tuple(short[name] for name in of_source["method"].astype(str)),
                    values=_numbers(of_source[metric.name]),
                    low=_numbers(of_source[f"{metric.name}_low"]),
                    high=_numbers(of_source[f"{metric.name}_high"]),
                    role="mean" if source in ours else "published",
                    group=(others if source in others else ours).index(source),
                )
            )
        panels.append(
            Panel(Axis(_spelled_out(metric), from_zero=True), Axis(categories=tuple(short.values())), dots=tuple(dots))
        )
    better = {metric.lower_is_better for metric in metrics}
    subtitle = "; ".join(filter(None, (LOWER_IS_BETTER if better == {True} else "", OWN_SCALES if panels else "")))
    return Chart(title, tuple(panels), subtitle=subtitle)


def _spelled_out(metric: Column) -> str:
    """The name of a metric whose heading is an abbreviation: what its help explains."""
    name = re.split("[:,.]", metric.help)[0] if metric.title.isupper() else ""
    return name or metric.title


def _mean_series(frame: pd.DataFrame, label: str, segmenters: Sequence[str] = ()) -> list[Series]:
    """Means by level with their intervals: one series per segmenter, named in the legend if there are several."""
    segmenters = segmenters or _segmenters(frame)
    return [
        Series(
            label=name if len(segmenters) > 1 else label,
            x=_floats(group["level"]),
            y=_numbers(group["mean"]),
            low=_numbers(group["ci_low"]),
            high=_numbers(group["ci_high"]),
            group=segmenters.index(name),
        )
        for name, group in _by_segmenter(frame)
    ]


def _published_series(table: Table, frame: pd.DataFrame) -> list[Series]:
    """The published values by level: one series, or one per segmenter if these differ."""
    if table.published is None or table.published.column not in frame:
        return []
    found: dict[tuple[Any, ...], Series] = {}
    segmenters = _segmenters(table.frame)
    for name, group in _by_segmenter(frame):
        y = _numbers(group[table.published.column])
        if any(value is not None for value in y):
            x = _floats(group["level"])
            series = Series(table.published.label, x, y, role="published", group=segmenters.index(name), name=name)
            found.setdefault((x, y), series)
    if len(found) == 1:
        return list(found.values())
    return [
        Series(f"{series.label}: {series.name}", series.x, series.y, role="published", group=series.group)
        for series in found.values()
    ]


def _behind_the_mean(rows: pd.DataFrame) -> tuple[tuple[Series, ...], tuple[Band, ...]]:
    """The means of the single models by level if these are few, else the band between their quartiles."""
    means = rows.groupby(["model", "level"])["change_percentage"].mean().astype(float).unstack("level")
    means = means.dropna(how="all")
    if len(means) > MOST_MODEL_LINES:
        low, high = _numbers(means.quantile(0.25)), _numbers(means.quantile(0.75))
        return (), (Band("quartiles of models", _floats(means.columns), low, high),)
    levels = _floats(means.columns)
    lines = (
        Series("each model", levels, _numbers(values), role="model", name=str(name))
        for name, values in means.iterrows()
    )
    return tuple(lines), ()


def _quartiles(counts: pd.DataFrame) -> Band:
    return Band("quartiles", _floats(counts.columns), _numbers(counts.quantile(0.25)), _numbers(counts.quantile(0.75)))


def _change_shares(
    counts: Mapping[str, pd.DataFrame], intervals: Sequence[tuple[float, float]]
) -> list[dict[str, list[float]]]:
    """For each interval and segmenter, the shares of models with 1, 2 … different numbers of segments, in percent."""
    shares = []
    for first, last in intervals:
        of_segmenters = {}
        for name, count in counts.items():
            within = count[[time for time in count.columns if first <= float(time) <= last]]
            different = [len(set(_numbers(numbers)) - {None}) for numbers in within.to_numpy()]
            of_segmenters[name] = (100.0 * np.bincount(different, minlength=2)[1:] / max(len(count), 1)).tolist()
        shares.append(of_segmenters)
    return shares


def _share_bars(
    label: str, shares: Sequence[float], categories: tuple[str, ...], *, group: int = 0, span: int | None = None
) -> Bars:
    padded = (*shares, *[0.0] * (len(categories) - len(shares)))
    return Bars(label.format(shares[0]), categories, padded, group, span)


def _heat_map(name: str, change: pd.DataFrame, largest: float) -> HeatMap:
    values = change.to_numpy(dtype=float)
    apart = values[~np.eye(len(values), dtype=bool)]
    apart = apart[~np.isnan(apart)]
    return HeatMap(
        title=f"{name}: mean {apart.mean():.1f} %" if len(apart) else name,
        rows=tuple(map(str, change.index)),
        columns=tuple(map(str, change.columns)),
        values=tuple(_numbers(row) for row in values),
        low=0.0,
        high=largest,
        label=CHANGE,
    )


def _shape_and_segmenter(key: str | tuple[str, ...]) -> tuple[str, str]:
    """The two parts of a key of `pair_matrices`; the segmenter is "" if the key has none."""
    shape, *segmenter = (key,) if isinstance(key, str) else key
    return str(shape), " ".join(map(str, segmenter))


def _largest(change: pd.DataFrame) -> float:
    values = change.to_numpy(dtype=float)
    return float(np.nanmax(values)) if (~np.isnan(values)).any() else 0.0


def logarithmic_ticks(low: float, high: float) -> tuple[float, ...]:
    """Round values to label on a logarithmic axis, at least two of them on an axis of any length.

    Parameters
    ----------
    low, high : float
        ends of the axis, above 0

    Returns
    -------
    tuple of float
        powers of ten; or these times 1, 2 and 5, or 1 to 9, if there are too few of them; or equally spaced values on
        an axis of less than that

    Examples
    --------
    >>> logarithmic_ticks(0.9, 1200), logarithmic_ticks(0.13, 12)
    ((1.0, 10.0, 100.0, 1000.0), (0.2, 0.5, 1.0, 2.0, 5.0, 10.0))
    >>> logarithmic_ticks(0.85, 0.93)
    (0.86, 0.88, 0.9, 0.92)
    """
    if low == high:
        return (low,)
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for digits in ((1,), (1, 2, 5), range(1, 10)):
        ticks = [float(f"{digit}e{exponent}") for exponent in exponents for digit in digits]
        ticks = [tick for tick in ticks if low <= tick <= high]
        if len(ticks) >= FEWEST_TICKS:
            return tuple(ticks)
    return _equally_spaced(low, high)


def _equally_spaced(low: float, high: float) -> tuple[float, ...]:
    """Multiples of a round step within a range: three to six."""
    rough = (high - low) / 4
    unit = 10.0 ** math.floor(math.log10(rough))
    step = next(digit * unit for digit in (5, 2, 1) if digit * unit <= rough)
    return tuple(float(f"{k * step:.12g}") for k in range(math.ceil(low / step), math.floor(high / step) + 1))


def _level_axis(label: str, levels: tuple[float, ...]) -> Axis:
    """The axis of a study's levels: logarithmic if a linear one would crowd the small ones together."""
    gaps = np.diff(levels) / np.ptp(levels) if len(levels) > 2 else np.ones(1)
    crowded = bool(min(levels, default=0.0) > 0 and max(levels) > 10 * min(levels) and gaps.min() < CROWDED)
    return Axis(label, ticks=levels, logarithmic=crowded)


def round_values(values: Sequence[float]) -> tuple[float, ...]:
    """The values 1, 2 and 5 times a power of ten within the range of some values; these themselves if there are few.

    Examples
    --------
    >>> round_values([0.3, 1.7, 20.0]), round_values([0.6, 0.75, 0.85])
    ((0.5, 1.0, 2.0, 5.0, 10.0, 20.0), (0.6, 0.75, 0.85))
    """
    if not values:
        return ()
    low, high = min(values), max(values)
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    candidates = [float(f"{digit}e{exponent}") for exponent in exponents for digit in (1, 2, 5)]
    found = tuple(value for value in candidates if low <= value <= high)
    return found if len(found) >= FEWEST_ROUND_VALUES else tuple(values)


def _by_segmenter(frame: pd.DataFrame) -> list[tuple[str, pd.DataFrame]]:
    """The rows of each segmenter, in their order; all rows under "" if there is no such column."""
    if "segmenter" not in frame:
        return [("", frame)]
    return [(str(name), group) for name, group in frame.groupby("segmenter", sort=False)]


def _segmenters(frame: pd.DataFrame) -> list[str]:
    return [name for name, _ in _by_segmenter(frame)]


def _has_several_segmenters(frame: pd.DataFrame) -> bool:
    return len(_segmenters(frame)) > 1


def _levels(frame: pd.DataFrame) -> tuple[float, ...]:
    return tuple(sorted(set(_floats(frame["level"]))))


def _units(frame: pd.DataFrame) -> str:
    return " and ".join(frame["unit"].unique()).replace("_", " ")


def _floats(values: Iterable[Hashable]) -> tuple[float, ...]:
    return tuple(float(value) for value in values)  # type: ignore[arg-type]


def _numbers(values: Any) -> tuple[Number, ...]:
    """Values as floats, None for missing ones."""
    return tuple(None if math.isnan(value) else value for value in np.asarray(values, dtype=float).tolist())
