"""How much accuracy a segmentation loses when its mesh is perturbed, where there is ground truth for the original."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

import heatwalk
from studies.columns import Column, Table
from studies.metrics import psb
from studies.statistics.bootstrap import interval_of_mean, model_mean

if TYPE_CHECKING:
    import pandas as pd
    import trimesh

    from studies.datasets import Model

TRUTH, LOSS = "truth", "loss"  # prefixes of the columns

_MEASURED = tuple(column for column in psb.COLUMNS if column.name in psb.MAIN)

COLUMNS: tuple[Column, ...] = (
    *(
        dataclasses.replace(
            column,
            name=f"{TRUTH}_{column.name}",
            compact=False,
            help=f"Of the variant against the ground truth, mean over people. {column.help}",
        )
        for column in _MEASURED
    ),
    *(
        dataclasses.replace(
            column,
            name=f"{LOSS}_{column.name}",
            heading=f"{column.title} loss",
            format="z.4f",  # no minus before what rounds to 0
            compact=False,
            help=f"{column.title} of the variant minus {column.title} of the original.",
        )
        for column in _MEASURED
    ),
)
"""The columns of the rows of a study of change, missing for a model without ground truth."""

N_TRUTH = Column(
    name="n", dtype="int64", heading="n", format=".0f", help="Trials that succeeded and have ground truth."
)

NOTES = (
    "The benchmark's metrics (Chen et al. 2009) of the variants against the ground truth of the originals, mean over "
    "people, repeats and models; 0 is agreement. Labels of a variant are taken back to the vertices of the original, "
    "and compared on its faces whose three vertices still exist. Loss: by how much the variant is worse than the "
    "original on the same faces, with its 95 % bootstrap interval; below 0 where it is better."
)


class GroundTruth:
    """The ground truth of a model, and how far the segmentation of its own mesh is from it.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        the original
    labels : (n,) int array
        its segmentation
    people : sequence of (m,) int array
        the ground truth: labels of its faces, by one person or several
    name : str
        name of the model, for messages

    Raises
    ------
    ValueError
        If a ground truth does not have one integer per face.

    Notes
    -----
    The original is compared once with the ground truth, each variant once more. Where a variant has lost vertices, both
    are compared on the faces that are left, so that the loss is not about which part is gone.

    Examples
    --------
    >>> import trimesh
    >>> mesh = trimesh.creation.box()
    >>> truth = GroundTruth(mesh, np.int64(mesh.vertices[:, 2] > 0), [np.int64(mesh.triangles_center[:, 2] > 0)])
    >>> values = truth.values(np.arange(8), np.zeros(8, dtype=np.int64))
    >>> values["truth_lce"] <= values["truth_gce"] < values["truth_rand_index_error"]
    True
    """

    def __init__(
        self,
        mesh: trimesh.Trimesh,
        labels: NDArray[np.int64],
        people: Sequence[NDArray[np.integer]],
        name: str = "",
    ) -> None:
        self._mesh, self._labels, self._people, self._name = mesh, labels, list(people), name
        self._whole = self._on(np.ones(len(mesh.faces), dtype=bool))
        self._original = self._whole.means(labels)

    @classmethod
    def of(cls, model: Model, mesh: trimesh.Trimesh, labels: NDArray[np.int64]) -> GroundTruth | None:
        """The ground truth of a model with this mesh and segmentation; None if it has none."""
        people = model.human_segmentations()
        return cls(mesh, labels, people, model.name) if people else None

    def values(self, counterpart: NDArray[np.int64], labels: NDArray[np.int64]) -> dict[str, float | None]:
        """The values of `COLUMNS` for a variant.

        Parameters
        ----------
        counterpart : (n,) int array
            for each vertex of the original its counterpart in the variant, -1 if it has none
        labels : (n_variant,) int array
            labels of the vertices of the variant

        Returns
        -------
        dict
            missing values (None) where no face is left, or where a cut is on a component without a cut of the other
            segmentation
        """
        kept = counterpart >= 0
        carried = np.where(kept, labels[counterpart], -1)
        is_left = kept[np.asarray(self._mesh.faces)].all(axis=1)
        if not is_left.any():
            return missing_values()
        if is_left.all():
            variant, original = self._whole.means(carried), self._original
        else:
            part = self._on(is_left)
            variant, original = part.means(carried), part.means(self._labels)
        return {f"{TRUTH}_{name}": _finite(variant[name]) for name in psb.MAIN} | {
            f"{LOSS}_{name}": _finite(variant[name] - original[name]) for name in psb.MAIN
        }

    def _on(self, faces: NDArray[np.bool_]) -> _Judge:
        """The comparison on some of the faces."""
        name = f"every ground truth of model {self._name}"
        for person in self._people:
            if person.shape != faces.shape:
                raise ValueError(f"{name} must have one label for each of its {len(faces)} faces, got {person.shape}")
        return _Judge(self._mesh.vertices, np.asarray(self._mesh.faces)[faces], [each[faces] for each in self._people])


class _Judge:
    """The benchmark's metrics of labels of vertices, means over people."""

    def __init__(
        self, vertices: NDArray[np.float64], faces: NDArray[np.int64], people: Sequence[NDArray[np.integer]]
    ) -> None:
        self._faces = faces
        self._evaluator = psb.Evaluator(_Surface(vertices, faces), people)

    def means(self, labels: NDArray[np.int64]) -> dict[str, float]:
        """The mean over people of every metric of a segmentation of the vertices."""
        scores = self._evaluator.evaluate(heatwalk.faces_from_vertices(labels, self._faces))
        with np.errstate(invalid="ignore"):
            return {name: float(np.mean([score[name] for score in scores])) for name in psb.MAIN}


