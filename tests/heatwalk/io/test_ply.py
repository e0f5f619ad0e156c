import re

import numpy as np
import pytest
import trimesh

from heatwalk.io import label_colours, read_mesh, write_ply
from heatwalk.io.ply import comments_of
from heatwalk.meshes import MeshError, face_areas
from tests.helpers.mesh_files import CUBE_QUADS, CUBE_VERTICES, TETRAHEDRON, is_mesh, off_bytes, ply_bytes, read_bytes
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
    notes = [note for note in mesh.notes if "coincide" not in note]
    assert notes == ([f"dropped {n_unused} vertices that belong to no face"] if n_unused else [])


COUNT_TYPES = ["uchar", "char", "ushort", "short", "uint", "int"]


def rows_of(polygons, order, count_kind, kind, before=b"", after=b""):
    return b"".join(
        before + np.array([len(p)], order + count_kind).tobytes() + np.array(p, order + kind).tobytes() + after
        for p in polygons
    )


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian"])
@pytest.mark.parametrize("count_type", COUNT_TYPES)
@pytest.mark.parametrize("corner_type", COUNT_TYPES)
def test_binary_faces_of_several_sizes_are_read_whatever_their_types(tmp_path, form, count_type, corner_type):
    codes = {"uchar": "u1", "char": "i1", "ushort": "u2", "short": "i2", "uint": "u4", "int": "i4"}
    order = ">" if "big" in form else "<"
    vertices = np.vstack([CUBE_VERTICES, [[0.5, 0.5, 2]]])
    sides = [*CUBE_QUADS[:1], *CUBE_QUADS[2:], [4, 5, 8], [5, 7, 8], [7, 6, 8], [6, 4, 8]]
    for polygons in (sides, sides[::-1]):
        header = ply_bytes(vertices, [], form).replace(b"face 0", b"face 9")
        header = header.replace(b"list uchar int", f"list {count_type} {corner_type}".encode())
        data = header + rows_of(polygons, order, codes[count_type], codes[corner_type])
        mesh, expected = (
            read_bytes(tmp_path, d, s) for d, s in ((data, ".ply"), (off_bytes(vertices, polygons), ".off"))
        )
        assert is_mesh(mesh, expected.vertices, expected.faces)
        assert face_areas(mesh.vertices, mesh.faces).sum() == pytest.approx(5 + 4 * np.sqrt(1.25) / 2)
        with pytest.raises(MeshError, match="declares 9 faces but contains 8: the file is truncated"):
            read_bytes(tmp_path, data[:-1], ".ply")


@pytest.mark.parametrize("form", ["binary_little_endian", "binary_big_endian"])
def test_lists_and_values_around_the_corners_of_binary_faces_are_skipped(tmp_path, form):
    order = ">" if "big" in form else "<"
    polygons = [[0, 2, 1], *CUBE_QUADS[1:3]]
    header = (
        ply_bytes(CUBE_VERTICES, [], form)
        .replace(b"face 0", b"face 3")
        .replace(
            b"property list uchar int vertex_indices",
            b"property short flags\nproperty list int double before\nproperty list uchar int vertex_indices\n"
            b"property list uchar char after\nproperty uchar last",
        )
    )
    body = b""
    for i, polygon in enumerate(polygons):
        body += np.array([7], order + "i2").tobytes() + rows_of([[0.5] * i], order, "i4", "f8")
        body += rows_of([polygon], order, "u1", "i4") + rows_of([[-1] * (3 - i)], order, "u1", "i1") + b"\x09"
    mesh = read_bytes(tmp_path, header + body, ".ply")
    expected = read_bytes(tmp_path, off_bytes(CUBE_VERTICES, polygons), ".off")
    assert is_mesh(mesh, expected.vertices, expected.faces)


def test_a_negative_number_of_corners_is_rejected(tmp_path):
    data = ply_bytes(*TETRAHEDRON, "binary_little_endian").replace(b"list uchar", b"list char")
    data = data[:-13] + b"\xff" + data[-12:]
    with pytest.raises(MeshError, match=r"face 3 \(counted from 0\) has -1 values in the list vertex_indices"):
        read_bytes(tmp_path, data, ".ply")


