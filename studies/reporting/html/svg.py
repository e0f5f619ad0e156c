"""Charts as SVG for a page: the same data as in print, with classes instead of colours, and values on hover.

Each panel becomes a drawing of its own, so that a page arranges them in as many columns as it has room for.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from html import escape

import numpy as np
from matplotlib import colormaps

from studies.columns import MISSING
from studies.figures.charts import (
    Axis,
    Band,
    Bars,
    Chart,
    Dots,
    HeatMap,
    Matrix,
    Number,
    Panel,
    Scatter,
    Series,
    logarithmic_ticks,
)
from studies.figures.style import FIELD_COLOURS

GROUPS = 6  # colours of methods, after which they repeat with other lines
LINES = 4
FAR = 3.0  # how many times larger than what is drawn as a line single trials are where the axis is compressed
ROOT_TICKS = (0, 1, 5, 10, 25, 50, 100, 150, 200)
WIDTH, HEIGHT = 520, 320  # of a panel, in its own units
SCATTER = (760, 480)  # width and height of a panel with named points
LEFT, RIGHT, TOP, BOTTOM = 58, 14, 12, 46
CHARACTER = 8.4  # mean width of a character, as large as those of panels side by side
NAME_CHARACTER = 6.0  # the same of names of points, which are smaller
ROW = 19  # height of a row of dots or cells
LONGEST_NAME = 32  # characters
JITTER = 0.012  # of the width, by which points at the same place are moved apart
GOLDEN = 0.6180339887498949
CLOSEST_TICKS = 0.09  # share of an axis by square roots
CAP = 3  # half the length of the bar at the end of an interval
DARK = 0.55  # share of the range of colours below which a number in a cell is white


@dataclass(frozen=True)
class Mark:
    """A point of a panel that stands for a trial.

    Parameters
    ----------
    x, y : float
        where it is, in values of the axes
    text : str
        shown on hover
    group : int
        number of the method within the study, from 0
    scene : int
        the scene of the page's viewer that shows it; -1 if none does
    """

    x: float
    y: float
    text: str
    group: int = 0
    scene: int = -1


@dataclass(frozen=True)
class Entry:
    """An entry of a legend: a class that has a colour, and the text."""

    style: str
    label: str


@dataclass(frozen=True)
class Drawing:
    """A panel as SVG.

    Parameters
    ----------
    title : str
    svg : str
    legend : tuple of Entry
    wide : bool
        whether it needs the whole width of a page
    """

    title: str
    svg: str
    legend: tuple[Entry, ...] = ()
    wide: bool = False


def drawings(chart: Chart, marks: Mapping[int, Sequence[Mark]] | None = None) -> list[Drawing]:
    """The panels of a chart.

    Parameters
    ----------
    chart : Chart
    marks : mapping of int to sequence of Mark, optional
        further points by the number of their panel

    Examples
    --------
    >>> line = Series("mean", x=(1.0, 2.0), y=(3.5, None))
    >>> chart = Chart("Holes", (Panel(Axis("holes"), Axis("Change Percentage"), series=(line,)),))
    >>> [drawing] = drawings(chart)
    >>> drawing.svg.count("<circle"), drawing.legend
    (1, (Entry(style='mean g0', label='mean'),))
    """
    marks = marks or {}
    panels: Sequence[Panel | HeatMap | Matrix | Scatter] = chart.panels
    return [_drawing(panel, marks.get(i, ())) for i, panel in enumerate(panels)]


def _drawing(panel: Panel | HeatMap | Matrix | Scatter, marks: Sequence[Mark]) -> Drawing:
    if isinstance(panel, HeatMap):
        return _cells(panel.title, panel.rows, panel.columns, panel.values, panel.low, panel.high, panel.label)
    if isinstance(panel, Matrix):
        values = [value for row in panel.values for value in row if value is not None]
        high = max(values, default=1.0)
        return _cells(
            "", panel.rows, panel.columns, panel.values, 0.0, high, panel.label, panel.marked, panel.first_apart
        )
    if isinstance(panel, Scatter):
        return _scatter(panel)
    return _dots(panel) if panel.dots else _panel(panel, marks)


class _Scale:
    """From the values of an axis to places in a drawing."""

    def __init__(
        self, values: Iterable[Number], axis: Axis, start: float, end: float, *, is_root: bool = False
    ) -> None:
        self.is_root = is_root
        finite = [value for value in (*values, *axis.ticks) if value is not None and math.isfinite(value)]
        self.logarithmic = axis.logarithmic and bool(finite) and min(finite) > 0
        low, high = (min(finite), max(finite)) if finite else (0.0, 1.0)
        if axis.from_zero and not self.logarithmic:
            low, high = min(low, 0.0), high * 1.05
        if low == high:
            low, high = (low / 2, high * 2) if self.logarithmic else (low - 0.5, high + 0.5)
        if not axis.from_zero or self.logarithmic:
            pad = 0.04 * (self._to(high) - self._to(low))
            low, high = self._from(self._to(low) - pad), self._from(self._to(high) + pad)
        self.low, self.high, self.start, self.end = low, high, start, end
        self.ticks = [tick for tick in axis.ticks if low <= tick <= high] or self._own_ticks()

    def __call__(self, value: float) -> float:
        low, high = self._to(self.low), self._to(self.high)
        return self.start + (self._to(value) - low) / (high - low) * (self.end - self.start)

    def _to(self, value: float) -> float:
        if self.is_root:
            return math.sqrt(max(value, 0.0))
        return math.log10(max(value, 1e-12)) if self.logarithmic else value

    def _from(self, value: float) -> float:
        return 10.0**value if self.logarithmic else value

    def _own_ticks(self) -> list[float]:
        if self.logarithmic:
            return list(logarithmic_ticks(self.low, self.high))
        if self.is_root:
            return [float(tick) for tick in ROOT_TICKS if tick <= self.high]
        rough = (self.high - self.low) / 5
        unit = 10.0 ** math.floor(math.log10(rough))
        step = next((digit * unit for digit in (1, 2, 5) if digit * unit >= rough), 10 * unit)
        first, last = math.ceil(self.low / step - 1e-9), math.floor(self.high / step + 1e-9)
        return [float(f"{k * step:.12g}") for k in range(first, last + 1)]


class _RootScale(_Scale):
    """By square roots: values near 0 are told apart although a few are large."""

    def _to(self, value: float) -> float:
        return math.sqrt(max(value, 0.0))

    def _from(self, value: float) -> float:
        return max(value, 0.0) ** 2

    def _own_ticks(self) -> list[float]:
        span = self._to(self.high) - self._to(self.low)
        kept: list[float] = []
        for power in range(3, -4, -1):
            for digit in (5, 2, 1):
                tick = float(f"{digit}e{power}")
                apart = not kept or self._to(kept[-1]) - self._to(tick) >= CLOSEST_TICKS * span
                if self.low <= tick <= self.high and apart:
                    kept.append(tick)
        if self.low > 0:
            return kept[::-1]
        return [0.0, *(tick for tick in reversed(kept) if self._to(tick) >= CLOSEST_TICKS * span)]


def _panel(panel: Panel, marks: Sequence[Mark]) -> Drawing:
    """Series, bands, spans and bars."""
    if panel.x.categories:
        names = panel.x.categories
        positions = {name: float(i) for i, name in enumerate(names)}
        x = _Scale((-0.5, len(names) - 0.5), Axis(), LEFT, WIDTH - RIGHT)
        x.ticks = [] if panel.bars or not panel.series else x.ticks
        labels = [(x(place), name) for name, place in positions.items()]
    else:
        of_series = [each for series in panel.series for each in series.x]
        spans = [end for span in panel.spans for end in (span.start, span.end)]
        x = _Scale([*of_series, *spans, *(mark.x for mark in marks)], panel.x, LEFT, WIDTH - RIGHT)
        labels = [(x(tick), f"{tick:g}") for tick in x.ticks]
    values: list[Number] = []
    for series in panel.series:
        values += [*series.y, *series.low, *series.high]
    for band in panel.bands:
        values += [*band.low, *band.high]
    for bars in panel.bars:
        values += bars.values
    # A few trials may change ten times as much as the mean.
    highest = max((mark.y for mark in marks), default=0.0)
    is_root = panel.y.from_zero and highest > FAR * max((each for each in values if each is not None), default=highest)
    y = _Scale([*values, highest] if marks else values, panel.y, HEIGHT - BOTTOM, TOP, is_root=is_root)
    if is_root:
        panel = replace(panel, y=replace(panel.y, label=f"{panel.y.label or 'CP'} (square-root scale)"))
    parts = [*_frame(panel, x, y, labels)]
    for i, span in enumerate(panel.spans):
        left, right = x(span.start), x(span.end)
        parts.append(
            f'<rect class="span s{i}" x="{_n(left)}" y="{TOP}" width="{_n(right - left)}" '
            f'height="{HEIGHT - BOTTOM - TOP}"{_tip(span.label)}/>'
        )
    parts += [_band(band, x, y) for band in panel.bands]
    parts += _bars(panel.bars, x, y)
    ordered = sorted(panel.series, key=lambda each: each.role not in ("model", "median"))
    thin = [_series(series, x, y) for series in ordered if series.role == "model"]
    if not marks or len(thin) <= len(panel.series):
        parts += thin
    parts += _marks(marks, x, y)
    parts += [_series(series, x, y) for series in ordered if series.role != "model"]
    return Drawing(panel.title, _svg(parts, panel.title or panel.y.label), _legend(panel))


def _frame(
    panel: Panel, x: _Scale, y: _Scale, labels: Sequence[tuple[float, str]], width: int = WIDTH, height: int = HEIGHT
) -> Iterator[str]:
    """Grid, axes and their labels."""
    bottom, right = height - BOTTOM, width - RIGHT
    for tick in y.ticks:
        yield f'<line class="grid" x1="{LEFT}" x2="{right}" y1="{_n(y(tick))}" y2="{_n(y(tick))}"/>'
        yield f'<text class="tick" x="{LEFT - 6}" y="{_n(y(tick) + 4)}" text-anchor="end">{tick:g}</text>'
    end = -math.inf
    for place, text in labels:
        half = len(text) * CHARACTER / 2
        yield f'<line class="axis" x1="{_n(place)}" x2="{_n(place)}" y1="{bottom}" y2="{bottom + 4}"/>'
        if place - half > end:
            yield f'<text class="tick" x="{_n(place)}" y="{bottom + 17}" text-anchor="middle">{escape(text)}</text>'
            end = place + half + 4
    yield f'<path class="axis" d="M{LEFT} {TOP}V{bottom}H{right}"/>'
    across = panel.x.label.replace("\n", " ")
    yield f'<text class="label" x="{(LEFT + right) / 2}" y="{height - 8}" text-anchor="middle">{escape(across)}</text>'
    middle = (TOP + bottom) / 2
    yield (
        f'<text class="label" transform="translate(14 {middle}) rotate(-90)" text-anchor="middle">'
        f"{escape(panel.y.label)}</text>"
    )


def _series(series: Series, x: _Scale, y: _Scale) -> str:
    """A line with its points, and their intervals."""
    style = _style(series.role, series.group)
    known = [(at, value) for at, value in zip(series.x, series.y, strict=True) if value is not None]
    parts = [f'<polyline class="line" points="{" ".join(f"{_n(x(a))},{_n(y(b))}" for a, b in known)}"/>']
    bounds = list(zip(series.low, series.high, strict=True)) or [(None, None)] * len(series.x)
    named = series.name or series.label
    for at, value, (low, high) in zip(series.x, series.y, bounds, strict=True):
        if value is None:
            continue
        text = f"{named}: {at:g} → {value:.4g}"
        if low is not None and high is not None:
            text += f" ({low:.4g} – {high:.4g})"
            parts.append(_interval(x(at), y(low), y(high)))
        if series.role != "model":
            parts.append(f'<circle class="dot" cx="{_n(x(at))}" cy="{_n(y(value))}" r="4"{_tip(text)}/>')
    return f'<g class="{style}">{"".join(parts)}</g>'


def _interval(x: float, low: float, high: float) -> str:
    ends = f"M{_n(x - CAP)} {_n(low)}h{2 * CAP}M{_n(x - CAP)} {_n(high)}h{2 * CAP}"
    return f'<path class="interval" d="M{_n(x)} {_n(low)}V{_n(high)}{ends}"/>'


def _band(band: Band, x: _Scale, y: _Scale) -> str:
    known = [
        (at, low, high)
        for at, low, high in zip(band.x, band.low, band.high, strict=True)
        if low is not None and high is not None
    ]
    there = [f"{_n(x(at))},{_n(y(high))}" for at, _, high in known]
    back = [f"{_n(x(at))},{_n(y(low))}" for at, low, _ in reversed(known)]
    style = _style("band", band.group)
    return f'<polygon class="{style}" points="{" ".join(there + back)}"{_tip(band.label)}/>'


def _bars(all_bars: Sequence[Bars], x: _Scale, y: _Scale) -> Iterator[str]:
    step = abs(x(1) - x(0)) if all_bars else 0.0
    width = 0.8 * step / max(len(all_bars), 1)
    for i, bars in enumerate(all_bars):
        style = f"bar s{bars.span}" if bars.span is not None else _style("bar", bars.group)
        for place, value in enumerate(bars.values):
            if value is not None:
                left, top, base = x(place) - 0.4 * step + i * width, y(value), y(max(y.low, 0.0))
                yield (
                    f'<rect class="{style}" x="{_n(left)}" y="{_n(top)}" width="{_n(width)}" '
                    f'height="{_n(max(base - top, 0))}"{_tip(f"{bars.label}, {bars.categories[place]}: {value:.4g}")}/>'
                )


def _marks(marks: Sequence[Mark], x: _Scale, y: _Scale) -> Iterator[str]:
    """A point for each trial, moved sideways a little, by its number."""
    for i, mark in enumerate(marks):
        moved = ((i * GOLDEN) % 1 - 0.5) * 2 * JITTER * WIDTH
        button = f' data-scene="{mark.scene}" tabindex="0" role="button"' if mark.scene >= 0 else ""
        label = f' aria-label="{escape(mark.text)}"' if mark.scene >= 0 else ""
        style = f"{_style('mark', mark.group)}{' shown' if mark.scene >= 0 else ''}"
        yield (
            f'<circle class="{style}" cx="{_n(x(mark.x) + moved)}" cy="{_n(y(mark.y))}" '
            f'r="{4 if mark.scene >= 0 else 2.5}"{_tip(mark.text)}{button}{label}/>'
        )


def _dots(panel: Panel) -> Drawing:
    """Dots with horizontal intervals in named rows."""
    names = [_shortened(name) for name in panel.y.categories]
    left = 12 + max((len(name) for name in names), default=0) * CHARACTER
    height = TOP + ROW * len(names) + BOTTOM
    values = [value for dots in panel.dots for value in (*dots.values, *dots.low, *dots.high)]
    x = _Scale(values, panel.x, left, WIDTH - RIGHT)
    bottom = height - BOTTOM
    parts = []
    for tick in x.ticks:
        parts.append(f'<line class="grid" x1="{_n(x(tick))}" x2="{_n(x(tick))}" y1="{TOP}" y2="{bottom}"/>')
        parts.append(f'<text class="tick" x="{_n(x(tick))}" y="{bottom + 16}" text-anchor="middle">{tick:g}</text>')
    rows = {name: TOP + ROW * (i + 0.5) for i, name in enumerate(panel.y.categories)}
    for name, shown in zip(panel.y.categories, names, strict=True):
        parts.append(
            f'<text class="tick" x="{_n(left - 6)}" y="{_n(rows[name] + 4)}" text-anchor="end">{escape(shown)}</text>'
        )
    parts.append(f'<path class="axis" d="M{_n(left)} {TOP}V{bottom}H{WIDTH - RIGHT}"/>')
    for dots in panel.dots:
        parts.append(f'<g class="{_style(dots.role, dots.group)}">{"".join(_dot_marks(dots, rows, x))}</g>')
    parts.append(
        f'<text class="label" x="{(left + WIDTH - RIGHT) / 2}" y="{height - 8}" text-anchor="middle">'
        f"{escape(panel.x.label)}</text>"
    )
    legend = tuple(Entry(_style(dots.role, dots.group), dots.label) for dots in panel.dots)
    return Drawing(panel.title, _svg(parts, panel.x.label, height=height), legend if len(legend) > 1 else ())


def _dot_marks(dots: Dots, rows: Mapping[str, float], x: _Scale) -> Iterator[str]:
    for name, value, low, high in zip(dots.categories, dots.values, dots.low, dots.high, strict=True):
        if value is None:
            continue
        text = f"{name}: {value:.4g}"
        if low is not None and high is not None:
            text += f" ({low:.4g} – {high:.4g})"
            yield f'<path class="interval" d="M{_n(x(low))} {_n(rows[name])}H{_n(x(high))}"/>'
        yield f'<circle class="dot" cx="{_n(x(value))}" cy="{_n(rows[name])}" r="4"{_tip(text)}/>'


def _cells(
    title: str,
    rows: Sequence[str],
    columns: Sequence[str],
    values: Sequence[Sequence[Number]],
    low: float,
    high: float,
    label: str,
    marked: Sequence[tuple[int, int]] = (),
    first_apart: int = 0,
) -> Drawing:
    """A matrix as coloured cells; small values are told apart although a few are large."""
    names = [_shortened(name) for name in rows]
    left = 12 + max((len(name) for name in names), default=0) * CHARACTER
    across = max(30.0, (WIDTH - left - RIGHT) / max(len(columns), 1)) if len(columns) < 14 else 34.0
    head = 16 + CHARACTER * max((len(_shortened(name)) for name in columns), default=0) * 0.86
    width = max(left + across * len(columns) + max(RIGHT, head / 2), 200)  # the last heading leans to the right
    colours = colormaps[FIELD_COLOURS]
    corners = set(marked)
    parts = []
    for j, name in enumerate(columns):
        place = left + across * (j + 0.5)
        parts.append(
            f'<text class="tick" transform="translate({_n(place + 4)} {_n(head - 6)}) rotate(-60)">'
            f"{escape(_shortened(name))}</text>"
        )
    for i, name in enumerate(rows):
        top = head + ROW * i + (8 if 0 < first_apart <= i else 0)
        parts.append(
            f'<text class="tick" x="{_n(left - 6)}" y="{_n(top + 13)}" text-anchor="end">{escape(names[i])}</text>'
        )
        for j, value in enumerate(values[i]):
            share = 0.0 if value is None or high <= low else math.sqrt(max(0.0, min(1.0, (value - low) / (high - low))))
            red, green, blue = (int(255 * each) for each in colours(share)[:3])
            paint = f' fill="#{red:02x}{green:02x}{blue:02x}"' if value is not None else ""
            text = MISSING if value is None else f"{value:.4g}"
            box = f'x="{_n(left + across * j)}" y="{_n(top)}" width="{_n(across)}" height="{ROW}"'
            parts.append(
                f'<rect class="cell{" missing" if value is None else ""}" {box}{paint} data-row="{i}" data-column="{j}"'
                f"{_tip(f'{name}, {columns[j]}: {text}')}/>"
            )
            if value is not None and across >= 26:
                shade = "light" if share < DARK else "dark"
                short = f"{value:.0f}" if value >= 9.95 else f"{value:.1f}"
                middle = _n(left + across * (j + 0.5))
                parts.append(f'<text class="number {shade}" x="{middle}" y="{_n(top + 13)}">{short}</text>')
            if (i, j) in corners:
                corner = left + across * (j + 1)
                parts.append(f'<path class="corner" d="M{_n(corner - 8)} {_n(top)}h8v8z"/>')
    height = head + ROW * len(rows) + (8 if 0 < first_apart < len(rows) else 0) + 4
    return Drawing(title, _svg(parts, title or label, width, height), wide=len(columns) > 12)


def _scatter(scatter: Scatter) -> Drawing:
    """Named points and the line through the best of them; names that would cover others are shown on hover alone."""
    width, height = SCATTER
    x = _RootScale([value for each in scatter.points for value in each.x], scatter.x, LEFT, width - RIGHT)
    y = _RootScale([value for each in scatter.points for value in each.y], scatter.y, height - BOTTOM, TOP)
    labels = [(x(tick), f"{tick:g}") for tick in x.ticks]
    parts = list(_frame(Panel(scatter.x, scatter.y), x, y, labels, width, height))
    if scatter.front:
        parts.append(
            f'<polyline class="front" points="{" ".join(f"{_n(x(a))},{_n(y(b))}" for a, b in scatter.front)}"/>'
        )
    legend = []
    for i, points in enumerate(scatter.points):
        style = _style(f"point {points.role}", i)
        legend.append(Entry(style, points.label))
        for name, across, up in zip(points.names, points.x, points.y, strict=True):
            tip = _tip(f"{name}: {across:.4g}, {up:.4g}")
            parts.append(f'<circle class="{style}" cx="{_n(x(across))}" cy="{_n(y(up))}" r="4.5"{tip}/>')
    parts += _names(scatter, x, y)
    label = f"{scatter.y.label} by {scatter.x.label}"
    return Drawing("", _svg(parts, label, width, height), tuple(legend), wide=True)


def _names(scatter: Scatter, x: _Scale, y: _Scale) -> Iterator[str]:
    """The names of points, each beside, above or below its own and apart from all else."""
    named = [
        (name, x(across), y(up))
        for points in scatter.points
        for name, across, up in zip(points.names, points.x, points.y, strict=True)
    ]
    taken = [(at - 5, height - 5, at + 5, height + 5) for _, at, height in named]
    for name, at, height in named:
        shown = _shortened(name)
        length = len(shown) * NAME_CHARACTER
        for left, baseline in (
            (at + 8, height + 4), (at - 8 - length, height + 4), (at - length / 2, height - 8),
            (at - length / 2, height + 17), (at + 6, height - 6), (at + 6, height + 15),
            (at - 6 - length, height - 6), (at - 6 - length, height + 15),
        ):  # fmt: skip
            box = (left, baseline - 10, left + length, baseline + 2)
            inside = box[0] > LEFT and box[2] < SCATTER[0] - RIGHT and box[1] > 0 and box[3] < SCATTER[1] - BOTTOM
            if inside and not any(_overlap(box, other) for other in taken):
                taken.append(box)
                yield f'<text class="name" x="{_n(left)}" y="{_n(baseline)}">{escape(shown)}</text>'
                break


def _overlap(a: Sequence[float], b: Sequence[float]) -> bool:
    """Whether two boxes (left, top, right, bottom) have a point in common."""
    return a[0] < b[2] and b[0] < a[2] and a[1] < b[3] and b[1] < a[3]


def _legend(panel: Panel) -> tuple[Entry, ...]:
    entries = [Entry(_style(each.role, each.group), each.label) for each in panel.series]
    entries += [Entry(_style("band", band.group), band.label) for band in panel.bands]
    entries += [Entry(f"span s{i}", span.label) for i, span in enumerate(panel.spans)]
    entries += [
        Entry(f"bar s{bars.span}" if bars.span is not None else _style("bar", bars.group), bars.label)
        for bars in panel.bars
    ]
    by_label = {entry.label: entry for entry in reversed(entries)}
    return tuple(dict.fromkeys(by_label[entry.label] for entry in entries))


def _style(role: str, group: int) -> str:
    line = group // GROUPS % LINES
    return f"{role} g{group % GROUPS}{f' l{line}' if line else ''}"


def _svg(parts: Iterable[str], label: str, width: float = WIDTH, height: float = HEIGHT) -> str:
    """A drawing of its own, that scales with the page."""
    return (
        f'<svg viewBox="0 0 {_n(width)} {_n(height)}" style="--natural:{_n(width)}px" role="group" '
        f'aria-label="{escape(label)}">{"".join(parts)}</svg>'
    )


def _tip(text: str) -> str:
    return f' data-tip="{escape(text)}"'


def _shortened(name: str) -> str:
    return name if len(name) <= LONGEST_NAME else f"{name[: LONGEST_NAME // 2]}…{name[-LONGEST_NAME // 2 + 1 :]}"


def _n(value: float) -> str:
    """A number with one decimal at most."""
    return f"{value:.1f}".removesuffix(".0") if np.isfinite(value) else "0"
