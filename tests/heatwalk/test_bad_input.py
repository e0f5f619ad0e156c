"""Bad input leads to a valid segmentation or a one-line message: what is wrong, and where."""

import errno
import os
import re
from pathlib import Path

import numpy as np
import pytest
import trimesh

import heatwalk
from heatwalk.cli import main
from heatwalk.io import read_mesh, read_seg
from heatwalk.io.reading import READABLE
from heatwalk.meshes import MeshError
from tests.helpers.meshes import bundled_path

VERTICES = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])


def obj_text(vertices, faces):
    rows = ["v " + " ".join(map(repr, row)) for row in np.asarray(vertices, dtype=float).tolist()]
    rows += ["f " + " ".join(str(corner + 1) for corner in face) for face in np.asarray(faces).tolist()]
    return "\n".join(rows) + "\n"


def off_text(vertices, faces):
    rows = [" ".join(map(repr, row)) for row in np.asarray(vertices, dtype=float).tolist()]
    rows += [f"{len(face)} {' '.join(map(str, face))}" for face in np.asarray(faces).tolist()]
    return f"OFF\n{len(vertices)} {len(faces)} 0\n" + "\n".join(rows) + "\n"


def moved(vertex, to):
    vertices = VERTICES.copy()
    vertices[vertex] = to
    return vertices


@pytest.fixture
def in_empty_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def assert_is_valid(segmentation, vertices, faces):
    n_accumulators = len(segmentation.exemplars)
    assert segmentation.labels.shape == (len(vertices),)
    assert segmentation.face_labels.shape == (len(faces),)
    assert np.array_equal(np.unique(segmentation.accumulator_labels), np.arange(n_accumulators))
    assert np.array_equal(segmentation.accumulator_labels[segmentation.exemplars], np.arange(n_accumulators))
    kept = segmentation.labels != n_accumulators
    assert np.array_equal(segmentation.labels[kept], segmentation.accumulator_labels[kept])


def assert_command_segments(path, capsys):
    """`segment` and `inspect` succeed, and the files contain the result of the function."""
    mesh = read_mesh(path)
    assert main(["inspect", str(path)]) == 0
    assert main(["segment", str(path), "--output", "out.ply"]) == 0
    assert capsys.readouterr().err == ""
    segmentation = heatwalk.segment(mesh.vertices, mesh.faces)
    assert np.array_equal(read_seg("out.seg"), segmentation.face_labels)
    written = read_mesh("out.ply")
    assert np.abs(written.vertices - mesh.vertices).max() <= 1e-7 * np.abs(mesh.vertices).max()
    assert np.array_equal(written.faces, mesh.faces)


def assert_command_refuses(path, message, capsys):
    """`segment` and `inspect` end with code 2 and the one line `path: message`, and nothing is written."""
    for arguments in (["segment", str(path), "--output", "out.ply"], ["inspect", str(path)]):
        assert main(arguments) == 2
        assert re.fullmatch(rf"heatwalk: error: {re.escape(str(path))}: {message}\n", capsys.readouterr().err)
    assert not Path("out.ply").exists()
    assert not Path("out.seg").exists()


# --- files that are not meshes

