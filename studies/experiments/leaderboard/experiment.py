"""The experiment behind the leaderboard: its options, its trials, and what its results folder has."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, ClassVar

import perturb
from studies.columns import Column, Table
from studies.datasets import Dataset, Model
from studies.experiments.change import Change, ChangeTrial, Part, Viewer, checked_viewer
from studies.experiments.experiment import Experiment, require_whole_number
from studies.experiments.leaderboard import tables
from studies.experiments.leaderboard.findings import sentences
from studies.experiments.leaderboard.scores import Options, Scores
from studies.experiments.leaderboard.variants import MADE
from studies.planning.errors import StudyError
from studies.planning.fingerprint import digest
from studies.planning.trial import Trial
from studies.reporting.text import count_of

if TYPE_CHECKING:
    import pandas as pd
    import trimesh

    from studies.experiments.experiment import Labels
    from studies.figures.charts import Chart
    from studies.figures.variant_scenes import VariantScenes
    from studies.segmenters import Segmenter

ORIGINAL = "original"  # the part with the unperturbed mesh

CONTROLS = ("rotation", "translation", "renumbering", "scaling", "flipped", "duplicates")

_UNPERTURBED = {
    "perturbation": {"_target_": "perturb.Translation"},
    "levels": [0.0],
    "title": "Original",
    "axis": "distance",
}

IDENTITY = (
    Column(name="target", dtype="string", help="Dotted name of the segmentation method."),
    Column(name="version", dtype="string", help="Version of the method, or a digest of its code."),
    Column(name="draw", dtype="string", help="Digest of what determines the variant, whatever method segments it."),
)
"""Columns of the rows that tell methods and variants apart."""


@dataclass(frozen=True, kw_only=True)
class BoardTrial(ChangeTrial):
    """A trial of a study of change, whose variant is made once per process for all methods."""

    @classmethod
    def of(cls, trial: ChangeTrial) -> BoardTrial:
        """The same trial, as one of a leaderboard."""
        return cls(**{each.name: getattr(trial, each.name) for each in dataclasses.fields(trial)})

    def perturbed(self, original: trimesh.Trimesh) -> tuple[perturb.Perturbed, float]:
        """The variant, and the seconds that perturbing took when it was made."""
        return MADE.get(self.draw, lambda: super(BoardTrial, self).perturbed(original))

    def known_values(self) -> dict[str, Any]:
        """What tells the method and the variant apart."""
        target = str(json.loads(self.segmenter.recipe)["_target_"])
        return {"target": target, "version": str(self.segmenter.version), "draw": self.draw}


class _Chosen(Dataset):
    """Some of the models of a dataset."""

    def __init__(self, name: str, models: Sequence[Model]) -> None:
        self.name = name
        self._models = list(models)

    def models(self) -> list[Model]:
        """The models."""
        return list(self._models)


@dataclass(frozen=True, kw_only=True)
class Leaderboard(Experiment):
    """All methods under all perturbations at the same draws.

    The trials are those of the studies of the single perturbations, whose rows are reused; in addition, each method
    segments the unperturbed mesh. A results folder keeps what was run with other methods, perturbations or models, and
    the tables are about all of it.

    Parameters
    ----------
    parts : mapping of str to mapping
        the perturbations with their strengths, by name; see `studies.experiments.change.Part`
    perturbations : sequence of str, optional
        names of the parts to run; all by default
    controls : sequence of str
        the parts that a method which measures along the surface cannot feel: reported on their own
    relative_to : str
        the method whose corruption errors are 1, by its name in the rows
    paired_with : str, optional
        a method, by its name in the rows, from whose mean corruption error the board has the differences of all others
    models_per_category : int, optional
        how many models of each category are run; None for all. Which ones depends on their names alone, and fewer are a
        part of more.
    repeats : int
        trials of each model at each strength, each with its own seed
    page : mapping, optional
        ``worst``: of how many variants, those that each method changed most, the viewer shows that method beside the
        one of ``relative_to``; ``models`` is 0 for a page without a viewer. See `studies.experiments.change.Viewer`
    """

    parts: Mapping[str, Mapping[str, Any]] | None = None
    perturbations: Sequence[str] | None = None
    controls: Sequence[str] = CONTROLS
    relative_to: str = "HeatWalk"
    paired_with: str | None = None
    models_per_category: int | None = 2
    repeats: int = 1
    page: Mapping[str, Any] | Viewer | None = field(default_factory=lambda: Viewer(worst=1))

    has_scenes: ClassVar[bool] = True
    columns: ClassVar[tuple[Column, ...]] = (*Change.columns, *IDENTITY)
    notes: ClassVar[str] = tables.NOTES
    gathers: ClassVar[bool] = True
    selecting: ClassVar[tuple[str, ...]] = ("segmenters", "segmenter", "perturbations", "models_per_category")
    presenting: ClassVar[tuple[str, ...]] = ("controls", "relative_to", "paired_with")
    picture: ClassVar[str] = "scatter"

    def __post_init__(self) -> None:
        if self.models_per_category is not None:
            require_whole_number("models_per_category", self.models_per_category)
        known = [*(self.parts or {})]
        for option in ("perturbations", "controls"):
            names = getattr(self, option)
            if names is not None and (isinstance(names, str) or not isinstance(names, Sequence)):
                raise StudyError(f"{option} is {names!r}: it must be a list, as in '{option}=[rotation,scaling]'")
            unknown = [name for name in names or () if name not in known]
            if unknown and known:
                raise StudyError(f"{option} contains {unknown[0]!r}, which is none of {', '.join(known)}")
        if self.perturbations is not None and not self.perturbations:
            raise StudyError("perturbations is empty: give at least one, as in 'perturbations=[holes,view]'")

    def plan(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> list[Trial]:
        """Every chosen model under every method, part, strength and repeat."""
        if not self.parts:
            raise StudyError(f"the study {study} has no perturbations: parts.NAME.perturbation=…, parts.NAME.levels=…")
        chosen = self.parts if self.perturbations is None else {name: self.parts[name] for name in self.perturbations}
        change = Change(parts={ORIGINAL: _UNPERTURBED, **chosen}, repeats=self.repeats, gallery=None)
        models = _Chosen(dataset.name, self.chosen_models(dataset.models()))
        trials = change.plan(study, models, segmenters)
        # The original has nothing random.
        return [BoardTrial.of(each) for each in trials if not (each.part == ORIGINAL and each.repeat)]  # type: ignore[arg-type]

    def chosen_models(self, models: Sequence[Model]) -> list[Model]:
        """The models that are run: of each category those whose names have the lowest digests, in their order."""
        if self.models_per_category is None:
            return list(models)
        of_category: dict[str, list[Model]] = {}
        for model in models:
            of_category.setdefault(model.category, []).append(model)
        chosen = {
            model.name
            for each in of_category.values()
            for model in sorted(each, key=lambda model: digest("leaderboard", model.name))[: self.models_per_category]
        }
        return [model for model in models if model.name in chosen]

    def named_parts(self, study: str = "") -> dict[str, Part]:
        """The perturbations by name."""
        return Change(parts=self.parts, gallery=None).named_parts(study) if self.parts else {}

    @property
    def options(self) -> Options:
        """The options that the scores depend on."""
        return Options(ORIGINAL, tuple(self.controls), self.relative_to, self.paired_with, tuple(self.parts or ()))

    def scores(self, rows: pd.DataFrame) -> Scores:
        """The scores of all methods, computed once for tables and charts of the same rows."""
        if self._latest.get("rows") is not rows:
            self._latest.update(rows=rows, scores=Scores(rows, self.options))
        return self._latest["scores"]

    @cached_property
    def _latest(self) -> dict[str, Any]:
        """The rows that scores were last computed for, and the scores."""
        return {}

    def tables(self, rows: pd.DataFrame) -> list[Table]:
        """The board, corruption errors by perturbation, the controls, and what the methods are."""
        return tables.tables(self.scores(rows), {name: part.title for name, part in self.named_parts().items()})

    def charts(self, study: str, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, Chart]:
        """A heat map, accuracy against robustness, ranks, and curves."""
        from studies.figures import board

        return board.charts(self.scores(rows), self.named_parts(), title)

    def files(self, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, str]:
        """The board for LaTeX, and everything about each method as JSON."""
        from studies.experiments.leaderboard import export

        return {
            "board.tex": export.board_for_latex(tables["table"], title),
            "board.json": export.as_json(tables, rows, title),
        }

    def scenes(self, trials: Sequence[Trial], rows: pd.DataFrame, labels: Labels) -> VariantScenes | None:
        """The variants that each method changed most, segmented again, beside the method that is the reference."""
        from studies.figures.variant_scenes import VariantScenes, worst_draws

        viewer = checked_viewer(self.page)
        worst = 0 if viewer.models == 0 else viewer.worst
        titles = {name: part.title for name, part in self.named_parts().items()}
        draws = worst_draws(trials, rows, worst, self.relative_to, titles)
        return VariantScenes(draws) if draws else None

    def findings(self, rows: pd.DataFrame, argument: Mapping[str, Any] | None = None) -> str:
        """Who changes least, how the reference compares with the methods that an argument is about, who is accurate."""
        return sentences(self.scores(rows), argument)

    def extent(self, rows: pd.DataFrame) -> str:
        """Models, methods, perturbations, strengths and trials."""
        perturbed = rows[rows["part"] != ORIGINAL]
        strengths = perturbed.groupby("part")["level"].nunique()
        most = int(strengths.max()) if len(strengths) else 0
        return ", ".join(
            (
                count_of(rows["model"].nunique(), "model"),
                count_of(rows["segmenter"].nunique(), "method"),
                f"{count_of(perturbed['part'].nunique(), 'perturbation')} at {count_of(most, 'strength')}",
                count_of(len(rows), "trial"),
            )
        )
