"""What happens inside the Heat Walk, model by model: its steps and its dissipators."""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

from studies.columns import Column, Table
from studies.experiments.change import Viewer, checked_viewer
from studies.experiments.experiment import (
    FAILURES,
    MODELS,
    PUBLISHED,
    SEGMENTER,
    Experiment,
    by_segmenter,
    check_plates,
    frame_of,
)
from studies.planning.errors import StudyError
from studies.planning.fingerprint import digest, fingerprint
from studies.planning.trial import Trial
from studies.segmenters import Segmenter
from studies.statistics.bootstrap import interval_of_mean

if TYPE_CHECKING:
    import pandas as pd

    from heatwalk import LoadedMesh
    from studies.datasets import Dataset
    from studies.experiments.experiment import Labels
    from studies.figures.method_scenes import AnatomyScenes
    from studies.figures.pictures import Picture

# The steps of the walk after which the share of settled points is kept.
STEPS = (1, 2, 3)
EACH_CATEGORY = "each_category"
MOST_OF_A_CLASS = 10
MOST_IN_A_SHOWCASE = 20


@dataclass(frozen=True, kw_only=True)
class AnatomyTrial(Trial):
    """One model and its walk.

    Parameters
    ----------
    segmenter : Segmenter
        of a Heat Walk
    """

    segmenter: Segmenter

    def prepare(self) -> LoadedMesh:
        """The mesh."""
        return self.model.load()

    def measure(self, prepared: LoadedMesh) -> dict[str, Any]:
        """Segment, and count how many points have settled after each step."""
        start = time.perf_counter()
        segmentation = self.segmenter.method.segmentation(prepared.vertices, prepared.faces)
        seconds = time.perf_counter() - start
        settled = segmentation.walk.settled_shares()
        return {
            "n_vertices": len(prepared.vertices),
            "n_faces": len(prepared.faces),
            "n_segments": segmentation.n_segments,
            "n_steps": len(settled) - 1,
            **{f"settled_{step}": float(settled[min(step, len(settled) - 1)]) for step in STEPS},
            "dissipating": float(segmentation.dissipates.mean()),
            "seconds_segment": seconds,
        }


