"""How the number of segments depends on the time that heat flows (paper, section 6.7, Figure 15)."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import trimesh

from studies.execution import map_ordered
from studies.experiments.experiment import Claim, Experiment
from studies.metrics import change_percentage, rand_index_error, van_dongen
from studies.planning.plan import StudyError, digest, identity, whole_number
from studies.planning.trial import Trial
from studies.segmenters import Segmenter
from studies.statistics import tables

# The time that the others are compared with: the paper's for all its other experiments.
USUAL_TIME = 1.0

# Segments of at least this share of the vertices are counted in ``n_large_segments``.
LARGE = 0.01


@dataclass(frozen=True, kw_only=True)
class TimeTrial(Trial):
    """One model at one time.

    times : every time of the study: one eigenproblem serves them all
    segmenter : studies.segmenters.Segmenter, of a Heat Walk
    """

    times: tuple[float, ...]
    segmenter: Segmenter

    def prepare(self):
        """The model's labels at every time and at the usual one."""
        mesh = self.model.load()
        times = sorted({*self.times, USUAL_TIME})
        labels = self.segmenter.method.at_times(mesh.vertices, mesh.faces, times)
        return len(mesh.vertices), len(mesh.faces), dict(zip(times, labels, strict=True))

    def measure(self, prepared):
        n_vertices, n_faces, labels = prepared
        usual, here = labels[USUAL_TIME], labels[self.level]
        sizes = np.unique(here, return_counts=True)[1]
        return {
            "n_vertices": n_vertices,
            "n_faces": n_faces,
            "n_compared": n_vertices,
            "n_segments_reference": len(np.unique(usual)),
            "n_segments": len(sizes),
            "n_large_segments": int((sizes >= LARGE * n_vertices).sum()),
            "change_percentage": change_percentage(usual, here),
            "van_dongen": van_dongen(usual, here),
            "rand_index_error": rand_index_error(usual, here),
        }


class Times(Experiment):
    """The number of segments over logarithmically spaced times, and how many models keep theirs over an interval."""

    columns: ClassVar[dict[str, str]] = {"n_large_segments": "Int64"}
    headings: ClassVar[dict[str, str]] = {
        "interval": "times",
        "counted": "segments counted",
        "times": "times tried",
        "unchanged": "unchanged %",
        "bounds": "95 % interval",
        "paper": "paper",
        "within_one": "within ±1 %",
        "n": "models",
        "failures": "failed",
    }
    notes = (
        "Share of models whose number of segments is the same at every time tried in the interval, in percent, with "
        "its 95 % bootstrap interval over models; and whose largest and smallest numbers differ by at most one. "
        "Large: segments of at least 1 % of the vertices. Coarse: at the interval's ends and at the time 1 alone. "
        "Paper: Benjamin et al. 2011, section 6.7, which does not say how times were spaced within an interval nor "
        "what was counted."
    )

    def narrow(self, table):
        return ("interval", "counted", "times", "unchanged", "bounds", "paper", "n", "failures")

    def claims(self, tables, cfg):
        return [
            Claim(
                f"Models whose number of segments does not change for times {row.low:g} to {row.high:g}",
                row.paper, row.unchanged, row.ci_low, row.ci_high, " %", digits=1, higher_is_better=True,
            )
            for row in tables["table"].itertuples()
            if row.counted == "all"
        ]  # fmt: skip

    def plan(self, cfg, dataset, segmenter):
        if not hasattr(segmenter.method, "at_times"):
            raise StudyError(f"the study {cfg.study.name} is about heat's time, which {segmenter.name} does not have")
        times = _times(cfg)
        models = dataset.models()
        if cfg.models_drawn is not None and whole_number("models_drawn", cfg.models_drawn) < len(models):
            drawn = np.random.default_rng(cfg.seed).choice(len(models), cfg.models_drawn, replace=False)
            models = [models[i] for i in sorted(drawn)]
        trials = []
        for model in models:
            mesh = identity(model)
            shares = digest(mesh, *segmenter.identity, times)
            trials += [
                TimeTrial(
                    study=cfg.study.name,
                    dataset=dataset.name,
                    part=cfg.study.name,
                    model=model,
                    mesh_digest=mesh[1],
                    times=times,
                    segmenter=segmenter,
                    segmenter_name=segmenter.name,
                    perturbation_name="time",
                    level=time,
                    unit=segmenter.method.time_unit,
                    group_key=shares,
                    trial_id=digest("time", mesh, time, *segmenter.identity)[:24],
                )
                for time in times
            ]
        return trials

    def tables(self, rows, cfg):
        import pandas as pd

        intervals = [(float(low), float(high), paper) for low, high, paper in cfg.intervals]
        return {
            "table": pd.DataFrame(
                summary | {"paper": paper} for low, high, paper in intervals for summary in _unchanged(rows, low, high)
            ),
            "by_time": tables.summary(rows, {cfg.study.name: {}}),
        }

    def display(self, table):
        return [
            {
                "interval": f"{row.low:g} – {row.high:g}",
                "counted": row.counted,
                "times": str(row.times),
                "unchanged": tables.number(row.unchanged, 1),
                "bounds": tables.interval_text(row.ci_low, row.ci_high, 1),
                "paper": tables.number(row.paper, 1),
                "within_one": tables.number(row.within_one, 1),
                "n": str(row.n),
                "failures": str(row.failures),
            }
            for row in table.itertuples()
        ]

    def surfaces(self, trials, rows, cfg, title, engine):
        """Figure 15: one model, the named or the first, at a few times."""
        first = {trial.model.name: trial for trial in reversed(trials)}
        named = [first[str(name)] for name in cfg.figure15.models if str(name) in first]
        shown = (named or [trials[0]])[0]
        times = list(cfg.figure15.times)
        shows = f"{shown.model.name} {shown.group_key} {times}"
        yield "figure15", shows, lambda: map_ordered(engine, _draw, [(shown, times)])[0]

    def curves(self, rows, tables, cfg, title):
        from studies.figures import curves as figures

        intervals = [(float(low), float(high)) for low, high, _ in cfg.intervals]
        return {cfg.study.name: figures.times(rows[rows["status"] == "ok"], intervals, title)}


