"""Figures of a study: curves of Change Percentage by level, and galleries of segmented variants.

Every figure is as wide as one or two columns of a paper, in letters of 7 to 8 points. Curves are written as PDF and
PNG, pictures of surfaces as PNG of 300 dots an inch; drawn again, each has the same bytes.
"""

import logging
import textwrap

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

from studies.figures.surfaces import FIELD_COLOURS
from studies.storage import atomic_write

matplotlib.use("Agg")
# Embedding letters in a PDF says at length what it leaves out of a font.
logging.getLogger("fontTools").setLevel(logging.WARNING)

ONE_COLUMN, TWO_COLUMNS = 3.4, 7.0  # inches
DPI = 300
OURS, PAPER = "#1f5fa8", "#c8501e"
STYLE = {
    "font.size": 8,
    "axes.titlesize": 8,
    "axes.labelsize": 8,
    "xtick.labelsize": 7,
    "ytick.labelsize": 7,
    "legend.fontsize": 7,
    "figure.titlesize": 9,
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "grid.linewidth": 0.5,
    "grid.alpha": 0.3,
    "pdf.fonttype": 42,  # letters as letters, which journals ask for and which can be searched
}
LARGEST_SCALE = 3  # drawn in proportion, as in the paper, which leaves out its ×10
FEW = 10  # models of which each has a line of its own; of more, the quartiles are drawn


@matplotlib.rc_context(STYLE)
def save(figure, path, shows=None):
    """Write a figure as PNG, and where ``shows`` is None, as for all curves, as PDF beside it.

    Parameters
    ----------
    figure : matplotlib Figure
    path : Path of the PNG
    shows : str, optional, written into the PNG as what its pictures show
    """
    # No dates and no versions of the software: the same figure has the same bytes.
    with atomic_write(path) as part:
        figure.savefig(part, dpi=DPI, metadata={"Software": None} | ({} if shows is None else {"Shows": shows}))
    if shows is None:
        with atomic_write(path.with_suffix(".pdf")) as part:
            figure.savefig(part, metadata={"CreationDate": None, "Creator": None, "Producer": None})


@matplotlib.rc_context(STYLE)
def curve(table, rows, axis, title):
    """Mean Change Percentage by level with its 95 % interval, the models behind it, and the paper's points.

    Up to ``FEW`` models have a line each; of more, the band between the quartiles of their means is drawn.

    Parameters
    ----------
    table : DataFrame from ``tables.summary``
    rows : DataFrame of the trials
    axis : str, what the levels are; their unit is put behind it
    title : str
    """
    figure = Figure(figsize=(ONE_COLUMN, 2.6), layout="constrained")
    axes = figure.add_subplot()
    models = rows.groupby(["model", "level"])["change_percentage"].mean().astype(float).unstack("level")
    models = models.dropna(how="all")
    if len(models) <= FEW:
        for i, (_, values) in enumerate(models.iterrows()):
            label = None if i else "each model"
            axes.plot(values.index, values, color=OURS, alpha=0.35, lw=0.7, label=label)
    else:
        low, high = models.quantile(0.25), models.quantile(0.75)
        axes.fill_between(low.index, low, high, color=OURS, alpha=0.15, lw=0, label="quartiles of models")
    _levels(axes, table, f"mean, 95 % interval ({len(models)} models)")
    axes.set(xlabel=f"{axis} ({_units(table)})", ylabel="Change Percentage", title=title)
    figure.legend(loc="outside lower center", ncols=2, frameon=False)
    return figure


@matplotlib.rc_context(STYLE)
def panels(table, named, title):
    """A small curve of Change Percentage a part of the study, in one row, as for the paper's Table 2.

    Each has its own scale of Change Percentage, since one perturbation changes ten times as much as another.

    Parameters
    ----------
    table : DataFrame from ``tables.summary``
    named : dict, part -> (its title, what its levels are); their unit is put below it
    title : str
    """
    parts = list(table.groupby("part", sort=False))
    # A part of one level needs less room than a curve.
    widths = [1.0 if len(part) > 1 else 0.45 for _, part in parts]
    figure = Figure(figsize=(TWO_COLUMNS if sum(widths) > 1.5 else ONE_COLUMN, 2.2), layout="constrained")
    row = figure.subplots(1, len(parts), squeeze=False, width_ratios=widths)[0]
    for axes, (name, part) in zip(row, parts, strict=True):
        _levels(axes, part, "mean, 95 % interval")
        axes.plot(part["level"], part["median"], color=OURS, marker="_", ls=":", lw=0.8, ms=5, label="median")
        heading, axis = named[name]
        axes.set(title=heading, xlabel=f"{axis}\n({_units(part)})")
        if len(part) == 1:
            axes.set_xlim(part["level"].iloc[0] - 1, part["level"].iloc[0] + 1)
    row[0].set_ylabel("Change Percentage")
    figure.suptitle(title)
    # Of the first part that has all three.
    fullest = max(row, key=lambda axes: len(axes.get_legend_handles_labels()[0]))
    figure.legend(*fullest.get_legend_handles_labels(), loc="outside lower center", ncols=3, frameon=False)
    return figure


