"""What a trial is: the least thing that is planned, run and stored; one row."""

from abc import ABC, abstractmethod
from dataclasses import dataclass

from studies.columns import Column
from studies.datasets import Model

# The columns of a row, in the order in which they stand in trials.parquet, with their types. An experiment may put
# columns of its own behind them.
COLUMNS: tuple[Column, ...] = (
    Column(name="study", dtype="string"),
    Column(name="dataset", dtype="string"),
    Column(name="model", dtype="string"),
    Column(name="category", dtype="string"),
    Column(name="segmenter", dtype="string"),
    Column(name="part", dtype="string"),
    Column(name="perturbation", dtype="string"),
    Column(name="level", dtype="float64"),
    Column(name="unit", dtype="string"),
    Column(name="repeat", dtype="int64"),
    Column(name="seed", dtype="int64"),
    Column(name="n_vertices", dtype="Int64"),
    Column(name="n_faces", dtype="Int64"),
    Column(name="n_vertices_perturbed", dtype="Int64"),
    Column(name="n_faces_perturbed", dtype="Int64"),
    Column(name="n_compared", dtype="Int64"),
    Column(name="n_segments_reference", dtype="Int64"),
    Column(name="n_segments", dtype="Int64"),
    Column(name="change_percentage", dtype="float64"),
    Column(name="van_dongen", dtype="float64"),
    Column(name="rand_index_error", dtype="float64"),
    Column(name="seconds_perturb", dtype="float64"),
    Column(name="seconds_segment", dtype="float64"),
    Column(name="status", dtype="string"),
    Column(name="error", dtype="string"),
    Column(name="applied", dtype="string"),
    Column(name="trial_id", dtype="string"),
)

# Timings: the columns in which two runs of the same trial may differ.
TIMINGS = ("seconds_perturb", "seconds_segment")


@dataclass(frozen=True, kw_only=True)
class Trial(ABC):
    """One measurement on one model: everything a worker needs, and small to send.

    study, dataset, part : names
    model : studies.datasets.Model, which loads its mesh when asked
    mesh_digest : str, the model's digest
    segmenter_name : str
    perturbation_name : str, "" where nothing is perturbed
    level : float, the amount in ``unit``
    repeat : int, 0 …
    seed : int, of the trial's own random generator
    group_key : str; trials of the same value, planned one after the other, share what ``prepare`` gives
    trial_id : str, what determines the trial's result
    """

    study: str
    dataset: str
    part: str
    model: Model
    mesh_digest: str
    segmenter_name: str
    perturbation_name: str = ""
    level: float = 0.0
    unit: str = ""
    repeat: int = 0
    seed: int = 0
    group_key: str
    trial_id: str

    def known_values(self):
        """The experiment's own columns that are known before the trial is run: a dict."""
        return {}

    @abstractmethod
    def prepare(self):
        """What this trial needs and others share, such as the segmentation of the original."""

    @abstractmethod
    def measure(self, prepared):
        """The columns of the row that only running the trial tells: a dict."""


def run_trial(trial, prepared):
    """The trial's row: a dict. Whatever a trial raises becomes its row."""
    try:
        return planned_row(trial) | trial.measure(prepared) | {"status": "ok"}
    except Exception as error:
        return failed_row(trial, "failed", reason(error))


def planned_row(trial):
    """What is known of a trial before it is run."""
    return dict.fromkeys(column.name for column in COLUMNS) | {
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
        **trial.known_values(),
    }


def failed_row(trial, status, error):
    """The row of a trial that gave no figure."""
    return planned_row(trial) | {"status": status, "error": error}


def reason(error):
    """An exception as one line."""
    return " ".join(f"{type(error).__name__}: {error}".split())


def columns_of(experiment):
    """The columns of an experiment's rows."""
    return (*COLUMNS, *(Column(name=name, dtype=dtype) for name, dtype in experiment.columns.items()))
