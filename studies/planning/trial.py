"""What a trial is: the least thing that is planned, run and stored; one row."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from studies.datasets import Model

# The columns of a row, in the order in which they stand in trials.parquet, with their types. An experiment may put
# columns of its own behind them.
COLUMNS = {
    "study": "string",
    "dataset": "string",
    "model": "string",
    "category": "string",
    "segmenter": "string",
    "part": "string",  # the part of the study; the study itself where it has one part
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

# Timings: the columns in which two runs of the same trial may differ.
TIMINGS = ("seconds_perturb", "seconds_segment")


@dataclass(frozen=True, kw_only=True)
class Trial(ABC):
    """One measurement on one model: everything a worker needs, and small to send.

    study, dataset, part : names
    model : studies.datasets.Model, which loads its mesh when asked
    mesh : str, the model's digest
    segmenter_name : str
    perturbation_name : str, "" where nothing is perturbed
    level : float, the amount in ``unit``
    repeat : int, 0 …
    seed : int, of the trial's own random generator
    shares : str; trials of the same value, planned one after the other, share what ``prepare`` gives
    trial_id : str, what determines the trial's result
    """

    study: str
    dataset: str
    part: str
    model: Model
    mesh: str
    segmenter_name: str
    perturbation_name: str = ""
    level: float = 0.0
    unit: str = ""
    repeat: int = 0
    seed: int = 0
    shares: str
    trial_id: str

    def known(self):
        """The experiment's own columns that are known before the trial is run: a dict."""
        return {}

    @abstractmethod
    def prepare(self):
        """What this trial needs and others share, such as the segmentation of the original."""

    @abstractmethod
    def measure(self, prepared):
        """The columns of the row that only running the trial tells: a dict."""


def run(trial, prepared):
    """The trial's row: a dict. Whatever a trial raises becomes its row."""
    try:
        return empty_row(trial) | trial.measure(prepared) | {"status": "ok"}
    except Exception as error:
        return failed_row(trial, "failed", reason(error))


def empty_row(trial):
    """What is known of a trial before it is run."""
    return dict.fromkeys(COLUMNS) | {
        "study": trial.study,
        "dataset": trial.dataset,
        "model": trial.model.name,
        "category": trial.model.category,
        "segmenter": trial.segmenter_name,
        "part": trial.part,
        "perturbation": trial.perturbation_name,
        "level": trial.level,
        "unit": trial.unit,
        "repeat": trial.repeat,
        "seed": trial.seed,
        "trial_id": trial.trial_id,
        **trial.known(),
    }


def failed_row(trial, status, error):
    """The row of a trial that gave no figure."""
    return empty_row(trial) | {"status": status, "error": error}


def reason(error):
    """An exception as one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())
