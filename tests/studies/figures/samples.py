"""Small tables and rows of studies, and the charts made of them."""

import numpy as np
import pandas as pd

from studies.columns import Column, Published, Table
from studies.figures.charts import level_curve, method_means, method_scores, pair_matrices, part_panels, segment_counts

SEGMENTERS = ("walk", "cuts")
INTERVALS = [(0.6, 2.7), (0.85, 1.9)]


def level_table(part, levels, published=None, segmenters=None):
    """A table of Change Percentages by level."""
    mean = np.linspace(1.0, 5.0, len(levels))
    frames = [
        pd.DataFrame(
            {
                "part": part, "level": levels, "unit": "count", "mean": mean + 3 * i, "ci_low": mean + 3 * i - 0.5,
                "ci_high": mean + 3 * i + 1, "median": mean + 3 * i - 0.2,
            }
        ).assign(**({} if segmenters is None else {"segmenter": name}))
        for i, name in enumerate(segmenters or [""])
    ]  # fmt: skip
    frame = pd.concat(frames, ignore_index=True)
    if published is None:
        return Table("table", frame)
    return Table(
        "table", frame.assign(published=list(published) * len(frames)), published=Published("published", "Smith 2011")
    )


def rows_of_levels(levels, n_models, segmenters=("walk",)):
    """Rows of trials of which each model has another Change Percentage."""
    return pd.DataFrame(
        {"segmenter": name, "model": str(model), "level": level, "change_percentage": model + level}
        for name in segmenters
        for model in range(n_models)
        for level in levels
    )


def rows_of_times():
    """Rows of a study of times, in which every second model has one more segment after time 1."""
    return pd.DataFrame(
        {"model": str(model), "level": time, "unit": "paper", "n_segments": 4 + model % 2 * (time > 1)}
        for model in range(4)
        for time in (0.5, 1.0, 1.5, 4.0)
    )


def _scores():
    scores = pd.DataFrame({"method": ["HeatWalk", "Humans", "HeatWalk"], "source": ["computed", "smith", "smith"]})
    for metric in ("hamming", "gce"):
        scores = scores.assign(**{metric: 0.2, f"{metric}_low": [0.1, np.nan, np.nan], f"{metric}_high": 0.3})
    return Table("table", scores, published=Published("source", "Smith 2011"))


def _curve(segmenters):
    levels = [1.0, 2.0, 4.0]
    table = level_table("holes", levels, [2.0, np.nan, 3.0], segmenters)
    return level_curve(table, rows_of_levels(levels, 12, segmenters or ("walk",)), "holes", "Holes")


def _panels(segmenters):
    parts = [
        level_table("short_circuits", [10.0], [2.32], segmenters),
        level_table("holes", [58.0, 250.0], [np.nan, np.nan], segmenters),
    ]
    named = {"short_circuits": ("Short circuits", "tubes"), "holes": ("Holes", "removed")}
    return part_panels(parts[0].replace(frame=pd.concat([part.frame for part in parts])), named, "Table 2")


def _matrices(segmenters):
    change = pd.DataFrame([[0.0, 3.0], [3.0, 0.0]], index=["cat0", "cat1"], columns=["cat0", "cat1"])
    if segmenters is None:
        return pair_matrices({"cat": change, "dog": change}, "Poses")
    return pair_matrices({(shape, name): change for shape in ("cat", "dog") for name in segmenters}, "Poses")


def _times(segmenters):
    rows = rows_of_times()
    if segmenters is not None:
        rows = pd.concat([rows.assign(segmenter=name) for name in segmenters])
    return segment_counts(rows, INTERVALS, "Times")


def _means():
    names = [f"HeatWalkRobust (part {i} only)" for i in range(8)]
    frame = pd.DataFrame({"segmenter": ["HeatWalk", *names], "mean": np.linspace(5, 12, 9)})
    return frame.assign(ci_low=frame["mean"] - 2, ci_high=frame["mean"] + 3, published=[8.0, *[np.nan] * 8])


MANY = [f"method {i}" for i in range(9)]
METRICS = [Column(name="hamming", heading="HD"), Column(name="gce", heading="GCE")]

CHARTS = {
    "curve": _curve(None),
    "curves of two segmenters": _curve(SEGMENTERS),
    "levels of many segmenters": _curve(MANY),
    "panels": _panels(None),
    "panels of two segmenters": _panels(SEGMENTERS),
    "parts of many segmenters": _panels(MANY),
    "times": _times(None),
    "times of two segmenters": _times(SEGMENTERS),
    "matrices": _matrices(None),
    "matrices of two segmenters": _matrices(SEGMENTERS),
    "means of methods": method_means(
        {"all (%)": _means(), "cat (%)": _means()}, "Poses", "lower is better", "the paper"
    ),
    "methods": method_scores(_scores(), METRICS, "Table 1"),
}


def ink(image):
    """The pixels of a picture that are not white."""
    return (image < 255).any(axis=2)