PNG = b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR\x00\x00\x00\x10\x00\x00\x00\x10\x08\x02" + bytes(range(256))
PLY_HEADER = "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
PLY_FACES = "element face 4\nproperty list uchar int vertex_indices\nend_header\n"
LETTER = b"Dear all,\nhere is the mesh, OFF to you.\n"
OFF = off_text(VERTICES, FACES).encode()
NO_OFF = "not an OFF file, or its header lacks the vertex and face counts"
NO_PLY = "not a PLY file: it does not begin with a line 'ply'"
NO_FACES = "not a {} file, or it has no faces or is truncated"
NOT_MESHES = {
    "empty off": (".off", b"", "the file is empty"),
    "empty obj": (".obj", b"", "the file is empty"),
    "empty ply": (".ply", b"", "the file is empty"),
    "empty stl": (".stl", b"", "the file is empty"),
    "blank": (".off", b" \n\n\t\n", "the file is empty"),
    "comments only": (".off", b"# nothing\n", NO_OFF),
    "picture as off": (".off", PNG, NO_OFF),
    "picture as obj": (".obj", PNG, NO_FACES.format("OBJ")),
    "picture as ply": (".ply", PNG, NO_PLY),
    "picture as stl": (
        ".stl",
        PNG,
        "not an STL file, or it is truncated: .* declares 959,985,462 triangles but contains 3",
    ),
    "text as off": (".off", LETTER, NO_OFF),
    "text as obj": (".obj", LETTER, NO_FACES.format("OBJ")),
    "text as ply": (".ply", LETTER, NO_PLY),
    "text as stl": (".stl", LETTER, "not an STL file, or it is truncated: .* lacks the 84 bytes of the header"),
    "off header only": (".off", b"OFF\n", NO_OFF),
    "off counts are words": (".off", b"OFF\nfour 4 0\n", NO_OFF),
    "off counts negative": (".off", b"OFF\n-4 4 0\n", NO_OFF),
    "off binary": (".off", b"OFF BINARY\n\0\0\0\4", "a binary OFF file; save it as ASCII OFF, or as PLY"),
    "off truncated": (".off", OFF[:-8], "declares 4 faces but contains 3: the file is truncated"),
    "off face cut short": (".off", OFF[:-4], "declares 4 faces but contains 3: the file is truncated"),
    "off without faces": (".off", b"OFF\n1 0 0\n0 0 0\n", NO_FACES.format("OFF")),
    "off word among numbers": (
        ".off",
        OFF.replace(b"1.0", b"one", 1),
        "line 4: 'one' is not a number",
    ),
    "obj of points": (".obj", b"v 0 0 0\nv 1 0 0\nv 0 1 0\n", NO_FACES.format("OBJ")),
    "obj index zero": (
        ".obj",
        b"v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 0 1 2\n",
        "line 5: a face refers to vertex 0, but OBJ counts vertices from 1",
    ),
    "ply header cut": (".ply", PLY_HEADER.encode(), "the header has no line 'end_header': the file is truncated, .*"),
    "ply of points": (
        ".ply",
        (PLY_HEADER + "end_header\n0 0 0\n0 0 1\n0 1 0\n1 0 0\n").encode(),
        "the header declares no faces; it declares vertex: .*",
    ),
    "ply of no faces": (
        ".ply",
        (PLY_HEADER + PLY_FACES.replace("4", "0") + "0 0 0\n0 0 1\n0 1 0\n1 0 0\n").encode(),
        NO_FACES.format("PLY"),
    ),
    "ply truncated": (
        ".ply",
        (PLY_HEADER + PLY_FACES + "0 0 0\n0 0 1\n0 1 0\n1 0 0\n3 0 1 2\n").encode(),
        "declares 4 faces but contains 1: the file is truncated",
    ),
    "ply truncated in the vertices": (
        ".ply",
        (PLY_HEADER + PLY_FACES + "0 0 0\n0 0").encode(),
        "declares 4 vertices but contains 1: the file is truncated",
    ),
    "ply index too large": (
        ".ply",
        (PLY_HEADER + PLY_FACES.replace("4", "1") + "0 0 0\n0 0 1\n0 1 0\n1 0 0\n3 0 1 4\n").encode(),
        r"face 0 \(counted from 0\) refers to vertex 4, but there are 4 vertices",
    ),
    "ply of an unknown type": (
        ".ply",
        (PLY_HEADER.replace("float z", "real z") + PLY_FACES).encode() + OFF.partition(b" 0\n")[2],
        "line 6: unknown type 'real'; PLY has char, .*",
    ),
    "stl text cut": (
        ".stl",
        b"solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nver",
        "declares 1 faces but contains 0: the file is truncated",
    ),
    "stl binary cut": (
        ".stl",
        b"x".ljust(80) + np.uint32(3).tobytes() + bytes(100),
        "not an STL file, or it is truncated: .* declares 3 triangles but contains 2",
    ),
    "stl without triangles": (".stl", bytes(84), NO_FACES.format("STL")),
    "unknown suffix": (".step", b"ISO-10303-21;", f"unknown suffix '.step'; supported: {READABLE}"),
    "no suffix": ("", b"OFF\n", "unknown suffix ''; .*"),
}


