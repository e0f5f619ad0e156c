import numpy as np
import pytest

from heatwalk.meshes import MeshError
from tests.helpers.mesh_files import TETRAHEDRON, is_mesh, read_bytes, stl_binary_bytes, stl_text_bytes


def test_stl_corners_of_equal_coordinates_become_one_vertex(tmp_path):
    vertices, faces = TETRAHEDRON
    text = stl_text_bytes(vertices * 1e-30, faces).replace(b"vertex 0.0", b"VERTEX -0.0")
    mesh = read_bytes(tmp_path, text, ".STL")
    assert np.array_equal(mesh.vertices, vertices[[0, 3, 2, 1]] * 1e-30)
    assert np.array_equal(mesh.faces, np.array([0, 3, 2, 1])[faces])
    assert mesh.notes == ("merged 12 STL corners into 4 vertices",)


def test_several_solids_of_an_stl_file_are_one_mesh(tmp_path):
    vertices, faces = TETRAHEDRON
    halves = stl_text_bytes(vertices, faces[:2]) + stl_text_bytes(vertices, faces[2:])
    assert is_mesh(read_bytes(tmp_path, halves, ".stl"), vertices[[0, 3, 2, 1]], np.array([0, 3, 2, 1])[faces])
    with pytest.raises(MeshError, match="declares 4 faces but contains 3: the file is truncated"):
        read_bytes(tmp_path, halves[:-20], ".stl")


STL_TEXT, STL_BINARY = stl_text_bytes(*TETRAHEDRON), stl_binary_bytes(*TETRAHEDRON)
HALVES = stl_text_bytes(TETRAHEDRON[0], TETRAHEDRON[1][:2]) + stl_text_bytes(TETRAHEDRON[0], TETRAHEDRON[1][2:])
STL_LAYOUTS = {
    "binary, trailing byte": STL_BINARY + b"\n",
    "binary, trailing text": STL_BINARY + b"made by x",
    "binary, trailing zeros": STL_BINARY + bytes(150),
    "trailing byte": STL_TEXT + b"\x1a",
    "trailing zeros": STL_TEXT + bytes(3),
    "a solid named vertex": STL_TEXT.replace(b"thing", b"vertex 1 2 3"),
    "a solid named endsolid": STL_TEXT.replace(b"thing", b"endsolid x"),
    "a solid named facet": STL_TEXT.replace(b"thing", b"facet of a solid"),
    "two solids with such names": HALVES.replace(b"thing", b"solid endsolid vertex 1 2 3"),
    "without names": STL_TEXT.replace(b" thing", b""),
    "old Macintosh line ends": STL_TEXT.replace(b"\n", b"\r"),
    "all on one line": STL_TEXT.replace(b"\n", b" "),
    "two solids on one line": HALVES.replace(b"\n", b" "),
    "upper case": STL_TEXT.upper(),
    "byte-order mark": b"\xef\xbb\xbf" + STL_TEXT,
}


@pytest.mark.parametrize("data", STL_LAYOUTS.values(), ids=STL_LAYOUTS)
def test_stl_files_are_read_however_they_are_laid_out(tmp_path, data):
    mesh = read_bytes(tmp_path, data, ".stl")
    assert is_mesh(mesh, TETRAHEDRON[0][[0, 3, 2, 1]], np.array([0, 3, 2, 1])[TETRAHEDRON[1]])


@pytest.mark.parametrize(
    ("data", "message"),
    [
        (
            STL_TEXT.replace(b"  vertex 1.0 0.0 0.0\n", b"", 1),
            r"line 2: not a facet of one loop of three vertices \(face 0, .*",
        ),
        (STL_TEXT.replace(b"vertex 0.0 0.0 1.0", b"vertex 0.0 0.0 z"), "line 13: 'z' is not a number"),
        (STL_TEXT.partition(b"endsolid")[0], "the last solid has no 'endsolid': the file is truncated"),
        (STL_BINARY + STL_BINARY[-100:], "contains 2 more triangles than its header declares: .*"),
        (STL_BINARY[:-1], "not an STL file, or it is truncated: .* declares 4 triangles but contains 3"),
    ],
)
def test_a_broken_stl_file_is_rejected_with_what_is_wrong_and_where(tmp_path, data, message):
    with pytest.raises(MeshError, match=f"mesh.stl: {message}$"):
        read_bytes(tmp_path, data, ".stl")


@pytest.mark.parametrize("name", ["my facet normal test", "facet outer loop", "endsolid facet normal 1 2 3"])
@pytest.mark.parametrize("line_end", ["\n", "\r\n", "\r"])
def test_a_solid_whose_name_looks_like_a_facet_is_read(tmp_path, name, line_end):
    text = stl_text_bytes(*TETRAHEDRON).decode().replace("solid thing", f"solid {name}") * 2
    mesh = read_bytes(tmp_path, text.replace("\n", line_end).encode(), ".stl")
    assert (len(mesh.vertices), len(mesh.faces)) == (4, 8)
