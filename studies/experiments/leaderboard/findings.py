"""What a leaderboard amounts to, in sentences whose numbers come from its scores."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import pandas as pd

from studies.experiments.leaderboard.scores import Scores
from studies.reporting.text import count_of

if TYPE_CHECKING:
    Row = Mapping[Any, Any]


def sentences(scores: Scores, argument: Mapping[str, Any] | None = None) -> str:
    """Who changes least, how the reference compares, what that means for an argument, and who is accurate.

    Parameters
    ----------
    scores : Scores
    argument : mapping, optional
        ``claim``, what a publication argues, and ``against``, the names of the methods that it argues against

    Returns
    -------
    str
        "" if the reference was not run in full
    """
    rows = {str(row["segmenter"]): row for row in scores.board.to_dict("records")}
    reference = scores.options.relative_to
    if reference not in scores.complete:
        return ""
    ranked = [rows[name] for name in rows if name in scores.ranked]
    found = [_least(ranked), _reference(rows[reference], ranked)]
    if argument:
        against = [rows[name] for name in argument["against"] if name in scores.complete]
        found += _argument(str(argument["claim"]), rows[reference], against)
    found += [_accuracy(rows[reference], ranked), _front(scores, rows)]
    return " ".join(filter(None, found))


def _least(ranked: Sequence[Row]) -> str:
    """Who has the lowest mean corruption error."""
    first = [row for row in ranked if row["rank"] == 1]
    if not first:
        return ""
    verb = "changes" if len(first) == 1 else "change"
    return f"Of {count_of(len(ranked), 'method')}, {_and(map(_with_error, first))} {verb} least."


def _reference(reference: Row, ranked: Sequence[Row]) -> str:
    """The rank of the reference."""
    if pd.isna(reference["rank"]):
        return ""
    better = [row["method"] for row in ranked if row["rank"] < reference["rank"]]
    than = f", behind {_and(better)}" if better else ""
    return f"The {reference['method']}, whose error is 1 by definition, has rank {reference['rank']}{than}."


def _argument(claim: str, reference: Row, against: Sequence[Row]) -> Iterator[str]:
    """What the board says about an argument against some methods."""
    if not against:
        return
    worse = [row for row in against if row["mce_low"] > 1]
    better = [row for row in against if row["mce_high"] < 1]
    if len(worse) == len(against):
        verdict = f"the board agrees: {_and(map(_with_error, worse))} change more than the {reference['method']}"
    elif pd.isna(against[0]["mce_low"]):
        verdict = f"one model cannot tell: {_and(map(_with_error, against))}"
    else:
        others = [row for row in against if row not in worse and row not in better]
        parts = ((worse, "above 1"), (better, "below 1"), (others, "not told apart from 1"))
        verdict = "the board agrees only in part: " if worse else "the board does not show it: "
        verdict += "; ".join(f"{what}: {_and(map(_with_error, rows))}" for rows, what in parts if rows)
    yield f"The paper argues {claim}; {verdict}."


def _accuracy(reference: Row, ranked: Sequence[Row]) -> str:
    """Who has the lowest Rand Index error on the variants."""
    known = [row for row in ranked if not pd.isna(row["rand_perturbed"])]
    if not known or pd.isna(reference["rand_perturbed"]):
        return ""
    best = min(known, key=lambda row: float(row["rand_perturbed"]))
    values = f"{best['method']}, with a Rand Index error of {best['rand_perturbed']:.3f}"
    if best["method"] == reference["method"]:
        return f"Most accurate on the variants is {values}."
    return (
        f"Most accurate on the variants is {values}; the {reference['method']} has {reference['rand_perturbed']:.3f}."
    )


def _front(scores: Scores, rows: Mapping[str, Row]) -> str:
    """The methods on the Pareto front."""
    front = [row["method"] for row in rows.values() if row["pareto"] == "yes" and not row["baseline"]]
    return f"No method is both more robust and more accurate than {_or(front)}." if front else ""


def _with_error(row: Row) -> str:
    """A method with its mean corruption error."""
    interval: str = "" if pd.isna(row["mce_low"]) else f", {row['mce_low']:.2f} – {row['mce_high']:.2f}"
    return f"{row['method']} ({row['mce']:.2f}{interval})"


def _and(names: Any) -> str:
    return _joined(list(names), "and")


def _or(names: Any) -> str:
    return _joined(list(names), "or")


def _joined(names: Sequence[str], word: str) -> str:
    """Names as a list in a sentence."""
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} {word} {names[-1]}"
