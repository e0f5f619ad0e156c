"""Accuracy of variants against ground truth, and its loss."""

from dataclasses import dataclass

import numpy as np
import pandas as pd
import pytest
import trimesh

import perturb
from heatwalk import LoadedMesh, faces_from_vertices
from perturb._odd_meshes import ellipsoid
from studies.datasets import Dataset, Model
from studies.execution import Serial, run_trials
from studies.experiments import Change
from studies.experiments.accuracy import COLUMNS, GroundTruth, missing_values
from studies.experiments.experiment import row_columns
from studies.metrics import psb
from studies.segmenters import make_segmenter
from studies.testing import check_experiment

PREFIXES = ("truth", "loss")


@dataclass(frozen=True)
class Egg(Model):
    """An ellipsoid that two people have cut, or nobody."""

    people: int = 2

    def load(self):
        return LoadedMesh(*ellipsoid(), ())

    def digest(self):
        return 64 * "e"

    def human_segmentations(self):
        vertices, faces = ellipsoid()
        return [np.int64(vertices[faces].mean(axis=1)[:, axis] > 0.2) for axis in range(self.people)]


class Eggs(Dataset):
    name = "eggs"

    def models(self):
        return [Egg("egg", "egg"), Egg("bare", "egg", people=0)]


@pytest.fixture(scope="module")
def mesh():
    return perturb.as_trimesh(*ellipsoid())


def labels_of(mesh, at=0.0):
    return np.int64(np.asarray(mesh.vertices)[:, 0] > at)


def means(mesh, faces, labels, people):
    """The benchmark's metrics on some faces, mean over people, by its own function."""
    surface = trimesh.Trimesh(mesh.vertices, np.asarray(mesh.faces)[faces], process=False)
    judged = faces_from_vertices(labels, np.asarray(surface.faces))
    scores = pd.DataFrame([psb.evaluate(surface, judged, person[faces]) for person in people])
    return scores[list(psb.MAIN)].mean()


def test_a_variant_with_the_labels_of_the_original_loses_exactly_nothing(mesh):
    people = Egg("egg", "").human_segmentations()
    truth = GroundTruth(mesh, labels_of(mesh), people)
    order = np.random.default_rng(0).permutation(len(mesh.vertices))
    labels = np.empty(len(order), dtype=np.int64)
    labels[order] = labels_of(mesh)
    values = truth.values(order, labels)
    assert [values[f"loss_{name}"] for name in psb.MAIN] == [0.0] * 5
    expected = means(mesh, np.ones(len(mesh.faces), dtype=bool), labels_of(mesh), people)
    assert [values[f"truth_{name}"] for name in psb.MAIN] == pytest.approx(expected.tolist(), rel=1e-12)


def test_a_variant_with_the_labels_of_the_only_person_is_right_and_gains_all_that_the_original_lacks(mesh):
    (person,) = Egg("egg", "", people=1).human_segmentations()
    right = labels_of(mesh, 0.2)
    person = faces_from_vertices(right, np.asarray(mesh.faces))
    truth = GroundTruth(mesh, labels_of(mesh, -0.3), [person])
    values = truth.values(np.arange(len(right)), right)
    expected = means(mesh, np.ones(len(mesh.faces), dtype=bool), labels_of(mesh, -0.3), [person])
    assert [values[f"truth_{name}"] for name in psb.MAIN] == [0.0] * 5
    assert [values[f"loss_{name}"] for name in psb.MAIN] == pytest.approx((-expected).tolist(), rel=1e-12)
    assert values["loss_rand_index_error"] < 0


def test_both_are_compared_on_the_faces_that_are_left(mesh):
    people = Egg("egg", "").human_segmentations()
    before, after = labels_of(mesh), labels_of(mesh, 0.4)
    kept = np.asarray(mesh.vertices)[:, 1] < 0.3
    counterpart = np.where(kept, np.cumsum(kept) - 1, -1)
    values = GroundTruth(mesh, before, people).values(counterpart, after[kept])
    left = kept[np.asarray(mesh.faces)].all(axis=1)
    assert 0 < left.sum() < len(left)
    variant, original = (means(mesh, left, labels, people) for labels in (after, before))
    assert [values[f"truth_{name}"] for name in psb.MAIN] == pytest.approx(variant.tolist(), rel=1e-12)
    assert [values[f"loss_{name}"] for name in psb.MAIN] == pytest.approx((variant - original).tolist(), abs=1e-12)


