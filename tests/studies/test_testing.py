"""The checks for authors of plug-ins: what ships passes, and what breaks one contract fails with the reason."""

import hashlib
import itertools
import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np
import pandas as pd
import pytest

import heatwalk
from studies import metrics
from studies.columns import Column, Table
from studies.datasets import Dataset, Model
from studies.datasets.bundled import Bundled
from studies.datasets.files import Files
from studies.datasets.psb import PSB
from studies.datasets.tosca import TOSCA
from studies.experiments import Anatomy, Benchmark, Change, Experiment, Poses, Times
from studies.metrics import Metric
from studies.planning.fingerprint import digest, fingerprint
from studies.planning.trial import Trial
from studies.segmenters import HeatWalk, Segmenter, make_segmenter
from studies.testing import check_dataset, check_experiment, check_metric, check_segmenter, example_meshes

HALVES = "tests.helpers.segmenting.halves"


# --- segmenters


def halves(vertices, faces):
    return (vertices[:, 0] > 0).astype(int)


def halves_of_faces(vertices, faces):
    return (vertices[faces].mean(axis=1)[:, 0] > 0).astype(int)


def draws(vertices, faces):
    return np.random.default_rng().integers(0, 9, len(vertices))


def counts_calls(vertices, faces, calls=itertools.count()):  # noqa: B008
    return np.full(len(vertices), next(calls))


def moves_vertices(vertices, faces):
    vertices *= 2
    return halves(vertices, faces)


def turns_faces(vertices, faces):
    faces[:] = faces[:, ::-1].copy()
    return halves(vertices, faces)


def too_few(vertices, faces):
    return halves(vertices, faces)[:-1]


def fractions(vertices, faces):
    return halves(vertices, faces) / 2


def below_background(vertices, faces):
    return halves(vertices, faces) - 2


def fails(vertices, faces):
    raise RuntimeError("no legs")


class ReturnsShortIntegers(Segmenter):
    def __call__(self, vertices, faces):
        return super().__call__(vertices, faces).astype(np.int32)


class Unpicklable(Segmenter):
    def __reduce__(self):
        raise TypeError("cannot pickle a network")


class ForgetsItsName(Segmenter):
    def __reduce__(self):
        return ForgetsItsName, ("another", self.recipe, self.version, self.labels_of)


def segmenter(kind=Segmenter, **options):
    return kind("halves", make_segmenter({"_target_": HALVES}).recipe, 1, **options)


@pytest.mark.parametrize("options", [{"_target_": "studies.segmenters.HeatWalk"}, {"_target_": HALVES}])
def test_segmenters_that_are_made_from_options_pass(options):
    check_segmenter(make_segmenter(options))


@pytest.mark.parametrize("method", [halves, halves_of_faces, HeatWalk()])
def test_methods_of_vertices_and_of_faces_pass(method):
    check_segmenter(method)


def test_a_method_is_checked_on_the_meshes_that_are_given():
    spheres = [example_meshes()["ellipsoid"]]
    check_segmenter(lambda v, f: halves(v, f) if len(v) == 162 else fails(v, f), spheres)
    with pytest.raises(AssertionError, match="no meshes"):
        check_segmenter(halves, [])


@pytest.mark.parametrize(
    ("method", "message"),
    [
        (draws, r"^draws is not deterministic: \d+ labels of a mesh with 162 vertices and 320 faces differ"),
        (counts_calls, r"^counts_calls is not deterministic: 162 labels"),
        (moves_vertices, r"^moves_vertices modifies the array of vertices of a mesh with 162 vertices"),
        (turns_faces, r"^turns_faces modifies the array of faces"),
        (too_few, r"^too_few returns 161 labels for 162 vertices and 320 faces; needed: 162 or 320"),
        (fractions, r"^fractions returns labels of shape \(162,\) and type float64"),
        (below_background, r"^below_background returns the label -2; needed: 0, 1, 2 … or -1"),
        (fails, r"^fails raises RuntimeError on a mesh with 162 vertices and 320 faces: no legs"),
        (segmenter(ReturnsShortIntegers), r"^halves must return a \(n,\) int64 array, and returns .* dtype int32"),
        (segmenter(Unpicklable), r"^halves cannot be pickled: TypeError: cannot pickle a network"),
        (segmenter(ForgetsItsName), r"^halves differs from its pickled copy"),
        (replace(segmenter(), name=""), r"its name is ''; it must be a string"),
    ],
)
def test_a_segmenter_that_breaks_a_contract_fails_with_the_reason(method, message):
    with pytest.raises(AssertionError, match=message):
        check_segmenter(method)