@pytest.mark.parametrize(("suffix", "data", "message"), NOT_MESHES.values(), ids=NOT_MESHES)
def test_a_file_that_is_not_a_mesh_is_rejected(in_empty_folder, capsys, suffix, data, message):
    path = Path(f"bad{suffix}")
    path.write_bytes(data)
    with pytest.raises(MeshError, match=re.escape(str(path)) + ": " + message):
        read_mesh(path)
    assert_command_refuses(path, message, capsys)


def test_a_missing_file_is_rejected(in_empty_folder, capsys):
    assert_command_refuses("gone.off", "cannot be read: No such file or directory", capsys)


def test_a_folder_without_a_mesh_is_rejected(in_empty_folder, capsys):
    Path("folder.off").mkdir()
    message = rf"the folder contains no mesh itself \(subfolders are not searched\); supported: {READABLE}"
    assert_command_refuses("folder.off", message, capsys)
    with pytest.raises(heatwalk.MeshError, match=r"^folder\.off: cannot be read: "):
        read_mesh("folder.off")


def test_a_file_without_permission_is_rejected(in_empty_folder, capsys, monkeypatch):
    def refuse(path):  # chmod would not stop root, under whom tests often run
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(path))

    monkeypatch.setattr(Path, "read_bytes", refuse)
    assert_command_refuses("secret.off", "cannot be read: Permission denied", capsys)


# --- meshes that cannot be segmented

TRIANGLE = VERTICES[:3], [[0, 1, 2]]
REFUSED = {
    "nan": (moved(1, [1, np.nan, 0]), FACES, "1 of 4 vertices have NaN or infinite coordinates: 1"),
    "infinite": (moved(3, [0, 0, -np.inf]), FACES, "1 of 4 vertices have NaN or infinite coordinates: 3"),
    "all nan": (VERTICES * np.nan, FACES, "4 of 4 vertices have NaN or infinite coordinates: 0, 1, 2, 3"),
    "index too large": (
        VERTICES,
        [*FACES, [0, 4, 1]],
        r"face 4 \(counted from 0\) refers to vertex 4, but there are 4 vertices",
    ),
    "index negative": (
        VERTICES,
        [[0, 2, -1], *FACES],
        r"face 0 \(counted from 0\) refers to vertex -1, but there are 4 vertices",
    ),
    "one triangle": (*TRIANGLE, "the mesh has 3 vertices; at least 4 are required"),
    "all in a line": (
        np.arange(4.0)[:, None] * [1, 2, 3],
        FACES,
        "all 4 triangles are degenerate: .*",
    ),
    "all in a point": (VERTICES * 0 + 7, FACES, "all 4 triangles are degenerate: the mesh has no area"),
    "all repeated corners": (VERTICES, [[0, 1, 1], [2, 3, 2]], "all 2 triangles are degenerate: .*"),
    "spur of a repeated corner": (
        np.vstack([VERTICES, [[2, 2, 2]]]),
        [*FACES, [0, 4, 4]],
        r"1 of 5 vertices have only triangles collapsed to an edge or a point \(merge coincident .*\): 4",
    ),
    "spur of coincident corners": (
        np.vstack([VERTICES, [[2, 2, 2]], [[2, 2, 2]]]),
        [*FACES, [0, 4, 5]],
        r"2 of 6 vertices have only triangles collapsed to an edge or a point \(merge coincident .*\): 4, 5",
    ),
}


@pytest.mark.parametrize(("vertices", "faces", "message"), REFUSED.values(), ids=REFUSED)
def test_a_mesh_that_cannot_be_segmented_is_rejected(in_empty_folder, capsys, vertices, faces, message):
    with pytest.raises(MeshError, match=f"^{message}$"):
        heatwalk.segment(vertices, faces)
    Path("bad.obj").write_text(obj_text(vertices, faces))
    if "vertex -1" in message:  # 0 in the file
        message = "line 5: a face refers to vertex 0, but OBJ counts vertices from 1"
    assert_command_refuses("bad.obj", message, capsys)


