"""How far a segmentation is from those made by people."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from heatwalk import LoadedMesh, faces_from_vertices
from studies.columns import Column, Table
from studies.datasets import Model
from studies.experiments.experiment import FAILURES, MODELS, Experiment, frame_of
from studies.metrics import psb
from studies.planning.errors import StudyError
from studies.planning.fingerprint import digest, fingerprint
from studies.planning.trial import Trial
from studies.reporting.text import count_of
from studies.segmenters import Segmenter
from studies.statistics.bootstrap import interval_of_mean

if TYPE_CHECKING:
    import pandas as pd

    from studies.datasets import Dataset
    from studies.figures.charts import Chart

PEOPLE = "Humans"
COMPUTED = "computed"  # the source of what was not published elsewhere


@dataclass(frozen=True, kw_only=True)
class BenchmarkTrial(Trial):
    """The segmentation of one model against those of every person, or each person's against the others'.

    Parameters
    ----------
    segmenter : Segmenter or None
        None for the people
    ground_truth : bool
        whether the model has one exact segmentation, which is compared with, instead of those by people
    """

    segmenter: Segmenter | None
    ground_truth: bool = False

    def prepare(self) -> tuple[LoadedMesh, list[np.ndarray]]:
        """The mesh and people's segmentations of its faces."""
        people = self.model.human_segmentations()
        if len(people) < 2 and not self.ground_truth:
            raise ValueError(
                f"model {self.model.name} has {count_of(len(people), 'segmentation')} by people; two are needed"
            )
        return self.model.load(), people

    def measure(self, prepared: tuple[LoadedMesh, list[np.ndarray]]) -> dict[str, Any]:
        """The mean of every metric over people."""
        mesh, people = prepared
        values: dict[str, Any] = {
            "n_vertices": len(mesh.vertices),
            "n_faces": len(mesh.faces),
            "n_people": len(people),
        }
        if self.segmenter is None:
            # Each pair once: the metrics that are shown are symmetric.
            scores = [psb.evaluate(mesh, a, b) for a, b in combinations(people, 2)]
            values["n_segments"] = round(float(np.mean([len(np.unique(labels)) for labels in people])))
        else:
            start = time.perf_counter()
            labels = self.segmenter(mesh.vertices, mesh.faces)
            values["seconds_segment"] = time.perf_counter() - start
            values["n_segments"] = len(np.unique(labels))
            face_labels = faces_from_vertices(labels, mesh.faces)
            scores = psb.Evaluator(mesh, people).evaluate(face_labels)
        return values | {name: float(np.mean([score[name] for score in scores])) for name in scores[0]}


def _judged(model: Model, segmenters: Sequence[Segmenter]) -> list[Segmenter | None]:
    """The segmenters, and None for the people, if several segmented the model."""
    return [each.for_model(model) for each in segmenters] + ([] if model.ground_truth else [None])


def has_people(model: Model) -> bool:
    """Whether the dataset of a model has segmentations by people."""
    return bool(model.human_digest()) or (
        type(model).human_digest is Model.human_digest
        and type(model).human_segmentations is not Model.human_segmentations
    )


@dataclass(frozen=True, kw_only=True)
class Benchmark(Experiment):
    """The Princeton benchmark's metrics, per model over its people, then over models."""

    columns: ClassVar[tuple[Column, ...]] = (
        *psb.COLUMNS,
        Column(name="n_people", dtype="Int64", help="People whose segmentations of the model are compared with."),
    )
    notes: ClassVar[str] = (
        "Mean over models of the mean over people's segmentations, and its 95 % bootstrap interval over models. CD: "
        "cut discrepancy; RI: Rand Index error; HD: Hamming distance; GCE, LCE: global and local consistency error "
        "(Chen et al. 2009); 0 is agreement. Humans: each person against the others."
    )

    def plan(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> list[Trial]:
        """One trial per model and segmenter, and one per model for its people, if any."""
        models = dataset.models()
        if not any(has_people(model) for model in models):
            raise StudyError(
                f"the study {study} needs segmentations by people, which the dataset {dataset.name} does not have; "
                "dataset=psb has them, and dataset=synthetic has exact ones"
            )
        return [
            BenchmarkTrial(
                study=study,
                dataset=dataset.name,
                part=study,
                model=model,
                mesh_digest=identity[1],
                segmenter=judged,
                ground_truth=model.ground_truth,
                segmenter_name=judged.name if judged else PEOPLE,
                group_key=digest(identity),
                trial_id=digest("benchmark", identity, model.human_digest(), judged and judged.fingerprint)[:24],
            )
            for model in models
            for identity in [fingerprint(model)]
            for judged in _judged(model, segmenters)
        ]

    def tables(self, rows: pd.DataFrame) -> list[Table]:
        """One row per method; one per method and category too if there are several."""
        method = Column(name="method", dtype="string", help="Segmentation method.")
        scores = [
            dataclasses.replace(column, bounds=(f"{column.name}_low", f"{column.name}_high"), compact=True)
            for column in psb.COLUMNS
            if column.name in psb.MAIN
        ]
        table = Table(
            name="table",
            frame=frame_of(
                {"method": name, "source": COMPUTED} | _scores(group)
                for name, group in rows.groupby("segmenter", sort=False)
            ),
            columns=(
                method, Column(name="source", dtype="string", help="Where the values come from."), *scores, MODELS,
                FAILURES,
            ),
            notes=self.notes,
        )  # fmt: skip
        if rows["category"].nunique() < 2:
            return [table]
        by_category = frame_of(
            {"method": name, "category": category} | _scores(group)
            for (name, category), group in rows.groupby(["segmenter", "category"], sort=False)
        )
        category = Column(name="category", dtype="string", help="Category of the models.")
        return [table, Table("by_category", by_category, (method, category, *scores, MODELS, FAILURES))]

    def charts(self, study: str, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, Chart]:
        """Every metric of every method, with its interval."""
        from studies.figures import charts

        metrics = [column for column in psb.COLUMNS if column.name in psb.MAIN]
        return {study: charts.method_scores(tables["table"], metrics, title)}


def _scores(rows: pd.DataFrame) -> dict[str, float]:
    """Mean and interval of every metric over models, and how many models there are."""
    good = rows[rows["status"] == "ok"]
    scores: dict[str, float] = {}
    for metric in psb.MAIN:
        low, high = interval_of_mean(good, metric)
        scores |= {metric: good[metric].mean(), f"{metric}_low": low, f"{metric}_high": high}
    return scores | {"n": len(good), "failures": len(rows) - len(good)}
