"""What the page of a leaderboard has: a heat map whose cells can be opened, and a card for each method."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, ClassVar

from studies.columns import MISSING, is_missing
from studies.figures.board import titles_of
from studies.reporting.html.page import Block, Cell, ChartBlock, TableBlock
from studies.reporting.html.svg import drawings
from studies.reporting.text import count_of

if TYPE_CHECKING:
    import pandas as pd

    from studies.columns import Table
    from studies.experiments.change import Part
    from studies.experiments.leaderboard import Leaderboard
    from studies.experiments.leaderboard.cards import Card
    from studies.experiments.leaderboard.scores import Scores
    from studies.figures.charts import Chart
    from studies.reporting.results import Results

WORST_SHOWN = 8  # trials of a method under a perturbation
ERRORS_SHOWN = 3
MOST_WIDE = 2  # panels of a chart that have the width of the page
VALUE = "change_percentage"
BELOW = ("scatter", "ranks", "curves")  # the charts below the heat map


@dataclass(frozen=True)
class HeatMapBlock(ChartBlock):
    """A heat map whose cells can be opened.

    Parameters
    ----------
    details : mapping
        what a cell shows, by its row and column: "3 0"
    """

    details: Mapping[str, Any] = field(default_factory=dict)
    kind: ClassVar[str] = "heat_map"
    assets: ClassVar[str] = "board"


@dataclass(frozen=True)
class MethodCard:
    """A method.

    Parameters
    ----------
    anchor, title : str
    badges : sequence of str
        what kind of method it is, in a few words each
    facts : sequence of (str, str)
    bibtex : str
        "" if there is none
    """

    anchor: str
    title: str
    badges: Sequence[str]
    facts: Sequence[tuple[str, str]]
    bibtex: str


@dataclass(frozen=True)
class MethodsBlock(Block):
    """A card for each method."""

    cards: Sequence[MethodCard] = ()
    kind: ClassVar[str] = "methods"
    assets: ClassVar[str] = "board"


def board_table(results: Results) -> TableBlock:
    """The board, whose methods lead to their cards."""
    table = results.main_table
    block = TableBlock.of(table, "Board")
    column = [heading.name for heading in table.visible()].index("method")
    rows = [
        [
            *row[:column],
            Cell(row[column].text, row[column].order, f"#{_anchor(record['segmenter'])}"),
            *row[column + 1 :],
        ]
        for row, record in zip(block.rows, table.records(), strict=True)
    ]
    return TableBlock(block.heading, block.headings, rows, block.notes, block.explained)


def board_blocks(results: Results, charts: Mapping[str, Chart], numbers: Mapping[str, int]) -> list[Block]:
    """The charts of a leaderboard, with a heat map whose cells show the worst cases.

    Parameters
    ----------
    results : Results
        of a `Leaderboard`
    charts : mapping of str to Chart
        those of its experiment
    numbers : mapping of str to int
        trial_id -> the scene of the page's viewer that shows it
    """
    experiment: Leaderboard = results.experiment  # type: ignore[assignment]
    scores = experiment.scores(results.rows)
    blocks: list[Block] = []
    if "heat_map" in charts:
        chart = charts["heat_map"]
        notes = f"{chart.subtitle}. A cell opens the worst cases of a method under a perturbation."
        details = cell_details(scores, experiment.named_parts(), numbers)
        blocks.append(HeatMapBlock("Heat map", drawings(chart), notes[:1].upper() + notes[1:], details))
    return [*blocks, *(_chart(charts[name], name) for name in BELOW if name in charts)]


def _chart(chart: Chart, name: str) -> ChartBlock:
    shown = drawings(chart)
    if len(shown) <= MOST_WIDE:
        shown = [replace(each, wide=True) for each in shown]
    return ChartBlock(name.capitalize(), shown, chart.subtitle)


def cell_details(scores: Scores, parts: Mapping[str, Part], numbers: Mapping[str, int]) -> dict[str, dict[str, Any]]:
    """What each cell of the heat map shows when it is opened, by its row and column.

    Parameters
    ----------
    scores : Scores
    parts : mapping of str to Part
        the perturbations, with their titles and strengths
    numbers : mapping of str to int
        trial_id -> the scene of the page's viewer that shows it
    """
    titles, rows = titles_of(scores, parts), scores.compared
    good = rows[(rows["status"] == "ok") & rows[VALUE].notna()]
    of_all = dict(list(rows.groupby(["part", "segmenter"], sort=False)))
    means = good.groupby(["part", "segmenter", "level"])[VALUE].mean().reset_index()
    curves: dict[Any, dict[float, float]] = {}
    for mean in means.to_dict("records"):
        curves.setdefault((mean["part"], mean["segmenter"]), {})[float(mean["level"])] = round(float(mean[VALUE]), 2)
    changed = good[good[VALUE] > 0].sort_values(VALUE, ascending=False, kind="stable")
    worst = changed.groupby(["part", "segmenter"], sort=False).head(WORST_SHOWN)
    worst_of = dict(list(worst.groupby(["part", "segmenter"], sort=False)))
    found = {}
    for i, part in enumerate(scores.parts):
        levels = [float(level) for level in (parts[part].levels or ())] if part in parts else []
        title = f"under {titles[part][:1].lower()}{titles[part][1:]}"
        for j, method in enumerate(scores.board["segmenter"]):
            found[f"{i} {j}"] = {
                "title": f"{scores.cards[method].label} {title}",
                "method": method,
                "curve": _ordered(curves.get((part, method), {}), levels),
                "reference": _ordered(curves.get((part, scores.options.relative_to), {}), levels),
                "worst": [list(_trial(row, numbers)) for row in _records(worst_of.get((part, method)))],
                **_facts(scores, part, method, of_all.get((part, method))),
            }
    return found


def _ordered(means: Mapping[float, float], levels: Sequence[float]) -> list[list[float]]:
    """Strengths with their means, in the order of the study."""
    return [[level, means[level]] for level in dict.fromkeys((*levels, *sorted(means))) if level in means]


def _records(rows: pd.DataFrame | None) -> list[dict[Any, Any]]:
    return [] if rows is None else rows.to_dict("records")


def _facts(scores: Scores, part: str, method: str, rows: pd.DataFrame | None) -> dict[str, list[str]]:
    """The scores of a method under a perturbation, and why trials failed."""
    if rows is None:
        return {"facts": ["not run"], "failures": []}
    error: Any = scores.corruption_errors.loc[method, part]
    change: Any = scores.mean_change.loc[method, part]
    failed = rows[rows["status"] != "ok"]
    facts = [
        f"CP {MISSING if is_missing(change) else f'{change:.1f} %'}",
        f"corruption error {error:.2f}" if part in scores.counting and not is_missing(error) else "",
        f"{count_of(len(rows), 'trial')}{f', {len(failed):,} of which failed' if len(failed) else ''}",
    ]
    reasons = failed["error"].dropna().astype(str).value_counts().head(ERRORS_SHOWN)
    return {
        "facts": [fact for fact in facts if fact],
        "failures": [f"{n:,} × {reason}" for reason, n in reasons.items()],
    }


def _trial(row: Mapping[Any, Any], numbers: Mapping[str, int]) -> Iterator[Any]:
    """Model, Change Percentage, strength and repeat of a trial, and the scene that shows it."""
    yield str(row["model"])
    yield f"{row[VALUE]:.1f}"
    unit = "" if is_missing(row.get("unit")) else f" {str(row['unit']).replace('_', ' ')}"
    yield f"{row['level']:g}{unit}"
    yield int(row["repeat"]) + 1
    yield numbers.get(str(row.get("trial_id")), -1)


def methods_block(results: Results) -> MethodsBlock:
    """A card for each method, in the order of the board."""
    experiment: Leaderboard = results.experiment  # type: ignore[assignment]
    cards = experiment.scores(results.rows).cards
    table = results.main_table
    return MethodsBlock("Methods", [_card(cards[row["segmenter"]], row, table) for row in table.records()])


def _card(card: Card, row: Mapping[str, Any], table: Table) -> MethodCard:
    """What a method is, and its scores as the board has them."""
    about = card.about
    licences = ", ".join(f"{package} ({licence})" for package, licence in about.licences.items())
    badges = ["told k" if card.told else "finds k"]
    badges += ["baseline"] if card.baseline else []
    badges += ["Pareto front"] if row.get("pareto") == "yes" else []
    badges += ["seeded"] if about.seeded else []
    scores = {column.name: column.text(row) for column in table.visible()}
    facts = {
        "source": about.source,
        "licences": licences,
        "needs": f"heatwalk[{about.extra}]" if about.extra else "",
        "rank": scores.get("rank", ""),
        "mCE": scores.get("mce", ""),
        "Rand error": scores.get("rand_original", ""),
        "failed": _with_unit(scores, "failed_share", "%"),
        "seconds": _with_unit(scores, "seconds", "s"),
        "memory": _with_unit(scores, "peak_memory", "MB"),
        "options": ", ".join(f"{name}={value}" for name, value in card.options.items()),
        "class": card.target,
        "version": card.version[:10],
    }
    shown = [(name, value) for name, value in facts.items() if value and value != MISSING]
    return MethodCard(_anchor(card.name), card.title, badges, shown, about.bibtex)


def _with_unit(scores: Mapping[str, str], name: str, unit: str) -> str:
    text = scores.get(name, "")
    return f"{text} {unit}" if text and text != MISSING else ""


def _anchor(method: str) -> str:
    """The anchor of a method's card.

    Examples
    --------
    >>> _anchor("HeatWalk (time=2)")
    'method-HeatWalk-time-2'
    """
    return f"method-{re.sub(r'[^A-Za-z0-9]+', '-', method).strip('-')}"
