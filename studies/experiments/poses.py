"""How far a segmentation moves from pose to pose (paper, section 6.2, Figures 6 and 7, which show pictures alone)."""

import time
from dataclasses import dataclass
from itertools import combinations, groupby
from typing import ClassVar

import numpy as np
import trimesh

from studies.datasets import Model
from studies.execution import map_ordered
from studies.experiments.experiment import Claim, Experiment
from studies.metrics import change_percentage, rand_index_error, van_dongen
from studies.planning.plan import StudyError, digest, identity
from studies.planning.trial import Trial, reason
from studies.segmenters import Segmenter
from studies.statistics import tables


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
    """Two poses of a shape, each segmented on its own.

    other : the model of the second pose
    poses : every pose of the shape
    segmenter : studies.segmenters.Segmenter
    """

    other: Model
    poses: tuple[Model, ...]
    segmenter: Segmenter

    def known_values(self):
        return {"other": self.other.name}

    def prepare(self):
        """Every pose of the shape: dict, name -> Pose, or the reason why there is none."""
        found = {}
        for model in self.poses:
            try:
                found[model.name] = self._segment(model)
            except Exception as error:
                found[model.name] = reason(error)
        return found

    def _segment(self, model):
        mesh = model.load()
        start = time.perf_counter()
        labels = self.segmenter(mesh.vertices, mesh.faces)
        seconds = time.perf_counter() - start
        return Pose(
            labels[model.correspondence()], len(mesh.vertices), len(mesh.faces), len(np.unique(labels)), seconds
        )

    def measure(self, poses):
        a, b = poses[self.model.name], poses[self.other.name]
        for model, pose in ((self.model, a), (self.other, b)):
            if isinstance(pose, str):
                raise ValueError(f"pose {model.name}: {pose}")
        return {
            "n_vertices": a.n_vertices,
            "n_faces": a.n_faces,
            "n_vertices_perturbed": b.n_vertices,
            "n_faces_perturbed": b.n_faces,
            "n_compared": len(a.labels),
            "n_segments_reference": a.n_segments,
            "n_segments": b.n_segments,
            "change_percentage": change_percentage(a.labels, b.labels),
            "van_dongen": van_dongen(a.labels, b.labels),
            "rand_index_error": rand_index_error(a.labels, b.labels),
            "seconds_segment": b.seconds,
        }


class Poses(Experiment):
    """Change Percentage between all pairs of poses of a shape; a shape is a category of the dataset."""

    columns: ClassVar[dict[str, str]] = {"other": "string"}
    headings: ClassVar[dict[str, str]] = {
        "shape": "shape",
        "poses": "poses",
        "pairs": "pairs",
        "mean": "CP %",
        "interval": "95 % interval",
        "median": "median",
        "largest": "largest",
        "van_dongen": "van Dongen",
        "segments": "segments",
        "failures": "failed",
    }
    notes = (
        "Every pose is segmented on its own; Change Percentage (CP, twice the share of points that must change their "
        "segment, in percent) between all pairs of poses of a shape, at the points that the dataset says are the same"
        " (TOSCA's lists at 5,000 vertices name some vertices more than once and some never). 95 % bootstrap interval"
        " of the mean: poses resampled. The paper shows pictures and gives no figures. Segments: their smallest and "
        "largest number over the poses."
    )

    def narrow(self, table):
        return ("shape", "poses", "pairs", "mean", "interval", "median", "largest", "failures")

    def claims(self, tables, cfg):
        row = tables["table"].iloc[-1]
        what = f"Between all pairs of poses, {row['shape']} shapes" if row["shape"] == "all" else row["shape"]
        return [Claim(what, np.nan, row["mean"], row["ci_low"], row["ci_high"], " %")]

    def plan(self, cfg, dataset, segmenter):
        trials = []
        models = sorted(dataset.models(), key=lambda model: model.category)
        for shape, group in groupby(models, key=lambda model: model.category):
            poses = tuple(group)
            meshes = {model.name: [*identity(model), model.correspondence_digest()] for model in poses}
            shares = digest(meshes, *segmenter.identity)
            for a, b in combinations(poses, 2):
                trials.append(
                    PoseTrial(
                        study=cfg.study.name,
                        dataset=dataset.name,
                        part=shape,
                        model=a,
                        mesh_digest=meshes[a.name][1],
                        other=b,
                        poses=poses,
                        segmenter=segmenter,
                        segmenter_name=segmenter.name,
                        perturbation_name="pose",
                        group_key=shares,
                        trial_id=digest("pose", meshes[a.name], meshes[b.name], *segmenter.identity)[:24],
                    )
                )
        if not trials:
            raise StudyError("no shape has two poses: a shape is a category of the dataset, such as a folder of files")
        return trials

    def tables(self, rows, cfg):
        import pandas as pd

        shapes = [_summary(shape, group) for shape, group in rows.groupby("part", sort=False)]
        if len(shapes) > 1:
            shapes.append(_summary("all", rows))
        return {"table": pd.DataFrame(shapes)}

    def display(self, table):
        return [
            {
                "shape": row.shape,
                "poses": str(row.poses),
                "pairs": str(row.pairs),
                "mean": tables.number(row.mean, 2),
                "interval": tables.interval_text(row.ci_low, row.ci_high, 2),
                "median": tables.number(row.median, 2),
                "largest": tables.number(row.largest, 1),
                "van_dongen": tables.number(row.van_dongen, 2),
                "segments": f"{tables.number(row.fewest_segments, 0)} – {tables.number(row.most_segments, 0)}",
                "failures": str(row.failures),
            }
            for row in table.itertuples(index=False)
        ]

    def curves(self, rows, tables, cfg, title):
        from studies.figures import curves as figures

        return {cfg.study.name: figures.matrix(matrices(rows), title)}

    def surfaces(self, trials, rows, cfg, title, engine):
        """Each of the study's ``plates``: some poses, a part in the colour that it has in the first of its shape."""
        there = {model.name: trial for trial in trials for model in trial.poses}
        for stem, plate in cfg.plates.items():
            poses = [str(name) for name in plate.models if str(name) in there]
            shown = [(there[name], name) for name in poses or list(there)[: cfg.gallery.columns]]
            shows = " ".join(f"{name} {trial.group_key}" for trial, name in shown)
            yield stem, shows, lambda shown=shown, plate=plate: map_ordered(engine, _draw, [(shown, plate.upright)])[0]


