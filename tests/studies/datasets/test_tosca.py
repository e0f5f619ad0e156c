import gzip
import hashlib
import itertools
import pickle
import shutil
import zipfile

import numpy as np
import pytest
import trimesh
from scipy.io import savemat

from heatwalk import MeshError
from heatwalk.io import read_mesh
from studies.datasets import DatasetError
from studies.datasets.tosca import TOSCA

OFF = "OFF\n4 4 0\n0 0 0\n1 0 0\n0 1 0\n0 0 1\n3 0 2 1\n3 0 1 3\n3 0 3 2\n3 1 2 3\n"


@pytest.fixture
def small(tmp_path):
    """Poses of a cat, the same four points listed in different orders, and one pose of a dog."""
    poses = tmp_path / "TOSCA_Isometric" / "vtx_5k"
    (poses / "corres").mkdir(parents=True)
    for name, points in (("cat10", "1 2 3 4 2"), ("cat2", "4 3 2 1 3"), ("dog0", "1")):
        (poses / f"{name}.off").write_text(OFF)
        (poses / "corres" / f"{name}.vts").write_text(points.replace(" ", "\r\n") + "\r\n")
    for other in ("readme.off", "1.off", "._cat2.off", "cat2.png"):
        (poses / other).write_text("")
    return poses


@pytest.fixture
def without_corres(small):
    shutil.rmtree(small / "corres")
    return small


@pytest.fixture(scope="session")
def cat(tosca_root):
    """Vertices of two poses of a cat with the same faces, as in the original: cat1 is cat0 bent."""
    mesh = read_mesh(tosca_root / "cat0.off")
    bent = mesh.vertices * [1, 1, 1.2] + np.sin(mesh.vertices[:, [1, 2, 0]] / 20)
    return {"cat0": mesh.vertices, "cat1": bent}, mesh.faces


def write_mat(path, vertices, faces, **more):
    x, y, z = vertices.T[:, :, None]
    savemat(path, {"surface": {"X": x, "Y": y, "Z": z, "TRIV": faces + 1.0, **more}})


def write_text(path, vertices, faces):
    np.savetxt(path.with_suffix(".vert"), vertices, "%.17g")
    np.savetxt(path.with_suffix(".tri"), faces + 1, "%d")


def as_zip(folder, path):
    files = [file for file in folder.rglob("*") if file.is_file()]  # before the archive, which may be in the folder
    with zipfile.ZipFile(path, "w") as archive:  # without entries for folders, as in many archives
        for file in files:
            archive.write(file, file.relative_to(folder))
    return path


def pose(root, name):
    [model] = TOSCA(root, models=[name]).models()
    return model


def test_the_zip_and_the_folder_contain_the_same_poses(tosca_zip, tosca_root):
    packed, unpacked = TOSCA(tosca_zip).models(), TOSCA(tosca_root).models()
    assert [(model.name, model.category) for model in packed] == [(model.name, model.category) for model in unpacked]
    for here, there in zip(packed[::8], unpacked[::8], strict=True):
        assert here.digest() == there.digest()
        assert here.correspondence_digest() == there.correspondence_digest()
        assert np.array_equal(here.load().vertices, there.load().vertices)
        assert np.array_equal(here.load().faces, there.load().faces)
        assert np.array_equal(here.correspondence(), there.correspondence())


def test_the_root_may_be_any_folder_down_to_the_poses_or_a_zip_of_it(small, tmp_path_factory):
    elsewhere = tmp_path_factory.mktemp("zips")
    roots = [small, small.parent, small.parent.parent]
    roots += [as_zip(root, elsewhere / f"{i}.zip") for i, root in enumerate(roots)]
    for root in roots:
        models = TOSCA(str(root)).models()
        assert [(model.name, model.category) for model in models] == [
            ("cat2", "cat"),
            ("cat10", "cat"),
            ("dog0", "dog"),
        ]
        assert models[0].digest() == hashlib.sha256(OFF.encode()).hexdigest()
        assert models[0].correspondence().tolist() == [3, 2, 1, 0, 2]


