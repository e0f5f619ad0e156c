"""Options, names and digests of the synthetic dataset, and the studies that need what it has."""

import hashlib
import os
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import heatwalk
from studies.datasets import DatasetError
from studies.datasets.cache import FOLDER_VARIABLE
from studies.datasets.synthetic import Synthetic, dataset
from studies.datasets.synthetic.shapes import SHAPES
from studies.experiments import Benchmark, Poses
from studies.metrics import psb
from studies.testing import check_dataset

LOW = 1000
FINGERPRINT = """
import hashlib
from studies.datasets.synthetic import Synthetic
for model in Synthetic(models=["pliers", "pliers-2"], resolution=1000).models():
    mesh, [labels] = model.load(), model.human_segmentations()
    arrays = mesh.vertices.tobytes() + mesh.faces.tobytes() + labels.tobytes() + model.correspondence().tobytes()
    print(hashlib.sha256(arrays).hexdigest(), model.digest())
"""


def one(name, **options):
    [model] = Synthetic(models=[name], **{"resolution": LOW} | options).models()
    return model


def test_models_are_named_after_their_shape_and_pose():
    names = [model.name for model in Synthetic().models()]
    assert names == [name for shape in SHAPES for name in (shape, f"{shape}-2")]
    assert [model.category for model in Synthetic().models()] == [shape for shape in SHAPES for _ in range(2)]
    assert Synthetic().total() == 24


def test_models_and_poses_select_what_satisfies_both():
    chosen = Synthetic(models=["hand-2", "cup", "hand"], poses=[1]).models()
    assert [model.name for model in chosen] == ["hand", "cup"]
    assert [model.name for model in Synthetic(poses=[2]).models()] == [f"{shape}-2" for shape in SHAPES]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"models": ["dog"]}, "does not have the models dog; it has biped, biped-2, quadruped"),
        ({"models": ["hand-3"]}, "does not have the models hand-3"),
        ({"poses": [3]}, "does not have the poses 3; it has 1, 2"),
        ({"models": ["hand"], "poses": [2]}, "dataset.models and dataset.poses together select none"),
        ({"models": "hand"}, r"'dataset.models=\[hand\]'"),
        ({"poses": 1}, r"'dataset.poses=\[1\]'"),
        ({"resolution": 100}, "dataset.resolution=100 must be a whole number from 1,000 to 500,000"),
        ({"resolution": 1e4}, "dataset.resolution=10000.0 must be a whole number"),
        ({"seed": -1}, "dataset.seed=-1 must be a whole number from 0"),
        ({"seed": True}, "dataset.seed=True must be a whole number"),
    ],
)
def test_options_that_cannot_be_met_are_an_error_that_says_what_can(options, message):
    with pytest.raises(DatasetError, match=message):
        Synthetic(**options).models()


def test_the_dataset_keeps_to_the_contract_of_datasets():
    check_dataset(Synthetic(models=["pliers", "pliers-2"], resolution=LOW))


def test_models_are_small_to_pickle_and_the_notes_name_the_parts():
    model = one("pliers")
    assert len(pickle.dumps(model)) < 300
    assert pickle.loads(pickle.dumps(model)) == model
    assert model.load().notes == (
        "generated with 5 parts: joint, left handle, left jaw, right handle, right jaw",
    )  # fmt: skip


def test_another_process_with_another_number_of_threads_computes_the_same_bytes(tmp_path):
    ours = []
    for model in Synthetic(models=["pliers", "pliers-2"], resolution=LOW).models():
        mesh, [labels] = model.load(), model.human_segmentations()
        arrays = mesh.vertices.tobytes() + mesh.faces.tobytes() + labels.tobytes() + model.correspondence().tobytes()
        ours += [hashlib.sha256(arrays).hexdigest(), model.digest()]
    # With a cache of its own, it cannot read what we have computed.
    other = {"OMP_NUM_THREADS": "3", "OPENBLAS_NUM_THREADS": "3", "PYTHONHASHSEED": "5", FOLDER_VARIABLE: str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", FINGERPRINT], cwd=Path(__file__).parents[4], env=os.environ | other,
        capture_output=True, text=True, check=True,
    )  # fmt: skip
    assert sorted(done.stdout.split()) == sorted(ours)


def test_the_digest_changes_with_all_that_determines_the_mesh(monkeypatch):
    models = [
        one("hand"),
        one("hand-2"),
        one("cup"),
        one("hand", resolution=1001),
        one("hand", seed=0),
        one("hand", seed=1),
    ]
    assert len({model.digest() for model in models}) == len(models)
    assert len({model.correspondence_digest() for model in models}) == len(models)
    assert all(model.human_digest() == model.digest() for model in models)
    before = one("hand").digest()
    monkeypatch.setitem(SHAPES, "hand", replace(SHAPES["hand"], blend=0.021))
    changed = one("hand").digest()
    monkeypatch.setattr(dataset, "VERSION", dataset.VERSION + 1)
    assert len({before, changed, one("hand").digest()}) == 3


def test_another_seed_is_another_mesh_with_the_same_parts():
    drawn, varied = one("pliers"), one("pliers", seed=1)
    assert drawn.load().vertices.shape != varied.load().vertices.shape
    assert set(varied.human_segmentations()[0]) == set(drawn.human_segmentations()[0])


def test_table_1_compares_with_the_exact_segmentation_and_has_no_row_of_people(plan, rows_of):
    trials = plan("+study=table1", "dataset=synthetic", f"dataset.resolution={LOW}", "dataset.models=[pliers]")
    [row] = rows_of(trials, Benchmark).to_dict("records")
    model = one("pliers")
    mesh, [exact] = model.load(), model.human_segmentations()
    wanted = psb.evaluate(mesh, heatwalk.segment(mesh.vertices, mesh.faces).face_labels, exact)
    assert (row["status"], row["segmenter"], row["n_people"]) == ("ok", "HeatWalk", 1)
    assert {name: row[name] for name in wanted} == pytest.approx(wanted, rel=1e-12)


def test_the_study_of_poses_compares_both_poses_at_every_vertex_of_the_first(plan, rows_of):
    words = ("dataset=synthetic", f"dataset.resolution={LOW}", "dataset.models=[pliers,pliers-2]")
    [row] = rows_of(plan("+study=pose", *words), Poses).to_dict("records")
    assert (row["status"], row["model"], row["other"]) == ("ok", "pliers", "pliers-2")
    assert row["n_compared"] == row["n_vertices"] == len(one("pliers").load().vertices)
    assert row["change_percentage"] < 20
    assert np.isfinite(row["van_dongen"])