# --- metrics


def metric(function=None, **changes):
    """A metric that passes, but for the changes."""
    column = {"name": "changed", "format": ".1f", "lower_is_better": True, "help": "Change Percentage."}
    options = {"symmetric": changes.pop("symmetric", True), "needs_mesh": changes.pop("needs_mesh", False)}
    function = function or (lambda c: metrics.change_percentage(c.reference, c.labels))
    return Metric(column=Column(**(column | changes)), function=function, **options)


def change(comparison):
    return metrics.change_percentage(comparison.reference, comparison.labels)


def grows(comparison, calls=itertools.count()):  # noqa: B008
    return change(comparison) + float(next(calls))


def writes(comparison):
    value = change(comparison)
    comparison.labels[:] = 0
    return value


def counts_unequal(comparison):
    """Reads the labels as numbers."""
    return float((comparison.reference != comparison.labels).mean())


def counts_changes_along_the_points(comparison):
    """Reads the order of the points."""
    changed = [(np.diff(each) != 0).sum() for each in (comparison.reference, comparison.labels)]
    return float(abs(changed[0] - changed[1]))


def refinement(comparison):
    """Not symmetric: free if each segment is inside one of the reference."""
    table = metrics.contingency.contingency_table(comparison.reference, comparison.labels)
    return float(1 - table.max(axis=0).sum() / table.sum())


@pytest.mark.parametrize("name", metrics.registered())
def test_shipped_metrics_pass(name):
    check_metric(metrics.registered()[name])


@pytest.mark.parametrize(
    "good",
    [
        metric(),
        metric(symmetric=False),
        metric(lambda c: 100 - change(c), lower_is_better=False),
        metric(lambda c: float(len(np.unique(c.labels))), lower_is_better=None, symmetric=False),
        metric(lambda c: len(np.unique(c.labels)), dtype="Int64", format="d", lower_is_better=None, symmetric=False),
        metric(lambda c: float(c.mesh.vertices[c.points].mean()), lower_is_better=None, needs_mesh=True),
        metric(refinement, symmetric=False),
    ],
)
def test_metrics_of_every_kind_pass(good):
    check_metric(good)


@pytest.mark.parametrize(
    ("bad", "message"),
    [
        (change, "is not a studies.metrics.Metric"),
        (metric(name="CP %"), "the name of its column is 'CP %', not an identifier"),
        (metric(dtype="int64"), "its column is int64; it must hold missing values: float64 or Int64"),
        (metric(dtype="number"), "the dtype of its column is 'number'; it must be one of float64, "),
        (metric(format=".2q"), "the format '.2q' of its column cannot show 1.5"),
        (metric(help=""), "its column needs a help text"),
        (metric(lower_is_better="yes"), "lower_is_better of its column is 'yes'; it must be True, False or None"),
        (metric(template="{changed}"), "its column has a template, and must have values"),
        (metric(lambda c: np.float64(change(c))), "returns float64 on the same partition.* needs a plain float"),
        (metric(lambda c: int(change(c))), "returns int on the same partition.* dtype float64 needs a plain float"),
        (metric(lambda c: change(c), dtype="Int64", format="d"), "returned 0.0, which is no Int64"),
        (metric(lambda c: None), "returns NoneType"),
        (
            metric(lambda c: float(len(c.mesh.faces)), lower_is_better=None),
            "raises AttributeError on two partitions without a mesh",
        ),
        (metric(lambda c: float(0 * c.labels[1]), lower_is_better=None), "raises IndexError on a single point"),
        (metric(grows), "changes from .* by a second call, on the same partition"),
        (metric(writes), "modifies the array `labels` of its comparison"),
        (metric(counts_unequal), "by renumbering the labels"),
        (metric(counts_changes_along_the_points), "by reordering the points"),
        (metric(refinement), "by exchanging the segmentations"),
        (metric(lambda c: 1 + change(c)), "is 1.0 for equal partitions; it must be 0, as lower is better"),
        (metric(lambda c: -change(c)), "is -.* better than -?0.0 for equal partitions"),
        (metric(lower_is_better=False), "better than 0.0 for equal partitions"),
    ],
)
def test_a_metric_that_breaks_a_contract_fails_with_the_reason(bad, message):
    with pytest.raises(AssertionError, match=message):
        check_metric(bad)


# --- datasets


TETRAHEDRON = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


@dataclass(frozen=True)
class Prism(Model):
    height: float = 1.0

    def load(self):
        vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, self.height]], dtype=float)
        return heatwalk.LoadedMesh(vertices, TETRAHEDRON.copy(), ())

    def digest(self):
        return hashlib.sha256(repr(self.height).encode()).hexdigest()


