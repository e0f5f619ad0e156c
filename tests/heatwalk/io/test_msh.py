import re

import numpy as np
import pytest

from heatwalk.io import read_mesh
from heatwalk.meshes import MeshError, inspect_mesh
from tests.helpers.mesh_files import CUBE_QUADS, CUBE_VERTICES, TETRAHEDRON, is_mesh

VERTICES, FACES = TETRAHEDRON
TRIANGLE, QUAD, TETRA, HEXAHEDRON, POINT, LINE, TRIANGLE_6 = 2, 3, 4, 5, 15, 1, 9
TAGS = [7, 3, 12, 5]  # Gmsh's numbers of nodes have gaps and any order


def ascii_2(vertices, elements, tags=None):
    tags = tags or range(1, len(vertices) + 1)
    nodes = [f"{tag} {x!r} {y!r} {z!r}" for tag, (x, y, z) in zip(tags, np.asarray(vertices).tolist(), strict=True)]
    rows = [f"{i} {kind} 2 0 1 {' '.join(map(str, nodes))}" for i, (kind, nodes) in enumerate(elements, start=1)]
    header = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat"]
    element_rows = ["$Elements", str(len(rows)), *rows, "$EndElements"]
    return "\n".join([*header, "$Nodes", str(len(nodes)), *nodes, "$EndNodes", *element_rows, ""]).encode()


def binary_2(vertices, elements, tags=None, order="<"):
    tags = tags or range(1, len(vertices) + 1)
    i4, f8 = f"{order}i4", f"{order}f8"
    data = b"$MeshFormat\n2.2 1 8\n" + np.array(1, i4).tobytes() + b"\n$EndMeshFormat\n$Nodes\n%d\n" % len(vertices)
    for tag, vertex in zip(tags, vertices, strict=True):
        data += np.array(tag, i4).tobytes() + np.array(vertex, f8).tobytes()
    data += b"\n$EndNodes\n$Elements\n%d\n" % len(elements)
    for i, (kind, nodes) in enumerate(elements):
        data += np.array([kind, 1, 2, i + 1, 0, 1, *nodes], i4).tobytes()
    return data + b"\n$EndElements\n"


def ascii_41(vertices, elements, tags=None):
    tags = list(tags or range(1, len(vertices) + 1))
    rows = [" ".join(map(repr, row)) for row in np.asarray(vertices).tolist()]
    half = len(tags) // 2
    blocks = [f"2 1 0 {half}", *map(str, tags[:half]), *rows[:half]]
    blocks += [f"2 2 1 {len(tags) - half}", *map(str, tags[half:]), *(f"{row} 0.25 0.75" for row in rows[half:])]
    parts = [
        line
        for i, (kind, nodes) in enumerate(elements)
        for line in (f"2 1 {kind} 1", f"{i + 1} {' '.join(map(str, nodes))}")
    ]
    header = ["$Comments", "what it is", "$EndComments", "$MeshFormat", "4.1 0 8", "$EndMeshFormat"]
    entities = ["$Entities", "0 0 0 0", "$EndEntities"]
    nodes = ["$Nodes", f"2 {len(tags)} 1 99", *blocks, "$EndNodes"]
    element_rows = ["$Elements", f"{len(elements)} {len(elements)} 1 99", *parts, "$EndElements"]
    return "\n".join([*header, *entities, *nodes, *element_rows, ""]).encode()


def binary_41(vertices, elements, tags=None, order="<"):
    tags = list(tags or range(1, len(vertices) + 1))
    i4, u8, f8 = f"{order}i4", f"{order}u8", f"{order}f8"
    data = b"$MeshFormat\n4.1 1 8\n" + np.array(1, i4).tobytes() + b"\n$EndMeshFormat\n$Nodes\n"
    data += np.array([1, len(tags), 1, 99], u8).tobytes() + np.array([2, 1, 0], i4).tobytes()
    data += np.array([len(tags), *tags], u8).tobytes() + np.asarray(vertices, f8).tobytes() + b"\n$EndNodes\n"
    data += b"$Elements\n" + np.array([len(elements), len(elements), 1, 99], u8).tobytes()
    for i, (kind, nodes) in enumerate(elements):
        data += np.array([2, 1, kind], i4).tobytes() + np.array([1, i + 1, *nodes], u8).tobytes()
    return data + b"\n$EndElements\n"


VERSIONS = {
    "2.2 ASCII": ascii_2,
    "2.2 binary": binary_2,
    "2.2 big-endian": lambda *mesh: binary_2(*mesh, order=">"),
    "4.1 ASCII": ascii_41,
    "4.1 binary": binary_41,
    "4.1 big-endian": lambda *mesh: binary_41(*mesh, order=">"),
}
every_version = pytest.mark.parametrize("encode", VERSIONS.values(), ids=VERSIONS)


def elements(kind, rows, start=1):
    return [(kind, [start + corner for corner in row]) for row in np.asarray(rows).tolist()]


def read(tmp_path, data):
    (tmp_path / "mesh.msh").write_bytes(data)
    return read_mesh(tmp_path / "mesh.msh")


@every_version
def test_triangles_keep_their_order_whatever_numbers_the_nodes_have(tmp_path, encode):
    rows = [(TRIANGLE, [TAGS[corner] for corner in face]) for face in FACES]
    mesh = read(tmp_path, encode(VERTICES, rows, TAGS))
    assert is_mesh(mesh, VERTICES, FACES)
    assert mesh.notes == ()


