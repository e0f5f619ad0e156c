"""Checks that a segmenter, a metric, a dataset or an experiment keeps to its contract, for the tests of their authors.

Each check raises AssertionError with a message that tells what is wrong, where, and what the contract is.

Examples
--------
>>> from studies import metrics, testing
>>> for metric in metrics.registered().values():
...     testing.check_metric(metric)
"""

from __future__ import annotations

import dataclasses
import math
import pickle
import re
import string
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.columns import Column, Table, dtypes, is_missing
from studies.metrics import Comparison, Metric, TriangleMesh

if TYPE_CHECKING:
    import pandas as pd

    from studies.datasets import Dataset, Model
    from studies.experiments import Experiment
    from studies.planning.trial import Trial
    from studies.segmenters import Segmenter

PICKLE_LIMIT = 10_000  # bytes; a model is sent with every one of its trials


# --- segmenters


def check_segmenter(
    segmenter: Callable[..., ArrayLike], meshes: Iterable[TriangleMesh] | None = None, labels_of: str = "auto"
) -> None:
    """Check a segmenter: labels, determinism, and that it leaves its input alone.

    Parameters
    ----------
    segmenter : callable
        (vertices (n, 3), faces (m, 3)) -> labels: a `studies.segmenters.Segmenter`, or a method that
        `studies.segmenters.make_segmenter` can make one of. A method that takes ``n_segments`` is told to find 4.
    meshes : iterable of TriangleMesh, optional
        meshes to segment; by default some small ones, closed, with a handle, and with a boundary
    labels_of : {"auto", "vertices", "faces"}
        what the labels of a method belong to, see `studies.segmenters.labels_at_vertices`

    Raises
    ------
    AssertionError
        If the segmenter raises on a mesh, returns anything else than one integer of at least -1 per vertex (a method:
        or face), modifies its input, returns other labels in a second call, or, if it is a `Segmenter`, is changed by
        pickling.

    Examples
    --------
    >>> from studies.segmenters import make_segmenter
    >>> check_segmenter(make_segmenter({"_target_": "studies.segmenters.HeatWalk", "time": 0.5}))
    """
    from studies.segmenters import Segmenter

    name = _name_of(segmenter)
    meshes = list(example_meshes().values() if meshes is None else meshes)
    _require(len(meshes) > 0, f"{name}: no meshes to check it on")
    first = [_labels(segmenter, name, mesh, labels_of) for mesh in meshes]
    for mesh, labels in zip(meshes, first, strict=True):
        again = _labels(segmenter, name, mesh, labels_of)
        _require(
            np.array_equal(labels, again),
            f"{name} is not deterministic: {_n_different(labels, again)} labels of {_described(mesh)} differ in a "
            "second call with the same mesh",
        )
    if not isinstance(segmenter, Segmenter):
        return
    _require(
        isinstance(segmenter.name, str) and segmenter.name != "",
        f"{name}: its name is {segmenter.name!r}; it must be a string that is not empty",
    )
    copy = _unpickled(segmenter, name)
    _require(copy == segmenter, f"{name} differs from its pickled copy; all of its state must be in its options")
    _require(
        np.array_equal(_labels(copy, name, meshes[0], labels_of), first[0]),
        f"{name}: its pickled copy returns other labels of {_described(meshes[0])}",
    )


def example_meshes() -> dict[str, TriangleMesh]:
    """Small meshes without symmetries: an ellipsoid, a torus, and a surface with a boundary.

    Returns
    -------
    dict of str to trimesh.Trimesh
        each with different numbers of vertices and faces

    Examples
    --------
    >>> {name: mesh.faces.shape for name, mesh in example_meshes().items()}
    {'ellipsoid': (320, 3), 'torus': (512, 3), 'open': (200, 3)}
    """
    import trimesh

    ellipsoid = trimesh.creation.icosphere(2)
    torus = trimesh.creation.torus(1.0, 0.4, major_sections=16, minor_sections=16)
    half = trimesh.Trimesh(ellipsoid.vertices, ellipsoid.faces[:200], process=False)
    half.remove_unreferenced_vertices()
    for mesh in (ellipsoid, torus, half):
        # Waves of different lengths and directions: no two vertices are equivalent.
        x, y, z = np.asarray(mesh.vertices).T
        mesh.vertices = np.column_stack([2.0 * x + 0.1 * np.sin(3 * y), y + 0.1 * np.sin(5 * z + x), 0.8 * z + 0.1 * x])
    return {"ellipsoid": ellipsoid, "torus": torus, "open": half}


