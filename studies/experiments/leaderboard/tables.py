"""The tables of the leaderboard."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from studies.columns import Column, Table
from studies.experiments.leaderboard.cards import TOLD_MARK, Card
from studies.experiments.leaderboard.scores import MEMORY, Scores
from studies.experiments.pairing import difference_column
from studies.reporting.text import count_of

NOTES = (
    "mCE: mean corruption error. Of each perturbation the Change Percentages (CP) are added up over strengths and"
    " models, and divided by the sum of the reference; mCE is the mean over perturbations but for the controls, which a"
    " method that measures along the surface cannot feel. A trial that failed counts with the worst value: CP 200, Rand"
    " Index error 1. Intervals: paired bootstrap over models. Rank: 1 plus the number of methods that are better by a"
    " difference whose 95 % interval does not contain 0; methods that cannot be told apart share a rank. A segmentation"
    " that never changes has mCE 0 whatever it is worth: read mCE and Rand error together. A method is on the Pareto"
    f" front if none is better in both. {TOLD_MARK}: the method is told how many segments to find; compare within each"
    " kind. Baselines have no rank."
)

METHOD = Column(
    name="method", dtype="string", help=f"Segmentation method; {TOLD_MARK}: told how many segments to find."
)
RANK = Column(
    name="rank", dtype="Int64", format="d", lower_is_better=True, help="Rank by mCE; shared if not told apart."
)
_BOARD = (
    RANK,
    METHOD,
    Column(name="segmenter", dtype="string", shown=False, help="Name of the method in the rows."),
    Column(name="k", dtype="string", compact=False, help="Whether the method is told how many segments to find."),
    Column(name="baseline", dtype="string", compact=False, help="Whether it is a trivial method, which has no rank."),
    Column(
        name="mce", heading="mCE", format=".2f", lower_is_better=True, bounds=("mce_low", "mce_high"),
        help="Mean corruption error, with its 95 % interval.",
    ),
    Column(
        name="rank_of_kind", dtype="Int64", heading="rank of kind", format="d", compact=False, lower_is_better=True,
        help="Rank by mCE among the methods that are told k, or among those that are not.",
    ),
    Column(
        name="mean_cp", heading="CP %", format=".1f", unit="%", lower_is_better=True,
        help="Mean Change Percentage under the perturbations.",
    ),
    Column(
        name="control_cp", heading="CP % of controls", format=".2f", unit="%", compact=False, lower_is_better=True,
        help="Mean Change Percentage under the controls.",
    ),
    Column(
        name="rand_original", heading="Rand original", format=".3f", lower_is_better=True,
        help="Rand Index error against the ground truth on the unperturbed meshes.",
    ),
    Column(
        name="rand_perturbed", heading="Rand perturbed", format=".3f", compact=False, lower_is_better=True,
        help="Rand Index error against the ground truth on the variants.",
    ),
    Column(
        name="rand_loss", heading="Rand loss", format="z.3f", compact=False, lower_is_better=True,
        help="The Rand Index error on the variants minus that on the unperturbed meshes.",
    ),
    Column(
        name="rank_of_accuracy", dtype="Int64", heading="rank of accuracy", format="d", compact=False,
        lower_is_better=True, help="Rank by the Rand Index error on the variants; shared if not told apart.",
    ),
    Column(
        name="pareto", dtype="string", heading="Pareto front", compact=False,
        help="Whether no method has both a lower mCE and a lower Rand Index error on the unperturbed meshes.",
    ),
    Column(
        name="failed_share", heading="failed %", format=".1f", unit="%", lower_is_better=True,
        help="Trials that failed, timed out or crashed.",
    ),
    Column(
        name="missing", dtype="int64", format="d", compact=False, lower_is_better=True,
        help="Cells (model, perturbation, strength) that were not run; a method that lacks some has no rank.",
    ),
    Column(
        name="seconds", heading="s", format=".2f", unit="s", lower_is_better=True,
        help="Median seconds of a segmentation.",
    ),
    Column(
        name=MEMORY, heading="MB", format=".0f", unit="MB", lower_is_better=True, compact=False,
        help="Peak memory of a segmentation, in MB.",
    ),
    Column(name="n", dtype="int64", heading="trials", format=",d", compact=False, help="Trials that were run."),
)  # fmt: skip


@dataclass(frozen=True, kw_only=True)
class _Cell(Column):
    """A method under one perturbation: corruption error, Change Percentage, and what failed or was not run."""

    def text(self, row: Mapping[str, Any], *, compact: bool = False) -> str:
        """Such as "1.25 (3.4)", or "1.25 (3.4) 2 failed"."""
        shown = super().text(row, compact=compact)
        counts = ((row.get(f"{self.name}_{what}"), what) for what in ("failed", "missing"))
        return " ".join([shown, *(f"{count} {what}" for count, what in counts if count)])


def tables(scores: Scores, titles: Mapping[str, str]) -> list[Table]:
    """The tables of a leaderboard, its board first.

    Parameters
    ----------
    scores : Scores
    titles : mapping of str to str
        of the parts
    """
    board = Table(
        "table", scores.board, _board_columns(scores), notes=" ".join([NOTES, *remarks(scores, titles)]), value="mce"
    )
    found = [board, _by_perturbation(scores, titles)]
    if scores.controls:
        found.append(_controls(scores, titles))
    return [*found, _methods(scores)]


def _board_columns(scores: Scores) -> tuple[Column, ...]:
    """The columns of the board, with the differences after mCE if there is a method that they are from."""
    other = scores.options.paired_with
    if other is None:
        return _BOARD
    title = scores.cards[other].title if other in scores.cards else other
    difference = difference_column(title, "mCE", format="+z.2f", lower_is_better=True)
    after = next(i for i, column in enumerate(_BOARD) if column.name == "mce") + 1
    return (*_BOARD[:after], difference, *_BOARD[after:])


def remarks(scores: Scores, titles: Mapping[str, str]) -> list[str]:
    """What holds for these rows in particular, a sentence each."""
    found = []
    reference = scores.options.relative_to
    if reference in scores.methods:
        found.append(f"The reference is {scores.cards[reference].title}.")
    else:
        found.append(f"There are no corruption errors and no ranks: no trial of the reference, {reference}, is stored.")
    if not scores.has_intervals:
        found.append("With one model there are no intervals, and every difference counts.")
    if scores.undefined:
        named = ", ".join(titles.get(name, name) for name in scores.undefined)
        found.append(f"Left out of mCE, because the reference does not change at all: {named}.")
    if scores.unmade_variants:
        variants = ", ".join(
            f"{titles.get(part, part)} {level:g} ({model})" for part, level, model in scores.unmade_variants
        )
        found.append(f"The perturbation could not make these variants, which count for no method: {variants}.")
    if scores.n_left_out:
        found.append(f"{count_of(scores.n_left_out, 'trial')} that fewer than half of the methods have: not compared.")
    return found


def _by_perturbation(scores: Scores, titles: Mapping[str, str]) -> Table:
    """Corruption error and Change Percentage of every method under every perturbation that counts."""
    notes = "Corruption error, and in parentheses the mean Change Percentage in percent."
    return _matrix("by_perturbation", scores, scores.counting, titles, notes)


def _controls(scores: Scores, titles: Mapping[str, str]) -> Table:
    """Change Percentage of every method under every control."""
    notes = (
        "Mean Change Percentage in percent. The controls do not change the surface, or only how a file describes it; a "
        "method that depends on nothing else has 0."
    )
    return _matrix("controls", scores, scores.controls, titles, notes, template="{{{0}_cp:.2f}}")


def _matrix(
    name: str,
    scores: Scores,
    parts: list[str],
    titles: Mapping[str, str],
    notes: str,
    template: str = "{{{0}_ce:.2f}} ({{{0}_cp:.1f}})",
) -> Table:
    """A table with a row per method and a cell per part."""
    import pandas as pd

    order = list(scores.board["segmenter"])
    values: dict[str, Any] = {
        "segmenter": order,
        "method": [scores.cards[method].label for method in order],
    }
    with_errors = "_ce" in template
    for part in parts:
        values |= {f"{part}_ce": scores.corruption_errors.loc[order, part].to_numpy()} if with_errors else {}
        values |= {
            f"{part}_cp": scores.mean_change.loc[order, part].to_numpy(),
            f"{part}_failed": scores.failures.loc[order, part].to_numpy(),
            f"{part}_missing": scores.missing.loc[order, part].fillna(0).astype(int).to_numpy(),
        }
    cells = [
        _Cell(name=part, heading=titles.get(part, part.replace("_", " ")), template=template.format(part))
        for part in parts
    ]
    return Table(name, pd.DataFrame(values), (METHOD, *cells), notes=notes)


_METHODS = (
    METHOD,
    Column(name="segmenter", dtype="string", shown=False, help="Name of the method in the rows."),
    Column(name="source", dtype="string", help="Publication of the method."),
    Column(name="licences", dtype="string", help="Packages that the method calls, and their licences."),
    Column(
        name="k", dtype="string", help="Whether the method is told how many segments to find, or finds their number."
    ),
    Column(name="seeded", dtype="string", help="Whether it draws random numbers, seeded by the mesh."),
    Column(name="baseline", dtype="string", help="Whether it is a trivial method."),
    Column(name="version", dtype="string", help="Version of the method, or the beginning of a digest of its code."),
)


def _methods(scores: Scores) -> Table:
    """What the methods are."""
    import pandas as pd

    order = list(scores.board["segmenter"])
    return Table("methods", pd.DataFrame([_described(scores.cards[name]) for name in order]), _METHODS)


def _described(card: Card) -> dict[str, Any]:
    about = card.about
    return {
        "method": card.label,
        "segmenter": card.name,
        "source": about.source,
        "licences": ", ".join(f"{package} ({licence})" for package, licence in about.licences.items()),
        "k": "told" if card.told else "finds",
        "seeded": "yes" if about.seeded else "",
        "baseline": "yes" if card.baseline else "",
        "version": card.version[:10],
    }
