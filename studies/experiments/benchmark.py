"""How far a segmentation is from those made by people."""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

import heatwalk
from heatwalk import LoadedMesh
from studies.columns import AUTHORS, COMPUTED, Column, Table
from studies.datasets import Model
from studies.experiments.change import Viewer, checked_viewer
from studies.experiments.experiment import (
    FAILURES,
    MODELS,
    PEAK_MEMORY,
    SEGMENTER,
    TOLD,
    Experiment,
    frame_of,
    measured,
    note_on_told,
    told_methods,
)
from studies.experiments.pairing import check_paired_with, difference, difference_column, matched, rows_of
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
    from studies.experiments.experiment import Labels
    from studies.figures.charts import Chart
    from studies.figures.people_scenes import PeopleScenes

PEOPLE = "Humans"
OF_AUTHORS = f" ({AUTHORS})"  # behind the names of their methods in rows, where they may be next to our own
NOTE_ON_AUTHORS = (
    "Source authors: computed here from the segmentations by the method's authors that come with the dataset, which may"
    " lack some models."
)

METHOD = Column(name="method", dtype="string", help="Segmentation method.")
SECONDS = Column(
    name="seconds_segment",
    heading="seconds",
    format=".3f",
    unit="s",
    lower_is_better=True,
    help="Mean time that segmenting a model took.",
)
LARGEST_SECONDS = dataclasses.replace(
    SECONDS, name="largest_seconds", heading="longest (s)", help="Longest time that segmenting a model took."
)
SOURCE = Column(name="source", dtype="string", help="Where the values come from.")


@dataclass(frozen=True)
class Prepared:
    """What the trials of a model share: its mesh, and segmentations of its faces.

    Parameters
    ----------
    mesh : LoadedMesh
    people : list of (m,) int array
    by_methods : dict of str to (m,) int array
        those that come with the dataset, by method; or what reading one raised
    """

    mesh: LoadedMesh
    people: list[np.ndarray]
    by_methods: Mapping[str, np.ndarray | Exception]


@dataclass(frozen=True, kw_only=True)
class BenchmarkTrial(Trial):
    """The segmentation of one model against those of every person, or each person's against the others'.

    Parameters
    ----------
    segmenter : Segmenter or None
        None for the people, and for a method of others
    method : str
        the method whose segmentation, as its authors computed it, comes with the dataset; "" for all others
    methods : tuple of str
        every such method of the model
    ground_truth : bool
        whether the model has one exact segmentation, which is compared with, instead of those by people
    """

    segmenter: Segmenter | None
    method: str = ""
    methods: tuple[str, ...] = ()
    ground_truth: bool = False

    def prepare(self) -> Prepared:
        """The mesh, and the segmentations of its faces by people and by methods of others."""
        people = self.model.human_segmentations()
        if len(people) < 2 and not self.ground_truth:
            raise ValueError(
                f"model {self.model.name} has {count_of(len(people), 'segmentation')} by people; two are needed"
            )
        by_methods = {method: _read_segmentation(self.model, method) for method in self.methods}
        return Prepared(self.model.load(), people, by_methods)

    def measure(self, prepared: Prepared) -> dict[str, Any]:
        """The mean of every metric over people."""
        mesh, people = prepared.mesh, prepared.people
        values: dict[str, Any] = {
            "n_vertices": len(mesh.vertices),
            "n_faces": len(mesh.faces),
            "n_people": len(people),
        }
        if self.method:
            face_labels = self._checked(prepared.by_methods[self.method], len(mesh.faces))
            values["n_segments"] = len(np.unique(face_labels))
            scores = psb.Evaluator(mesh, people).evaluate(face_labels)
        elif self.segmenter is None:
            # Each pair once: the metrics that are shown are symmetric.
            scores = [psb.evaluate(mesh, a, b) for a, b in combinations(people, 2)]
            values["n_segments"] = round(float(np.mean([len(np.unique(labels)) for labels in people])))
        else:
            labels, values["seconds_segment"], values["peak_memory"] = measured(self.segmenter, mesh)
            values["n_segments"] = len(np.unique(labels))
            face_labels = heatwalk.faces_from_vertices(labels, mesh.faces)
            scores = psb.Evaluator(mesh, people).evaluate(face_labels)
        return values | {name: float(np.mean([score[name] for score in scores])) for name in scores[0]}

    def _checked(self, labels: np.ndarray | Exception, n_faces: int) -> np.ndarray:
        """The face labels that come with the dataset, one per face; what reading them raised is raised."""
        if isinstance(labels, Exception):
            raise labels
        if len(labels) != n_faces:
            raise ValueError(
                f"the segmentation of model {self.model.name} by {self.method} has {count_of(len(labels), 'label')}, "
                f"and its mesh {count_of(n_faces, 'face')}"
            )
        return labels


