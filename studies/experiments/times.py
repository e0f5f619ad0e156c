"""How the number of segments depends on the time for which heat flows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from heatwalk import LoadedMesh
from studies import metrics
from studies.columns import Column, Table
from studies.experiments.change import Viewer, checked_viewer, columns_by_level, summary
from studies.experiments.distinct import REACHES, DistinctSegments
from studies.experiments.experiment import (
    FAILURES,
    MODELS,
    PUBLISHED,
    SEGMENTER,
    Experiment,
    by_segmenter,
    check_plates,
    frame_of,
    require_whole_number,
)
from studies.experiments.pairing import check_paired_with, difference, difference_column, rows_of
from studies.metrics import Comparison
from studies.planning.errors import StudyError
from studies.planning.fingerprint import digest, fingerprint
from studies.planning.names import check_name
from studies.planning.trial import Trial
from studies.planning.types import has_type
from studies.reporting.text import count_of
from studies.segmenters import Segmenter
from studies.statistics.bootstrap import interval_of_values

if TYPE_CHECKING:
    import pandas as pd

    from studies.datasets import Dataset, Model
    from studies.experiments.experiment import Labels
    from studies.figures.charts import Chart
    from studies.figures.pictures import Picture
    from studies.figures.times_scenes import TimesScenes

# The time that the others are compared with: the usual one of all other studies.
REFERENCE_TIME = 1.0

# Segments of at least this share of the vertices are counted in ``n_large_segments``.
LARGE_SHARE = 0.01

COUNTED = ("all", "distinct")
CRITERIA = ("exact", "within_one", "share_of_times")
_HELP_OF_CRITERION = {
    "exact": "Share of models with the same number of segments at every time.",
    "within_one": "Share of models whose numbers of segments differ by at most one.",
    "share_of_times": "Share of times at which the number of segments is that at time 1, mean over models.",
}

# Ways of counting: what tables call it, the column of the rows, whether only at the ends of an interval and the
# reference time, and which value of the option ``counted`` chooses it.
_COUNTINGS = (
    ("all", "n_segments", False, "all"),
    ("all, coarse", "n_segments", True, "all"),
    ("large", "n_large_segments", False, "all"),
    ("large, coarse", "n_large_segments", True, "all"),
    ("distinct (1)", "n_distinct_segments_1", False, "distinct"),
    ("distinct (2)", "n_distinct_segments_2", False, "distinct"),
)


@dataclass(frozen=True, kw_only=True)
class TimeTrial(Trial):
    """One model at one time.

    Parameters
    ----------
    times : tuple of float
        every time of the study: one eigenproblem serves them all
    segmenter : Segmenter
        of a Heat Walk
    """

    times: tuple[float, ...]
    segmenter: Segmenter

    def prepare(self) -> Prepared:
        """The mesh, and the segments at every time."""
        mesh = self.model.load()
        times = sorted({*self.times, REFERENCE_TIME})
        return Prepared(mesh, dict(zip(times, _at_times(self.segmenter.method, mesh, times), strict=True)))

    def measure(self, prepared: Prepared) -> dict[str, Any]:
        """Count the segments, and compare with those at the reference time."""
        mesh, at_time = prepared.mesh, prepared.at_time[self.level]
        reference, labels = prepared.at_time[REFERENCE_TIME].labels, at_time.labels
        n_vertices = len(mesh.vertices)
        sizes = np.unique(labels, return_counts=True)[1]
        return {
            "n_vertices": n_vertices,
            "n_faces": len(mesh.faces),
            "n_compared": n_vertices,
            "n_segments_reference": len(np.unique(reference)),
            "n_segments": len(sizes),
            "n_large_segments": int((sizes >= LARGE_SHARE * n_vertices).sum()),
            **{_distinct(reach): number for reach, number in zip(REACHES, at_time.n_distinct, strict=True)},
            **metrics.compare(Comparison(reference, labels, mesh, np.arange(n_vertices))),
        }


@dataclass(frozen=True)
class AtTime:
    """Labels of the vertices at one time, and the numbers of distinct segments for each of `REACHES`."""

    labels: np.ndarray
    n_distinct: tuple[int | None, ...]


@dataclass(frozen=True)
class Prepared:
    """What the trials of a model share: its mesh, and the segments at each time."""

    mesh: LoadedMesh
    at_time: Mapping[float, AtTime]


def _at_times(method: Any, mesh: LoadedMesh, times: Sequence[float]) -> Iterator[AtTime]:
    """The segments at each time; the distinct ones only of a method that tells its exemplars."""
    if not hasattr(method, "segmentations"):
        for labels in method.at_times(mesh.vertices, mesh.faces, times):
            yield AtTime(labels, (None,) * len(REACHES))
        return
    distinct = DistinctSegments(mesh.vertices, mesh.faces)
    for segmentation in method.segmentations(mesh.vertices, mesh.faces, times):
        counts = tuple(distinct.count(segmentation, reach) for reach in REACHES)
        yield AtTime(segmentation.labels, counts)


def _distinct(reach: int) -> str:
    """The column of the number of distinct segments."""
    return f"n_distinct_segments_{reach}"


@dataclass(frozen=True, kw_only=True)
class Times(Experiment):
    """The number of segments over logarithmically spaced times, and how many models keep theirs over an interval.

    Parameters
    ----------
    times : mapping
        ``first``, ``last`` and ``count`` of the times, in the segmenter's unit; the ends of the intervals and the
        reference time 1 are added
    intervals : sequence of (float, float)
    models_drawn : int or None
        how many models of the dataset, drawn at random; None for all
    seed : int
        of that draw
    plate : mapping
        the picture: ``models``, of which the first in the study is shown, by default the study's first; ``times``
    counted : {"all", "distinct"} or sequence of str
        which segments the table counts; "distinct" as by `DistinctSegments`; by default a row for each
    criterion : {"exact", "within_one", "share_of_times"}
        what the share ``unchanged`` is, which is compared with published values: of the models whose number is the same
        at every time, of those whose largest and smallest number differ by at most one, or, mean over models, of the
        times at which the number is that at time 1. The others are in columns beside it.
    paired_with : str, optional
        one of several segmenters, by its name in the rows, from which the tables have the differences of the others
    page : mapping
        which ``models`` the viewer of the page shows, at every time of the study, see
        `studies.experiments.change.Viewer`
    """

    times: Mapping[str, Any]
    intervals: Sequence[tuple[float, float]] = ()
    models_drawn: int | None = None
    seed: int = 0
    plate: Mapping[str, Any] = field(default_factory=dict)
    counted: str | Sequence[str] = COUNTED
    criterion: str = CRITERIA[0]
    paired_with: str | None = None
    page: Mapping[str, Any] | Viewer | None = field(default_factory=Viewer)

    has_scenes: ClassVar[bool] = True

    def __post_init__(self) -> None:
        self._all_times()
        self._counted()
        if self.criterion not in CRITERIA:
            raise StudyError(f"criterion is {self.criterion!r}: choose one of {', '.join(CRITERIA)}")
        if not has_type(self.seed, int) or self.seed < 0:
            raise StudyError(f"seed is {self.seed!r}: it must be a whole number of at least 0")
        if self.plate:
            check_plates({"figure15": self.plate})
            check_name("figure15.stem", self.plate.get("stem"))
            times: Any = self.plate.get("times")
            if not has_type(times, Sequence[float]) or not all(0 < time < math.inf for time in times):
                raise StudyError(f"figure15.times is {times!r}: it must be a list of times above 0")
            if not has_type(self.plate.get("models"), Sequence[int | str]):
                raise StudyError(f"figure15.models is {self.plate.get('models')!r}: it must be a list [a,b]")

    columns: ClassVar[tuple[Column, ...]] = (
        *metrics.columns(),
        Column(name="n_large_segments", dtype="Int64", help="Segments of at least 1 % of the vertices."),
        *(
            Column(
                name=_distinct(reach),
                dtype="Int64",
                help="Segments of at least 1 % of the area, those joined whose exemplars are at most "
                f"{count_of(reach, 'edge')} apart.",
            )
            for reach in REACHES
        ),
    )
    notes: ClassVar[str] = (
        "Share of models whose number of segments is the same at every time tried in the interval, in percent, with "
        "its 95 % bootstrap interval over models; and whose largest and smallest numbers differ by at most one. "
        "Large: segments of at least 1 % of the vertices. Coarse: only at the interval's ends and at time 1. Distinct: "
        "segments of at least 1 % of the area, those joined whose exemplars are at most one or two edges apart. Times: "
        "the share of the times, of which 1 is one, at which the number is that at time 1, mean over models."
    )

    def plan(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> list[Trial]:
        """One trial per model, segmenter and time."""
        check_paired_with(self.paired_with, segmenters)
        for segmenter in segmenters:
            if not hasattr(segmenter.method, "at_times"):
                raise StudyError(
                    f"the study {study} varies the time of heat flow, which {segmenter.name} does not have"
                )
        times = self._all_times()
        trials: list[Trial] = []
        for model in self._drawn(dataset.models()):
            identity = fingerprint(model)
            for segmenter in segmenters:
                group_key = digest(identity, *segmenter.fingerprint, times)
                trials += [
                    TimeTrial(
                        study=study,
                        dataset=dataset.name,
                        part=study,
                        model=model,
                        mesh_digest=identity[1],
                        times=times,
                        segmenter=segmenter,
                        segmenter_name=segmenter.name,
                        perturbation_name="time",
                        level=time,
                        unit=segmenter.method.time_unit,
                        group_key=group_key,
                        trial_id=digest("time", identity, time, *segmenter.fingerprint)[:24],
                    )
                    for time in times
                ]
        return trials

    def _drawn(self, models: Sequence[Model]) -> Sequence[Model]:
        if self.models_drawn is None or require_whole_number("models_drawn", self.models_drawn) >= len(models):
            return models
        drawn = np.random.default_rng(self.seed).choice(len(models), self.models_drawn, replace=False)
        return [models[i] for i in sorted(drawn)]

    def _all_times(self) -> tuple[float, ...]:
        """The times of the study, and the ends of its intervals, ascending."""
        if not isinstance(self.times, Mapping) or self.times.keys() != {"first", "last", "count"}:
            raise StudyError(f"times is {self.times!r}: it must be a mapping {{first: …, last: …, count: …}}")
        first, last = self.times["first"], self.times["last"]
        count = require_whole_number("times.count", self.times["count"])
        if not (has_type([first, last], Sequence[float]) and 0 < first < last < math.inf):
            raise StudyError(f"times.first={first} and times.last={last}: give two times with 0 < first < last")
        ends = [float(end) for interval in self._pairs() for end in interval]
        # Rounded, so that a time is the same number on every machine and in its row.
        return tuple(sorted({*np.geomspace(first, last, count).round(6).tolist(), *ends, REFERENCE_TIME}))

    def _pairs(self) -> list[tuple[float, float]]:
        """The intervals, checked."""
        if not has_type(self.intervals, Sequence[Any]):
            raise StudyError(f"intervals is {self.intervals!r}: it must be a list, as in 'intervals=[[0.6,2.7]]'")
        for interval in self.intervals:
            is_pair = has_type(interval, tuple[float, float])
            if not (is_pair and 0 < interval[0] < interval[1] < math.inf):
                raise StudyError(f"intervals contains {interval!r}: each must be two times [first, last], first < last")
        return [(float(low), float(high)) for low, high in self.intervals]

    def tables(self, rows: pd.DataFrame) -> list[Table]:
        """One row per interval and way of counting; and the Change Percentage by time."""
        keys = by_segmenter(rows)
        groups = rows.groupby(keys, sort=False) if keys else [((), rows)]
        others = rows_of(rows, self.paired_with)
        of_others = None if others is None else _numbers_of(others)
        records = [
            dict(zip(keys, key, strict=True)) | record
            for key, group in groups
            for numbers in [_numbers_of(group)]
            for low, high in self._pairs()
            for record in self._unchanged(numbers, low, high, of_others)
        ]
        columns = (
            SEGMENTER,
            Column(name="low", shown=False, help="First time of the interval."),
            Column(name="high", shown=False, help="Last time of the interval."),
            Column(name="interval", heading="times", template="{low:g} – {high:g}", help="Interval of times."),
            Column(name="counted", dtype="string", heading="segments counted", help="Which segments are counted."),
            Column(name="criterion", dtype="string", shown=self.criterion != CRITERIA[0],
                   help="What the share of unchanged ones is."),
            Column(name="times", dtype="int64", heading="times tried", compact=False,
                   help="Times within the interval."),
            Column(name="unchanged", heading="unchanged %", format=".1f", lower_is_better=False,
                   help=_HELP_OF_CRITERION[self.criterion]),
            Column(name="bounds", heading="95 % interval", template="{ci_low:.1f} – {ci_high:.1f}",
                   help="95 % bootstrap interval over models."),
            difference_column(self.paired_with, "unchanged %", format="+z.1f", lower_is_better=False),
            PUBLISHED,
            *(
                Column(name=criterion, heading=heading, format=".1f", lower_is_better=False, compact=False,
                       bounds=(f"{criterion}_low", f"{criterion}_high"), help=_HELP_OF_CRITERION[criterion])
                for criterion, heading in (("within_one", "within ±1 %"), ("share_of_times", "times %"))
            ),
            MODELS,
            FAILURES,
        )  # fmt: skip
        return [
            Table("table", frame_of(records), columns, notes=self.notes, value="unchanged"),
            Table(
                "by_time",
                summary(rows, self.paired_with),
                columns_by_level(rows, self.paired_with),
                value="mean",
            ),
        ]

    def _counted(self) -> tuple[str, ...]:
        """Which segments are counted, checked."""
        counted = [self.counted] if isinstance(self.counted, str) else self.counted
        if not has_type(counted, Sequence[str]) or not counted or not {*counted} <= {*COUNTED}:
            raise StudyError(f"counted is {self.counted!r}: it must be one of {', '.join(COUNTED)}, or a list [a,b]")
        return tuple(counted)

    def _unchanged(
        self, numbers: _Numbers, low: float, high: float, others: _Numbers | None
    ) -> Iterator[dict[str, Any]]:
        """How many models keep their number of segments from ``low`` to ``high``, by each way of counting.

        With the differences from the numbers of another method, if there are any.
        """
        times = [time for time in numbers.times if low <= time <= high]
        for name, column, is_coarse, option in _COUNTINGS:
            by_time = numbers.by_time.get(column)
            is_measured = by_time is not None and (not times or by_time[times].notna().any(axis=None))
            if option not in self._counted() or by_time is None or not is_measured:
                continue
            tried = [time for time in times if not is_coarse or time in (low, REFERENCE_TIME, high)]
            shares = {criterion: _shares(by_time, tried, criterion) for criterion in CRITERIA}
            share = shares[self.criterion]
            yield {
                "low": low,
                "high": high,
                "counted": name,
                "criterion": self.criterion,
                "times": len(tried),
                **dict(zip(("unchanged", "ci_low", "ci_high"), _mean_and_interval(share), strict=True)),
                **({} if others is None else _difference(share, numbers, others, column, tried, self.criterion)),
                **{
                    f"{criterion}{suffix}": value
                    for criterion in CRITERIA[1:]
                    for suffix, value in zip(("", "_low", "_high"), _mean_and_interval(shares[criterion]), strict=True)
                },
                "n": len(shares[CRITERIA[0]]),
                "failures": numbers.n_failed,
            }

    def charts(self, study: str, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, Chart]:
        """The number of segments over time and how much it varies within intervals; of many methods, the shares."""
        from studies.figures import charts

        table = tables["table"]
        if rows["segmenter"].nunique() <= charts.MOST_METHODS or table.frame.empty:
            return {study: charts.segment_counts(rows[rows["status"] == "ok"], self._pairs(), title)}
        first = table.frame[table.frame["counted"] == table.frame["counted"].iloc[0]]
        label = table.published.label if table.published else ""
        shown = {"unchanged": "mean", table.published.column if table.published else "": "published"}
        means = {
            f"times {low:g} to {high:g}": first[(first["low"] == low) & (first["high"] == high)].rename(columns=shown)
            for low, high in self._pairs()
        }
        subtitle = f"{_HELP_OF_CRITERION[self.criterion].removesuffix('.')} (%); higher is better"
        return {study: charts.method_means(means, title, subtitle, label)}

    def pictures(
        self, study: str, trials: Sequence[Trial], rows: pd.DataFrame, title: str, labels: Labels
    ) -> Iterable[Picture]:
        """One model at a few times."""
        from studies.figures.method_figures import TimePlate

        if not self.plate:
            return
        good = set(rows.loc[rows["status"] == "ok", "trial_id"])
        first = {trial.model.name: trial for trial in reversed(trials) if trial.trial_id in good}
        named = [first[str(name)] for name in self.plate["models"] if str(name) in first]
        shown = [*named, *reversed(first.values())]
        if shown:
            yield TimePlate(self.plate["stem"], shown[0], list(self.plate["times"]), title)

    def scenes(self, trials: Sequence[Trial], rows: pd.DataFrame, labels: Labels) -> TimesScenes | None:
        """Some models at every time, first at the reference time."""
        from studies.figures.gallery import choose_models
        from studies.figures.times_scenes import TimesScenes

        viewer = checked_viewer(self.page)
        good = set(rows.loc[rows["status"] == "ok", "trial_id"])
        by_model: dict[str, list[Trial]] = {}
        for trial in trials:
            if trial.trial_id in good:
                by_model.setdefault(trial.model.name, []).append(trial)
        names = choose_models(by_model, viewer.models) if viewer.models != 0 else []
        return TimesScenes([by_model[name] for name in names], REFERENCE_TIME) if names else None


@dataclass(frozen=True)
class _Numbers:
    """The numbers of segments by one method.

    Parameters
    ----------
    segmenter : str
    times : list of float
        those at which a trial succeeded
    by_time : dict of str to DataFrame
        of each way of counting that has a column in the rows: a row per model, a column per time
    n_failed : int
        models with a failed trial
    """

    segmenter: str
    times: list[float]
    by_time: Mapping[str, pd.DataFrame]
    n_failed: int


def _numbers_of(rows: pd.DataFrame) -> _Numbers:
    """The numbers of segments in the rows of one method."""
    good = rows[rows["status"] == "ok"]
    columns = dict.fromkeys(column for _, column, _, _ in _COUNTINGS if column in rows)
    return _Numbers(
        "".join(rows["segmenter"].iloc[:1]),
        good["level"].unique().tolist(),
        {name: good.pivot(index="model", columns="level", values=name).astype(float) for name in columns},
        rows.loc[rows["status"] != "ok", "model"].nunique(),
    )


def _shares(by_time: pd.DataFrame, times: Sequence[float], criterion: str) -> pd.Series:
    """The share, in percent, that a criterion takes for unchanged, of each model.

    Parameters
    ----------
    by_time : DataFrame
        numbers of segments: a row per model, a column per time
    times : sequence of float
        those that are compared
    criterion : str
        one of `CRITERIA`
    """
    numbers = by_time[list(times)].dropna(how="all")
    if criterion == "share_of_times":
        known = by_time.get(REFERENCE_TIME, by_time.iloc[:0].min(axis=1)).dropna()
        numbers = numbers[numbers.index.isin(known.index)]
        same = numbers.eq(known.reindex(numbers.index), axis=0).sum(axis=1) / numbers.notna().sum(axis=1)
    else:
        same = numbers.max(axis=1) - numbers.min(axis=1) <= CRITERIA.index(criterion)
    return 100.0 * same.astype(float)


def _mean_and_interval(shares: pd.Series) -> tuple[float, float, float]:
    """The mean over models, and its interval."""
    return shares.mean(), *interval_of_values(list(shares.to_numpy()[:, None]))


def _difference(
    share: pd.Series, numbers: _Numbers, others: _Numbers, column: str, times: Sequence[float], criterion: str
) -> dict[str, float]:
    """The mean over models of the difference of the shares of two methods, and its interval."""
    is_other = numbers.segmenter != others.segmenter and set(times) <= set(others.times)
    of_others = _shares(others.by_time[column], times, criterion) if is_other else share.iloc[:0]
    mean, *interval = _mean_and_interval((share - of_others).dropna())
    return difference(mean, (interval[0], interval[1]))