def test_poses_are_by_shape_in_the_order_of_their_numbers(tosca_zip):
    there = TOSCA(tosca_zip).models()
    poses = {
        shape: [model.name for model in models] for shape, models in itertools.groupby(there, lambda m: m.category)
    }
    numbers = {"cat": range(11), "centaur": range(6), "dog": [0, 1, 2, 3, 5, 6, 7, 8, 10], "michael": range(20)}
    assert poses == {shape: [f"{shape}{number}" for number in of_shape] for shape, of_shape in numbers.items()}


def test_the_ends_of_an_edge_are_next_to_each_other_in_every_pose(tosca_root):
    """In mean edge lengths. With vertices counted from 0 instead of 1 in one pose, the median is 2.2 and more."""
    for one, other in (("cat0", "cat9"), ("centaur1", "centaur2"), ("dog3", "dog10"), ("michael5", "michael15")):
        here, there = pose(tosca_root, one), pose(tosca_root, other)
        a, b = (trimesh.Trimesh(mesh.vertices, mesh.faces, process=False) for mesh in (here.load(), there.load()))
        counterpart = np.full(len(a.vertices), -1)
        counterpart[here.correspondence()] = there.correspondence()
        ends = counterpart[a.edges_unique]
        ends = ends[(ends >= 0).all(axis=1)]
        apart = np.linalg.norm(b.vertices[ends[:, 0]] - b.vertices[ends[:, 1]], axis=1) / b.edges_unique_length.mean()
        assert len(ends) > len(a.edges_unique) / 2
        assert np.median(apart) < 1.2
        assert np.quantile(apart, 0.99) < 5


def test_the_original_as_matlab_structures_or_as_text_contains_the_same_poses(cat, tmp_path):
    vertices, faces = cat
    mat, text = tmp_path / "mat", tmp_path / "text"
    mat.mkdir()
    text.mkdir()
    for name in vertices:
        write_mat(mat / f"{name}.mat", vertices[name], faces)
        write_text(text / name, vertices[name], faces)
    for root in (mat, text, as_zip(mat, tmp_path / "mat.zip"), as_zip(text, tmp_path / "text.zip")):
        models = TOSCA(root).models()
        assert [(model.name, model.category) for model in models] == [("cat0", "cat"), ("cat1", "cat")]
        for model in models:
            mesh = model.load()
            assert np.array_equal(mesh.vertices, vertices[model.name])
            assert np.array_equal(mesh.faces, faces)
            assert mesh.notes == ()
            assert np.array_equal(model.correspondence(), np.arange(len(mesh.vertices)))


def test_vertices_without_faces_are_dropped_from_all_poses_alike(cat, tmp_path):
    vertices, faces = cat
    for name in vertices:
        write_mat(tmp_path / f"{name}.mat", np.insert(vertices[name], 7, 0, axis=0), faces + (faces >= 7))
    for model in TOSCA(tmp_path).models():
        mesh = model.load()
        assert np.array_equal(mesh.vertices, vertices[model.name])
        assert np.array_equal(mesh.faces, faces)
        assert mesh.notes == ("dropped 1 vertices that belong to no face",)
        assert np.array_equal(model.correspondence(), np.arange(len(mesh.vertices)))


def test_the_digest_of_a_pose_changes_with_each_of_its_files_and_with_no_other(cat, tmp_path):
    vertices, faces = cat
    for name in vertices:
        write_text(tmp_path / name, vertices[name], faces)
    models = TOSCA(tmp_path).models()
    digests = [model.digest() for model in models]
    for suffix in (".vert", ".tri"):
        file = tmp_path / f"cat0{suffix}"
        file.write_text(file.read_text() + "\n")
        assert models[0].digest() not in digests
        assert models[1].digest() == digests[1]
        digests.append(models[0].digest())
    assert models[0].correspondence_digest() == models[0].digest()


def test_the_digest_of_a_correspondence_is_that_of_its_file(small):
    file = small / "corres" / "cat2.vts"
    before = pose(small, "cat2").digest()
    file.write_text("1\n2\n3\n4\n4\n")
    assert pose(small, "cat2").digest() == before
    assert pose(small, "cat2").correspondence_digest() == hashlib.sha256(file.read_bytes()).hexdigest()