def _draw(task):
    """Some poses side by side: a matplotlib Figure."""
    from studies.figures import plates
    from studies.figures.surfaces import named_as

    shown, upright = task
    items, first = [], {}
    for trial, name in shown:
        model = next(model for model in trial.poses if model.name == name)
        loaded = model.load()
        mesh = trimesh.Trimesh(loaded.vertices, loaded.faces, process=False)
        labels = trial.segmenter(mesh.vertices, mesh.faces)
        here = labels[model.correspondence()]
        before = first.setdefault(trial.part, here)
        items.append((mesh, named_as(before, here, labels), name))
    return plates.showcase(items, upright=upright)[0]


def matrices(rows):
    """Change Percentage between the poses of each shape: dict, shape -> symmetric DataFrame, NaN where it failed."""
    import pandas as pd

    found = {}
    for shape, group in rows.groupby("part", sort=False):
        good = group[group["status"] == "ok"]
        names = list(dict.fromkeys([*good["model"], *good["other"]]))
        half = good.pivot(index="model", columns="other", values="change_percentage").reindex(
            index=names, columns=names
        )
        values = half.to_numpy(dtype=float)
        values = np.where(np.isnan(values), values.T, values)
        np.fill_diagonal(values, 0)
        found[shape] = pd.DataFrame(values, index=names, columns=names)
    return found


def _summary(shape, rows):
    import pandas as pd

    good = rows[rows["status"] == "ok"]
    low, high = pose_interval(list(matrices(good).values()))
    segments = pd.concat([good["n_segments"], good["n_segments_reference"]])
    return {
        "shape": shape,
        "poses": len(set(good["model"]) | set(good["other"])),
        "pairs": len(good),
        "mean": good["change_percentage"].mean(),
        "ci_low": low,
        "ci_high": high,
        "median": good["change_percentage"].median(),
        "largest": good["change_percentage"].max(),
        "van_dongen": good["van_dongen"].mean(),
        "fewest_segments": segments.min(),
        "most_segments": segments.max(),
        "failures": len(rows) - len(good),
    }


def pose_interval(matrices):
    """95 % percentile-bootstrap interval of the mean over pairs of poses, by drawing poses.

    The pairs of one pose go together, so it is the poses that are the sample. A pose drawn twice makes no pair with
    itself.

    matrices : list of square DataFrames, a shape each
    """
    if not matrices or max(map(len, matrices)) < 3:
        return np.nan, np.nan
    rng = np.random.default_rng(0)
    totals, counts = np.zeros(tables.RESAMPLES), np.zeros(tables.RESAMPLES)
    for matrix in matrices:
        values = matrix.to_numpy()
        n = len(values)
        there = ~np.isnan(values) & ~np.eye(n, dtype=bool)
        weight = rng.multinomial(n, np.full(n, 1 / n), size=tables.RESAMPLES).astype(float)
        totals += np.einsum("ri,ij,rj->r", weight, np.where(there, values, 0), weight)
        counts += np.einsum("ri,ij,rj->r", weight, there.astype(float), weight)
    means = totals[counts > 0] / counts[counts > 0]
    return tuple(np.quantile(means, [0.025, 0.975]).tolist())
