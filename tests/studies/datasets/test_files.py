import gzip
import hashlib
import pickle

import numpy as np
import pytest
import trimesh

from studies.datasets import DatasetError
from studies.datasets.files import Files
from tests.helpers.meshes import bundled

NAMES = ["cow2.off", "cow10.OBJ", "cow1.ply", "cats/b.stl", "cats/wild/a.off"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("my [meshes]")
    mesh = bundled("ant")
    for i, name in enumerate(NAMES):
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        scaled = mesh.copy()
        scaled.apply_scale(i + 1)
        scaled.export(path, file_type=path.suffix[1:].lower())
    (folder / "notes.txt").write_text("not a mesh")
    (folder / "folder.off").mkdir()
    return folder


def named(dataset):
    return [(model.name, model.category) for model in dataset.models()]


def test_a_folder_is_searched_to_any_depth_in_natural_order(folder):
    expected = [("cats/b", "cats"), ("cats/wild/a", "wild"), ("cow1", ""), ("cow2", ""), ("cow10", "")]
    assert named(Files(str(folder))) == expected


@pytest.mark.parametrize(
    ("pattern", "names"),
    [
        ("*", ["cow1", "cow2", "cow10"]),
        ("cow?.*", ["cow1", "cow2"]),
        ("*.off", ["cow2"]),
        ("**/*.off", ["cats/wild/a", "cow2"]),
        ("cats/**/*", ["b", "wild/a"]),
        ("c*s/*", ["cats/b"]),
        ("cow10.OBJ", ["cow10"]),
    ],
)
def test_a_pattern_names_models_by_their_path_below_its_fixed_part(folder, monkeypatch, pattern, names):
    monkeypatch.chdir(folder)
    assert [model.name for model in Files(pattern).models()] == names


def test_a_relative_pattern_and_an_absolute_one_give_the_same_models(folder, monkeypatch):
    monkeypatch.chdir(folder.parent)
    assert Files(folder.name).models() == Files(str(folder)).models()


def test_models_can_be_loaded_from_another_working_directory(folder, monkeypatch):
    monkeypatch.chdir(folder)
    sent = [pickle.dumps(model) for model in Files("*").models()]
    monkeypatch.chdir("/")
    for model, scale in zip(map(pickle.loads, sent), (3, 1, 2), strict=True):
        np.testing.assert_allclose(model.load().vertices, scale * bundled("ant").vertices, rtol=1e-6)


def test_a_digest_changes_with_the_file_and_with_nothing_else(tmp_path):
    path, copy = tmp_path / "a.off", tmp_path / "other name.off"
    bundled("ant").export(path)
    copy.write_bytes(path.read_bytes())
    one, other = Files(str(tmp_path)).models()
    before = one.digest()
    assert other.digest() == before
    path.write_bytes(path.read_bytes().replace(b"1", b"2", 1))
    assert one.digest() != before
    assert other.digest() == before


def test_files_have_no_human_segmentations(folder):
    assert all(model.human_segmentations() == [] for model in Files(str(folder)).models())


def test_the_dataset_has_the_name_that_its_option_specifies(folder):
    assert Files(str(folder)).name == "files"
    assert Files(str(folder), name="cats").name == "cats"


@pytest.mark.parametrize("pattern", ["nowhere", "no*/where.off", "*.txt", "cow9.off"])
def test_no_mesh_is_an_error_that_lists_the_suffixes_the_pattern_and_the_folder(folder, monkeypatch, pattern):
    monkeypatch.chdir(folder)
    with pytest.raises(DatasetError) as error:
        Files(pattern).models()
    for part in (".off, .obj, .ply, .stl", f"dataset.glob={pattern!r}", str(folder)):
        assert part in str(error.value)


def test_a_missing_pattern_is_an_error_that_shows_one():
    with pytest.raises(DatasetError, match=r"dataset\.glob='my/meshes/\*\*/\*\.off'"):
        Files(None).models()


def test_two_files_with_one_model_name_are_an_error_that_names_both(tmp_path):
    for name in ("cow.off", "cow.obj"):
        bundled("ant").export(tmp_path / name)
    with pytest.raises(DatasetError, match=r"cow\.obj and .*cow\.off would both be the model 'cow'; .*\*\*/\*\.off"):
        Files(str(tmp_path)).models()
    assert len(Files(str(tmp_path / "*.off")).models()) == 1


def test_suffixes_in_upper_case_are_found_by_every_pattern_and_files_of_macos_by_none(tmp_path):
    for name in ("1.OFF", "2.off", "a/3.Off", "._1.OFF", "._2.off", "a/._3.off", "__MACOSX/._2.off", "__MACOSX/4.off"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    for pattern in ("", "/**/*.off", "/**/*.OFF", "/**/*"):
        assert [model.name for model in Files(f"{tmp_path}{pattern}").models()] == ["1", "2", "a/3"]
    for pattern in ("/._*", "/._1.OFF"):
        with pytest.raises(DatasetError, match="no mesh"):
            Files(f"{tmp_path}{pattern}").models()


def test_welding_gives_other_models_and_leaves_those_without_it_as_they_were(tmp_path):
    ant = bundled("ant")
    corners = ant.triangles.reshape(-1, 3)
    trimesh.Trimesh(corners, np.arange(len(corners)).reshape(-1, 3), process=False).export(tmp_path / "ant.off")
    plain, exact, near = (Files(str(tmp_path), weld=weld).models()[0] for weld in (None, "exact", 1e-5))
    assert plain.digest() == hashlib.sha256((tmp_path / "ant.off").read_bytes()).hexdigest()
    assert len({plain.digest(), exact.digest(), near.digest()}) == 3
    assert len(plain.load().vertices) == len(corners)
    assert len(exact.load().vertices) == len(ant.vertices)
    assert len(near.load().faces) == len(ant.faces)
    with pytest.raises(DatasetError, match=r"^dataset.weld='near' must be 'exact' or a positive number below 1"):
        Files(str(tmp_path), weld="near")


def test_files_of_every_format_are_found_compressed_or_not(tmp_path):
    off = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"
    for name in ("a.glb", "b.GLTF", "c.3mf", "d.vtk", "e.vtp", "f.vtu", "g.msh", "h.obj.bz2", "k.txt.gz", "l.zip"):
        (tmp_path / name).touch()
    for name in ("i.1.off.gz", "j.OFF.GZ"):
        (tmp_path / name).write_bytes(gzip.compress(off.encode()))
    assert [model.name for model in Files(str(tmp_path)).models()] == [*"abcdefgh", "i.1", "j"]
    for pattern in ("*.off.gz", "*.OFF.gz", "*.gz"):
        models = Files(f"{tmp_path}/{pattern}").models()
        assert [model.name for model in models] == ["i.1", "j"]
        assert len(models[0].load().faces) == 4
    (tmp_path / "j.off").write_text(off)
    with pytest.raises(DatasetError, match=r"would both be the model 'j'; give a pattern that matches one of them"):
        Files(str(tmp_path)).models()


def test_the_digest_of_a_gltf_file_is_also_that_of_its_buffers(tmp_path):
    path = tmp_path / "a.gltf"
    path.write_text('{"asset": {"version": "2.0"}, "buffers": [{"uri": "a.bin", "byteLength": 1}]}')
    digests = set()
    for data in (None, b"1", b"2"):
        if data:
            (tmp_path / "a.bin").write_bytes(data)
        digests.add(Files(str(tmp_path)).models()[0].digest())
    assert len(digests) == 3


def test_models_can_be_selected_by_name(tmp_path):
    for name in ("a.off", "cats/tom.off", "cats/kit.off"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert [model.name for model in Files(str(tmp_path), models=["cats/tom", "a"]).models()] == ["a", "cats/tom"]
    with pytest.raises(DatasetError, match="does not have the models b; it has a, cats/kit, cats/tom"):
        Files(str(tmp_path), models=["b"]).models()
