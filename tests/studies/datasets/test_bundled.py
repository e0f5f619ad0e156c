import hashlib
import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial import KDTree

from heatwalk import inspect_mesh
from studies.datasets import DatasetError, bundled
from studies.datasets.bundled import RECIPES, Bundled

FINGERPRINT = """
import hashlib
import sys
from studies.datasets.bundled import RECIPES, Bundled, prepare
[model] = Bundled([sys.argv[1]]).models()
mesh = prepare(RECIPES[model.name])
print(hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest(), model.digest())
"""


@pytest.fixture(scope="module", params=RECIPES)
def model(request):
    [model] = Bundled([request.param]).models()
    return model


def as_trimesh(model):
    mesh = model.load()
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def test_the_models_are_an_ant_a_bunny_and_a_cow():
    assert [model.name for model in Bundled().models()] == ["ant", "bunny", "cow"]
    assert [model.name for model in Bundled(["cow", "ant"]).models()] == ["ant", "cow"]


def test_the_surface_is_closed_oriented_outwards_and_of_one_piece_without_handles(model):
    mesh = as_trimesh(model)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert mesh.body_count == 1
    assert mesh.euler_number == 2
    assert len(np.unique(mesh.faces)) == len(mesh.vertices)
    assert len(np.unique(mesh.vertices, axis=0)) == len(mesh.vertices)
    assert len(np.unique(np.sort(mesh.faces, axis=1), axis=0)) == len(mesh.faces)


def test_the_surface_has_five_to_ten_thousand_evenly_spaced_vertices(model):
    mesh = as_trimesh(model)
    lengths = mesh.edges_unique_length
    assert 5_000 <= len(mesh.vertices) <= 10_000
    assert lengths.std() < 0.2 * lengths.mean()
    assert np.degrees(np.quantile(mesh.face_angles, 0.01)) > 20


def test_the_surface_is_close_to_the_packaged_mesh(model):
    mesh, recipe = as_trimesh(model), RECIPES[model.name]
    packaged = bundled.read_mesh(recipe.path)
    diagonal = np.linalg.norm(np.ptp(packaged.vertices, axis=0))
    samples = trimesh.sample.sample_surface(trimesh.Trimesh(packaged.vertices, packaged.faces), 200_000, seed=0)[0]
    # The distance of a wrap from the mesh is its offset, and more in the gaps that it bridges.
    distance = KDTree(samples).query(mesh.vertices)[0] / diagonal
    assert np.quantile(distance, 0.9) < 1.5 * recipe.offset / 100


def test_the_mesh_can_be_segmented_as_it_is(model):
    mesh = model.load()
    report = inspect_mesh(mesh.vertices, mesh.faces)
    assert report.problem is None
    assert report.n_degenerate_faces == 0


@pytest.mark.slow
def test_another_process_computes_the_same_bytes(model):
    mesh = model.load()
    ours = hashlib.sha256(mesh.vertices.tobytes() + mesh.faces.tobytes()).hexdigest()
    other = subprocess.run(
        [sys.executable, "-c", FINGERPRINT, model.name],
        cwd=Path(__file__).parents[3],
        capture_output=True,
        text=True,
        check=True,
    )
    assert other.stdout.split() == [ours, model.digest()]


def test_a_digest_changes_with_the_recipe(model, monkeypatch):
    before = model.digest()
    monkeypatch.setitem(RECIPES, model.name, replace(RECIPES[model.name], alpha=3))
    assert model.digest() != before


def test_modifying_a_mesh_does_not_affect_the_next_one_loaded(model):
    first = model.load()
    first.vertices[:] = 0
    first.faces[:] = 0
    again = model.load()
    assert np.ptp(again.vertices) > 0
    assert again.faces.max() == len(again.vertices) - 1


def test_models_are_small_to_pickle(model):
    assert len(pickle.dumps(model)) < 200
    assert pickle.loads(pickle.dumps(model)) == model


def test_the_notes_describe_the_resampling(model):
    mesh = model.load()
    assert mesh.notes[-1].startswith("resampled by an alpha wrap")
    assert mesh.notes[-1].endswith(f"vertices became {len(mesh.vertices):,}")
    assert ("Loop" in mesh.notes[-1]) == (model.name == "ant")


@pytest.mark.parametrize("models", [["dog"], ["cow", 94], []])
def test_unknown_names_are_an_error_that_lists_the_models(models):
    with pytest.raises(DatasetError, match="the bundled models are ant, bunny, cow"):
        Bundled(models).models()


def test_a_single_name_is_an_error_that_shows_a_list():
    with pytest.raises(DatasetError, match=r"'dataset.models=\[cow\]'"):
        Bundled("cow")
