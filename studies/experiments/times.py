"""How the number of segments depends on the time for which heat flows."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from studies import metrics
from studies.columns import Column, Table
from studies.experiments.change import columns_by_level, summary
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
from studies.metrics import Comparison
from studies.planning.errors import StudyError
from studies.planning.fingerprint import digest, fingerprint
from studies.planning.names import check_name
from studies.planning.trial import Trial
from studies.planning.types import has_type
from studies.segmenters import Segmenter
from studies.statistics.bootstrap import interval_of_mean

if TYPE_CHECKING:
    import pandas as pd

    from studies.datasets import Dataset, Model
    from studies.experiments.experiment import Labels
    from studies.figures.charts import Chart
    from studies.figures.pictures import Picture

# The time that the others are compared with: the usual one of all other studies.
REFERENCE_TIME = 1.0

# Segments of at least this share of the vertices are counted in ``n_large_segments``.
LARGE_SHARE = 0.01


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

    def prepare(self) -> tuple[int, int, dict[float, np.ndarray]]:
        """The numbers of vertices and faces, and the labels at every time."""
        mesh = self.model.load()
        times = sorted({*self.times, REFERENCE_TIME})
        labels = self.segmenter.method.at_times(mesh.vertices, mesh.faces, times)
        return len(mesh.vertices), len(mesh.faces), dict(zip(times, labels, strict=True))

    def measure(self, prepared: tuple[int, int, Mapping[float, np.ndarray]]) -> dict[str, Any]:
        """Count the segments, and compare with those at the reference time."""
        n_vertices, n_faces, labels = prepared
        reference, at_level = labels[REFERENCE_TIME], labels[self.level]
        sizes = np.unique(at_level, return_counts=True)[1]
        return {
            "n_vertices": n_vertices,
            "n_faces": n_faces,
            "n_compared": n_vertices,
            "n_segments_reference": len(np.unique(reference)),
            "n_segments": len(sizes),
            "n_large_segments": int((sizes >= LARGE_SHARE * n_vertices).sum()),
            **metrics.compare(Comparison(reference, at_level)),
        }


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
    """

    times: Mapping[str, Any]
    intervals: Sequence[tuple[float, float]] = ()
    models_drawn: int | None = None
    seed: int = 0
    plate: Mapping[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._all_times()
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
    )
    notes: ClassVar[str] = (
        "Share of models whose number of segments is the same at every time tried in the interval, in percent, with "
        "its 95 % bootstrap interval over models; and whose largest and smallest numbers differ by at most one. "
        "Large: segments of at least 1 % of the vertices. Coarse: only at the interval's ends and at time 1."
    )

    def plan(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> list[Trial]:
        """One trial per model, segmenter and time."""
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
        records = [
            dict(zip(keys, key, strict=True)) | record
            for key, group in groups
            for low, high in self._pairs()
            for record in _unchanged(group, low, high)
        ]
        columns = (
            SEGMENTER,
            Column(name="low", shown=False, help="First time of the interval."),
            Column(name="high", shown=False, help="Last time of the interval."),
            Column(name="interval", heading="times", template="{low:g} – {high:g}", help="Interval of times."),
            Column(name="counted", dtype="string", heading="segments counted", help="Which segments are counted."),
            Column(name="times", dtype="int64", heading="times tried", compact=False,
                   help="Times within the interval."),
            Column(name="unchanged", heading="unchanged %", format=".1f", lower_is_better=False,
                   help="Share of models with the same number of segments at every time."),
            Column(name="bounds", heading="95 % interval", template="{ci_low:.1f} – {ci_high:.1f}",
                   help="95 % bootstrap interval over models."),
            PUBLISHED,
            Column(name="within_one", heading="within ±1 %", format=".1f", lower_is_better=False, compact=False,
                   help="Share of models whose numbers of segments differ by at most one."),
            MODELS,
            FAILURES,
        )  # fmt: skip
        return [
            Table("table", frame_of(records), columns, notes=self.notes, value="unchanged"),
            Table("by_time", summary(rows), columns_by_level(rows), value="mean"),
        ]

    def charts(self, study: str, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, Chart]:
        """The number of segments over time, and how much it varies within the intervals."""
        from studies.figures import charts

        return {study: charts.segment_counts(rows[rows["status"] == "ok"], self._pairs(), title)}

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


def _unchanged(rows: pd.DataFrame, low: float, high: float) -> Iterator[dict[str, Any]]:
    """The shares of models that keep their number of segments from ``low`` to ``high``, by each way of counting."""
    import pandas as pd

    good = rows[(rows["status"] == "ok") & rows["level"].between(low, high)]
    failed = rows.loc[rows["status"] != "ok", "model"].nunique()
    coarse = good[good["level"].isin([low, REFERENCE_TIME, high])]
    for counted, column, kept in (
        ("all", "n_segments", good),
        ("all, coarse", "n_segments", coarse),
        ("large", "n_large_segments", good),
        ("large, coarse", "n_large_segments", coarse),
    ):
        numbers = kept.groupby("model")[column]
        spread = numbers.max() - numbers.min()
        same = pd.DataFrame({"model": spread.index, "same": 100.0 * (spread == 0).to_numpy(dtype=float)})
        ci_low, ci_high = interval_of_mean(same, "same")
        yield {
            "low": low,
            "high": high,
            "counted": counted,
            "times": kept["level"].nunique(),
            "unchanged": same["same"].mean(),
            "ci_low": ci_low,
            "ci_high": ci_high,
            "within_one": 100.0 * (spread <= 1).astype(float).mean(),
            "n": len(same),
            "failures": failed,
        }