def test_poses_without_listed_vertices_correspond_by_number_if_they_have_the_same_faces(without_corres):
    for model in TOSCA(without_corres).models():
        assert model.correspondence().tolist() == [0, 1, 2, 3]
    (without_corres / "cat10.off").write_text(OFF.replace("3 0 2 1", "3 2 1 0"))
    with pytest.raises(DatasetError, match=r"cat10\.off and .*cat2\.off have different faces.* cat10\.vts is not in"):
        pose(without_corres, "cat10").correspondence()


def test_one_shape_may_have_listed_vertices_and_another_none(small):
    (small / "corres" / "dog0.vts").unlink()
    assert pose(small, "dog0").correspondence().tolist() == [0, 1, 2, 3]
    assert pose(small, "cat10").correspondence().tolist() == [0, 1, 2, 3, 1]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("", "the file is empty"),
        ("1\n2\n3\n4\n", r"has 4 lines, .*cat2\.vts has 5"),
        ("1\n2\nx\n4\n1\n", r"line 3 is not a vertex number \(1, 2, 3 …\): 'x'"),
        ("1\n2 3\n3\n4\n1\n", "line 2 is not a vertex number"),
        ("1\n2\n3\n4\n0\n", "line 5 is vertex 0, not one of 1 … 4"),
        ("1\n2\n5\n4\n1\n", "line 3 is vertex 5, not one of 1 … 4"),
    ],
)
@pytest.mark.parametrize("packed", [False, True])
def test_a_damaged_list_of_vertices_is_an_error_that_names_file_and_line(small, content, message, packed):
    (small / "corres" / "cat10.vts").write_text(content)
    root = as_zip(small, small.with_suffix(".zip")) if packed else small
    with pytest.raises(DatasetError, match=rf"corres/cat10\.vts:? .*{message}|corres/cat10\.vts: {message}") as error:
        pose(root, "cat10").correspondence()
    assert str(error.value).startswith(str(root))


def test_a_missing_list_of_vertices_is_an_error_for_its_pose_alone(small):
    (small / "corres" / "cat2.vts").unlink()
    with pytest.raises(DatasetError, match=r"corres/cat2\.vts is missing"):
        pose(small, "cat2").correspondence()
    assert pose(small, "cat10").correspondence().tolist() == [0, 1, 2, 3, 1]


def test_listed_vertices_of_a_mesh_that_reading_renumbers_are_an_error(small):
    (small / "cat10.off").write_text(OFF.replace("4 4 0\n", "5 4 0\n").replace("0 0 1\n3", "0 0 1\n9 9 9\n3", 1))
    with pytest.raises(DatasetError, match=r"cat10\.vts may number other vertices than those read: dropped 1 vert"):
        pose(small, "cat10").correspondence()


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"other": 1}, "no MATLAB structure `surface` with X, Y, Z and TRIV"),
        ({"surface": 1}, "no MATLAB structure `surface`"),
        ({"surface": {"X": [1.0], "Y": [1.0], "TRIV": [[1, 1, 1]]}}, "no MATLAB structure `surface`"),
        ({"surface": {"X": np.ones(3), "Y": np.ones(2), "Z": np.ones(3), "TRIV": [[1, 2, 3]] * 2}}, "dimensions"),
        ({"surface": {"X": np.ones(3), "Y": np.ones(3), "Z": np.ones(3), "TRIV": [[1, 2, 4]] * 2}}, "vertex 3, but"),
        ({"surface": {"X": np.ones(3), "Y": np.ones(3), "Z": np.ones(3), "TRIV": [[1, 2, 0]] * 2}}, "vertex -1, but"),
        ({"surface": {"X": np.ones(3), "Y": np.ones(3), "Z": np.ones(3), "TRIV": [[1, 2, 1.5]] * 2}}, "not integers"),
    ],
)
def test_a_damaged_matlab_file_is_an_error_that_names_it(tmp_path, content, message):
    savemat(tmp_path / "cat0.mat", content)
    with pytest.raises(MeshError, match=rf"cat0\.mat: .*{message}") as error:
        pose(tmp_path, "cat0").load()
    assert str(error.value).startswith(str(tmp_path))