@dataclass(frozen=True, kw_only=True)
class Anatomy(Experiment):
    """The walk of every model, and plates that show it.

    Parameters
    ----------
    plates : mapping of str to mapping
        by file stem: ``shows``, one of ``studies.figures.method_figures.PLATES``, and ``models``: their names, of which
        those in the study are shown; or "each_category" for the first model of each category. If the study has none of
        them, "showcase" shows the first of each category, "class" models of the largest category, and the others the
        study's first model
    page : mapping, optional
        ``models`` is 0 for a page without a viewer, see `studies.experiments.change.Viewer`
    """

    plates: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    page: Mapping[str, Any] | Viewer | None = field(default_factory=Viewer)

    has_scenes: ClassVar[bool] = True

    columns: ClassVar[tuple[Column, ...]] = (
        Column(name="n_steps", dtype="Int64", help="Steps until every point has settled."),
        *(
            Column(name=f"settled_{step}", help=f"Share of points at their final exemplar after step {step}.")
            for step in STEPS
        ),
        Column(name="dissipating", help="Share of points in the dissipator region."),
    )
    notes: ClassVar[str] = (
        "Settled: the share of points that have reached their final exemplar after so many steps of the walk, in "
        "percent. Dissipating: the share of points in the dissipator region. Intervals: bootstrap over models."
    )

    def __post_init__(self) -> None:
        from studies.figures.method_figures import PLATES

        check_plates(self.plates)
        for stem, plate in self.plates.items():
            if plate.get("shows") not in PLATES:
                raise StudyError(f"plates.{stem}.shows is {plate.get('shows')!r}: choose one of {', '.join(PLATES)}")

    def plan(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> list[Trial]:
        """One trial per model and segmenter."""
        for segmenter in segmenters:
            if not hasattr(segmenter.method, "segmentation"):
                raise StudyError(f"the study {study} looks inside the Heat Walk, which {segmenter.name} is not")
        return [
            AnatomyTrial(
                study=study,
                dataset=dataset.name,
                part=study,
                model=model,
                mesh_digest=identity[1],
                segmenter=segmenter,
                segmenter_name=segmenter.name,
                group_key=digest(identity),
                trial_id=digest("anatomy", identity, *segmenter.fingerprint)[:24],
            )
            for model in dataset.models()
            for identity in [fingerprint(model)]
            for segmenter in segmenters
        ]

    def tables(self, rows: pd.DataFrame) -> list[Table]:
        """One row per quantity: mean, interval and range over models."""
        keys = by_segmenter(rows)
        groups = rows.groupby(keys, sort=False) if keys else [((), rows)]
        records = [dict(zip(keys, key, strict=True)) | record for key, group in groups for record in _quantities(group)]
        columns = (
            SEGMENTER,
            Column(name="what", dtype="string", heading="mean over models", help="Quantity."),
            Column(name="mean", heading="value", format=".1f", help="Mean over models."),
            Column(name="ci_low", shown=False, help="Lower end of the 95 % interval of the mean."),
            Column(name="ci_high", shown=False, help="Upper end of the 95 % interval of the mean."),
            Column(
                name="interval",
                heading="95 % interval",
                template="{ci_low:.1f} – {ci_high:.1f}",
                help="95 % bootstrap interval of the mean over models.",
            ),
            Column(name="lowest", format=".1f", compact=False, help="Smallest value of a model."),
            Column(name="highest", format=".1f", compact=False, help="Largest value of a model."),
            PUBLISHED,
            MODELS,
            FAILURES,
        )
        return [Table("table", frame_of(records), columns, notes=self.notes, value="mean", published_before="n")]

    def pictures(
        self, study: str, trials: Sequence[Trial], rows: pd.DataFrame, title: str, labels: Labels
    ) -> Iterable[Picture]:
        """The plates."""
        from studies.figures.method_figures import AnatomyPlate

        for stem, shows, shown in self._shown(trials, rows):
            yield AnatomyPlate(stem, shows, shown, title)

    def scenes(self, trials: Sequence[Trial], rows: pd.DataFrame, labels: Labels) -> AnatomyScenes | None:
        """What the plates show."""
        from studies.figures.method_scenes import AnatomyScenes

        shown = list(self._shown(trials, rows)) if checked_viewer(self.page).models != 0 else []
        return AnatomyScenes(shown) if shown else None

    def _shown(self, trials: Sequence[Trial], rows: pd.DataFrame) -> Iterator[tuple[str, str, list[Trial]]]:
        """The plates: name, what each shows, and the trials of the models that are shown."""
        good = set(rows.loc[rows["status"] == "ok", "trial_id"])
        by_name = {trial.model.name: trial for trial in reversed(trials) if trial.trial_id in good}
        by_name = dict(reversed(by_name.items()))
        drawn: set[tuple[str, ...]] = set()
        for stem, plate in self.plates.items():
            names = _shown_models(plate["shows"], plate.get("models"), by_name)
            chosen = {str(name) for name in plate.get("models") or ()} & set(names)
            # Of a few models of one category, a showcase and its class would be the same picture.
            if names and (chosen or plate["shows"] != "class" or tuple(names) not in drawn):
                drawn.add(tuple(names))
                yield stem, plate["shows"], [by_name[name] for name in names]


def _quantities(rows: pd.DataFrame) -> list[dict[str, Any]]:
    """Mean, interval and range of each quantity over models."""
    import pandas as pd

    good = rows[rows["status"] == "ok"]
    measured = {
        "steps of the walk": good["n_steps"].astype(float),
        **{f"settled after step {step}, %": 100 * good[f"settled_{step}"] for step in STEPS},
        "dissipating, %": 100 * good["dissipating"],
        "segments": good["n_segments"].astype(float),
    }
    records = []
    for what, values in measured.items():
        low, high = interval_of_mean(pd.DataFrame({"model": good["model"], "value": values}), "value")
        records.append(
            {
                "what": what,
                "mean": values.mean(),
                "ci_low": low,
                "ci_high": high,
                "lowest": values.min(),
                "highest": values.max(),
                "n": len(good),
                "failures": len(rows) - len(good),
            }
        )
    return records


def _shown_models(shows: str, wanted: str | Sequence[str | int] | None, by_name: Mapping[str, Trial]) -> list[str]:
    """The models of a plate: those wanted that the study has, else some that suit what it shows."""
    from studies.figures.method_figures import OF_MODELS

    named = [str(name) for name in wanted or () if str(name) in by_name] if wanted != EACH_CATEGORY else []
    if not by_name or (named and not (shows in OF_MODELS and len(named) == 1)):
        return named
    by_category: dict[str, list[str]] = {}
    for name, trial in by_name.items():
        by_category.setdefault(trial.model.category, []).append(name)
    if shows == "class":
        largest = max(by_category.values(), key=len)
        return largest[:MOST_OF_A_CLASS] if len(largest) > 1 else named
    if shows == "showcase" or wanted == EACH_CATEGORY:
        if len(by_category) > 1:
            return [names[0] for names in by_category.values()]
        return list(by_name)[:MOST_IN_A_SHOWCASE]
    return list(by_name)[:1]