ARRAYS_REFUSED = {
    "isolated vertices": (
        np.vstack([VERTICES, np.ones((7, 3))]),
        FACES,
        r"7 of 11 vertices belong to no face \(remove them\): 4, 5, 6, 7, 8, …",
    ),
    "no faces": (VERTICES, np.empty((0, 3), dtype=int), ".* 4 vertices and no faces; at least one face is required"),
    "nothing": (
        np.empty((0, 3)),
        np.empty((0, 3), dtype=int),
        ".* 0 vertices and no faces; at least one face is required",
    ),
    "quads": (
        np.vstack([VERTICES, VERTICES + 1]),
        np.arange(8).reshape(2, 4),
        r"faces must be an array of shape \(…, 3\), got \(2, 4\)",
    ),
    "edges": (VERTICES, [[0, 1], [2, 3]], r"faces must be an array of shape \(…, 3\), got \(2, 2\)"),
    "flat faces": (VERTICES, FACES.ravel(), r"faces must be an array of shape \(…, 3\), got \(12,\)"),
    "vertices in the plane": (VERTICES[:, :2], FACES, r"vertices must be an array of shape \(…, 3\), got \(4, 2\)"),
    "a single vertex": (VERTICES[0], FACES, r"vertices must be an array of shape \(…, 3\), got \(3,\)"),
    "transposed vertices": (VERTICES.T, FACES, r"vertices must be an array of shape \(…, 3\), got \(3, 4\)"),
    "ragged faces": (VERTICES, [[0, 1, 2], [0, 1, 2, 3]], "faces are not a rectangular array of numbers: .*"),
    "words": ([["a", "b", "c"]] * 4, FACES, "vertices must be real numbers, got an array of <U1"),
    "none": (None, FACES, "vertices must be real numbers, got an array of object"),
    "complex vertices": (VERTICES * 1j, FACES, "vertices must be real numbers, got an array of complex128"),
    "faces of floats": (VERTICES, FACES.astype(float), "faces must be integers, got an array of float64"),
    "mask as faces": (VERTICES, FACES > 0, "faces must be integers, got an array of bool"),
    "huge unsigned index": (
        VERTICES,
        np.where(FACES == 3, 2**64 - 1, FACES.astype(np.uint64)),
        "face 1 .* refers to vertex 18446744073709551615, but there are 4 vertices",
    ),
}


@pytest.mark.parametrize(("vertices", "faces", "message"), ARRAYS_REFUSED.values(), ids=ARRAYS_REFUSED)
def test_arrays_that_are_not_a_triangle_mesh_are_rejected(vertices, faces, message):
    with pytest.raises(MeshError, match=f"^{message}$"):
        heatwalk.segment(vertices, faces)


# --- meshes that look bad and can be segmented


def test_isolated_vertices_in_a_file_are_dropped_and_change_nothing(in_empty_folder, capsys):
    cow = read_mesh(bundled_path("cow"))
    spread = np.vstack([cow.vertices, np.full((3, 3), 99.0)])
    Path("cow.off").write_text(off_text(spread, cow.faces))
    assert_command_segments("cow.off", capsys)
    expected = heatwalk.segment(cow.vertices, cow.faces).face_labels
    assert np.array_equal(read_seg("out.seg"), expected)


def test_quads_in_a_file_are_split_and_the_seg_file_has_a_label_for_every_triangle(in_empty_folder, capsys):
    quads = "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n"
    corners = "".join(f"{x} {y} {z}\n" for z in (0, 2) for y in (0, 3) for x in (0, 7))
    Path("box.off").write_text("OFF\n8 6 0\n" + corners + quads)
    assert_command_segments("box.off", capsys)
    assert len(read_seg("out.seg")) == 12


def test_no_accumulator_region_spans_two_components(in_empty_folder, capsys):
    cow = read_mesh(bundled_path("cow"))
    n = len(cow.vertices)
    aside = cow.vertices + np.array([3, 0, 0])
    vertices = np.vstack([cow.vertices, aside, 0.01 * VERTICES + 5])
    faces = np.vstack([cow.faces, cow.faces + n, FACES + 2 * n])
    segmentation = heatwalk.segment(vertices, faces)
    assert_is_valid(segmentation, vertices, faces)
    component = np.repeat([0, 1, 2], [n, n, 4])
    regions = np.unique(np.column_stack([segmentation.accumulator_labels, component]), axis=0)
    assert len(regions) == len(segmentation.exemplars)
    assert set(regions[:, 1]) == {0, 1, 2}
    Path("two.off").write_text(off_text(vertices, faces))
    assert_command_segments("two.off", capsys)


def with_duplicate_faces(cow):
    return cow.vertices, np.vstack([cow.faces, cow.faces[:50], cow.faces[50:60, ::-1]])