def test_files_that_do_not_contain_a_pose_are_errors_that_name_them(tmp_path):
    (tmp_path / "cat0.mat").write_bytes(b"nothing of MATLAB")
    (tmp_path / "text").mkdir()
    (tmp_path / "text" / "cat0.vert").write_text("0 0 0\n1 0 0\n0 1 0\n")
    with pytest.raises(MeshError, match=r"cat0\.mat: "):
        pose(tmp_path, "cat0").load()
    with pytest.raises(MeshError, match=r"cat0\.vert and .*cat0\.tri: .*FileNotFound"):
        pose(tmp_path / "text", "cat0").load()
    (tmp_path / "text" / "cat0.tri").write_text("1 2 x\n")
    with pytest.raises(MeshError, match=r"cat0\.vert and .*cat0\.tri: .*could not convert string 'x'"):
        pose(tmp_path / "text", "cat0").load()


def test_poses_are_small_to_pickle_and_load_the_same_elsewhere(tosca_zip):
    model = pose(tosca_zip, "cat3")
    sent = pickle.dumps(model)
    assert len(sent) < 1000
    assert np.array_equal(pickle.loads(sent).load().vertices, model.load().vertices)
    assert np.array_equal(pickle.loads(sent).correspondence(), model.correspondence())


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"categories": ["cow"]}, "does not have the categories cow; it has cat, dog$"),
        ({"models": ["cat1", "cat2"]}, "does not have the models cat1; it has cat2, cat10, dog0$"),
        ({"models": ["cat2"], "categories": ["Dog"]}, "has 3 poses, and .* select none of them"),
    ],
)
def test_a_request_for_what_is_not_available_is_an_error_that_lists_what_is(small, options, message):
    with pytest.raises(DatasetError, match=message):
        TOSCA(small, **options).models()


def test_poses_in_two_formats_or_in_two_folders_are_an_error_that_names_both(small):
    write_mat(small / "cat2.mat", np.eye(3), np.array([[0, 1, 2], [2, 1, 0]]))
    with pytest.raises(DatasetError, match=r"vtx_5k has cat2 both as \.mat and as \.off"):
        TOSCA(small).models()
    shutil.copytree(small, small.parent / "vtx_7k")
    with pytest.raises(DatasetError, match="contains the data more than once, in vtx_5k and vtx_7k"):
        TOSCA(small.parent).models()


def test_missing_data_are_an_error_that_lists_the_expected_files_and_what_to_type(tmp_path):
    (tmp_path / "empty").mkdir()
    (tmp_path / "not a zip.zip").write_text("nothing")
    as_zip(tmp_path / "empty", tmp_path / "other.zip")
    for root in (None, tmp_path / "nowhere", tmp_path, tmp_path / "not a zip.zip", tmp_path / "other.zip"):
        with pytest.raises(DatasetError) as error:
            TOSCA(root).models()
        for part in ("cat0.mat", "cat0.tri", "corres/cat0.vts", "dataset.root=PATH", "TOSCA_ROOT", str(root or "")):
            assert part in str(error.value)


@pytest.mark.parametrize("packed", [False, True])
def test_suffixes_in_upper_case_and_compressed_poses_are_found(small, packed):
    poses = next(small.rglob("cat2.off")).parent
    (poses / "cat2.off").rename(poses / "cat2.OFF")
    (poses / "cat10.off.GZ").write_bytes(gzip.compress((poses / "cat10.off").read_bytes()))
    (poses / "cat10.off").unlink()
    lists = poses / "corres"
    if lists.is_dir():
        for file in list(lists.iterdir()):
            file.rename(file.with_suffix(".VTS"))
    root = as_zip(small, small.with_suffix(".zip")) if packed else small
    models = {model.name: model for model in TOSCA(root).models()}
    assert {"cat2", "cat10"} <= models.keys()
    for name in ("cat2", "cat10"):
        assert len(models[name].load().faces) == 4
        assert len(models[name].digest()) == 64
        assert len(models[name].correspondence())


def test_a_pose_as_text_is_found_by_a_suffix_in_upper_case(tmp_path):
    np.savetxt(tmp_path / "dog0.VERT", np.eye(4)[:, :3])
    np.savetxt(tmp_path / "dog0.Tri", [[1, 2, 3], [2, 3, 4]], "%d")
    assert len(TOSCA(tmp_path).models()[0].load().faces) == 2