def _levels(axes, table, label):
    """The means by level with their intervals, and the paper's points, where there are any."""
    # By height relative to the mean, since the percentile interval need not be centred on it.
    errors = np.abs([table["mean"] - table["ci_low"], table["ci_high"] - table["mean"]])
    axes.errorbar(
        table["level"], table["mean"], yerr=np.nan_to_num(errors), color=OURS, marker="o", ms=3, capsize=2, lw=1.2,
        label=label, zorder=3,
    )  # fmt: skip
    if table["paper"].notna().any():
        axes.plot(
            table["level"], table["paper"], color=PAPER, marker="s", ms=3, ls="--", lw=1.0, label="the paper", zorder=4,
            clip_on=False,
        )  # fmt: skip
    levels = np.sort(table["level"].to_numpy(dtype=float))
    # A level too near to the one before, for the letters, keeps its tick without its number.
    texts, last = [], -np.inf
    for level in levels:
        near = level - last < 0.16 * np.ptp(levels)
        texts.append("" if near else f"{level:g}")
        last = last if near else level
    axes.set_xticks(levels, texts)
    axes.set_ylim(bottom=0, top=None if table[["mean", "paper"]].max(axis=None) > 0 else 1)
    axes.grid()


def _units(rows):
    return " and ".join(rows["unit"].unique()).replace("_", " ")


def gallery_trials(planned, rows, models, n_columns):
    """The trials that the gallery shows: of each of some models, one repeat of some levels.

    models : how many, taken evenly from the list, so that a benchmark shows several categories; or the names of those
        to show where they are there, and three if none is
    n_columns : how many levels, evenly from the lowest to the highest; of a study of several parts, the last of each

    Returns
    -------
    list of lists of trials, a model each
    """
    good = set(rows.loc[rows["status"] == "ok", "trial_id"])
    first = {}
    for trial in planned:
        if trial.trial_id in good:
            first.setdefault(trial.model.name, {}).setdefault((trial.part, trial.level), trial)
    named = [] if isinstance(models, int) else [str(name) for name in models if str(name) in first]
    names = named or _evenly(list(first), models if isinstance(models, int) else 3)
    levels = list(dict.fromkeys((trial.part, trial.level) for trial in planned))
    last = dict(levels)  # part -> its last level
    levels = _evenly(levels, n_columns) if len(last) == 1 else list(last.items())
    return [[first[name][level] for level in levels if level in first[name]] for name in names]


def _evenly(items, count):
    if count >= len(items):
        return items
    return [items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int)] if count > 0 else []


@matplotlib.rc_context(STYLE)
def gallery(pictures, rows, axes, style, title):
    """Originals and variants side by side, a row a model.

    Parameters
    ----------
    pictures : list of (trials of one model, pictures): (height, width, 3) uint8 arrays of the original and each variant
    rows : DataFrame, where the Change Percentage in the captions stands
    axes : dict, part -> what its levels are
    style : what ``render.pictures`` was told; "scaled" draws pictures in proportion, up to ``LARGEST_SCALE``
    title : str

    Returns
    -------
    matplotlib Figure
    """
    change = rows.set_index("trial_id")["change_percentage"]
    lines = []
    for trials, (original, *variants) in pictures:
        line = [(original, f"{trials[0].model.name}: original", 1.0)]
        for trial, picture in zip(trials, variants, strict=True):
            part = f"{trial.part} ".replace("_", " ") if len(axes) > 1 else ""
            line.append((picture, f"{part}{trial.level:g}: CP {change[trial.trial_id]:.1f} %", trial.level))
        if style == "scaled":
            line = [(_shrunk(picture, scale / LARGEST_SCALE), *rest, scale) for picture, *rest, scale in line
                    if scale <= LARGEST_SCALE]  # fmt: skip
        lines.append([(picture, caption) for picture, caption, _ in line])
    what = f": {next(iter(axes.values()))} ({_units(rows)})" if len(axes) == 1 else ""
    return grid(lines, f"{title}{what}; CP: Change Percentage")[0]