def _draw(task):
    """One model at several times: a matplotlib Figure."""
    from studies.figures import plates

    trial, times = task
    loaded = trial.model.load()
    mesh = trimesh.Trimesh(loaded.vertices, loaded.faces, process=False)
    usual, *segmentations = trial.segmenter.method.segmentations(mesh.vertices, mesh.faces, [USUAL_TIME, *times])
    return plates.over_time(mesh, segmentations, usual)[0]


def _times(cfg):
    """The times of the study, and the ends of its intervals, ascending."""
    first, last, count = cfg.times.first, cfg.times.last, whole_number("times.count", cfg.times.count)
    if not 0 < first < last:
        raise StudyError(f"times.first={first} and times.last={last}: give two times with 0 < first < last")
    ends = [float(end) for low, high, _ in cfg.intervals for end in (low, high)]
    # Rounded, so that a time is the same number on every machine and in its row.
    return tuple(sorted({*np.geomspace(first, last, count).round(6).tolist(), *ends, USUAL_TIME}))


def _unchanged(rows, low, high):
    """The shares of models that keep their number of segments from ``low`` to ``high``, by each way of counting."""
    import pandas as pd

    good = rows[(rows["status"] == "ok") & rows["level"].between(low, high)]
    failed = int((rows.groupby("model")["status"].agg(lambda status: (status != "ok").any())).sum())
    coarse = good[good["level"].isin([low, USUAL_TIME, high])]
    for counted, column, kept in (
        ("all", "n_segments", good),
        ("all, coarse", "n_segments", coarse),
        ("large", "n_large_segments", good),
        ("large, coarse", "n_large_segments", coarse),
    ):
        numbers = kept.groupby("model")[column]
        spread = numbers.max() - numbers.min()
        same = pd.DataFrame({"model": spread.index, "same": 100.0 * (spread == 0).to_numpy(dtype=float)})
        ci_low, ci_high = tables.interval(same, "same")
        yield {
            "low": low,
            "high": high,
            "counted": counted,
            "times": kept["level"].nunique(),
            "unchanged": same["same"].mean(),
            "ci_low": ci_low,
            "ci_high": ci_high,
            "within_one": 100.0 * (spread <= 1).mean(),
            "n": len(same),
            "failures": failed,
        }