class Prisms(Dataset):
    name = "prisms"

    def __init__(self, kind=Prism, heights=(1, 2, 3)):
        self.listed = [kind(f"prism{height}", "prism", float(height)) for height in heights]

    def models(self):
        return self.listed


SHARED = Prism("shared", "").load()


class LoadsNothing(Prism):
    def load(self):
        raise heatwalk.MeshError("the file is empty")


class LoadsOutside(Prism):
    def load(self):
        return replace(super().load(), faces=TETRAHEDRON + 1)


class LoadsSingle(Prism):
    def load(self):
        mesh = super().load()
        return replace(mesh, vertices=mesh.vertices.astype(np.float32))


class LoadsNaN(Prism):
    def load(self):
        mesh = super().load()
        mesh.vertices[0, 0] = np.nan
        return mesh


class LoadsOneNote(Prism):
    def load(self):
        return replace(super().load(), notes="scaled")


class SharesArrays(Prism):
    def load(self):
        return SHARED


class ShortDigest(Prism):
    def digest(self):
        return "abc"


class OneDigest(Prism):
    def digest(self):
        return "0" * 64


class NewDigest(Prism):
    def digest(self, calls=itertools.count()):  # noqa: B008
        return hashlib.sha256(str(next(calls)).encode()).hexdigest()


class Unsendable(Prism):
    def __reduce__(self):
        raise TypeError("cannot pickle a file")


class SentAsAnother(Prism):
    def __reduce__(self):
        return SentAsAnother, (self.name, self.category, 7.0)


@dataclass(frozen=True)
class Large(Prism):
    content: str = field(default="x" * 20_000)


class WrongHumans(Prism):
    def human_segmentations(self):
        return [np.zeros(3, int)]


class HumansWithoutDigest(Prism):
    def human_segmentations(self):
        return [np.zeros(4, int)]


class CorrespondsOutside(Prism):
    def correspondence(self):
        return np.array([0, 4])


class CorrespondsWithoutDigest(Prism):
    def correspondence(self):
        return np.array([0, 3])


class Shuffled(Prisms):
    def models(self, calls=itertools.count()):  # noqa: B008
        return self.listed[:: (-1) ** next(calls)]


class Nameless(Prisms):
    name = ""


def test_the_bundled_dataset_passes():
    check_dataset(Bundled())


def test_a_folder_of_files_passes(tmp_path):
    for name, mesh in example_meshes().items():
        mesh.export(tmp_path / f"{name}.off")
    check_dataset(Files(str(tmp_path)))


def test_the_benchmark_and_tosca_pass(psb_zip, tosca_zip):
    check_dataset(PSB(psb_zip))
    check_dataset(TOSCA(tosca_zip))


def test_a_dataset_of_ones_own_passes():
    check_dataset(Prisms())


@pytest.mark.parametrize(
    ("dataset", "message"),
    [
        (Prism("a", ""), "is not a studies.datasets.Dataset"),
        (Nameless(), "Nameless.name is ''; it must be a string"),
        (Prisms(heights=()), "has no models; it must raise DatasetError"),
        (Prisms(kind=lambda *fields: fields), r"lists \('prism1', 'prism', 1.0\), which is not a studies.datasets.Mo"),
        (Prisms(kind=lambda *_: Prism(1, "prism")), "name and category of a model must be strings, got 1, 'prism'"),
        (Prisms(heights=(1, 2, 2)), "has more than one model named prism2"),
        (Shuffled(), "lists different models, or another order, when asked again"),
        (Prisms(LoadsNothing), "^model 'prism1' of dataset 'prisms' does not load a triangle mesh: the file is empty"),
        (Prisms(LoadsOutside), "does not load a triangle mesh: face 1 .* refers to vertex 4"),
        (Prisms(LoadsSingle), "vertices must be a writable float64 array, got a ndarray .* dtype float32"),
        (Prisms(LoadsNaN), "has coordinates that are NaN or infinite"),
        (Prisms(LoadsOneNote), "notes must be a tuple of sentences, got 'scaled'"),
        (Prisms(SharesArrays), "loads another mesh the second time; arrays that a caller modifies must not be shared"),
        (Prisms(ShortDigest), r"digest\(\) must be a SHA-256 in hexadecimal, got 'abc'"),
        (Prisms(NewDigest), r"digest\(\) changes from \w+ to \w+ in a second call"),
        (Prisms(OneDigest), "models 'prism1' and 'prism2' have different meshes and the same digest"),
        (Prisms(Unsendable), "cannot be pickled: TypeError: cannot pickle a file"),
        (Prisms(SentAsAnother), "differs from its pickled copy"),
        (Prisms(Large), r"is pickled to 20,\d+ bytes; it must load its mesh, not contain it"),
        (Prisms(WrongHumans), r"human segmentation 0 must be an integer per face \(4\), got a ndarray of shape \(3,\)"),
        (Prisms(HumansWithoutDigest), r"human_digest\(\) must be a SHA-256 in hexadecimal, got ''"),
        (Prisms(CorrespondsOutside), r"correspondence\(\) must contain vertices from 0 to 3"),
        (Prisms(CorrespondsWithoutDigest), r"correspondence_digest\(\) must be a SHA-256"),
    ],
)
def test_a_dataset_that_breaks_a_contract_fails_with_the_reason(dataset, message):
    with pytest.raises(AssertionError, match=message):
        check_dataset(dataset)