def _read_segmentation(model: Model, method: str) -> np.ndarray | Exception:
    """The segmentation of a model by a method of others, or what reading it raises."""
    try:
        return model.method_segmentation(method)
    except Exception as error:
        return error


@dataclass(frozen=True)
class _Judged:
    """What segmented a model: a segmenter; people, if there is none; or a method of others, by its name."""

    segmenter: Segmenter | None
    method: str = ""
    digest: str = ""

    @property
    def name(self) -> str:
        if self.method:
            return self.method + OF_AUTHORS
        return self.segmenter.name if self.segmenter else PEOPLE

    @property
    def fingerprint(self) -> Any:
        return [AUTHORS, self.method, self.digest] if self.method else self.segmenter and self.segmenter.fingerprint


def _judged(model: Model, segmenters: Sequence[Segmenter], digests: Mapping[str, str]) -> list[_Judged]:
    """What segmented a model: the segmenters, people if there are several, and the methods of others."""
    return [
        *(_Judged(each.for_model(model)) for each in segmenters),
        *([] if model.ground_truth else [_Judged(None)]),
        *(_Judged(None, method, sha256) for method, sha256 in digests.items()),
    ]


def has_people(model: Model) -> bool:
    """Whether the dataset of a model has segmentations by people."""
    return bool(model.human_digest()) or (
        type(model).human_digest is Model.human_digest
        and type(model).human_segmentations is not Model.human_segmentations
    )


@dataclass(frozen=True, kw_only=True)
class Benchmark(Experiment):
    """The Princeton benchmark's metrics, per model over its people, then over models.

    Parameters
    ----------
    page : mapping, optional
        which models the viewer of the page shows, and ``worst`` more on which the first method agrees least with
        people; see `studies.experiments.change.Viewer`
    paired_with : str, optional
        one of several segmenters, by its name in the rows, from which a table has the differences of the others
    """

    page: Mapping[str, Any] | Viewer | None = field(default_factory=Viewer)
    paired_with: str | None = None

    has_scenes: ClassVar[bool] = True
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
        """One trial per model and segmenter, one per model for its people, if any, and one per method of others."""
        check_paired_with(self.paired_with, segmenters)
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
                segmenter=judged.segmenter,
                method=judged.method,
                methods=tuple(digests),
                ground_truth=model.ground_truth,
                segmenter_name=judged.name,
                group_key=digest(identity),
                trial_id=digest("benchmark", identity, human_digest, judged.fingerprint)[:24],
            )
            for model in models
            for identity, human_digest, digests in [(fingerprint(model), model.human_digest(), model.method_digests())]
            for judged in _judged(model, segmenters, digests)
        ]

    def tables(self, rows: pd.DataFrame) -> list[Table]:
        """One row per method; one per method and category too if there are several."""
        scores = [
            dataclasses.replace(column, bounds=(f"{column.name}_low", f"{column.name}_high"), compact=True)
            for column in psb.COLUMNS
            if column.name in psb.MAIN
        ]
        told = told_methods(rows)
        table = Table(
            name="table",
            frame=frame_of(
                _named(str(name)) | ({TOLD.name: _yes_or_no(name, told, group)} if told else {}) | _scores(group)
                for name, group in rows.groupby("segmenter", sort=False)
            ),
            columns=(METHOD, SOURCE, TOLD, *scores, MODELS, FAILURES),
            notes=" ".join(filter(None, (self.notes, _note_on_authors(rows), note_on_told(told)))),
        )
        further = (_differences(rows, self.paired_with), _table_by_category(rows, scores), _cost(rows))
        return [table, *filter(None, further)]

    def charts(self, study: str, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, Chart]:
        """Every metric of every method, with its interval."""
        from studies.figures import charts

        metrics = [column for column in psb.COLUMNS if column.name in psb.MAIN]
        return {study: charts.method_scores(tables["table"], metrics, title)}

    def scenes(self, trials: Sequence[Trial], rows: pd.DataFrame, labels: Labels) -> PeopleScenes | None:
        """People's segmentations beside those of the methods."""
        from studies.figures.gallery import choose_models
        from studies.figures.people_scenes import people_scenes

        viewer = checked_viewer(self.page)
        good = rows[(rows["status"] == "ok") & rows["rand_index_error"].notna()]
        scores = dict(zip(good["trial_id"], good["rand_index_error"].astype(float), strict=True))
        models = choose_models([trial.model.name for trial in trials], viewer.models) if viewer.models != 0 else []
        return people_scenes(trials, scores, models, viewer.worst) if models else None