PLY_TEXT = ply_bytes(*TETRAHEDRON, "ascii")
PLY_LAYOUTS = {
    "blank lines": PLY_TEXT.replace(b"end_header\n", b"end_header\n\n \n").replace(b"3 0 1 3", b"\n3 0 1 3\n\n"),
    "old Macintosh line ends": PLY_TEXT.replace(b"\n", b"\r"),
    "carriage returns": PLY_TEXT.replace(b"\n", b"\r\n"),
    "comment before the format": PLY_TEXT.replace(b"ply\n", b"ply\ncomment made by x\nobj_info y\n"),
    "end_header in a comment": PLY_TEXT.replace(b"made by a test", b"end_header"),
    "element in a comment": PLY_TEXT.replace(b"made by a test", b"element face 9"),
    "trailing byte": PLY_TEXT + b"\x1a",
    "trailing zeros": PLY_TEXT + bytes(7),
    "trailing word": PLY_TEXT + b"x",
    "byte-order mark": b"\xef\xbb\xbf" + PLY_TEXT,
    "rows broken into lines": PLY_TEXT.replace(b"3 1 2 3", b"3 1\n2\n3"),
    "binary, old Macintosh line ends": ply_bytes(TETRAHEDRON[0], [], "binary_little_endian")
    .replace(b"face 0", b"face 4")
    .partition(b"end_header\n")[0]
    .replace(b"\n", b"\r")
    + b"end_header\r"
    + ply_bytes(*TETRAHEDRON, "binary_little_endian").partition(b"end_header\n")[2],
    "binary, trailing byte": ply_bytes(*TETRAHEDRON, "binary_big_endian") + b"x",
    "binary, trailing zeros": ply_bytes(*TETRAHEDRON, "binary_big_endian") + bytes(26),
}


@pytest.mark.parametrize("data", PLY_LAYOUTS.values(), ids=PLY_LAYOUTS)
def test_ply_files_are_read_however_they_are_laid_out(tmp_path, data):
    assert is_mesh(read_bytes(tmp_path, data, ".ply"), *TETRAHEDRON)


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            PLY_TEXT.replace(b"3 0 1 3", b"3 0 1 3 9"),
            r"line 16: 5 values, where the header declares 4 for the face 1 .*",
        ),
        (PLY_TEXT.replace(b"3 0 1 3", b"3 0 x 3"), "line 16: 'x' is not a number"),
        (PLY_TEXT.replace(b"3 0 1 3", b"3 0 1.5 3"), "a face has the corner 1.5, which is not the number of a vertex"),
        (
            PLY_TEXT.replace(b"3 0 1 3", b"-3 0 1 3"),
            r"face 1 \(counted from 0\) has -3 values in the list vertex_indices",
        ),
        (PLY_TEXT.replace(b"format ascii 1.0\n", b""), "the header has no line 'format': .*"),
        (PLY_TEXT.replace(b"ascii", b"text"), "line 2: unknown format 'text'; PLY has ascii, .*"),
        (PLY_TEXT.replace(b"uchar int vertex_indices", b"uchar int strips"), "the header must declare one list of .*"),
        (PLY_TEXT.replace(b"double z", b"double depth"), "the header declares vertices without .* x, y and z"),
        (PLY_TEXT.replace(b"element face", b"element fa\x00ce"), r".* declares vertex, fa\\x00ce: a point cloud .*"),
        (PLY_TEXT.replace(b"list uchar", b"list float"), "line 9: the number of values of the list .* as float"),
        (PLY_TEXT.replace(b"comment", b"remark"), "line 3: 'remark made by a test' does not belong in the header .*"),
        (
            ply_bytes(*TETRAHEDRON, "binary_little_endian") + b"\3" + bytes(8) + b"\1\0\0\0",
            "contains 1 more faces than its header declares: .*",
        ),
    ],
)
def test_a_broken_ply_file_is_rejected_with_what_is_wrong_and_where(tmp_path, data, message):
    with pytest.raises(MeshError, match=f"mesh.ply: {message}$"):
        read_bytes(tmp_path, data, ".ply")


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


@pytest.mark.parametrize("scale", [1e-200, 1e-50, 1e50, 1e200])
def test_a_mesh_that_single_precision_cannot_represent_is_written_in_double_precision(tmp_path, scale):
    write_ply(tmp_path / "a.ply", TETRAHEDRON[0] * scale, TETRAHEDRON[1], np.zeros(4, dtype=int))
    assert is_mesh(read_mesh(tmp_path / "a.ply"), TETRAHEDRON[0] * scale, TETRAHEDRON[1])