# --- experiments


@dataclass(frozen=True, kw_only=True)
class CountTrial(Trial):
    segmenter: Segmenter
    extra: Callable[[Trial], dict[str, Any]] | None = None

    def prepare(self):
        return self.model.load()

    def measure(self, prepared):
        labels = self.segmenter(prepared.vertices, prepared.faces)
        values = {"n_vertices": len(prepared.vertices), "n_labels": len(np.unique(labels)), "seconds_segment": 0.0}
        return values | (self.extra(self) if self.extra else {})


N_LABELS = Column(name="n_labels", dtype="Int64", format="d", help="Number of labels.")


@dataclass(frozen=True, kw_only=True)
class Count(Experiment):
    """Counts labels; a test replaces what it breaks."""

    extra: Callable[[Trial], dict[str, Any]] | None = None
    change: Callable[[list[Trial]], list[Trial]] | None = None
    make_tables: Callable[[pd.DataFrame], list[Table]] | None = None

    columns: ClassVar[tuple[Column, ...]] = (N_LABELS,)

    def plan(self, study, dataset, segmenters):
        trials = [
            CountTrial(
                study=study,
                dataset=dataset.name,
                part=study,
                model=model,
                mesh_digest=model.digest(),
                segmenter=segmenter,
                segmenter_name=segmenter.name,
                repeat=repeat,
                seed=repeat,
                group_key=digest(fingerprint(model), segmenter.fingerprint),
                trial_id=digest("count", fingerprint(model), repeat, segmenter.fingerprint)[:24],
                extra=self.extra,
            )
            for segmenter in segmenters
            for model in dataset.models()
            for repeat in range(2)
        ]
        return self.change(trials) if self.change else trials

    def tables(self, rows):
        if self.make_tables:
            return self.make_tables(rows)
        return [a_table(rows)]


MODEL = Column(name="model", dtype="string")


def a_table(rows, name="table", columns=(MODEL, N_LABELS), **options):
    return Table(name, rows[["model", "n_labels"]], columns, **options)


class NoColumns(Count):
    columns = ("n_labels",)


class ColumnOfTheBase(Count):
    columns = (N_LABELS, Column(name="status", dtype="string", help="Again."))


class ColumnWithoutHelp(Count):
    columns = (replace(N_LABELS, help=""),)


class CannotBeMissing(Count):
    columns = (replace(N_LABELS, dtype="int64"),)


def unequal(trial, calls=itertools.count()):  # noqa: B008
    return {"n_labels": next(calls)}


def undeclared(trial):
    return {"n_colours": 3, "labels": np.zeros(3)}


def text(trial):
    return {"n_labels": "many"}


def impossible(trial):
    raise RuntimeError("no legs")


def renamed(trials, calls=itertools.count()):  # noqa: B008
    run = next(calls)
    return [replace(trial, trial_id=f"{trial.trial_id}{run}") for trial in trials]


def numbered_in_the_study(trials):
    return [replace(trial, trial_id=f"{i} of {len(trials)}") for i, trial in enumerate(trials)]


def unpicklable(trials):
    return [replace(trial, extra=lambda trial: {}) for trial in trials]


def of_the_segmenter(trials):
    return [replace(trial, seed=len(trial.segmenter_name)) for trial in trials]


def without_the_segmenter(trials):
    return [replace(trial, trial_id=f"{trial.model.name}{trial.repeat}") for trial in trials]


def by_repeat(trials):
    return sorted(trials, key=lambda trial: trial.repeat)


def fails_on_failures(rows):
    return [a_table(rows.astype({"n_labels": "int64"}))]