def _labels(
    segmenter: Callable[..., ArrayLike], name: str, mesh: TriangleMesh, labels_of: str
) -> NDArray[np.integer[Any]]:
    """The labels that a segmenter returns for a mesh, if they keep to the contract."""
    from studies.segmenters import LabelError, Segmenter, labels_at_vertices
    from studies.segmenters.segmenter import TOLD, signature

    vertices, faces = np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)
    passed = vertices.copy(), faces.copy()
    told = {TOLD: 4} if not isinstance(segmenter, Segmenter) and TOLD in signature(segmenter).parameters else {}
    try:
        labels = segmenter(*passed, **told)
    except Exception as error:
        raise AssertionError(f"{name} raises {type(error).__name__} on {_described(mesh)}: {error}") from error
    for what, before, after in (("vertices", vertices, passed[0]), ("faces", faces, passed[1])):
        _require(np.array_equal(before, after), f"{name} modifies the array of {what} of {_described(mesh)}")
    if isinstance(segmenter, Segmenter):
        _require(
            isinstance(labels, np.ndarray) and labels.shape == (len(vertices),) and labels.dtype == np.int64,
            f"{name} must return a (n,) int64 array, and returns {_described_array(labels)} for {_described(mesh)}",
        )
    try:
        labels_at_vertices(labels, vertices, faces, labels_of)
    except LabelError as error:
        raise AssertionError(f"{name} returns {error}") from error
    return np.array(labels)


# --- metrics


def check_metric(metric: Metric) -> None:
    """Check a metric: its column, and the values that it computes.

    Parameters
    ----------
    metric : studies.metrics.Metric
        as listed in ``METRICS`` of its module

    Raises
    ------
    AssertionError
        If the column is not well formed; if a value is not a plain float or int as the column's dtype requires, or
        None though the metric is not declared as one that may be missing; or if values depend on which numbers the
        labels are, on the order of the points, or on previous calls, if arrays are modified, if exchanging the
        segmentations changes a value of a metric declared as symmetric, or if equal partitions do not have the best
        value, which is 0 if lower is better.

    Examples
    --------
    >>> from studies.metrics import registered
    >>> check_metric(registered()["van_dongen"])
    """
    _require(isinstance(metric, Metric), f"{metric!r} is not a studies.metrics.Metric")
    name = f"metric {metric.column.name!r}"
    _check_column(metric.column, name)
    _require(metric.column.stored, f"{name}: its column has a template, and must have values")
    _require(
        metric.column.dtype in _TYPES,
        f"{name}: the dtype of its column is {metric.column.dtype}; it must hold missing values: {' or '.join(_TYPES)}",
    )
    for what, comparison in _comparisons(metric.needs_mesh):
        value = _value(metric, name, what, comparison)
        _check_invariances(metric, name, what, comparison, value)
        _check_best(metric, name, what, comparison, value)


# The Python type of the values of a column, by its dtype. A plain integer column could not hold missing values.
_TYPES: dict[str, type] = {"float64": float, "Int64": int}


def _comparisons(with_mesh: bool) -> Iterator[tuple[str, Comparison]]:
    """Comparisons to check a metric on, each with a description."""
    rng = np.random.default_rng(0)
    mesh = example_meshes()["ellipsoid"]
    n = len(mesh.vertices)
    patches = _patches(mesh, 6, rng)
    partitions = {
        "the same partition": (patches, patches),
        "two partitions": (patches, _patches(mesh, 4, rng)),
        "random labels": (rng.integers(0, 5, n), rng.integers(0, 7, n)),
        "a partition and one segment": (patches, np.zeros(n, dtype=np.int64)),
        "one segment per point and a partition": (np.arange(n), patches),
        "labels of -1 for the background": (patches - 1, np.where(patches == 2, -1, patches)),
    }
    for what, (reference, labels) in partitions.items():
        yield f"{what}, with a mesh", Comparison(reference, labels, mesh, np.arange(n))
    kept = np.flatnonzero(rng.random(n) < 0.7)
    reference, labels = partitions["two partitions"]
    yield "two partitions of some vertices", Comparison(reference[kept], labels[kept], mesh, kept)
    if not with_mesh:
        yield "two partitions without a mesh", Comparison(reference, labels)
        yield "a single point", Comparison(np.array([3]), np.array([0]))


