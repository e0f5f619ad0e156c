"""The board for other programs: LaTeX, and JSON with everything about each method."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from studies.columns import Table, is_missing
from studies.experiments.leaderboard.cards import Card, cards_of
from studies.reporting.latex import latex

if TYPE_CHECKING:
    import pandas as pd

_YES_OR_NO = ("baseline", "pareto")
# The columns that fit on a page.
_IN_LATEX = (
    "rank",
    "method",
    "mce",
    "mean_cp",
    "control_cp",
    "rand_original",
    "rand_perturbed",
    "failed_share",
    "seconds",
)
_NAMES = ("method", "segmenter")


def board_for_latex(table: Table, title: str) -> str:
    """The columns of the board that fit on a page, for LaTeX."""
    columns = [dataclasses.replace(each, compact=True) for each in table.columns if each.name in _IN_LATEX]
    return latex(table.replace(columns=columns), title)


def as_json(tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> str:
    """One entry per method, in the order of the board: who, what, licences, citation, version, and all scores."""
    cards = cards_of(rows)
    matrices = [tables[name] for name in ("by_perturbation", "controls") if name in tables]
    under: dict[str, dict[str, Any]] = {}
    for matrix in matrices:
        for row in matrix.records():
            under.setdefault(row["segmenter"], {}).update(row)
    parts = [column.name for matrix in matrices for column in matrix.columns if column.name != "method"]
    document = {
        "title": title,
        "models": sorted(map(str, rows["model"].unique())),
        "methods": [
            _described(cards[row["segmenter"]])
            | {"scores": _scores(row)}
            | {"perturbations": {part: _under(under[row["segmenter"]], part) for part in parts}}
            for row in tables["table"].records()
        ],
    }
    return json.dumps(document, indent=2, ensure_ascii=False) + "\n"


def _described(card: Card) -> dict[str, Any]:
    about = card.about
    return {
        "name": card.name,
        "title": card.title,
        "source": about.source,
        "bibtex": about.bibtex,
        "licences": dict(about.licences),
        "extra": about.extra,
        "told_k": card.told,
        "seeded": about.seeded,
        "baseline": card.baseline,
        "target": card.target,
        "version": card.version,
        "options": card.options,
    }


def _scores(row: Mapping[str, Any]) -> dict[str, Any]:
    return {
        name: value == "yes" if name in _YES_OR_NO else _plain(value)
        for name, value in row.items()
        if name not in (*_NAMES, "k", "baseline")
    }


def _under(row: Mapping[str, Any], part: str) -> dict[str, Any]:
    """The scores of a method under one perturbation."""
    names = {"ce": "corruption_error", "cp": "change_percentage", "failed": "failed", "missing": "missing"}
    return {name: _plain(row[f"{part}_{key}"]) for key, name in names.items() if f"{part}_{key}" in row}


def _plain(value: Any) -> Any:
    """A value as JSON has it: None where it is missing."""
    if is_missing(value) or (isinstance(value, float) and not math.isfinite(value)):
        return None
    return value.item() if hasattr(value, "item") else value