@every_version
def test_elements_of_several_kinds_are_read_and_points_and_lines_passed_over(tmp_path, encode):
    rows = elements(POINT, [[0]]) + elements(QUAD, CUBE_QUADS[:5]) + elements(LINE, [[0, 1]])
    rows += elements(TRIANGLE, [[1, 3, 7], [1, 7, 5]])
    mesh = read(tmp_path, encode(CUBE_VERTICES, rows))
    report = inspect_mesh(mesh.vertices, mesh.faces)
    assert (report.is_watertight, report.area) == (True, pytest.approx(6))
    assert mesh.notes == ("triangulated 7 faces into 12 triangles", "ignored 2 cells of points or lines")


@every_version
def test_of_volume_elements_the_boundary_is_taken(tmp_path, encode):
    twice = np.vstack([CUBE_VERTICES, CUBE_VERTICES[4:] + np.array([0, 0, 1])])
    corners = [0, 1, 3, 2, 4, 5, 7, 6]
    mesh = read(tmp_path, encode(twice, elements(HEXAHEDRON, [corners, [corner + 4 for corner in corners]])))
    report = inspect_mesh(mesh.vertices, mesh.faces)
    assert (report.area, report.is_watertight, report.is_consistently_oriented) == (pytest.approx(10), True, True)
    assert mesh.notes[-1] == "took the 10 boundary faces of 2 volume cells"


@every_version
def test_elements_of_second_order_are_read_by_their_corners(tmp_path, encode):
    vertices = np.vstack([VERTICES, np.zeros((3, 3))])
    mesh = read(tmp_path, encode(vertices, elements(TRIANGLE_6, [[*face, 4, 5, 6] for face in FACES])))
    assert is_mesh(mesh, VERTICES, FACES)


@every_version
def test_a_file_cut_anywhere_is_an_error(tmp_path, encode):
    data = encode(VERTICES, elements(TRIANGLE, FACES))
    for length in range(1, len(data) - len("$EndElements\n"), 5):
        with pytest.raises(MeshError, match=r"mesh\.msh: "):
            read(tmp_path, data[:length])


@every_version
def test_a_node_that_does_not_exist_and_an_element_of_an_unknown_kind_are_errors(tmp_path, encode):
    for rows, message in (
        (elements(TRIANGLE, [[0, 1, 8]]), "an element refers to node 9, which the file does not define"),
        ([(140, [1, 2, 3])], "contains elements of Gmsh's type 140, which are not read"),
        (elements(POINT, [[0]]), "has no faces"),
        ([], "has no faces"),
    ):
        with pytest.raises(MeshError, match=re.escape(message)):
            read(tmp_path, encode(VERTICES, rows))
    with pytest.raises(MeshError, match="defines node 3 more than once"):
        read(tmp_path, encode(VERTICES, elements(TRIANGLE, [[0, 1, 2]]), [1, 2, 3, 3]))


def test_what_is_wrong_in_a_file_is_said(tmp_path):
    data = ascii_2(VERTICES, elements(TRIANGLE, FACES))
    for broken, message in (
        (data.replace(b"2.2 0 8", b"4 0 8"), "is version 4 of Gmsh's format; versions 2 and 4.1 are read"),
        (b"$NOD\n1\n1 0 0 0\n$ENDNOD\n", "is version 1 of Gmsh's format"),
        (b"solid\n", "not a file of Gmsh"),
        (data.replace(b"$Elements", b"$Others"), "has no section $Elements"),
        (data.replace(b"1 0.0 0.0 0.0", b"1 0.0 nought 0.0"), "line 6: 'nought' is not a number"),
        (data.replace(b"$EndNodes", b"9\n$EndNodes"), "the section $Nodes contains more numbers than it declares"),
        (data.replace(b"1 2 2 0 1", b"1 2.5 2 0 1"), "the section $Elements has 2.5 where an integer is required"),
    ):
        with pytest.raises(MeshError, match=re.escape(message)):
            read(tmp_path, broken)


def test_infinite_coordinates_are_left_to_the_checks_of_the_mesh(tmp_path):
    for encode in VERSIONS.values():
        mesh = read(tmp_path, encode(np.where(VERTICES == 1, np.inf, VERTICES), elements(TRIANGLE, FACES)))
        assert "have NaN or infinite coordinates" in inspect_mesh(mesh.vertices, mesh.faces).problem


def test_many_elements_of_alternating_kinds_are_read(tmp_path):
    size = 60
    square = np.array([[x, y, 0.0] for y in range(size) for x in range(size)])
    rows = []
    for y in range(size - 1):
        for x in range(size - 1):
            a, b, c, d = (1 + y * size + x + step for step in (0, 1, size + 1, size))
            rows += [(QUAD, [a, b, c, d])] if (x + y) % 2 else [(TRIANGLE, [a, b, c]), (TRIANGLE, [a, c, d])]
    mesh = read(tmp_path, ascii_2(square, rows))
    assert len(mesh.faces) == 2 * (size - 1) ** 2
    assert inspect_mesh(mesh.vertices, mesh.faces).area == pytest.approx((size - 1) ** 2)
