"""The board for other programs: LaTeX, and JSON with everything about each method."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from studies.columns import Table, is_missing
from studies.experiments.leaderboard.cards import Card, cards_of

if TYPE_CHECKING:
    import pandas as pd

_SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "–": "--",
}  # fmt: skip
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
    return latex(table.replace(columns=[column for column in table.columns if column.name in _IN_LATEX]), title)


def latex(table: Table, title: str) -> str:
    r"""A table for LaTeX with the package booktabs: words to the left, numbers to the right.

    Parameters
    ----------
    table : Table
    title : str
        the caption

    Examples
    --------
    >>> import pandas as pd
    >>> from studies.columns import Column
    >>> share = Column(name="share", heading="failed %", format=".1f")
    >>> text = latex(Table("table", pd.DataFrame({"share": [0.5]}), (share,)), "50 % of all")
    >>> print(*text.splitlines()[2:7], sep="\n")
    \caption{50 \% of all}
    \begin{tabular}{r}
    \toprule
    failed \% \\
    \midrule
    """
    columns = table.visible()
    alignment = "".join("l" if column.dtype == "string" else "r" for column in columns)
    lines = [
        r"% needs \usepackage{booktabs}",
        r"\begin{table}",
        rf"\caption{{{escaped(title)}}}",
        rf"\begin{{tabular}}{{{alignment}}}",
        r"\toprule",
        _line([column.title for column in columns]),
        r"\midrule",
        *(_line(cells) for cells in table.cells()),
        r"\bottomrule",
        r"\end{tabular}",
        r"\end{table}",
    ]
    return "\n".join(lines) + "\n"


def escaped(text: str) -> str:
    r"""Text with the characters that are special in LaTeX escaped.

    Examples
    --------
    >>> print(escaped("95 % of my_method"))
    95 \% of my\_method
    """
    return "".join(_SPECIAL.get(letter, letter) for letter in text)


def _line(cells: list[str]) -> str:
    return " & ".join(map(escaped, cells)) + r" \\"


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
