"""How far a segmentation moves from pose to pose."""

from __future__ import annotations

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import combinations, groupby
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from studies import metrics
from studies.columns import Column, Table
from studies.datasets import Model
from studies.execution.interruption import is_ctrl_c, reason
from studies.experiments.change import Viewer, checked_viewer
from studies.experiments.experiment import (
    FAILURES,
    SEGMENTER,
    Experiment,
    by_segmenter,
    check_plates,
    frame_of,
    require_whole_number,
)
from studies.experiments.pairing import check_paired_with, difference, difference_column, matched, rows_of
from studies.metrics import Comparison
from studies.planning.errors import StudyError
from studies.planning.fingerprint import digest, fingerprint
from studies.planning.trial import Trial
from studies.reporting.text import count_of
from studies.segmenters import Segmenter
from studies.statistics.bootstrap import interval_over_pairs

if TYPE_CHECKING:
    import pandas as pd

    from studies.datasets import Dataset
    from studies.experiments.experiment import Labels
    from studies.figures.charts import Chart
    from studies.figures.method_scenes import PoseScenes
    from studies.figures.pictures import Picture

ALL_SHAPES = "all"
MOST_METHODS_DRAWN = 2  # whose segmentations of poses a picture shows

OTHER = Column(name="other", dtype="string", help="Name of the second pose.")


@dataclass(frozen=True)
class Pose:
    """A pose's segmentation, at the points that all poses of its shape have in common."""

    labels: np.ndarray
    n_vertices: int
    n_faces: int
    n_segments: int
    seconds: float


@dataclass(frozen=True, kw_only=True)
class PoseTrial(Trial):
    """Two poses of a shape, each segmented independently.

    Parameters
    ----------
    other : Model
        the second pose
    poses : tuple of Model
        every pose of the shape
    segmenter : Segmenter
    """

    other: Model
    poses: tuple[Model, ...]
    segmenter: Segmenter

    def model_names(self) -> Sequence[str]:
        """The names of all poses of the shape."""
        return [model.name for model in self.poses]

    def digest_of(self, name: str) -> str:
        """The digest of one of the poses."""
        return next(model.digest() for model in self.poses if model.name == name)

    def known_values(self) -> dict[str, Any]:
        """The name of the second pose."""
        return {"other": self.other.name}

    def prepare(self) -> dict[str, Pose | str]:
        """Every pose of the shape by name, or the reason why it could not be segmented."""
        poses: dict[str, Pose | str] = {}
        segmenter = self.segmenter_of_shape()
        for model in self.poses:
            try:
                poses[model.name] = _segment(model, segmenter)
            except BaseException as error:
                if is_ctrl_c(error):
                    raise
                poses[model.name] = reason(error)
        return poses

    def segmenter_of_shape(self) -> Segmenter:
        """The segmenter for all poses; one that must be told how many segments to find is told that of the first."""
        if not self.segmenter.is_told:
            return self.segmenter
        mesh = self.poses[0].load()
        return self.segmenter.for_original(mesh.vertices, mesh.faces)

    def measure(self, prepared: Mapping[str, Pose | str]) -> dict[str, Any]:
        """Compare the two poses."""
        a, b = (_segmented(prepared, model) for model in (self.model, self.other))
        return {
            "n_vertices": a.n_vertices,
            "n_faces": a.n_faces,
            "n_vertices_perturbed": b.n_vertices,
            "n_faces_perturbed": b.n_faces,
            "n_compared": len(a.labels),
            "n_segments_reference": a.n_segments,
            "n_segments": b.n_segments,
            **metrics.compare(Comparison(a.labels, b.labels)),
            "seconds_segment": b.seconds,
        }


def _segment(model: Model, segmenter: Segmenter) -> Pose:
    mesh = model.load()
    start = time.perf_counter()
    labels = segmenter(mesh.vertices, mesh.faces)
    seconds = time.perf_counter() - start
    return Pose(labels[model.correspondence()], len(mesh.vertices), len(mesh.faces), len(np.unique(labels)), seconds)


def has_correspondence(model: Model) -> bool:
    """Whether the dataset of a model specifies corresponding points."""
    return bool(model.correspondence_digest()) or type(model).correspondence is not Model.correspondence


