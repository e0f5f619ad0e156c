"""How far a segmentation is from people's (paper, section 6.1, Table 1)."""

import math
import time
from dataclasses import dataclass
from itertools import combinations
from typing import ClassVar

import numpy as np

from heatwalk import faces_from_vertices
from studies.experiments.experiment import Claim, Experiment
from studies.metrics import psb
from studies.planning.plan import digest, identity
from studies.planning.trial import Trial
from studies.segmenters import Segmenter
from studies.statistics import tables

# The columns of Table 1, as the benchmark's evaluator calls them -> as the paper heads them.
METRICS = {
    "cut_discrepancy": "CD",
    "rand_index_error": "RI",
    "hamming": "HD",
    "gce": "GCE",
    "lce": "LCE",
}

PEOPLE = "Humans"


@dataclass(frozen=True, kw_only=True)
class BenchmarkTrial(Trial):
    """The segmentation of one model against those of every person, or every person's against the others'.

    segmenter : studies.segmenters.Segmenter; None for the people
    """

    segmenter: Segmenter | None

    def prepare(self):
        """The mesh and people's segmentations of its faces."""
        people = self.model.human_segmentations()
        if len(people) < 2:
            raise ValueError(f"model {self.model.name} has {len(people)} segmentations by people; two are needed")
        return self.model.load(), people

    def measure(self, prepared):
        mesh, people = prepared
        found = {"n_vertices": len(mesh.vertices), "n_faces": len(mesh.faces), "n_people": len(people)}
        if self.segmenter is None:
            # Each pair once: what is shown of the metrics does not depend on which of the two is judged.
            scores = [psb.evaluate(mesh, a, b) for a, b in combinations(people, 2)]
            found["n_segments"] = round(np.mean([len(np.unique(labels)) for labels in people]))
        else:
            start = time.perf_counter()
            labels = self.segmenter(mesh.vertices, mesh.faces)
            found["seconds_segment"] = time.perf_counter() - start
            found["n_segments"] = len(np.unique(labels))
            of_faces = faces_from_vertices(labels, mesh.faces)
            scores = [psb.evaluate(mesh, of_faces, person) for person in people]
        return found | {name: float(np.mean([score[name] for score in scores])) for name in scores[0]}


class Benchmark(Experiment):
    """The Princeton benchmark's metrics, per model over its people, then over models."""

    columns: ClassVar[dict[str, str]] = {
        "cut_discrepancy": "float64",
        "hamming": "float64",
        "missing_rate": "float64",
        "false_alarm_rate": "float64",
        "gce": "float64",
        "lce": "float64",
        "gce_area": "float64",
        "lce_area": "float64",
        "n_people": "Int64",
    }
    headings: ClassVar[dict[str, str]] = {
        "method": "method",
        "source": "source",
        **METRICS,
        "n": "models",
        "failures": "failed",
    }
    notes = (
        "Mean over models of the mean over people's segmentations, and its 95 % bootstrap interval over models. CD: "
        "cut discrepancy; RI: Rand Index error; HD: Hamming distance; GCE, LCE: global and local consistency error "
        "(Chen et al. 2009); 0 is agreement. Humans: each person against the others. Paper: Benjamin et al. 2011, "
        "Table 1."
    )

    def narrow(self, table):
        return ("method", "source", *(f"{metric}_alone" for metric in METRICS), "n", "failures")

    def claims(self, tables, cfg):
        table = tables["table"].set_index(["source", "method"])
        return [
            Claim(f"Table 1, {method}: {metric.replace('_', ' ')}", table.loc[("paper", method), metric],
                  *table.loc[("computed", method), [metric, f"{metric}_low", f"{metric}_high"]], digits=3)
            for method in table.loc["computed"].index
            if ("paper", method) in table.index
            for metric in METRICS
        ]  # fmt: skip

    def plan(self, cfg, dataset, segmenter):
        trials = []
        for model in dataset.models():
            mesh = identity(model)
            for judged in (segmenter, None):
                trials.append(
                    BenchmarkTrial(
                        study=cfg.study.name,
                        dataset=dataset.name,
                        part=cfg.study.name,
                        model=model,
                        mesh_digest=mesh[1],
                        segmenter=judged,
                        segmenter_name=judged.name if judged else PEOPLE,
                        group_key=digest(mesh),
                        trial_id=digest("benchmark", mesh, model.people_digest(), judged and judged.identity)[:24],
                    )
                )
        return trials

    def tables(self, rows, cfg):
        import pandas as pd

        found = [
            {"method": name, "source": "computed"} | _scores(group)
            for name, group in rows.groupby("segmenter", sort=False)
        ]
        paper = [{"method": name, "source": "paper"} | dict(scores) for name, scores in cfg.paper.items()]
        made = {"table": pd.DataFrame([*found, *paper])}
        if rows["category"].nunique() > 1:
            made["by_category"] = pd.DataFrame(
                {"method": name, "category": category} | _scores(group)
                for (name, category), group in rows.groupby(["segmenter", "category"], sort=False)
            )
        return made

    def display(self, table):
        return [
            {
                "method": row["method"],
                "source": row["source"],
                **{metric: _with_interval(row, metric) for metric in METRICS},
                **{f"{metric}_alone": f"{row[metric]:.3f}" for metric in METRICS},
                "n": tables.number(row["n"], 0),
                "failures": tables.number(row["failures"], 0),
            }
            for _, row in table.iterrows()
        ]

    def curves(self, rows, tables, cfg, title):
        from studies.figures import curves as figures

        return {cfg.study.name: figures.methods(tables["table"], METRICS, title)}


def _with_interval(row, metric):
    low, high = row[f"{metric}_low"], row[f"{metric}_high"]
    return f"{row[metric]:.3f}" + ("" if math.isnan(low) else f" ({low:.3f} – {high:.3f})")


def _scores(rows):
    """Mean and interval of every metric over models, and how many there are."""
    good = rows[rows["status"] == "ok"]
    found = {}
    for metric in METRICS:
        low, high = tables.interval(good, metric)
        found |= {metric: good[metric].mean(), f"{metric}_low": low, f"{metric}_high": high}
    return found | {"n": len(good), "failures": len(rows) - len(good)}
