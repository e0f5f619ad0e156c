"""Figures of a study: the curve of Change Percentage by level, and a gallery of segmented variants."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure

from studies import render
from studies.engine import Lost, LostError

matplotlib.use("Agg")

OURS, PAPER = "#1f5fa8", "#c8501e"


def curve(table, rows, axis, title):
    """Mean Change Percentage by level with its 95 % interval, each model's own mean, and the paper's points.

    Parameters
    ----------
    table : DataFrame from ``tables.summary``
    rows : DataFrame of the trials
    axis : str, what the levels are; their unit is put behind it
    title : str
    """
    figure = Figure(figsize=(6.4, 4.2), dpi=150, layout="constrained")
    axes = figure.add_subplot()
    models = rows.groupby(["model", "level"])["change_percentage"].mean().unstack("level")
    label = "each model"
    for _, values in models.iterrows():
        axes.plot(values.index, values, color=OURS, alpha=max(0.2, 0.7 / np.sqrt(len(models))), lw=0.8, label=label)
        label = None
    # By height relative to the mean, since the percentile interval need not be centred on it.
    errors = np.abs([table["mean"] - table["ci_low"], table["ci_high"] - table["mean"]])
    axes.errorbar(
        table["level"], table["mean"], yerr=np.nan_to_num(errors), color=OURS, marker="o", capsize=3, lw=1.8,
        label=f"mean and 95 % interval ({len(models)} models)", zorder=3,
    )  # fmt: skip
    if table["paper"].notna().any():
        axes.plot(
            table["level"],
            table["paper"],
            color=PAPER,
            marker="s",
            ls="--",
            lw=1.4,
            label="the paper",
            zorder=4,
            clip_on=False,
        )
    axes.set(xlabel=f"{axis} ({_units(table)})", ylabel="Change Percentage", title=title)
    axes.set_xticks(table["level"], [f"{level:g}" for level in table["level"]])
    axes.set_ylim(bottom=0, top=None if np.nanmax([models.max(axis=None), 0]) > 0 else 1)
    axes.grid(alpha=0.25)
    axes.spines[["top", "right"]].set_visible(False)
    figure.legend(loc="outside lower center", ncols=3, frameon=False)
    return figure


def _units(rows):
    return " and ".join(rows["unit"].unique()).replace("_", " ")


def gallery_trials(planned, rows, models, n_columns):
    """The trials that the gallery shows: of each of some models, one repeat of some levels.

    models : how many, taken evenly from the list, so that a benchmark shows several categories; or their names
    n_columns : how many levels, evenly from the lowest to the highest; of a study of several parts, the last of each
    """
    good = set(rows.loc[rows["status"] == "ok", "trial_id"])
    first = {}
    for trial in planned:
        if trial.trial_id in good:
            first.setdefault(trial.model.name, {}).setdefault((trial.part, trial.level), trial)
    by_count = isinstance(models, int)
    names = _evenly(list(first), models) if by_count else [str(name) for name in models if str(name) in first]
    levels = list(dict.fromkeys((trial.part, trial.level) for trial in planned))
    last = dict(levels)  # part -> its last level
    levels = _evenly(levels, n_columns) if len(last) == 1 else list(last.items())
    return [first[name][level] for name in names for level in levels if level in first[name]]


def _evenly(items, count):
    if count >= len(items):
        return items
    return [items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int)] if count > 0 else []


def gallery(shown, rows, axes, title, engine):
    """Originals and variants side by side, a row a model.

    Parameters
    ----------
    shown : list of trials, those of a model one after the other
    rows : DataFrame, where the Change Percentage in the captions stands
    axes : dict, part -> what its levels are
    title : str
    engine : what computes the segmentations and draws them
    """
    first = {trial.model.name: trial for trial in reversed(shown)}
    tasks = [task for t in shown for task in ([(t, True)] if first[t.model.name] is t else []) + [(t, False)]]
    # By the workers: where drawing off screen takes a process down, the study's results stand all the same.
    pictures = dict(engine.run(render.picture, tasks))
    for picture in pictures.values():
        if isinstance(picture, Lost):
            raise LostError(picture.reason)
    change = rows.set_index("trial_id")["change_percentage"]
    by_model = {}
    for trial, original in tasks:
        part = f"{trial.part} ".replace("_", " ") if len(axes) > 1 else ""
        caption = f"{part}{trial.level:g}: CP {change[trial.trial_id]:.1f} %"
        by_model.setdefault(trial.model.name, []).append(
            (pictures[trial, original], f"{trial.model.name}: original" if original else caption)
        )
    columns = max(map(len, by_model.values()))
    figure = Figure(figsize=(2.4 * columns, 2.3 * len(by_model) + 0.4), dpi=150, layout="constrained")
    what = f": {next(iter(axes.values()))} ({_units(rows)})" if len(axes) == 1 else ""
    figure.suptitle(f"{title}{what}, and the Change Percentage (CP)")
    grid = figure.subplots(len(by_model), columns, squeeze=False)
    for cell in grid.flat:
        cell.set_axis_off()
    for line, cells in zip(grid, by_model.values(), strict=True):
        for cell, (picture, caption) in zip(line, cells, strict=False):
            cell.imshow(picture)
            cell.set_title(caption, fontsize=9)
    return figure