def _segmented(poses: Mapping[str, Pose | str], model: Model) -> Pose:
    pose = poses[model.name]
    if isinstance(pose, str):
        raise ValueError(f"pose {model.name}: {pose}")
    return pose


@dataclass(frozen=True, kw_only=True)
class Poses(Experiment):
    """Change Percentage between all pairs of poses of a shape; a shape is a category of the dataset.

    Parameters
    ----------
    plates : mapping of str to mapping
        pictures by file stem: ``models``, the names of poses, of which those in the study are shown, and ``upright``,
        the vertical axis: 1 (y) or 2 (z)
    columns_shown : int
        how many poses a picture shows if none of its models is in the study
    paired_with : str, optional
        one of several segmenters, by its name in the rows, from which the table has the differences of the others
    page : mapping, optional
        ``columns``: how many poses of a shape the viewer shows, the first and those that differ most from it;
        ``models`` is 0 for a page without a viewer. See `studies.experiments.change.Viewer`
    """

    plates: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    columns_shown: int = 6
    paired_with: str | None = None
    page: Mapping[str, Any] | Viewer | None = field(default_factory=Viewer)

    has_scenes: ClassVar[bool] = True

    def __post_init__(self) -> None:
        check_plates(self.plates)
        for stem, plate in self.plates.items():
            upright = plate.get("upright", 1)
            if isinstance(upright, bool) or upright not in (1, 2):
                raise StudyError(f"plates.{stem}.upright is {upright!r}: it must be 1 (y) or 2 (z)")
        require_whole_number("gallery.columns", self.columns_shown)

    columns: ClassVar[tuple[Column, ...]] = (*metrics.columns(), OTHER)
    notes: ClassVar[str] = (
        "Every pose is segmented independently; Change Percentage (CP, twice the share of points that must change "
        "their segment, in percent) between all pairs of poses of a shape, at the points that correspond according to "
        "the dataset (TOSCA's lists at 5,000 vertices name some vertices more than once and some never). 95 % bootstrap"
        " interval of the mean: poses resampled. Segments: their smallest and largest number over the poses."
    )

    def plan(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> list[Trial]:
        """One trial per pair of poses of a shape and segmenter."""
        check_paired_with(self.paired_with, segmenters)
        trials: list[Trial] = []
        models = sorted(dataset.models(), key=lambda model: model.category)
        if not any(has_correspondence(model) for model in models):
            raise StudyError(
                f"the study {study} needs the corresponding points of two poses of a shape, which the dataset "
                f"{dataset.name} does not have; dataset=tosca and dataset=synthetic have them"
            )
        for shape, group in groupby(models, key=lambda model: model.category):
            poses = tuple(group)
            identities = {model.name: [*fingerprint(model), model.correspondence_digest()] for model in poses}
            for segmenter in (each.for_model(poses[0]) for each in segmenters):
                group_key = digest(identities, *segmenter.fingerprint)
                told = [identities[poses[0].name]] if segmenter.is_told else []
                for a, b in combinations(poses, 2):
                    trials.append(
                        PoseTrial(
                            study=study,
                            dataset=dataset.name,
                            part=shape,
                            model=a,
                            mesh_digest=identities[a.name][1],
                            other=b,
                            poses=poses,
                            segmenter=segmenter,
                            segmenter_name=segmenter.name,
                            perturbation_name="pose",
                            group_key=group_key,
                            trial_id=digest(
                                "pose", identities[a.name], identities[b.name], *segmenter.fingerprint, *told
                            )[:24],
                        )
                    )
        if not trials:
            raise StudyError("no shape has two poses: a shape is a category of the dataset, such as a folder of files")
        return trials

    def tables(self, rows: pd.DataFrame) -> list[Table]:
        """One row per shape, and one for all of them."""
        keys = by_segmenter(rows)
        groups = rows.groupby(keys, sort=False) if keys else [((), rows)]
        differences = _differences(rows[rows["status"] == "ok"], self.paired_with)
        records = []
        for key, group in groups:
            pairs = None if differences is None else differences[differences["segmenter"].isin(group["segmenter"])]
            shapes = [
                _summary(str(shape), of_shape, None if pairs is None else pairs[pairs["part"] == shape])
                for shape, of_shape in group.groupby("part", sort=False)
            ]
            if len(shapes) > 1:
                shapes.append(_summary(ALL_SHAPES, group, pairs))
            records += [dict(zip(keys, key, strict=True)) | shape for shape in shapes]
        columns = (
            SEGMENTER,
            Column(name="shape", dtype="string", help="Shape: a category of the dataset."),
            Column(name="poses", dtype="int64", help="Poses that were segmented."),
            Column(name="pairs", dtype="int64", help="Pairs of poses."),
            Column(name="mean", heading="CP %", format=".2f", lower_is_better=True, help="Mean Change Percentage."),
            Column(name="ci_low", shown=False, help="Lower end of the 95 % interval of the mean."),
            Column(name="ci_high", shown=False, help="Upper end of the 95 % interval of the mean."),
            Column(
                name="interval",
                heading="95 % interval",
                template="{ci_low:.2f} – {ci_high:.2f}",
                help="95 % bootstrap interval of the mean over pairs, poses resampled.",
            ),
            difference_column(self.paired_with, "CP %", format="+z.2f", lower_is_better=True),
            Column(name="median", format=".2f", lower_is_better=True, help="Median over pairs."),
            Column(name="largest", format=".1f", lower_is_better=True, help="Largest Change Percentage of a pair."),
            Column(
                name="van_dongen",
                heading="van Dongen",
                format=".2f",
                lower_is_better=True,
                compact=False,
                help="Mean van Dongen distance in percent.",
            ),
            Column(
                name="segments",
                template="{fewest_segments:.0f} – {most_segments:.0f}",
                compact=False,
                help="Smallest and largest number of segments of a pose.",
            ),
            FAILURES,
        )
        return [Table("table", frame_of(records), columns, notes=self.notes)]

    def charts(self, study: str, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, Chart]:
        """A matrix of pairs per shape, and per segmenter if there are several; the means of more than a few."""
        from studies.figures import charts

        keys = by_segmenter(rows)
        groups = rows.groupby(keys, sort=False) if keys else [((), rows)]
        if len(groups) > charts.MOST_METHODS:
            shapes = {str(shape): of_shape for shape, of_shape in tables["table"].frame.groupby("shape", sort=False)}
            means = {f"{shape} (%)": shapes[shape] for shape in sorted(shapes, key=lambda shape: shape != ALL_SHAPES)}
            n_hidden = len(means) - charts.MOST_PANELS_OF_MEANS
            more = f"; {count_of(n_hidden, 'shape')} more in the table" if n_hidden > 0 else ""
            subtitle = f"mean Change Percentage between all pairs of poses; lower is better{more}"
            return {study: charts.method_means(means, title, subtitle)}
        changes = {(shape, *key): matrix for key, group in groups for shape, matrix in pair_matrices(group).items()}
        return {study: charts.pair_matrices(changes, title)}

    def pictures(
        self, study: str, trials: Sequence[Trial], rows: pd.DataFrame, title: str, labels: Labels
    ) -> Iterable[Picture]:
        """Some poses side by side, by the first methods, a part in the colour that it has in the first of its shape."""
        from studies.figures.method_figures import PosePlate

        good = rows[rows["status"] == "ok"]
        segmented = {
            *zip(good["segmenter"], good["model"], strict=True),
            *zip(good["segmenter"], good["other"], strict=True),
        }
        by_method: dict[str, dict[str, Trial]] = {}
        for trial in trials:
            for model in getattr(trial, "poses", ()):
                if (trial.segmenter_name, model.name) in segmented:
                    by_method.setdefault(str(trial.segmenter_name), {}).setdefault(model.name, trial)
        methods = list(by_method.values())[:MOST_METHODS_DRAWN]
        poses = methods[0] if methods else {}
        for stem, plate in self.plates.items():
            named = [str(name) for name in plate["models"] if str(name) in poses]
            # Those that are named are a choice from the whole of a dataset: of a part of it, others are shown.
            few = len(named) < min(self.columns_shown, len(poses))
            names = _of_each_shape(poses, self.columns_shown) if few else named
            shown = [(of_method[name], name) for name in names for of_method in methods if name in of_method]
            if shown:
                yield PosePlate(stem, shown, plate.get("upright", 1), title)

    def scenes(self, trials: Sequence[Trial], rows: pd.DataFrame, labels: Labels) -> PoseScenes | None:
        """The first pose of each shape, and those that differ most from it, by every method."""
        from studies.figures.method_scenes import PoseScenes

        viewer = checked_viewer(self.page)
        good = rows[rows["status"] == "ok"].set_index("trial_id")
        by_shape: dict[str, dict[str, list[Any]]] = {}
        for trial in trials:
            if trial.trial_id in good.index:
                by_shape.setdefault(trial.part, {}).setdefault(str(trial.segmenter_name), []).append(trial)
        if viewer.models == 0 or not by_shape:
            return None
        changes = good["change_percentage"].astype(float)
        shown = []
        for shape, methods in by_shape.items():
            first = next(iter(methods.values()))
            from_first = [trial for trial in first if trial.model.name == first[0].model.name]
            farthest = sorted(from_first, key=lambda trial: -changes[trial.trial_id])[: viewer.columns - 1]
            names = [first[0].model.name, *(trial.other.name for trial in from_first if trial in farthest)]
            shown.append((shape, [(of_method[0], names) for of_method in methods.values()]))
        return PoseScenes(shown, next((plate.get("upright", 1) for plate in self.plates.values()), 1))


def _of_each_shape(poses: Mapping[str, Trial], count: int) -> list[str]:
    """About this many poses, the first ones of some shapes in turn, at least two of each, shape by shape."""
    by_shape: dict[str, list[str]] = {}
    for name, trial in poses.items():
        by_shape.setdefault(trial.part, []).append(name)
    by_shape = dict(list(by_shape.items())[: max(count // 2, 1)])
    longest = max(map(len, by_shape.values()), default=0)
    in_turn = [names[i] for i in range(longest) for names in by_shape.values() if i < len(names)][:count]
    return [name for names in by_shape.values() for name in names if name in in_turn]


def pair_matrices(rows: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Change Percentage between the poses of each shape.

    Returns
    -------
    dict of str to DataFrame
        by shape, a symmetric matrix whose index and columns are the poses, NaN where a trial failed
    """
    import pandas as pd

    matrices = {}
    for shape, group in rows.groupby("part", sort=False):
        good = group[group["status"] == "ok"]
        names = list(dict.fromkeys([*good["model"], *good["other"]]))
        half = good.pivot(index="model", columns="other", values="change_percentage").reindex(
            index=names, columns=names
        )
        values = half.to_numpy(dtype=float)
        values = np.where(np.isnan(values), values.T, values)
        np.fill_diagonal(values, 0)
        matrices[str(shape)] = pd.DataFrame(values, index=names, columns=names)
    return matrices


def _summary(shape: str, rows: pd.DataFrame, differences: pd.DataFrame | None) -> dict[str, Any]:
    """What the rows of a shape by one method amount to, with the differences from another method, if there are any."""
    import pandas as pd

    good = rows[rows["status"] == "ok"]
    low, high = _interval(good)
    segments = pd.concat([good["n_segments"], good["n_segments_reference"]])
    return {
        "shape": shape,
        "poses": len(set(good["model"]) | set(good["other"])),
        "pairs": len(good),
        "mean": good["change_percentage"].mean(),
        "ci_low": low,
        "ci_high": high,
        **({} if differences is None else _difference(differences)),
        "median": good["change_percentage"].median(),
        "largest": good["change_percentage"].max(),
        "van_dongen": good["van_dongen"].mean(),
        "fewest_segments": segments.min(),
        "most_segments": segments.max(),
        "failures": len(rows) - len(good),
    }


def _interval(rows: pd.DataFrame) -> tuple[float, float]:
    """The interval of the mean Change Percentage over pairs, poses resampled."""
    return interval_over_pairs([matrix.to_numpy() for matrix in pair_matrices(rows).values()])


def _differences(rows: pd.DataFrame, paired_with: str | None) -> pd.DataFrame | None:
    """The differences of the Change Percentages of every method from those of one of them, between the same poses."""
    others = rows_of(rows, paired_with)
    return None if others is None else matched(rows, others, "change_percentage", ["part", "model", "other"])


def _difference(differences: pd.DataFrame) -> dict[str, float]:
    """The mean over pairs of the differences of Change Percentages, and its interval."""
    return difference(differences["change_percentage"].mean(), _interval(differences.assign(status="ok")))
