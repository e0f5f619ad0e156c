"""Figures of a study: the curve of Change Percentage by level, and a gallery of segmented variants."""

import matplotlib
import numpy as np
from matplotlib.figure import Figure
from PIL import Image

matplotlib.use("Agg")

OURS, PAPER = "#1f5fa8", "#c8501e"


def curve(table, rows, axis, title, path):
    """Mean Change Percentage by level with its 95 % interval, each model's own mean, and the paper's points.

    Parameters
    ----------
    table : DataFrame from ``tables.summary``
    rows : DataFrame of the trials
    axis : str, what the levels are; their unit is put behind it
    title : str
    path : Path of the PNG to write
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
    figure.savefig(path)


def _units(rows):
    return " and ".join(rows["unit"].unique()).replace("_", " ")


def gallery_trials(planned, rows, n_models, n_columns):
    """The trials that the gallery shows: of the first models that have them, one repeat of some levels.

    Models are taken evenly from the list, so that a benchmark shows several categories; levels evenly from the lowest
    to the highest.
    """
    good = set(rows.loc[rows["status"] == "ok", "trial_id"])
    first = {}
    for trial in planned:
        if trial.trial_id in good:
            first.setdefault(trial.model.name, {}).setdefault(trial.level, trial)
    models = _evenly(list(first), n_models)
    levels = _evenly(list(dict.fromkeys(trial.level for trial in planned)), n_columns)
    return [first[model][level] for model in models for level in levels if level in first[model]]


def _evenly(items, count):
    if count >= len(items):
        return items
    return [items[i] for i in np.linspace(0, len(items) - 1, count).round().astype(int)] if count > 0 else []


def gallery(pictures, rows, axis, title, path):
    """Write the pictures of originals and variants side by side, a row a model.

    Parameters
    ----------
    pictures : dict (trial, whether it is the original) -> (height, width, 3) uint8 array, a model's in one run
    rows : DataFrame, where the Change Percentage in the captions stands
    axis : str, what the levels are
    title : str
    path : Path of the PNG to write
    """
    change = rows.set_index("trial_id")["change_percentage"]
    by_model = {}
    for (trial, original), picture in pictures.items():
        caption = f"{trial.level:g}: CP {change[trial.trial_id]:.1f} %"
        by_model.setdefault(trial.model.name, []).append(
            (picture, f"{trial.model.name}: original" if original else caption)
        )
    columns = max(map(len, by_model.values()))
    figure = Figure(figsize=(2.4 * columns, 2.3 * len(by_model) + 0.4), dpi=150, layout="constrained")
    figure.suptitle(f"{title}: {axis} ({_units(rows)}), and the Change Percentage (CP)")
    grid = figure.subplots(len(by_model), columns, squeeze=False)
    for axes in grid.flat:
        axes.set_axis_off()
    for line, cells in zip(grid, by_model.values(), strict=True):
        for axes, (picture, caption) in zip(line, cells, strict=False):
            axes.imshow(picture)
            axes.set_title(caption, fontsize=9)
    figure.savefig(path, metadata={"Shows": _shows(pictures)})


def is_drawn(tasks, path):
    """Whether ``path`` is a gallery of exactly these pictures already."""
    if not path.exists():
        return False
    with Image.open(path) as image:
        return image.info.get("Shows") == _shows(tasks)


def _shows(tasks):
    return " ".join(trial.trial_id for trial, _ in tasks)