def _patches(mesh: TriangleMesh, count: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Labels of vertices: the nearest of some random vertices."""
    centres = mesh.vertices[rng.choice(len(mesh.vertices), count, replace=False)]
    return np.linalg.norm(mesh.vertices[:, None] - centres, axis=2).argmin(axis=1)


def _value(metric: Metric, name: str, what: str, comparison: Comparison) -> float | int:
    """The value of a metric, NaN if it is missing, if it keeps to the contract."""
    passed = Comparison(
        comparison.reference.copy(),
        comparison.labels.copy(),
        comparison.mesh,
        None if comparison.points is None else comparison.points.copy(),
    )
    try:
        value = metric(passed)
    except Exception as error:
        raise AssertionError(f"{name} raises {type(error).__name__} on {what}: {error}") from error
    expected = _TYPES[metric.column.dtype]
    _require(
        type(value) is expected or (value is None and metric.may_be_missing),
        f"{name} returns {type(value).__name__} on {what}; its column of dtype {metric.column.dtype} needs a plain "
        f"{expected.__name__}",
    )
    for field in ("reference", "labels", "points"):
        _require(
            np.array_equal(getattr(comparison, field), getattr(passed, field)),
            f"{name} modifies the array `{field}` of its comparison on {what}",
        )
    return math.nan if value is None else value


def _check_invariances(metric: Metric, name: str, what: str, comparison: Comparison, value: float | int) -> None:
    """Raise if a change that does not matter changes the value."""
    order = np.random.default_rng(1).permutation(len(comparison.labels))
    reference, labels, points = comparison.reference, comparison.labels, comparison.points
    changes = {
        "a second call": comparison,
        "renumbering the labels": Comparison(reference, _renumbered(labels), comparison.mesh, points),
        "reordering the points": Comparison(
            reference[order], labels[order], comparison.mesh, None if points is None else points[order]
        ),
    }
    if metric.symmetric:
        changes["exchanging the segmentations"] = Comparison(labels, reference, comparison.mesh, points)
    for change, changed in changes.items():
        other = _value(metric, name, what, changed)
        _require(_equal(value, other), f"{name} changes from {value} to {other} by {change}, on {what}")


def _check_best(metric: Metric, name: str, what: str, comparison: Comparison, value: float | int) -> None:
    """Raise if equal partitions do not have the best value."""
    lower_is_better = metric.column.lower_is_better
    if lower_is_better is None or math.isnan(value):
        return
    reference = comparison.reference
    same = Comparison(reference, _renumbered(reference), comparison.mesh, comparison.points)
    best = _value(metric, name, f"equal partitions ({what})", same)
    if lower_is_better:
        _require(abs(best) < 1e-9, f"{name} is {best} for equal partitions; it must be 0, as lower is better")
    _require(
        value >= best - 1e-9 if lower_is_better else value <= best + 1e-9,
        f"{name} is {value} on {what}, better than {best} for equal partitions",
    )


def _renumbered(labels: NDArray[np.integer[Any]]) -> NDArray[np.int64]:
    """Labels of the same partition, in another order and with gaps; -1 remains -1."""
    renumbered = 3 * (labels.max() - labels).astype(np.int64) + 2
    return np.where(labels == -1, -1, renumbered)


def _equal(a: float, b: float) -> bool:
    """Whether two values are equal but for rounding."""
    return a == b or (math.isnan(a) and math.isnan(b)) or math.isclose(a, b, rel_tol=1e-9, abs_tol=1e-12)


# --- datasets


def check_dataset(dataset: Dataset, limit: int = 3) -> None:
    """Check a dataset: its models, their meshes and digests, and that they can be sent to workers.

    Parameters
    ----------
    dataset : studies.datasets.Dataset
        one whose files are available
    limit : int
        how many of its models are loaded, evenly spaced

    Raises
    ------
    AssertionError
        If the dataset has no name or no models, if its order of models differs between calls, if names of models are
        not unique; or if a model does not load valid arrays, returns arrays shared between calls, has a digest that is
        not SHA-256, not stable, or that of another model with another mesh, cannot be pickled to a few kilobytes, or
        is not the same when it is sent with its content.

    Examples
    --------
    >>> from studies.datasets.bundled import Bundled
    >>> check_dataset(Bundled(["cow"]))
    """
    from studies.datasets import Dataset, Model

    _require(isinstance(dataset, Dataset), f"{dataset!r} is not a studies.datasets.Dataset")
    name = getattr(dataset, "name", None)
    _require(isinstance(name, str) and name != "", f"{type(dataset).__name__}.name is {name!r}; it must be a string")
    models = list(dataset.models())
    _require(len(models) > 0, f"dataset {name!r} has no models; it must raise DatasetError instead")
    for model in models:
        _require(isinstance(model, Model), f"dataset {name!r} lists {model!r}, which is not a studies.datasets.Model")
        _require(
            isinstance(model.name, str) and model.name != "" and isinstance(model.category, str),
            f"dataset {name!r}: name and category of a model must be strings, got {model.name!r}, {model.category!r}",
        )
    names = [model.name for model in models]
    repeated = sorted({each for each in names if names.count(each) > 1})
    _require(not repeated, f"dataset {name!r} has more than one model named {', '.join(repeated)}")
    _require(
        list(dataset.models()) == models,
        f"dataset {name!r} lists different models, or another order, when asked again; models must be frozen "
        "dataclasses, and their order must depend on nothing but their names",
    )
    step = max(1, len(models) // max(1, limit))
    checked = models[::step][:limit]
    loaded = {model.name: _check_model(model, f"model {model.name!r} of dataset {name!r}") for model in checked}
    _check_different_digests(checked, loaded)


def _check_model(model: Model, name: str) -> TriangleMesh:
    """Check one model; returns its mesh."""
    mesh = _loaded(model, name)
    first = np.array(mesh.vertices), np.array(mesh.faces)
    mesh.vertices[:] = 0
    mesh.faces[:] = 0
    mesh = _loaded(model, name)
    _require(
        np.array_equal(first[0], mesh.vertices) and np.array_equal(first[1], mesh.faces),
        f"{name} loads another mesh the second time; arrays that a caller modifies must not be shared",
    )
    digest = _check_digest(model, "digest", name)
    copy = _unpickled(model, name)
    size = len(pickle.dumps(model))
    _require(size < PICKLE_LIMIT, f"{name} is pickled to {size:,} bytes; it must load its mesh, not contain it")
    _require(
        copy == model and copy.digest() == digest,
        f"{name} differs from its pickled copy; all of its state must be in its fields",
    )
    _check_humans(model, len(first[1]), name)
    _check_correspondence(model, len(first[0]), name)
    _check_embedded(model, mesh, name)
    return mesh


def _loaded(model: Model, name: str) -> TriangleMesh:
    """The mesh that a model loads, if its arrays are valid."""
    from heatwalk import MeshError
    from heatwalk.meshes import check_arrays

    try:
        mesh = model.load()
        check_arrays(mesh.vertices, mesh.faces)
    except MeshError as error:
        raise AssertionError(f"{name} does not load a triangle mesh: {error}") from error
    for what, array, dtype in (("vertices", mesh.vertices, np.float64), ("faces", mesh.faces, np.int64)):
        _require(
            type(array) is np.ndarray and array.dtype == dtype and array.flags.writeable,
            f"{name}: {what} must be a writable {np.dtype(dtype)} array, got {_described_array(array)}; "
            f"np.array({what}, dtype=np.{np.dtype(dtype)}) makes one",
        )
    _require(bool(np.isfinite(mesh.vertices).all()), f"{name} has coordinates that are NaN or infinite")
    _require(
        isinstance(mesh.notes, tuple) and all(isinstance(note, str) for note in mesh.notes),
        f"{name}: notes must be a tuple of sentences, got {mesh.notes!r}",
    )
    return mesh


def _check_digest(model: Model, method: str, name: str) -> str:
    """The digest that a method of a model returns, if it is stable and a SHA-256."""
    digest = getattr(model, method)()
    _require(
        isinstance(digest, str) and re.fullmatch("[0-9a-f]{64}", digest) is not None,
        f"{name}: {method}() must be a SHA-256 in hexadecimal, got {digest!r}",
    )
    again = getattr(model, method)()
    _require(again == digest, f"{name}: {method}() changes from {digest} to {again} in a second call")
    return digest


def _check_humans(model: Model, n_faces: int, name: str) -> None:
    """Check the segmentations by people, if a model has any."""
    people = model.human_segmentations()
    for i, labels in enumerate(people):
        _require(
            isinstance(labels, np.ndarray) and labels.shape == (n_faces,) and labels.dtype.kind in "iu",
            f"{name}: human segmentation {i} must be an integer per face ({n_faces}), got {_described_array(labels)}",
        )
    if people:
        _check_digest(model, "human_digest", name)


def _check_correspondence(model: Model, n_vertices: int, name: str) -> None:
    """Check the vertices at common points, if a model has any."""
    from studies.datasets import DatasetError

    try:
        points = model.correspondence()
    except DatasetError:
        return
    _require(
        isinstance(points, np.ndarray) and points.ndim == 1 and points.dtype.kind in "iu",
        f"{name}: correspondence() must be a (p,) int array, got {_described_array(points)}",
    )
    _require(
        len(points) > 0 and points.min() >= 0 and points.max() < n_vertices,
        f"{name}: correspondence() must contain vertices from 0 to {n_vertices - 1}",
    )
    _check_digest(model, "correspondence_digest", name)


def _check_embedded(model: Model, mesh: TriangleMesh, name: str) -> None:
    """Raise if a model has other content when it is sent with its content."""
    from studies.datasets.in_memory import embed_models

    sent = _unpickled(embed_models(_ModelHolder(model)), name).model
    embedded = sent.load()
    _require(
        np.array_equal(embedded.vertices, mesh.vertices) and np.array_equal(embedded.faces, mesh.faces),
        f"{name} has another mesh when it is sent with its content",
    )
    ours, theirs = model.human_segmentations(), sent.human_segmentations()
    _require(
        len(ours) == len(theirs) and all(map(np.array_equal, ours, theirs)),
        f"{name} has other human segmentations when it is sent with its content",
    )


@dataclass(frozen=True)
class _ModelHolder:
    """Something with a model, as a trial is."""

    model: Model


def _check_different_digests(models: Sequence[Model], loaded: Mapping[str, TriangleMesh]) -> None:
    """Raise if two models have one digest and different meshes."""
    by_digest: dict[str, Model] = {}
    for model in models:
        other = by_digest.setdefault(model.digest(), model)
        ours, theirs = loaded[model.name], loaded[other.name]
        _require(
            np.array_equal(ours.vertices, theirs.vertices) and np.array_equal(ours.faces, theirs.faces),
            f"models {other.name!r} and {model.name!r} have different meshes and the same digest",
        )


# --- experiments


def check_experiment(experiment: Experiment, dataset: Dataset, segmenter: Segmenter, limit: int = 4) -> None:
    """Check an experiment: its plan, the rows of some trials, and its tables.

    Parameters
    ----------
    experiment : studies.experiments.Experiment
        the experiment, with its options
    dataset : studies.datasets.Dataset
        a small dataset that it can measure
    segmenter : studies.segmenters.Segmenter
        a quick segmenter that it can measure
    limit : int
        how many trials are run, each twice

    Raises
    ------
    AssertionError
        If a column is not well formed or has the name of another; if trials are not picklable, have the same id, or
        other ids when they are planned again or with fewer models, if their seeds depend on the segmenter, or if
        trials of one group are not consecutive; if a trial fails, is not reproducible or returns a value of a column
        that is not declared; or if the tables, of these rows or of rows of which some or all failed, are not well
        formed.

    Examples
    --------
    >>> from studies.datasets.bundled import Bundled
    >>> from studies.experiments import Anatomy
    >>> from studies.segmenters import make_segmenter
    >>> walk = make_segmenter({"_target_": "studies.segmenters.HeatWalk"})
    >>> check_experiment(Anatomy(), Bundled(["cow"]), walk)
    """
    from studies.experiments import Experiment

    _require(isinstance(experiment, Experiment), f"{experiment!r} is not a studies.experiments.Experiment")
    name = f"experiment {type(experiment).__name__}"
    columns = _row_columns(experiment, name)
    trials = _planned(experiment, name, dataset, segmenter)
    rows = _measured(trials, name, columns, limit)
    _check_tables(experiment, name, "measured", _frame(rows, columns))
    _check_tables(experiment, name, "partly failed", _frame(_failed(trials[: len(rows)], rows, every=2), columns))
    _check_tables(experiment, name, "failed", _frame(_failed(trials[: len(rows)], rows, every=1), columns))


def _row_columns(experiment: Experiment, name: str) -> tuple[Column, ...]:
    """All columns of the rows of an experiment, if they are well formed."""
    from studies.planning.trial import COLUMNS

    _require(
        isinstance(experiment.columns, tuple) and all(isinstance(each, Column) for each in experiment.columns),
        f"{name}: columns must be a tuple of studies.columns.Column, got {experiment.columns!r}",
    )
    for column in experiment.columns:
        _check_column(column, f"{name}: column {column.name!r}")
        _require(column.stored, f"{name}: column {column.name!r} of its rows has a template, and must have values")
    names = [column.name for column in (*COLUMNS, *experiment.columns)]
    repeated = sorted({each for each in names if names.count(each) > 1})
    _require(not repeated, f"{name}: columns declared more than once: {', '.join(repeated)}")
    return (*COLUMNS, *experiment.columns)


def _planned(experiment: Experiment, name: str, dataset: Dataset, segmenter: Segmenter) -> list[Trial]:
    """The trials of an experiment, if its plan keeps to the contract."""
    from studies.planning.trial import Trial

    trials = list(experiment.plan("check", dataset, [segmenter]))
    _require(len(trials) > 0, f"{name} plans no trials; it must raise StudyError instead")
    for trial in trials:
        _require(isinstance(trial, Trial), f"{name} plans {trial!r}, which is not a studies.planning.trial.Trial")
    ids = [trial.trial_id for trial in trials]
    _require(len(set(ids)) == len(ids), f"{name} plans {len(ids)} trials with {len(set(ids))} different trial_ids")
    again = [trial.trial_id for trial in experiment.plan("check", dataset, [segmenter])]
    _require(again == ids, f"{name} plans other trial_ids, or another order, when it plans again")
    _check_fewer_models(experiment, name, dataset, segmenter, set(ids))
    _check_two_segmenters(experiment, name, dataset, segmenter)
    groups = [key for key, _ in groupby(trials, key=lambda trial: trial.group_key)]
    _require(len(set(groups)) == len(groups), f"{name} plans trials of one group_key that are not consecutive")
    for trial in trials:
        copy = _unpickled(trial, f"{name}: trial {trial.trial_id}")
        _require(copy.trial_id == trial.trial_id, f"{name}: trial {trial.trial_id} differs from its pickled copy")
    return trials


def _check_fewer_models(
    experiment: Experiment, name: str, dataset: Dataset, segmenter: Segmenter, ids: set[str]
) -> None:
    """Raise if trials of some models have other ids in a study without the last model."""
    from studies.planning.errors import StudyError

    fewer = list(dataset.models())[:-1]
    if not fewer:
        return
    try:
        remaining = {trial.trial_id for trial in experiment.plan("check", _subset(dataset, fewer), [segmenter])}
    except StudyError:  # too few to be measured
        return
    _require(remaining <= ids, f"{name} plans other trial_ids for a model in a study of fewer models")


def _subset(dataset: Dataset, models: Sequence[Model]) -> Dataset:
    """A dataset of some of its models."""
    from studies.datasets import Dataset

    class Subset(Dataset):
        name = dataset.name

        def models(self) -> Sequence[Model]:
            return models

    return Subset()


def _check_two_segmenters(experiment: Experiment, name: str, dataset: Dataset, segmenter: Segmenter) -> None:
    """Raise if two segmenters share trial ids, or are not given the same seeds."""
    other = dataclasses.replace(segmenter, name=f"another {segmenter.name}", version="another version")
    trials = list(experiment.plan("check", dataset, [segmenter, other]))
    ours, theirs = ([trial for trial in trials if trial.segmenter_name == each.name] for each in (segmenter, other))
    _require(
        len(ours) == len(theirs) > 0, f"{name} plans {len(ours)} trials of one segmenter, {len(theirs)} of another"
    )
    _require(
        sorted(trial.seed for trial in ours) == sorted(trial.seed for trial in theirs),
        f"{name}: seeds depend on the segmenter; methods must be compared under the same draws",
    )
    shared = {trial.trial_id for trial in ours} & {trial.trial_id for trial in theirs}
    _require(not shared, f"{name}: trials of two segmenters have the same trial_id; it must contain their fingerprint")


def _measured(trials: Sequence[Trial], name: str, columns: Sequence[Column], limit: int) -> list[dict[str, Any]]:
    """Rows of the first trials, if measuring keeps to the contract."""
    rows = []
    for _, group in groupby(trials[:limit], key=lambda trial: trial.group_key):
        members = list(group)
        try:
            prepared = pickle.dumps(members[0].prepare())
        except Exception as error:
            raise AssertionError(f"{name}: prepare() raises {type(error).__name__}: {error}") from error
        rows += [_measured_row(trial, name, columns, prepared) for trial in members]
    return rows


def _measured_row(trial: Trial, name: str, columns: Sequence[Column], prepared: bytes) -> dict[str, Any]:
    """The row of a trial, if it succeeds, is reproducible and has declared columns only."""
    from studies.planning.trial import TIMINGS, run_trial

    row, again = (_without_arrays(run_trial(trial, pickle.loads(prepared))) for _ in range(2))
    _require(row["status"] == "ok", f"{name}: trial {trial.trial_id} fails: {row['error']}")
    undeclared = sorted(row.keys() - dtypes(columns).keys())
    _require(
        not undeclared,
        f"{name}: trial {trial.trial_id} returns {', '.join(undeclared)}; declare a Column for each value in `columns`",
    )
    for key in row.keys() - set(TIMINGS):
        same = row[key] == again[key] or (is_missing(row[key]) and is_missing(again[key]))
        _require(same, f"{name}: trial {trial.trial_id} is not reproducible: {key} is {row[key]}, then {again[key]}")
    return row


def _without_arrays(row: Mapping[str, Any]) -> dict[str, Any]:
    """A row without the arrays that are kept for pictures."""
    return {key: value for key, value in row.items() if not isinstance(value, np.ndarray)}


def _failed(trials: Sequence[Trial], rows: Sequence[dict[str, Any]], every: int) -> list[dict[str, Any]]:
    """The rows as if every so many of the trials had failed, from the first on."""
    from studies.planning.trial import failed_row

    return [
        failed_row(trial, "failed", "RuntimeError: made to fail") if i % every == 0 else row
        for i, (trial, row) in enumerate(zip(trials, rows, strict=True))
    ]


def _frame(rows: Sequence[Mapping[str, Any]], columns: Sequence[Column]) -> pd.DataFrame:
    """Rows as a DataFrame with the declared dtypes."""
    import pandas as pd

    types = dtypes(columns)
    frame = pd.DataFrame(rows, columns=list(types))
    for name, dtype in types.items():
        try:
            frame = frame.astype({name: dtype})
        except (TypeError, ValueError) as error:
            values = frame[name].tolist()
            raise AssertionError(f"column {name!r} of dtype {dtype} cannot hold {values}: {error}") from error
    return frame


def _check_tables(experiment: Experiment, name: str, rows_are: str, rows: pd.DataFrame) -> None:
    """Raise if the tables of some rows are not well formed."""
    where = f"{name}: tables of {rows_are} rows"
    try:
        tables = experiment.tables(rows)
    except Exception as error:
        raise AssertionError(f"{where}: tables() raises {type(error).__name__}: {error}") from error
    _require(
        isinstance(tables, list) and len(tables) > 0 and all(isinstance(table, Table) for table in tables),
        f"{where}: tables() must return a list of at least one studies.columns.Table, got {tables!r}",
    )
    names = [table.name for table in tables]
    _require(names[0] == "table", f"{where}: the first one must have the name 'table', got {names[0]!r}")
    _require(len(set(names)) == len(names), f"{where}: names must differ, got {', '.join(names)}")
    for table in tables:
        if table.columns or table is tables[0]:  # others may be stored without being shown
            _check_table(table, f"{where}: {table.name!r}")


def _check_table(table: Table, name: str) -> None:
    """Raise if a table has values without a column, or cannot be shown."""
    for column in table.columns:
        _check_column(column, f"{name}: column {column.name!r}", needs_help=False)
    declared = {name for column in table.columns for name in _stored_names(column)}
    undeclared = sorted(set(table.frame.columns) - declared)
    _require(not undeclared, f"{name} has values without a Column: {', '.join(undeclared)}")
    _require(not table.value or table.value in declared, f"{name}: its value {table.value!r} is not a column of it")
    for compact in (False, True):
        _require(len(table.visible(compact=compact)) > 0, f"{name} shows no columns, compact={compact}")
        try:
            table.cells(compact=compact)
        except Exception as error:
            raise AssertionError(f"{name} cannot be shown: {type(error).__name__}: {error}") from error


# --- what the checks share

_EXAMPLE_VALUES = {"float64": 1.5, "Float64": 1.5, "int64": 1, "Int64": 1, "string": "x", "bool": True, "boolean": True}


def _check_column(column: Column, name: str, *, needs_help: bool = True) -> None:
    """Raise if a column is not well formed."""
    _require(isinstance(column, Column), f"{name}: {column!r} is not a studies.columns.Column")
    _require(column.name.isidentifier(), f"{name}: the name of its column is {column.name!r}, not an identifier")
    _require(
        column.dtype in _EXAMPLE_VALUES,
        f"{name}: the dtype of its column is {column.dtype!r}; it must be one of {', '.join(_EXAMPLE_VALUES)}",
    )
    _require(
        column.lower_is_better in (True, False, None),
        f"{name}: lower_is_better of its column is {column.lower_is_better!r}; it must be True, False or None",
    )
    _require(bool(column.help) or not needs_help, f"{name}: its column needs a help text of one sentence")
    example = _EXAMPLE_VALUES[column.dtype]
    values = dict.fromkeys(_stored_names(column), 1.5 if column.template else example)
    try:
        column.text(values)
    except (ValueError, KeyError, IndexError) as error:
        raise AssertionError(
            f"{name}: the format {column.template or column.format!r} of its column cannot show {example!r}: {error}"
        ) from error


def _stored_names(column: Column) -> list[str]:
    """The names of the stored columns that a column shows."""
    if column.stored:
        return [column.name, *(column.bounds or ())]
    return [name for _, name, _, _ in string.Formatter().parse(column.template) if name]


def _unpickled(value: Any, name: str) -> Any:
    """A copy of a value, pickled and unpickled."""
    try:
        return pickle.loads(pickle.dumps(value))
    except Exception as error:
        raise AssertionError(f"{name} cannot be pickled: {type(error).__name__}: {error}") from error


def _name_of(function: Any) -> str:
    """How messages name a callable."""
    return str(
        getattr(function, "name", None) or getattr(function, "__qualname__", None) or type(function).__qualname__
    )


def _described(mesh: TriangleMesh) -> str:
    """How messages name a mesh."""
    return f"a mesh with {len(mesh.vertices)} vertices and {len(mesh.faces)} faces"


def _described_array(value: Any) -> str:
    """How messages name what should have been an array."""
    if isinstance(value, np.ndarray):
        return f"a {type(value).__name__} of shape {value.shape} and dtype {value.dtype}"
    return repr(value)


def _n_different(a: NDArray[Any], b: NDArray[Any]) -> str:
    """How many entries of two arrays differ."""
    return str(np.count_nonzero(a != b)) if a.shape == b.shape else "all"


def _require(condition: bool, message: str) -> None:
    """Raise AssertionError if a condition is not met; unlike ``assert``, under ``python -O`` too."""
    if not condition:
        raise AssertionError(message)
