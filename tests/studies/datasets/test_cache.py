"""Computed meshes on disk: computed once, and again whenever the file is of no use."""

import numpy as np
import pytest

from heatwalk.io import LoadedMesh
from studies.datasets.bundled import RECIPES, BundledModel, prepare
from studies.datasets.cache import FOLDER_VARIABLE, cache_folder, cached_mesh

MESH = LoadedMesh(np.random.default_rng(0).normal(size=(5, 3)), np.array([[0, 1, 2], [2, 3, 4]]), ("Größe ±σ", ""))


@pytest.fixture
def count(tmp_path, monkeypatch):
    """A function: digest -> (the mesh, how often it has been computed); with a cache of its own."""
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "of" / "mine"))
    computed = []

    def load(digest):
        return cached_mesh(digest, lambda: computed.append(digest) or MESH), len(computed)

    return load


def same(first, second):
    return (
        np.array_equal(first.vertices, second.vertices)
        and np.array_equal(first.faces, second.faces)
        and (first.vertices.dtype, first.faces.dtype) == (second.vertices.dtype, second.faces.dtype)
        and first.notes == second.notes
    )


def test_a_mesh_is_computed_once_and_read_back_to_the_byte(count):
    for _ in range(3):
        mesh, computed = count("abc")
        assert same(mesh, MESH)
        assert computed == 1
    assert [path.name for path in cache_folder().iterdir()] == ["abc.npz"]


def test_another_digest_is_another_mesh(count):
    count("abc")
    assert count("abd")[1] == 2


@pytest.mark.parametrize("damage", [0, 1, 100, 400, "end", "flip"])
def test_a_damaged_file_is_replaced(count, damage):
    count("abc")
    path = cache_folder() / "abc.npz"
    content = path.read_bytes()
    if damage == "flip":
        position = content.index(MESH.vertices.tobytes()[:16])
        broken = content[:position] + bytes([content[position] ^ 1]) + content[position + 1 :]
    else:
        broken = content[: -30 if damage == "end" else damage]
    path.write_bytes(broken)
    mesh, computed = count("abc")
    assert same(mesh, MESH)
    assert computed == 2
    assert count("abc")[1] == 2


def test_a_folder_that_cannot_be_written_to_costs_time_only(count, tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "file"))
    assert same(count("abc")[0], MESH)
    assert count("abc")[1] == 2


def test_without_the_variable_it_is_in_the_cache_folder_of_the_user(monkeypatch, tmp_path):
    monkeypatch.delenv(FOLDER_VARIABLE)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("LOCALAPPDATA", str(tmp_path))
    assert cache_folder().parts[-2:] == ("heatwalk", "meshes")
    assert tmp_path in cache_folder().parents


def test_a_bundled_mesh_on_disk_is_the_computed_one():
    model = BundledModel("ant", "animal")
    model.load()
    stored = cached_mesh(model.digest(), lambda: pytest.fail("it is not on disk"))
    assert same(stored, prepare(RECIPES["ant"]))