@pytest.fixture
def walk():
    return make_segmenter({"_target_": "studies.segmenters.HeatWalk"})


def test_an_experiment_of_ones_own_passes():
    check_experiment(Count(), Prisms(), segmenter(labels_of="vertices"))


def test_arrays_that_are_kept_for_pictures_are_no_columns():
    check_experiment(Count(extra=with_array), Prisms(), segmenter(labels_of="vertices"))


def with_array(trial):
    return {"labels": np.zeros(3)}


@pytest.fixture
def shapes(tmp_path):
    """Two files of a category."""
    for name in ("ellipsoid", "open"):
        example_meshes()[name].export(tmp_path / f"{name}.off")
    return Files(str(tmp_path))


@pytest.mark.parametrize(
    "experiment",
    [
        Anatomy(),
        Times(times={"first": 0.5, "last": 2, "count": 3}, intervals=[(0.5, 2)]),
        Change(perturbation={"_target_": "perturb.ShotNoise", "amount": 0.1}, levels=[0.1, 0.2], gallery=None),
    ],
    ids=lambda experiment: type(experiment).__name__,
)
def test_shipped_experiments_on_files_pass(experiment, shapes, walk):
    check_experiment(experiment, shapes, walk)


def test_the_benchmark_experiment_passes(psb_zip):
    check_experiment(Benchmark(), PSB(psb_zip, models=[341, 342]), make_segmenter({"_target_": HALVES}))


def test_the_experiment_of_poses_passes(tosca_zip):
    check_experiment(Poses(), TOSCA(tosca_zip, models=["cat0", "cat1", "dog0"]), make_segmenter({"_target_": HALVES}))


@pytest.mark.parametrize(
    ("experiment", "message"),
    [
        (Prisms(), "is not a studies.experiments.Experiment"),
        (NoColumns(), r"columns must be a tuple of studies.columns.Column, got \('n_labels',\)"),
        (ColumnOfTheBase(), "columns declared more than once: status"),
        (ColumnWithoutHelp(), "column 'n_labels': its column needs a help text"),
        (Count(change=lambda trials: []), "plans no trials; it must raise StudyError"),
        (Count(change=lambda trials: [0]), "plans 0, which is not a studies.planning.trial.Trial"),
        (Count(change=lambda trials: trials * 2), "plans 12 trials with 6 different trial_ids"),
        (Count(change=renamed), "plans other trial_ids, or another order, when it plans again"),
        (Count(change=numbered_in_the_study), "plans other trial_ids for a model in a study of fewer models"),
        (Count(change=of_the_segmenter), "seeds depend on the segmenter"),
        (Count(change=without_the_segmenter), "trials of two segmenters have the same trial_id"),
        (Count(change=by_repeat), "plans trials of one group_key that are not consecutive"),
        (Count(change=unpicklable), "trial .* cannot be pickled"),
        (Count(extra=impossible), "trial .* fails: RuntimeError: no legs"),
        (Count(extra=unequal), "is not reproducible: n_labels is 0, then 1"),
        (Count(extra=undeclared), "returns n_colours; declare a Column for each value"),
        (Count(extra=text), r"column 'n_labels' of dtype Int64 cannot hold \['many'"),
        (CannotBeMissing(), r"column 'n_labels' of dtype int64 cannot hold \[nan"),
        (Count(make_tables=lambda rows: []), "must return a list of at least one studies.columns.Table"),
        (Count(make_tables=lambda rows: {"table": rows}), "must return a list of at least one studies.columns.Table"),
        (Count(make_tables=lambda rows: [a_table(rows, "t")]), "the first one must have the name 'table', got 't'"),
        (Count(make_tables=lambda rows: [a_table(rows)] * 2), "names must differ, got table, table"),
        (Count(make_tables=lambda rows: [a_table(rows, columns=(N_LABELS,))]), "has values without a Column: model"),
        (Count(make_tables=lambda rows: [a_table(rows, columns=())]), "has values without a Column: model, n_labels"),
        (Count(make_tables=lambda rows: [a_table(rows, value="mean")]), "its value 'mean' is not a column"),
        (Count(make_tables=fails_on_failures), "tables of partly failed rows: tables.. raises"),
    ],
)
def test_an_experiment_that_breaks_a_contract_fails_with_the_reason(experiment, message):
    with pytest.raises(AssertionError, match=message):
        check_experiment(experiment, Prisms(), segmenter(labels_of="vertices"))


def test_the_messages_of_all_checks_are_one_line():
    with pytest.raises(AssertionError) as error:
        check_metric(metric(grows))
    assert re.fullmatch(r"[^\n]+", str(error.value))
