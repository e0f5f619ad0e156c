"""What happens inside the Heat Walk (paper, sections 3 to 5, Figures 1 to 4) and what it makes of shapes (Figure 5)."""

import math
import time
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import trimesh

from studies.execution import map_ordered
from studies.experiments.experiment import Claim, Experiment
from studies.figures import plates
from studies.planning.plan import StudyError, digest, identity
from studies.planning.trial import Trial
from studies.segmenters import Segmenter
from studies.statistics import tables

# After how many steps of the walk the share of settled points is kept.
STEPS = (1, 2, 3)


@dataclass(frozen=True, kw_only=True)
class AnatomyTrial(Trial):
    """One model and its walk.

    segmenter : studies.segmenters.Segmenter, of a Heat Walk
    """

    segmenter: Segmenter

    def prepare(self):
        """The mesh."""
        return self.model.load()

    def measure(self, mesh):
        start = time.perf_counter()
        segmentation = self.segmenter.method.segmentation(mesh.vertices, mesh.faces)
        seconds = time.perf_counter() - start
        settled = plates.settled_shares(segmentation.walk)
        return {
            "n_vertices": len(mesh.vertices),
            "n_faces": len(mesh.faces),
            "n_segments": segmentation.n_segments,
            "n_steps": len(settled) - 1,
            **{f"settled_{step}": float(settled[min(step, len(settled) - 1)]) for step in STEPS},
            "dissipating": float(segmentation.dissipates.mean()),
            "seconds_segment": seconds,
        }


class Anatomy(Experiment):
    """The walk of every model: its steps, its dissipators; and the figures that show them."""

    columns: ClassVar[dict[str, str]] = {
        "n_steps": "Int64",
        **{f"settled_{step}": "float64" for step in STEPS},
        "dissipating": "float64",
    }
    headings: ClassVar[dict[str, str]] = {
        "what": "mean over models",
        "mean": "value",
        "interval": "95 % interval",
        "lowest": "lowest",
        "highest": "highest",
        "paper": "paper",
        "n": "models",
        "failures": "failed",
    }
    notes = (
        "Settled: the share of points that after so many steps of the walk stand at their final exemplar, in percent. "
        "Dissipating: the share of points in the dissipator region. Intervals: bootstrap over models."
    )

    def narrow(self, table):
        return ("what", "mean", "interval", "paper", "n")

    def claims(self, tables, cfg):
        return [
            Claim(f"Figure 3: {row.what}", row.paper, row.mean, row.ci_low, row.ci_high, " %", 1, higher_is_better=True)
            for row in tables["table"].itertuples()
            if not math.isnan(row.paper)
        ]

    def plan(self, cfg, dataset, segmenter):
        if not hasattr(segmenter.method, "segmentation"):
            raise StudyError(f"the study {cfg.study.name} looks inside the Heat Walk, which {segmenter.name} is not")
        trials = []
        for model in dataset.models():
            mesh = identity(model)
            trials.append(
                AnatomyTrial(
                    study=cfg.study.name,
                    dataset=dataset.name,
                    part=cfg.study.name,
                    model=model,
                    mesh_digest=mesh[1],
                    segmenter=segmenter,
                    segmenter_name=segmenter.name,
                    group_key=digest(mesh),
                    trial_id=digest("anatomy", mesh, *segmenter.identity)[:24],
                )
            )
        return trials

    def tables(self, rows, cfg):
        import pandas as pd

        good = rows[rows["status"] == "ok"]
        measured = {
            "steps of the walk": good["n_steps"].astype(float),
            **{f"settled after step {step}, %": 100 * good[f"settled_{step}"] for step in STEPS},
            "dissipating, %": 100 * good["dissipating"],
            "segments": good["n_segments"].astype(float),
        }
        found = []
        for what, values in measured.items():
            low, high = tables.interval(pd.DataFrame({"model": good["model"], "value": values}), "value")
            found.append(
                {
                    "what": what,
                    "mean": values.mean(),
                    "ci_low": low,
                    "ci_high": high,
                    "lowest": values.min(),
                    "highest": values.max(),
                    "paper": cfg.paper.get(what, np.nan),
                    "n": len(good),
                    "failures": len(rows) - len(good),
                }
            )
        return {"table": pd.DataFrame(found)}

    def display(self, table):
        return [
            {
                "what": row.what,
                "mean": tables.number(row.mean, 1),
                "interval": tables.interval_text(row.ci_low, row.ci_high, 1),
                "lowest": tables.number(row.lowest, 1),
                "highest": tables.number(row.highest, 1),
                "paper": tables.number(row.paper, 1),
                "n": str(row.n),
                "failures": str(row.failures),
            }
            for row in table.itertuples()
        ]

    def surfaces(self, trials, rows, cfg, title, engine):
        """The study's ``plates``: file stem -> which of ``PLATES``, and the models that it shows."""
        good = set(rows.loc[rows["status"] == "ok", "model"])
        by_name = {trial.model.name: trial for trial in trials if trial.model.name in good}
        for stem, plate in cfg.plates.items():
            if plate.shows not in PLATES:
                raise StudyError(f"plates.{stem}.shows is {plate.shows!r}: choose one of {', '.join(PLATES)}")
            names = _shown(plate.models, by_name)
            if names:
                shows = " ".join([plate.shows, *(by_name[name].trial_id for name in names)])
                yield (
                    stem,
                    shows,
                    lambda plate=plate, names=names: map_ordered(
                        engine, _draw, [(plate.shows, [by_name[name] for name in names])]
                    )[0],
                )


def _shown(models, by_name):
    """The models of a plate: those named that are there; else the first; ``each_category``: the first of each."""
    if models == "each_category":
        return list({trial.model.category: name for name, trial in reversed(by_name.items())}.values())[::-1]
    named = [str(name) for name in models or () if str(name) in by_name]
    return named or list(by_name)[:1]


def _draw(task):
    """The figure of a plate: in a worker, since drawing off screen can take a process down."""
    shows, trials = task
    drawn = []
    for trial in trials:
        loaded = trial.prepare()
        mesh = trimesh.Trimesh(loaded.vertices, loaded.faces, process=False)
        drawn.append((trial, mesh, trial.segmenter.method.segmentation(mesh.vertices, mesh.faces)))
    return PLATES[shows](drawn)


def _showcase(drawn):
    categories = [trial.model.category for trial, *_ in drawn]
    by_category = all(categories) and len(set(categories)) == len(categories)
    items = [
        (mesh, plates.segments(seg), trial.model.category if by_category else trial.model.name)
        for trial, mesh, seg in drawn
    ]
    return plates.showcase(items)[0]


PLATES = {
    "pipeline": lambda drawn: plates.pipeline(*drawn[0][1:])[0],
    "diffusion": lambda drawn: plates.diffusion(*drawn[0][1:])[0],
    "walk": lambda drawn: plates.walk(*drawn[0][1:])[0],
    "divergences": lambda drawn: plates.divergences(*drawn[0][1:])[0],
    "showcase": _showcase,
}