def _shrunk(picture, share):
    """A picture at a share of its size, standing at the bottom of a white one of its old size."""
    height, width, _ = picture.shape
    size = (max(1, round(side * share)) for side in (width, height))
    small = Image.fromarray(picture).resize(tuple(size), Image.Resampling.LANCZOS)
    sheet = Image.new("RGB", (width, height), "white")
    sheet.paste(small, ((width - small.width) // 2, height - small.height))
    return np.asarray(sheet)


@matplotlib.rc_context(STYLE)
def grid(lines, heading=None, below=0.0):
    """Lay out pictures in rows, each under its caption, on the width of two columns.

    The pictures of a row are cropped alike, so that what had the same frame keeps it.

    Parameters
    ----------
    lines : rows of (picture, caption); the pictures of a row (height, width, 3) uint8 arrays of the same size
    heading : str, optional, over all
    below : inches left free under each picture, for a colour bar

    Returns
    -------
    figure : matplotlib Figure
    axes : the rows of Axes, one a picture
    """
    lines = [(_cropped([picture for picture, _ in line]), [caption for _, caption in line]) for line in lines]
    cell = min(TWO_COLUMNS / max(len(captions) for _, captions in lines), 2.4)
    width, gap = cell * max(len(captions) for _, captions in lines), 0.04
    heights = [min((cell - gap) * pictures[0].shape[0] / pictures[0].shape[1], 1.4 * cell) for pictures, _ in lines]
    captions_lines = [1 + max(caption.count("\n") for caption in captions) for _, captions in lines]
    tops = [0.14 * count + 0.04 for count in captions_lines]
    # A line of the heading holds some fifteen letters an inch.
    heading = "\n".join(textwrap.wrap(heading or "", max(int(15 * width), 30)))
    head = 0.1 + 0.16 * (1 + heading.count("\n")) if heading else 0.0
    total = head + sum(heights) + sum(tops) + below * len(lines)
    figure = Figure(figsize=(width, total))
    if heading:
        figure.text(0.5, 1 - 0.07 / total, heading, ha="center", va="top", fontsize=STYLE["figure.titlesize"])
    drawn, top = [], total - head
    for (pictures, captions), height, above in zip(lines, heights, tops, strict=True):
        bottom = top - above - height
        row = []
        for i, (picture, caption) in enumerate(zip(pictures, captions, strict=True)):
            place = ((i * cell + gap / 2) / width, bottom / total, (cell - gap) / width, height / total)
            axes = figure.add_axes(place)
            axes.set_axis_off()
            axes.imshow(picture, interpolation="antialiased")
            middle = (i + 0.5) * cell / width
            figure.text(middle, (bottom + height + 0.03) / total, caption, ha="center", va="bottom", fontsize=7)
            row.append(axes)
        drawn.append(row)
        top = bottom - below
    return figure, drawn


def _cropped(pictures):
    """Pictures of one size, without the white rows and columns that all of them have at their borders."""
    ink = np.any([(picture < 255).any(axis=2) for picture in pictures], axis=0)
    if not ink.any():
        return pictures
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    return [picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] for picture in pictures]


@matplotlib.rc_context(STYLE)
def times(rows, intervals, title):
    """How the number of segments depends on time (paper, section 6.7).

    Left, its median and quartiles over models by time, the intervals shaded; right, of how many different numbers a
    model has within each interval: in a first bar the models whose number does not change.

    Parameters
    ----------
    rows : DataFrame of the trials: model, level (the time), unit, n_segments; every model at the same times
    intervals : list of (first, last) times
    title : str
    """
    counts = rows.pivot(index="model", columns="level", values="n_segments").astype(float)
    figure = Figure(figsize=(TWO_COLUMNS, 2.8), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=[1.3, 1])
    below = {"loc": "upper center", "bbox_to_anchor": (0.5, -0.2)}
    shades = matplotlib.colormaps["Oranges"](np.linspace(0.3, 0.65, len(intervals)))
    for (first, last), shade in zip(intervals, shades, strict=True):
        left.axvspan(first, last, color=shade, alpha=0.4, lw=0, label=f"times {first:g} to {last:g}")
    low, middle, high = (counts.quantile(q) for q in (0.25, 0.5, 0.75))
    left.fill_between(middle.index, low, high, color=OURS, alpha=0.25, lw=0, label="quartiles")
    left.plot(middle.index, middle, color=OURS, marker="o", ms=2.5, lw=1.2, label="median")
    left.set_xscale("log")
    ticks = [time for time in (0.1, 0.2, 0.5, 1, 2, 5, 10, 20) if counts.columns[0] <= time <= counts.columns[-1]]
    left.set_xticks(ticks, [f"{time:g}" for time in ticks])
    left.minorticks_off()
    # From hundreds of segments at short times to a handful.
    left.set_yscale("log")
    left.set(xlabel=f"time ({_units(rows)} units)", ylabel="segments", title=f"Segments of {len(counts)} models")
    left.legend(frameon=False, ncols=2, **below)
    left.grid()
    within = [counts.loc[:, first:last].nunique(axis=1) for first, last in intervals]
    most = max(count.max() for count in within)
    width = 0.8 / len(intervals)
    for i, ((first, last), count, shade) in enumerate(zip(intervals, within, shades, strict=True)):
        share = 100 * np.bincount(count, minlength=most + 1)[1:] / len(counts)
        right.bar(np.arange(1, most + 1) + (i - (len(intervals) - 1) / 2) * width, share, width, color=shade,
                  label=f"times {first:g} to {last:g}: {share[0]:.1f} % unchanged")  # fmt: skip
    right.set_xticks(np.arange(1, most + 1))
    right.set(xlabel="different numbers of segments of a model", ylabel="models (%)", title="Change within an interval")
    right.legend(frameon=False, **below)
    figure.suptitle(title)
    return figure


@matplotlib.rc_context(STYLE)
def matrix(changes, title):
    """Change Percentage between all pairs of poses: a square a shape, in a row, with one colour bar.

    Parameters
    ----------
    changes : dict, shape -> square DataFrame whose rows and columns are its poses
    title : str
    """
    square = min(2.0, (TWO_COLUMNS - 0.7) / len(changes))
    figure = Figure(figsize=(0.7 + square * len(changes), 0.5 + square), layout="constrained")
    row = figure.subplots(1, len(changes), squeeze=False)[0]
    largest = max(np.nanmax(change.to_numpy(dtype=float)) for change in changes.values()) or 1
    for axes, (shape, change) in zip(row, changes.items(), strict=True):
        values = change.to_numpy(dtype=float)
        edges = np.arange(len(values) + 1) - 0.5
        shown = axes.pcolormesh(edges, edges, values, cmap=FIELD_COLOURS, vmin=0, vmax=largest)
        axes.set_aspect("equal")
        axes.invert_yaxis()
        axes.spines[:].set_visible(False)
        # At most a dozen names to a side.
        ticks = np.arange(0, len(values), -(-len(values) // 12))
        axes.set_xticks(ticks, [str(change.columns[i]) for i in ticks], rotation=90)
        axes.set_yticks(ticks, [str(change.index[i]) for i in ticks])
        apart = values[~np.eye(len(values), dtype=bool)]
        axes.set_title(f"{shape}: mean {np.nanmean(apart):.1f} %" if len(apart) else str(shape))
    figure.suptitle(title)
    figure.colorbar(shown, ax=row, label="Change Percentage", shrink=0.8, pad=0.01)
    return figure


@matplotlib.rc_context(STYLE)
def methods(table, metrics, title):
    """The benchmark's metrics of each method: ours with their intervals beside the paper's.

    Parameters
    ----------
    table : DataFrame with the columns method, source (computed | paper), and for each metric METRIC, METRIC_low and
        METRIC_high (NaN where there is no interval)
    metrics : dict, metric -> its short name
    title : str
    """
    names = list(dict.fromkeys(table["method"]))[::-1]
    figure = Figure(figsize=(TWO_COLUMNS, 0.9 + 0.17 * len(names)), layout="constrained")
    for axes, (metric, short) in zip(figure.subplots(1, len(metrics), sharey=True), metrics.items(), strict=True):
        for source, colour, marker, label in (("paper", PAPER, "s", "the paper"), ("computed", OURS, "o", "ours")):
            rows = table[table["source"] == source]
            at = [names.index(name) for name in rows["method"]]
            errors = np.abs([rows[metric] - rows[f"{metric}_low"], rows[f"{metric}_high"] - rows[metric]])
            axes.errorbar(rows[metric], at, xerr=np.nan_to_num(errors), color=colour, marker=marker, ms=3.5, ls="",
                          lw=1, capsize=2, label=label)  # fmt: skip
        axes.set(xlabel=short, xlim=(0, None))
        axes.set_yticks(range(len(names)), names)
        axes.grid(axis="x")
    figure.suptitle(title)
    figure.legend(*axes.get_legend_handles_labels(), loc="outside lower center", ncols=2, frameon=False)
    return figure