def test_precision_is_double_only_where_single_would_move_a_vertex_by_a_thousandth_of_its_shortest_edge(tmp_path):
    vertices, faces = TETRAHEDRON
    for offset, kind in ((1e3, b"float"), (1e5, b"double"), (5e6, b"double")):
        write_ply(tmp_path / "a.ply", vertices * 0.4 + offset + 0.01, faces, np.zeros(4, dtype=int))
        assert b"property %s x" % kind in (tmp_path / "a.ply").read_bytes()
        moved = np.abs(read_mesh(tmp_path / "a.ply").vertices - (vertices * 0.4 + offset + 0.01))
        assert np.linalg.norm(moved, axis=1).max() <= 0.4e-3
    # One short edge far from the origin is enough; ends that coincide do not count.
    apart = np.array([[100.0, 0, 0], [101, 0, 0], [100, 1, 0], [100, 0, 1e-4], [100, 0, 1e-4]])
    write_ply(tmp_path / "a.ply", apart + 0.1, [[0, 1, 2], [0, 3, 1], [3, 4, 2]], np.zeros(5, dtype=int))
    assert b"property double x" in (tmp_path / "a.ply").read_bytes()
    write_ply(tmp_path / "a.ply", apart[[0, 1, 2, 2]], [[0, 1, 2], [2, 3, 0]], np.zeros(4, dtype=int))
    assert b"property float x" in (tmp_path / "a.ply").read_bytes()


def test_a_named_property_is_written_if_it_is_given(tmp_path):
    margin = np.array([0.0, 0.25, 0.5, 1.0])
    write_ply(tmp_path / "a.ply", *TETRAHEDRON, np.arange(4), properties={"margin": margin})
    write_ply(tmp_path / "b.ply", *TETRAHEDRON, np.arange(4))
    data = trimesh.load(tmp_path / "a.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    assert np.array_equal(data["margin"], margin)
    assert np.array_equal(data["label"], np.arange(4))
    assert np.array_equal(read_mesh(tmp_path / "a.ply").vertices, read_mesh(tmp_path / "b.ply").vertices)
    assert b"margin" not in (tmp_path / "b.ply").read_bytes()


def test_labels_are_a_property_of_the_vertices_of_a_written_ply(tmp_path):
    labels = np.array([7, 0, 300, 7])
    write_ply(tmp_path / "a.ply", *TETRAHEDRON, labels, comments=["seg of a"])
    data = trimesh.load(tmp_path / "a.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    assert np.array_equal(data["label"], labels)
    assert data["label"].dtype == np.int32
    assert comments_of(tmp_path / "a.ply") == ["heatwalk", "seg of a"]
    (tmp_path / "a.off").write_bytes(b"OFF\ncomment heatwalk\n")
    assert comments_of(tmp_path / "a.off") == []


def test_named_properties_of_the_vertices_are_written_beside_the_label(tmp_path):
    pymeshlab = pytest.importorskip("pymeshlab")
    margin, count = np.array([0.1, 1e-9, 0, 3]), np.array([1, -2, 3, 2**31 - 1])
    labels = np.array([0, 1, 1, 0])
    write_ply(tmp_path / "a.ply", *TETRAHEDRON, labels, properties={"margin": margin, "count": count})
    data = trimesh.load(tmp_path / "a.ply", process=False).metadata["_ply_raw"]["vertex"]["data"]
    assert np.array_equal(data["label"], labels)
    assert np.array_equal(data["margin"], margin)
    assert np.array_equal(data["count"], count)
    assert is_mesh(read_mesh(tmp_path / "a.ply"), *TETRAHEDRON)
    meshes = pymeshlab.MeshSet()
    meshes.load_new_mesh(str(tmp_path / "a.ply"))
    assert np.array_equal(meshes.current_mesh().vertex_matrix(), TETRAHEDRON[0])
    assert np.array_equal(meshes.current_mesh().face_matrix(), TETRAHEDRON[1])
    assert np.array_equal(np.rint(meshes.current_mesh().vertex_color_matrix() * 255), label_colours(labels))


@pytest.mark.parametrize(
    ("properties", "message"),
    [
        ({"label": np.zeros(4)}, "the property 'label' must be letters, digits and underscores, and none of"),
        ({"a b": np.zeros(4)}, "the property 'a b' must be letters"),
        ({"a": np.zeros(3)}, "the property 'a' must have one number for each of the 4 vertices"),
        ({"a": np.array(["x"] * 4)}, "the property 'a' must have one number"),
        ({"a": np.full(4, 2**31)}, "the property 'a' has integers beyond 32 bits"),
    ],
)
def test_a_property_that_cannot_be_written_is_refused(properties, message, tmp_path):
    with pytest.raises(ValueError, match=message):
        write_ply(tmp_path / "a.ply", *TETRAHEDRON, np.zeros(4, dtype=int), properties=properties)
    assert not (tmp_path / "a.ply").exists()