def _differences(rows: pd.DataFrame, paired_with: str | None) -> Table | None:
    """The scores of each method minus those of another, on the same models; None if there is no such method."""
    good = rows[rows["status"] == "ok"]
    others = rows_of(good, paired_with)
    if others is None:
        return None
    records: list[dict[str, Any]] = []
    for name, group in good[good["segmenter"] != paired_with].groupby("segmenter", sort=False):
        pairs = {metric: matched(group, others, metric, ["model"]) for metric in psb.MAIN}
        records.append({METHOD.name: name, "n": len(pairs[psb.MAIN[0]])})
        for metric, of_metric in pairs.items():
            records[-1] |= difference(of_metric[metric].mean(), interval_of_mean(of_metric, metric), metric)
    columns = [
        difference_column(
            paired_with, column.title, name=column.name, heading=column.title, format="+z.3f", lower_is_better=True
        )
        for column in psb.COLUMNS
        if column.name in psb.MAIN
    ]
    return Table(
        name="differences",
        frame=frame_of(records),
        columns=(METHOD, *columns, MODELS),
        notes=f"The metrics of each method minus those of {paired_with}; negative: nearer to people.",
    )


def _table_by_category(rows: pd.DataFrame, scores: Sequence[Column]) -> Table | None:
    """The scores by method and category; None if there are not several categories."""
    if rows["category"].nunique() < 2:
        return None
    frame = frame_of(
        {"method": name, "category": category} | _scores(group)
        for (name, category), group in rows.groupby(["segmenter", "category"], sort=False)
    )
    category = Column(name="category", dtype="string", help="Category of the models.")
    return Table("by_category", frame, (METHOD, category, *scores, MODELS, FAILURES))


def _cost(rows: pd.DataFrame) -> Table | None:
    """Seconds and peak memory of each method; None if the rows are from before memory was measured.

    In a table of its own, because they differ between runs, and the others do not.
    """
    if PEAK_MEMORY.name not in rows or rows[PEAK_MEMORY.name].isna().all():
        return None
    good = rows[(rows["status"] == "ok") & rows["segmenter_options"].notna()]
    frame = frame_of(
        {
            "segmenter": name,
            SECONDS.name: group[SECONDS.name].mean(),
            LARGEST_SECONDS.name: group[SECONDS.name].max(),
            PEAK_MEMORY.name: group[PEAK_MEMORY.name].median(),
            MODELS.name: len(group),
        }
        for name, group in good.groupby("segmenter", sort=False)
    )
    return Table("cost", frame, (SEGMENTER, SECONDS, LARGEST_SECONDS, PEAK_MEMORY, MODELS))


def _named(name: str) -> dict[str, str]:
    """The method and the source of rows with this name of a segmenter."""
    is_of_authors = name.endswith(OF_AUTHORS)
    return {"method": name.removesuffix(OF_AUTHORS), "source": AUTHORS if is_of_authors else COMPUTED}


def _note_on_authors(rows: pd.DataFrame) -> str:
    return NOTE_ON_AUTHORS if rows["segmenter"].str.endswith(OF_AUTHORS).any() else ""


def _yes_or_no(name: Any, told: Sequence[str], rows: pd.DataFrame) -> str | None:
    """Whether a method is told how many segments to find; None for people and the methods of others."""
    if rows["segmenter_options"].isna().all():
        return None
    return "yes" if name in told else "no"


def _scores(rows: pd.DataFrame) -> dict[str, float]:
    """Mean and interval of every metric over models, and how many models there are."""
    good = rows[rows["status"] == "ok"]
    scores: dict[str, float] = {}
    for metric in psb.MAIN:
        low, high = interval_of_mean(good, metric)
        scores |= {metric: good[metric].mean(), f"{metric}_low": low, f"{metric}_high": high}
    return scores | {"n": len(good), "failures": len(rows) - len(good)}
