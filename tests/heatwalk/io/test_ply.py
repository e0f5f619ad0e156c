import re

import numpy as np
import pytest
import trimesh

from heatwalk.io import label_colours, read_mesh, write_ply
from heatwalk.meshes import MeshError
from tests.helpers.mesh_files import CUBE_QUADS, CUBE_VERTICES, TETRAHEDRON, is_mesh, ply_bytes, read_bytes
from tests.helpers.meshes import bundled_path


@pytest.mark.parametrize("name", ["bone", "ant", "airplane"])
def test_ply_files_keep_the_order_of_their_vertices_and_faces(name):
    pymeshlab = pytest.importorskip("pymeshlab")
    mesh = read_mesh(bundled_path(name))
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(bundled_path(name)))
    reference = meshes.current_mesh()
    used = np.unique(reference.face_matrix())
    assert np.array_equal(mesh.vertices, reference.vertex_matrix().astype(np.float32)[used])
    assert np.array_equal(used[mesh.faces], reference.face_matrix())
    n_unused = reference.vertex_number() - len(used)
    assert mesh.notes == ((f"dropped {n_unused} vertices that belong to no face",) if n_unused else ())


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian"])
def test_a_binary_ply_file_with_faces_of_several_sizes_is_rejected(tmp_path, form):
    for polygons in ([[0, 1, 2], *CUBE_QUADS], [*CUBE_QUADS, [0, 1, 2]]):
        with pytest.raises(MeshError, match="PLY is unexpected length"):
            read_bytes(tmp_path, ply_bytes(CUBE_VERTICES, polygons, form), ".ply")


@pytest.mark.parametrize("form", ["ascii", "binary_little_endian", "binary_big_endian"])
def test_unused_ply_properties_and_elements_are_skipped(tmp_path, form):
    header = (
        f"ply\r\nformat {form} 1.0\r\nobj_info x\r\nelement camera 2\r\nproperty list ushort short sizes\r\n"
        "property float f\r\nelement vertex 4\r\nproperty uchar red\r\nproperty float z\r\n"
        "property double y\r\n"
        "property float x\r\nelement face 4\r\nproperty int flags\r\nproperty list int uint vertex_index\r\n"
        "property list uchar float texcoord\r\nproperty uchar quality\r\nelement edge 1\r\nproperty int vertex1\r\n"
        "property int vertex2\r\n"
        "end_header\r\n"
    ).encode()
    order = ">" if "big" in form else "<"
    body, rows = b"", []

    def put(*typed):
        nonlocal body
        body += b"".join(np.array(value, dtype=order + kind).tobytes() for kind, value in typed)
        rows.append(" ".join(str(value) for _, value in typed))

    put(("u2", 2), ("i2", 7), ("i2", 8), ("f4", 0.5))
    put(("u2", 2), ("i2", 8), ("i2", 9), ("f4", 0.5))
    for x, y, z in TETRAHEDRON[0].tolist():
        put(("u1", 200), ("f4", z), ("f8", y), ("f4", x))
    for i, face in enumerate(TETRAHEDRON[1].tolist()):
        seam = [("f4", 0.25 * (i + corner)) for corner in range(6)]
        put(("i4", 5), ("i4", 3), *(("u4", c) for c in face), ("u1", 6), *seam, ("u1", 9))
    put(("i4", 0), ("i4", 1))
    mesh = read_bytes(tmp_path, header + ("\r\n".join(rows).encode() if form == "ascii" else body), ".ply")
    assert is_mesh(mesh, *TETRAHEDRON)


def test_the_last_face_of_a_ply_file_is_complete_only_with_all_its_properties(tmp_path):
    header = ply_bytes(*TETRAHEDRON, "ascii").replace(b"property list", b"property int flags\nproperty list")
    data = re.sub(rb"^3 ", b"7 3 ", header, flags=re.MULTILINE)
    assert is_mesh(read_bytes(tmp_path, data, ".ply"), *TETRAHEDRON)
    for cut in (b"2\n", b"3 2\n", b"0 3 2\n", b"3 0 3 2\n"):
        with pytest.raises(MeshError, match="declares 4 faces but contains 3: the file is truncated"):
            read_bytes(tmp_path, data.removesuffix(cut), ".ply")


def test_a_written_ply_returns_the_mesh_in_single_precision_and_the_colours_of_its_labels(tmp_path):
    cow = read_mesh(bundled_path("cow"))
    labels = np.arange(len(cow.vertices)) % 7
    for dissipator in (6, None):
        write_ply(tmp_path / "cow.ply", cow.vertices, cow.faces, labels, dissipator)
        assert is_mesh(read_mesh(tmp_path / "cow.ply"), cow.vertices.astype(np.float32), cow.faces)
        coloured = trimesh.load(tmp_path / "cow.ply", process=False)
        assert np.array_equal(coloured.visual.vertex_colors, label_colours(labels, dissipator))


@pytest.mark.parametrize("scale", [1e-50, 1e50])
def test_a_mesh_that_single_precision_cannot_represent_is_not_written(tmp_path, scale):
    with pytest.raises(OSError, match="outside the range of single precision"):
        write_ply(tmp_path / "a.ply", TETRAHEDRON[0] * scale, TETRAHEDRON[1], np.zeros(4, dtype=int))
    assert not (tmp_path / "a.ply").exists()
