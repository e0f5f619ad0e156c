"""The charts of the leaderboard: what they show, as plain data."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING

from studies.columns import MISSING, is_missing
from studies.experiments.leaderboard.cards import names_in_charts
from studies.figures.charts import (
    CHANGE,
    WIDE_RANGE,
    Axis,
    Chart,
    Dots,
    Matrix,
    Number,
    Panel,
    Points,
    Scatter,
    Series,
    round_values,
)
from studies.statistics.ranks import pareto_front

if TYPE_CHECKING:
    from studies.experiments.change import Part
    from studies.experiments.leaderboard.scores import Scores

PANELS_PER_ROW = 5
LOWER_LEFT = "better to the lower left"


def charts(scores: Scores, parts: Mapping[str, Part], title: str) -> dict[str, Chart]:
    """The charts of a leaderboard by file stem; those that there are no values for are left out.

    Parameters
    ----------
    scores : Scores
    parts : mapping of str to Part
        the perturbations, with their titles
    title : str
        of all charts
    """
    titles = titles_of(scores, parts)
    found = {"curves": curves(scores, parts, titles, title), "heat_map": heat_map(scores, titles, title)}
    if not scores.board["mce"].isna().all():
        found["ranks"] = ranks(scores, title)
        if not scores.board["rand_original"].isna().all():
            found["scatter"] = scatter(scores, title)
    return found


def titles_of(scores: Scores, parts: Mapping[str, Part]) -> dict[str, str]:
    """The titles of the perturbations that were run, by their names."""
    return {name: parts[name].title if name in parts else name.replace("_", " ").capitalize() for name in scores.parts}


def heat_map(scores: Scores, titles: Mapping[str, str], title: str) -> Chart:
    """Mean Change Percentage of every method under every perturbation; controls below the others."""
    methods = list(scores.board["segmenter"])
    parts = scores.parts
    values = tuple(tuple(_number(scores.mean_change.loc[method, part]) for method in methods) for part in parts)
    marked = tuple(
        (i, j) for i, part in enumerate(parts) for j, method in enumerate(methods) if scores.failures.loc[method, part]
    )
    matrix = Matrix(
        rows=tuple(titles[part] for part in parts),
        columns=tuple(map(names_in_charts(scores.cards).__getitem__, methods)),
        values=values,
        marked=marked,
        first_apart=len(scores.counting),
        label=CHANGE,
    )
    failed = "; corner: some trials failed, and count 200" if marked else ""
    missing = "; grey: not run" if any(value is None for row in values for value in row) else ""
    return Chart(title, (matrix,), subtitle=f"mean Change Percentage{_controls(scores)}{failed}{missing}")


def scatter(scores: Scores, title: str) -> Chart:
    """Accuracy against robustness, with the Pareto front."""
    board = scores.board[scores.board["mce"].notna() & scores.board["rand_original"].notna()]
    board = board[[scores.is_complete[name] for name in board["segmenter"]]]
    kinds = {
        "finds the number of segments": (board["k"] == "finds") & (board["baseline"] == ""),
        "told the number of segments": (board["k"] == "told") & (board["baseline"] == ""),
        "baseline": board["baseline"] == "yes",
    }
    roles = ("method", "told", "baseline")
    named = names_in_charts(scores.cards, mark=False)
    points = tuple(
        Points(
            label=label,
            names=tuple(named[name] for name in board.loc[chosen, "segmenter"]),
            x=tuple(board.loc[chosen, "rand_original"].astype(float)),
            y=tuple(board.loc[chosen, "mce"].astype(float)),
            role=role,
        )
        for (label, chosen), role in zip(kinds.items(), roles, strict=True)
        if chosen.any()
    )
    on_front = board[pareto_front(board["rand_original"], board["mce"])].sort_values(["rand_original", "mce"])
    panel = Scatter(
        Axis("Rand Index error on the unperturbed meshes"),
        Axis("mean corruption error"),
        points,
        tuple(zip(on_front["rand_original"].astype(float), on_front["mce"].astype(float), strict=True)),
    )
    return Chart(title, (panel,), subtitle=f"{LOWER_LEFT}; line: Pareto front")


def ranks(scores: Scores, title: str) -> Chart:
    """Mean corruption error, and Rand Index error on the variants, with their intervals; baselines are left out."""
    board = scores.board[scores.board["mce"].notna()]
    board = board[board["baseline"] == ""] if (board["baseline"] == "").any() else board
    named = names_in_charts(scores.cards)
    names = tuple(_ranked(rank, named[name]) for rank, name in zip(board["rank"], board["segmenter"], strict=True))
    panels = [_dots("mean corruption error", names, board["mce"], board["mce_low"], board["mce_high"])]
    if not board["rand_perturbed"].isna().all():
        bounds = [scores.accuracy_intervals.get(name, (math.nan, math.nan)) for name in board["segmenter"]]
        low, high = zip(*bounds, strict=True)
        panels.append(_dots("Rand Index error on the variants", names, board["rand_perturbed"], low, high))
    subtitle = "rank: methods that cannot be told apart share one" if scores.has_intervals else ""
    intervals = "95 % intervals over models; " if scores.has_intervals else ""
    return Chart(title, tuple(panels), subtitle=f"{intervals}{subtitle}; lower is better".removeprefix("; "))


def curves(scores: Scores, parts: Mapping[str, Part], titles: Mapping[str, str], title: str) -> Chart:
    """Mean Change Percentage by strength, in the order of the study: a panel per perturbation, a line per method."""
    means = scores.change.T.groupby(level=[0, 1], sort=False).mean().T
    order = list(scores.board["segmenter"])
    named = names_in_charts(scores.cards)
    panels = []
    for i, part in enumerate(scores.parts):
        of_part = means[part]
        levels = (
            [float(level) for level in (parts[part].levels or ()) if float(level) in of_part] if part in parts else []
        )
        of_part = of_part[[*levels, *(level for level in sorted(of_part) if level not in levels)]]
        strengths = tuple(float(n + 1) for n in range(len(of_part.columns)))
        panels.append(
            Panel(
                Axis("strength" if i >= len(scores.parts) - PANELS_PER_ROW else "", ticks=strengths),
                Axis("CP (%)" if i % PANELS_PER_ROW == 0 else "", from_zero=True),
                title=titles[part],
                series=tuple(
                    Series(
                        named[method], strengths, tuple(map(_number, of_part.loc[method])),
                        group=scores.methods.index(method),
                    )
                    for method in order
                ),
            )
        )  # fmt: skip
    subtitle = f"mean Change Percentage (CP) by strength; each panel has a scale of its own{_controls(scores)}"
    return Chart(title, tuple(panels), per_row=PANELS_PER_ROW, subtitle=subtitle)


def _dots(
    label: str, names: tuple[str, ...], values: Iterable[float], low: Iterable[float], high: Iterable[float]
) -> Panel:
    dots = Dots(
        "mean, 95 % interval", names, tuple(map(_number, values)), tuple(map(_number, low)), tuple(map(_number, high))
    )
    reached = [value for value in (*dots.values, *dots.low, *dots.high) if value is not None]
    if min(reached) > 0 and max(reached) / min(reached) >= WIDE_RANGE:
        axis = Axis(label, ticks=round_values(reached), logarithmic=True)
    else:
        axis = Axis(label, from_zero=True)
    return Panel(axis, Axis(categories=names), dots=(dots,))


def _ranked(rank: object, label: str) -> str:
    """A method with its rank before it."""
    return f"{label}  {MISSING if is_missing(rank) else rank}"


def _controls(scores: Scores) -> str:
    return "; controls come last" if scores.controls else ""


def _number(value: float) -> Number:
    return None if math.isnan(value) else float(value)
