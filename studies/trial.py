"""One trial: perturb a mesh, segment it, compare it with the segmentation of the original; one row."""

import json
import time
from dataclasses import dataclass

import numpy as np
import trimesh

from studies.metrics import change_percentage, rand_index_error, van_dongen

# The columns of a row, in the order in which they stand in trials.parquet, with their types.
COLUMNS = {
    "study": "string",
    "dataset": "string",
    "model": "string",
    "category": "string",
    "segmenter": "string",
    "perturbation": "string",
    "level": "float64",
    "unit": "string",
    "repeat": "int64",
    "seed": "int64",
    "n_vertices": "Int64",
    "n_faces": "Int64",
    "n_vertices_perturbed": "Int64",
    "n_faces_perturbed": "Int64",
    "n_compared": "Int64",  # vertices of the original that have a counterpart
    "n_segments_reference": "Int64",
    "n_segments": "Int64",
    "change_percentage": "float64",
    "van_dongen": "float64",
    "rand_index_error": "float64",
    "seconds_perturb": "float64",
    "seconds_segment": "float64",
    "status": "string",  # ok | failed | timeout | crashed
    "error": "string",
    "applied": "string",  # JSON: what the perturbation says it did
    "trial_id": "string",
}


@dataclass(frozen=True)
class Reference:
    """A model's own mesh and its segmentation."""

    mesh: trimesh.Trimesh
    labels: np.ndarray


@dataclass(frozen=True)
class Variant:
    """A perturbed mesh and its segmentation, beside the reference."""

    reference: Reference
    mesh: trimesh.Trimesh
    labels: np.ndarray
    counterpart: np.ndarray
    applied: dict
    seconds_perturb: float
    seconds_segment: float

    def compared(self):
        """Labels of the reference and of the variant at the vertices of the original that still exist."""
        kept = self.counterpart >= 0
        return self.reference.labels[kept], self.labels[self.counterpart[kept]]


# The last reference made in this process: a worker gets the trials of one model one after the other.
_last_reference = {}


def reference(trial):
    """The segmentation of the trial's unperturbed mesh."""
    key = (trial.mesh, trial.segmenter_id)
    if key not in _last_reference:
        _last_reference.clear()
        loaded = trial.model.load()
        mesh = trimesh.Trimesh(loaded.vertices, loaded.faces, process=False)
        _last_reference[key] = Reference(mesh, _segment(trial, mesh))
    return _last_reference[key]


def variant(trial):
    """Perturb and segment: the trial's geometry."""
    original = reference(trial)
    start = time.perf_counter()
    perturbed = trial.perturbation(original.mesh, np.random.default_rng(trial.seed))
    middle = time.perf_counter()
    labels = _segment(trial, perturbed.mesh)
    end = time.perf_counter()
    return Variant(
        original, perturbed.mesh, labels, perturbed.counterpart, perturbed.applied, middle - start, end - middle
    )


def run(trial):
    """The trial's row: a dict with the keys of ``COLUMNS``. Whatever a trial raises becomes its row."""
    try:
        outcome = variant(trial)
        before, after = outcome.compared()
        return empty_row(trial) | {
            "n_vertices": len(outcome.reference.mesh.vertices),
            "n_faces": len(outcome.reference.mesh.faces),
            "n_vertices_perturbed": len(outcome.mesh.vertices),
            "n_faces_perturbed": len(outcome.mesh.faces),
            "n_compared": len(before),
            "n_segments_reference": len(np.unique(outcome.reference.labels)),
            "n_segments": len(np.unique(outcome.labels)),
            "change_percentage": change_percentage(before, after),
            "van_dongen": van_dongen(before, after),
            "rand_index_error": rand_index_error(before, after),
            "seconds_perturb": outcome.seconds_perturb,
            "seconds_segment": outcome.seconds_segment,
            "status": "ok",
            "applied": json.dumps(outcome.applied),
        }
    except Exception as error:
        return failed_row(trial, "failed", f"{type(error).__name__}: {error}")


def empty_row(trial):
    """What is known of a trial before it is run."""
    return dict.fromkeys(COLUMNS) | {
        "study": trial.study,
        "dataset": trial.dataset,
        "model": trial.model.name,
        "category": trial.model.category,
        "segmenter": trial.segmenter_name,
        "perturbation": trial.perturbation_name,
        "level": trial.level,
        "unit": trial.unit,
        "repeat": trial.repeat,
        "seed": trial.seed,
        "trial_id": trial.trial_id,
    }


def failed_row(trial, status, error):
    """The row of a trial that gave no labels."""
    return empty_row(trial) | {"status": status, "error": " ".join(error.split())}


def _segment(trial, mesh):
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    labels = np.asarray(trial.segmenter(vertices, faces))
    if labels.shape != (len(vertices),) or not np.issubdtype(labels.dtype, np.integer):
        raise ValueError(
            f"{trial.segmenter_name} gave labels of shape {labels.shape} and type {labels.dtype} "
            f"for {len(vertices)} vertices; a segmenter gives one integer a vertex"
        )
    return labels
