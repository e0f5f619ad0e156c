"""A trial is the smallest unit that is planned, run and stored: one row."""

from __future__ import annotations

import json
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from studies.columns import Column
from studies.datasets import Model
from studies.execution.interruption import is_ctrl_c, reason, traceback_of

COLUMNS: tuple[Column, ...] = (
    Column(name="study", dtype="string", help="Name of the study."),
    Column(name="dataset", dtype="string", help="Name of the dataset."),
    Column(name="model", dtype="string", help="Name of the model in its dataset."),
    Column(name="category", dtype="string", help="Category of the model, empty if the dataset has none."),
    Column(name="segmenter", dtype="string", help="Segmentation method, with those of its options that are set."),
    Column(name="segmenter_options", dtype="string", help="All options of the segmentation method, as JSON."),
    Column(name="part", dtype="string", help="Part of the study; the study itself if it has a single part."),
    Column(name="perturbation", dtype="string", help="Name of the perturbation, empty if nothing is perturbed."),
    Column(name="level", format="g", help="Amount of the perturbation, in `unit`."),
    Column(name="unit", dtype="string", help="Unit of the level."),
    Column(name="repeat", dtype="int64", help="Number of the repeat, from 0."),
    Column(name="seed", dtype="int64", help="Seed of the trial's random generator."),
    Column(name="n_vertices", dtype="Int64", help="Vertices of the model."),
    Column(name="n_faces", dtype="Int64", help="Faces of the model."),
    Column(name="n_vertices_perturbed", dtype="Int64", help="Vertices of the perturbed mesh."),
    Column(name="n_faces_perturbed", dtype="Int64", help="Faces of the perturbed mesh."),
    Column(name="n_compared", dtype="Int64", help="Vertices of the model that have a counterpart."),
    Column(name="n_segments_reference", dtype="Int64", format=".1f", help="Segments of the model."),
    Column(name="n_segments", dtype="Int64", format=".1f", help="Segments of the perturbed mesh."),
    Column(name="seconds_perturb", unit="s", lower_is_better=True, help="Time that perturbing took."),
    Column(name="seconds_segment", unit="s", lower_is_better=True, help="Time that segmenting took."),
    Column(
        name="peak_memory",
        format=".1f",
        unit="MB",
        lower_is_better=True,
        help="Peak memory of segmenting, above what the process used before.",
    ),
    Column(name="status", dtype="string", help="ok, failed, timeout or crashed."),
    Column(name="error", dtype="string", help="Why the trial failed, in one line."),
    Column(name="traceback", dtype="string", help="Where the trial failed, as Python shows it."),
    Column(name="applied", dtype="string", help="What the perturbation did, as JSON."),
    Column(name="trial_id", dtype="string", help="Digest of everything that determines the result."),
)
"""The columns that every row has. An experiment adds those of what it measures."""

TIMINGS = ("seconds_perturb", "seconds_segment", "peak_memory")
"""The columns in which two runs of the same trial may differ: times, and the memory that is measured with them."""


@dataclass(frozen=True, kw_only=True)
class Trial(ABC):
    """One measurement on one model: everything that a worker needs, and cheap to send.

    Parameters
    ----------
    study, dataset, part : str
        names
    model : Model
        loads its mesh when asked
    mesh_digest : str
        the model's digest
    segmenter_name : str
    perturbation_name : str
        "" if nothing is perturbed
    level : float
        the amount in ``unit``
    repeat : int
        from 0
    seed : int
        seed of the trial's own random generator
    group_key : str
        trials with the same key, planned one after another, share what ``prepare`` returns
    trial_id : str
        digest of what determines the trial's result
    keep_labels : bool
        whether ``measure`` also returns the labels, for the pictures of the study
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
    keep_labels: bool = False

    def model_names(self) -> Sequence[str]:
        """The names of the models that the trial is about, those of other trials of its group too."""
        return (self.model.name,)

    def digest_of(self, name: str) -> str:
        """The digest of one of these models."""
        return self.mesh_digest

    def known_values(self) -> dict[str, Any]:
        """Values of the experiment's own columns that are known before the trial runs."""
        return {}

    @abstractmethod
    def prepare(self) -> Any:
        """What this trial needs and shares with others, such as the segmentation of the original."""

    @abstractmethod
    def measure(self, prepared: Any) -> dict[str, Any]:
        """Values of the columns that only running the trial can tell.

        A value that is a numpy array is not a column: it is kept in a file next to the rows, for pictures.
        """


def run_trial(trial: Trial, prepared: Any) -> dict[str, Any]:
    """The row of a trial. Whatever the trial raises becomes its row, but for the user's Ctrl-C."""
    try:
        return planned_row(trial) | _storable(trial.measure(prepared)) | {"status": "ok"}
    except BaseException as error:
        if is_ctrl_c(error):
            raise
        return failed_row(trial, "failed", reason(error), traceback_of(error))


def _storable(values: Mapping[str, Any]) -> dict[str, Any]:
    """Measured values as JSON represents them: plain numbers for those of NumPy.

    Raises
    ------
    TypeError
        If a value is neither an array nor one that JSON can represent.
    """
    plain = {name: value.item() if isinstance(value, np.generic) else value for name, value in values.items()}
    for name, value in plain.items():
        if not isinstance(value, np.ndarray):
            try:
                json.dumps(value)
            except (TypeError, ValueError, RecursionError) as error:
                raise TypeError(f"the value of {name} cannot be stored: {error}") from error
    return plain


def planned_row(trial: Trial) -> dict[str, Any]:
    """What is known of a trial before it runs, as a row with every base column."""
    return dict.fromkeys(column.name for column in COLUMNS) | {
        "study": trial.study,
        "dataset": trial.dataset,
        "model": trial.model.name,
        "category": trial.model.category,
        "segmenter": trial.segmenter_name,
        "segmenter_options": options_of(trial),
        "part": trial.part,
        "perturbation": trial.perturbation_name,
        "level": trial.level,
        "unit": trial.unit,
        "repeat": trial.repeat,
        "seed": trial.seed,
        "trial_id": trial.trial_id,
        **trial.known_values(),
    }


def options_of(trial: Trial) -> str | None:
    """The options of a trial's method as JSON; None if it has none, as the people of a benchmark."""
    options = getattr(getattr(trial, "segmenter", None), "options", None)
    return json.dumps(options, sort_keys=True) if isinstance(options, Mapping) else None


def failed_row(trial: Trial, status: str, error: str, traceback: str = "") -> dict[str, Any]:
    """The row of a trial without a result."""
    return planned_row(trial) | {"status": status, "error": error, "traceback": traceback or None}