def test_nothing_is_known_of_a_variant_without_a_face_of_the_original(mesh):
    truth = GroundTruth(mesh, labels_of(mesh), Egg("egg", "").human_segmentations())
    assert truth.values(np.full(len(mesh.vertices), -1), np.zeros(4, dtype=np.int64)) == missing_values()


def test_a_cut_on_a_component_where_the_others_have_none_has_no_discrepancy(mesh):
    pair = trimesh.util.concatenate(mesh, mesh.copy().apply_translation([5, 0, 0]))
    n = len(mesh.vertices)
    first, second = (np.where(np.arange(2 * n) // n == k, np.tile(labels_of(mesh), 2), 2) for k in (0, 1))
    truth = GroundTruth(pair, first, [faces_from_vertices(first, np.asarray(pair.faces))])
    values = truth.values(np.arange(2 * n), second)
    assert values["truth_cut_discrepancy"] is None
    assert values["loss_cut_discrepancy"] is None
    assert values["loss_rand_index_error"] > 0


def test_a_ground_truth_of_another_mesh_is_an_error_that_names_the_model(mesh):
    with pytest.raises(ValueError, match=r"ground truth of model egg must have one label for each of its 1280 faces"):
        GroundTruth(mesh, labels_of(mesh), [np.zeros(3, dtype=int)], "egg")


@pytest.fixture(scope="module")
def studied():
    """The experiment and its rows: two levels of noise, of a model with ground truth and of one without."""
    change = Change(
        perturbation={"_target_": "perturb.MissingParts", "shape": "plane"}, levels=[0.05, 0.3], repeats=2, gallery=None
    )
    halves = make_segmenter({"_target_": "tests.helpers.segmenting.halves"})
    rows = list(run_trials(Serial(), change.plan("missing_parts", Eggs(), [halves])))
    assert [row["error"] for row in rows] == [None] * 8
    return change, pd.DataFrame(rows, columns=[column.name for column in row_columns(change)])


def test_rows_have_the_values_where_the_model_has_ground_truth_and_only_there(studied):
    _, rows = studied
    names = [column.name for column in COLUMNS]
    assert names == [f"{prefix}_{name}" for prefix in PREFIXES for name in psb.MAIN]
    assert rows.loc[rows["model"] == "egg", names].notna().all(axis=None)
    assert rows.loc[rows["model"] == "bare", names].isna().all(axis=None)


def test_the_table_of_accuracy_has_means_and_intervals_of_the_losses_by_level(studied):
    change, rows = studied
    (table,) = [table for table in change.tables(rows) if table.name == "accuracy"]
    egg = rows[rows["model"] == "egg"].groupby("level")
    assert table.frame["n"].tolist() == [2, 2]
    for name in [column.name for column in COLUMNS]:
        assert table.frame[name].tolist() == pytest.approx(egg[name].mean().tolist())
    for name in psb.MAIN:
        low, high = (table.frame[f"loss_{name}_{end}"] for end in ("low", "high"))
        assert ((low <= table.frame[f"loss_{name}"] + 1e-12) & (table.frame[f"loss_{name}"] <= high + 1e-12)).all()
    assert not {column.name for column in table.visible(compact=True)} & {column.name for column in COLUMNS}


def test_the_main_table_and_that_of_failures_do_not_depend_on_ground_truth(studied):
    change, rows = studied
    bare = rows.drop(columns=[column.name for column in COLUMNS])
    with_truth, without = ({table.name: table for table in change.tables(each)} for each in (rows, bare))
    assert set(with_truth) - set(without) == {"accuracy"}
    for name, table in without.items():
        pd.testing.assert_frame_equal(table.frame, with_truth[name].frame)


def test_failures_are_a_share_of_the_trials_of_their_level(studied):
    change, rows = studied
    broken = rows.copy()
    broken.loc[(broken["level"] == 0.3) & (broken["repeat"] == 1), "status"] = "failed"
    (table,) = [table for table in change.tables(broken) if table.name == "failures_and_seconds"]
    assert table.frame["failed_share"].tolist() == [0, 50]
    assert table.frame["n"].tolist() == [4, 2]
    seconds = broken[broken["status"] == "ok"].groupby("level")["seconds_segment"].mean()
    assert table.frame["seconds_segment"].tolist() == pytest.approx(seconds.tolist())


def test_the_experiment_keeps_to_its_contract_with_ground_truth(studied):
    change, _ = studied
    check_experiment(change, Eggs(), make_segmenter({"_target_": "tests.helpers.segmenting.halves"}), limit=2)
