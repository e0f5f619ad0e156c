"""Tables of a study: a row a level, with intervals, beside the paper's figures."""

import numpy as np

RESAMPLES = 2000


def summary(trials, paper):
    """Change Percentage by part and level.

    Parameters
    ----------
    trials : DataFrame of rows, as ``Store.frame`` gives them
    paper : dict, part -> dict, level -> the Change Percentage that the paper reports

    Returns
    -------
    DataFrame with the columns part, level, unit, mean, ci_low, ci_high (the 95 % interval of the mean), median,
    van_dongen, rand_index_error (means), n_segments, n_segments_reference (means), n (trials that gave a figure),
    failures, paper
    """
    import pandas as pd

    rows = []
    for (part, level, unit), group in trials.groupby(["part", "level", "unit"], sort=False):
        good = group[group["status"] == "ok"]
        rows.append(
            {
                "part": part,
                "level": level,
                "unit": unit,
                **_mean_and_interval(good),
                "median": good["change_percentage"].median(),
                "van_dongen": _model_mean(good, "van_dongen"),
                "rand_index_error": _model_mean(good, "rand_index_error"),
                "n_segments": _model_mean(good, "n_segments"),
                "n_segments_reference": _model_mean(good, "n_segments_reference"),
                "n": len(good),
                "failures": len(group) - len(good),
                "paper": next((float(cp) for at, cp in paper[part].items() if np.isclose(at, level)), np.nan),
            }
        )
    return pd.DataFrame(rows)


def by_category(trials):
    """Change Percentage by part, level and category: part, level, unit, category, mean, ci_low, ci_high, median, n."""
    import pandas as pd

    return pd.DataFrame(
        {
            **dict(zip(("part", "level", "unit", "category"), key, strict=True)),
            **_mean_and_interval(good),
            "median": good["change_percentage"].median(),
            "n": len(good),
        }
        for key, good in trials[trials["status"] == "ok"].groupby(["part", "level", "unit", "category"], sort=False)
    )


def _mean_and_interval(trials, column="change_percentage"):
    low, high = interval(trials, column)
    return {"mean": _model_mean(trials, column), "ci_low": low, "ci_high": high}


def _model_mean(trials, column):
    """Mean over models of the mean over repeats, so that a model with failures weighs as much as the others."""
    return trials.groupby("model")[column].mean().astype(float).mean()


def interval(trials, column="change_percentage"):
    """95 % percentile-bootstrap interval of the mean over models of the mean over repeats.

    Models are drawn with replacement, then repeats of each drawn model: both are samples, of shapes and of noise. With
    a single model only the repeats are resampled, and the interval speaks of that model alone.

    Returns
    -------
    (low, high), NaN where there is no trial or nothing to resample
    """
    values = [group.to_numpy(dtype=float) for _, group in trials.groupby("model")[column]]
    if sum(map(len, values)) < 2:
        return np.nan, np.nan
    rng = np.random.default_rng(0)
    counts = np.array([len(v) for v in values])
    padded = np.full((len(values), counts.max()), np.nan)
    for i, v in enumerate(values):
        padded[i, : len(v)] = v
    models = rng.integers(len(values), size=(RESAMPLES, len(values)))
    drawn = rng.random((RESAMPLES, len(values), counts.max()))
    repeats = (drawn * counts[models][:, :, None]).astype(int)
    sample = padded[models[:, :, None], repeats]
    sample[np.arange(counts.max()) >= counts[models][:, :, None]] = np.nan
    means = np.nanmean(sample, axis=2).mean(axis=1)
    return tuple(np.quantile(means, [0.025, 0.975]).tolist())


HEADINGS = {
    "part": "perturbation",
    "level": "level",
    "unit": "unit",
    "mean": "CP %",
    "interval": "95 % interval",
    "median": "median",
    "paper": "paper",
    "van_dongen": "van Dongen",
    "rand_index_error": "Rand error",
    "segments": "segments (original)",
    "n": "n",
    "failures": "failed",
}


def display(table):
    """The table as text, a dict a row with the keys of ``HEADINGS``: what table.md and the terminal show."""
    return [
        {
            "part": row.part.replace("_", " "),
            "level": f"{row.level:g}",
            "unit": row.unit.replace("_", " "),
            "mean": number(row.mean, 2),
            "interval": interval_text(row.ci_low, row.ci_high, 2),
            "median": number(row.median, 2),
            "paper": number(row.paper, 2),
            "van_dongen": number(row.van_dongen, 2),
            "rand_index_error": number(row.rand_index_error, 4),
            "segments": f"{number(row.n_segments, 1)} ({number(row.n_segments_reference, 1)})",
            "n": str(row.n),
            "failures": str(row.failures),
        }
        for row in table.itertuples()
    ]


def number(value, digits):
    """A number as text, – where there is none."""
    import pandas as pd

    return "–" if pd.isna(value) else f"{value:.{digits}f}"


def interval_text(low, high, digits):
    import pandas as pd

    return "–" if pd.isna(low) else f"{low:.{digits}f} – {high:.{digits}f}"


def markdown(title, headings, rows, notes):
    """A page of Markdown: the rows of a table as text, and what its columns mean.

    headings : dict, key in the rows -> heading
    rows : list of dict
    """
    lines = [f"# {title}", "", "| " + " | ".join(headings.values()) + " |", "|" + " --- |" * len(headings)]
    lines += ["| " + " | ".join(row[key] for key in headings) + " |" for row in rows]
    return "\n".join([*lines, "", notes, ""])