def with_nonmanifold_edges(cow):
    fin = cow.vertices[cow.faces[:5]].mean(axis=1) * 1.2
    tips = len(cow.vertices) + np.arange(5)
    return np.vstack([cow.vertices, fin]), np.vstack([cow.faces, np.column_stack([cow.faces[:5, :2], tips])])


def with_degenerate_faces(cow):
    """Three edges split on one side only, each T closed by a triangle without height; repeated corners."""
    faces = cow.faces.copy()
    split = [5, 500, 2000]
    a, b, c = faces[split].T
    middle = len(cow.vertices) + np.arange(3)
    faces[split] = np.column_stack([a, middle, c])
    other_half = np.column_stack([middle, b, c])
    without_height = np.column_stack([a, b, middle])
    repeated = np.column_stack([a, a, b])
    vertices = np.vstack([cow.vertices, (cow.vertices[a] + cow.vertices[b]) / 2])
    return vertices, np.vstack([faces, other_half, without_height, repeated])


def with_vertices_on_edges(cow):
    """Vertices in the middle of edges, each in no triangle but one without height over that edge."""
    a, b = cow.faces[::1000, :2].T
    middle = len(cow.vertices) + np.arange(len(a))
    vertices = np.vstack([cow.vertices, (cow.vertices[a] + cow.vertices[b]) / 2])
    return vertices, np.vstack([cow.faces, np.column_stack([a, b, middle])])


def with_holes(cow):
    return cow.vertices, np.delete(cow.faces, [10, 1000, 4000], axis=0)


@pytest.mark.parametrize(
    ("spoil", "field", "count"),
    [
        (with_duplicate_faces, "n_duplicate_faces", 60),
        (with_nonmanifold_edges, "n_nonmanifold_edges", 5),
        (with_degenerate_faces, "n_degenerate_faces", 6),
        (with_vertices_on_edges, "n_degenerate_faces", 6),
        (with_holes, "n_boundary_edges", 9),
    ],
)
def test_a_real_mesh_with_local_faults_is_segmented(in_empty_folder, capsys, spoil, field, count):
    vertices, faces = spoil(read_mesh(bundled_path("cow")))
    assert getattr(heatwalk.inspect_mesh(vertices, faces), field) == count
    assert_is_valid(heatwalk.segment(vertices, faces), vertices, faces)
    Path("spoilt.off").write_text(off_text(vertices, faces))
    assert_command_segments("spoilt.off", capsys)


@pytest.mark.parametrize("spoil", [with_degenerate_faces, with_vertices_on_edges])
def test_triangles_without_height_change_no_region_of_the_other_vertices(spoil):
    cow = read_mesh(bundled_path("cow"))
    regions = heatwalk.segment(*spoil(cow)).accumulator_labels
    assert np.array_equal(regions[: len(cow.vertices)], heatwalk.segment(cow.vertices, cow.faces).accumulator_labels)


@pytest.mark.parametrize("scale", [1e-200, 1e-30, 1e30, 1e200])
def test_coordinates_of_any_size_give_the_same_labels(in_empty_folder, capsys, scale):
    cow = read_mesh(bundled_path("cow"))
    scaled = heatwalk.segment(cow.vertices * scale, cow.faces)
    assert np.array_equal(scaled.labels, heatwalk.segment(cow.vertices, cow.faces).labels)
    Path("cow.off").write_text(off_text(cow.vertices * scale, cow.faces))
    assert_command_segments("cow.off", capsys)


def test_the_smallest_closed_surface_is_segmented(in_empty_folder, capsys):
    assert_is_valid(heatwalk.segment(VERTICES, FACES), VERTICES, FACES)
    Path("tetrahedron.off").write_text(off_text(VERTICES, FACES))
    assert_command_segments("tetrahedron.off", capsys)


def test_a_flat_sheet_is_segmented():
    sheet = trimesh.creation.box([1, 1, 1]).subdivide().subdivide()
    top = sheet.faces[(sheet.triangles[:, :, 2] == 0.5).all(axis=1)]
    used, faces = np.unique(top, return_inverse=True)
    faces = faces.reshape(-1, 3)
    assert_is_valid(heatwalk.segment(sheet.vertices[used], faces), sheet.vertices[used], faces)