@dataclasses.dataclass(frozen=True)
class _Surface:
    """Vertices and faces, as metrics read them."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


def missing_values() -> dict[str, float | None]:
    """The values of `COLUMNS` of a trial without ground truth."""
    return dict.fromkeys(column.name for column in COLUMNS)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def accuracy_table(rows: pd.DataFrame, keys: Sequence[str], key_columns: Sequence[Column]) -> Table | None:
    """The metrics of the variants and their losses by part and level; None if no row has ground truth.

    Parameters
    ----------
    rows : DataFrame
        trials
    keys : sequence of str
        columns of the rows that the table has a row for each combination of
    key_columns : sequence of Column
        the columns that show them
    """
    measured = [column for column in COLUMNS if column.name in rows]
    if not measured:
        return None
    good = rows[(rows["status"] == "ok") & rows[[column.name for column in measured]].notna().any(axis=1)]
    if good.empty:
        return None
    import pandas as pd

    records: list[dict[str, Any]] = [
        {**dict(zip(keys, key, strict=True)), **_means(group, measured), "n": len(group)}
        for key, group in good.groupby(list(keys), sort=False)
    ]
    shown = [
        dataclasses.replace(column, bounds=_bounds(column.name)) if _is_loss(column) else column for column in measured
    ]
    return Table("accuracy", pd.DataFrame(records), (*key_columns, *shown, N_TRUTH), notes=NOTES)


def _means(rows: pd.DataFrame, columns: Sequence[Column]) -> dict[str, Any]:
    """The mean of every column, and the intervals of the losses."""
    means: dict[str, Any] = {}
    for column in columns:
        present = rows[rows[column.name].notna()]
        means[column.name] = model_mean(present, column.name)
        if _is_loss(column):
            means |= dict(zip(_bounds(column.name), interval_of_mean(present, column.name), strict=True))
    return means


def _is_loss(column: Column) -> bool:
    return column.name.startswith(f"{LOSS}_")


def _bounds(name: str) -> tuple[str, str]:
    return f"{name}_low", f"{name}_high"
