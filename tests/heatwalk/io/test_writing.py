import numpy as np
import pytest
import trimesh

from heatwalk.io import read_mesh, write_mesh
from heatwalk.io.seg import seg_bytes
from heatwalk.meshes import MeshError
from tests.helpers.mesh_files import TETRAHEDRON, is_mesh
from tests.helpers.meshes import bundled_path


@pytest.fixture(scope="module")
def cow():
    """The cow, with coordinates that need all digits, and one that single precision cannot represent."""
    mesh = read_mesh(bundled_path("cow"))
    vertices = mesh.vertices * np.pi + np.random.default_rng(0).standard_normal(mesh.vertices.shape) * 1e-9
    vertices[0, 0] = 1e-300
    return vertices, mesh.faces


@pytest.mark.parametrize("suffix", [".off", ".obj", ".ply", ".OFF"])
def test_a_written_mesh_is_read_unchanged_in_every_bit(cow, suffix, tmp_path):
    write_mesh(tmp_path / f"cow{suffix}", *cow)
    assert is_mesh(read_mesh(tmp_path / f"cow{suffix}"), *cow)


@pytest.mark.parametrize("suffix", [".off", ".obj", ".ply"])
def test_other_programs_read_a_written_mesh(cow, suffix, tmp_path):
    pymeshlab = pytest.importorskip("pymeshlab")
    write_mesh(tmp_path / f"cow{suffix}", *cow)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(tmp_path / f"cow{suffix}"))
    by_trimesh = trimesh.load(tmp_path / f"cow{suffix}", process=False)
    for vertices, faces in (
        (meshes.current_mesh().vertex_matrix(), meshes.current_mesh().face_matrix()),
        (by_trimesh.vertices, by_trimesh.faces),
    ):
        assert np.array_equal(faces, cow[1])
        assert np.allclose(vertices, cow[0], rtol=1e-6, atol=1e-300)


def test_a_written_stl_has_the_triangles_in_single_precision_and_their_normals(cow, tmp_path):
    vertices, faces = cow
    write_mesh(tmp_path / "cow.stl", vertices, faces)
    mesh = read_mesh(tmp_path / "cow.stl")
    assert np.array_equal(mesh.vertices[mesh.faces], vertices.astype(np.float32)[faces])
    header, records = np.split(np.fromfile(tmp_path / "cow.stl", np.uint8), [84])
    normals = records.reshape(-1, 50)[:, :12].copy().view("<f4")
    assert not bytes(header).startswith(b"solid")
    assert np.allclose(normals, trimesh.Trimesh(vertices, faces, process=False).face_normals, atol=1e-6)


def test_huge_and_collapsed_triangles_are_written_as_stl_with_finite_normals(tmp_path):
    vertices = np.vstack([TETRAHEDRON[0] * 1e30, [[1e30, 1e30, 1e30]]])
    write_mesh(tmp_path / "a.stl", vertices, [[0, 1, 2], [0, 1, 1], [1, 2, 4]])
    normals = np.fromfile(tmp_path / "a.stl", np.uint8)[84:].reshape(-1, 50)[:, :12].copy().view("<f4")
    assert np.isfinite(normals).all()
    assert np.array_equal(normals[1], np.zeros(3))


@pytest.mark.parametrize(
    ("name", "faces", "message"),
    [
        ("a.dae", TETRAHEDRON[1], r"a\.dae: the suffix must be one of \.off, \.obj, \.ply, \.stl to write a mesh"),
        ("a.off", [[0, 1, 4]], "refers to vertex 4, but there are 4 vertices"),
        ("a.off", np.empty((0, 3), dtype=int), "no faces"),
    ],
)
def test_what_is_no_mesh_or_no_format_is_not_written(name, faces, message, tmp_path):
    with pytest.raises(MeshError, match=message):
        write_mesh(tmp_path / name, TETRAHEDRON[0], faces)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "labels",
    [[3, 0, 12, 1], [0] * 9, [-1, 5], [10**9, 0], [], np.array([7, 300, 2], dtype=np.uint16), np.arange(2000) % 7],
)
def test_labels_are_written_one_per_line_whatever_their_size(labels):
    assert seg_bytes(labels) == "".join(f"{label}\n" for label in np.asarray(labels).tolist()).encode()
