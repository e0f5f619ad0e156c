import re

import numpy as np
import pytest
import pyvista
from vtkmodules.vtkIOLegacy import vtkDataSetWriter
from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

from heatwalk.io import read_mesh
from heatwalk.io.welding import weld_vertices
from heatwalk.meshes import MeshError, inspect_mesh
from tests.helpers.mesh_files import CUBE_QUADS, CUBE_VERTICES

CELLS = pyvista.examples.cells
SURFACES = {
    "triangles": pyvista.Sphere(theta_resolution=8, phi_resolution=8),
    "strips": pyvista.Sphere(theta_resolution=8, phi_resolution=8).strip(),
    "quads": pyvista.PolyData.from_regular_faces(CUBE_VERTICES, CUBE_QUADS),
    "several sizes": pyvista.Cylinder(resolution=7),
}
GRIDS = {
    "hexahedra": pyvista.ImageData(dimensions=(3, 4, 2)).cast_to_unstructured_grid(),
    "tetrahedra": pyvista.ImageData(dimensions=(3, 2, 2)).to_tetrahedra(),
    **{
        cell.__name__: cell()
        for cell in (
            CELLS.Tetrahedron, CELLS.Hexahedron, CELLS.Voxel, CELLS.Wedge, CELLS.Pyramid, CELLS.PentagonalPrism,
            CELLS.HexagonalPrism, CELLS.Pixel, CELLS.Quadrilateral, CELLS.Triangle, CELLS.Polygon, CELLS.TriangleStrip,
        )
    },
}  # fmt: skip
STRUCTURED = {
    "image": pyvista.ImageData(dimensions=(3, 4, 5), spacing=(1, 2, 3), origin=(9, 0, 0)),
    "rectilinear": pyvista.RectilinearGrid([0, 1, 3], [0, 2], [0, 1, 5, 6]),
    "slab": pyvista.ImageData(dimensions=(3, 1, 5)).cast_to_structured_grid(),
    "curved": pyvista.StructuredGrid(*np.meshgrid([0.0, 1, 2], [0.0, 1, 3], [0.0, 1])),
}


def legacy(data_set, path, is_binary, version):
    writer = vtkDataSetWriter()
    writer.SetFileVersion(version)
    (writer.SetFileTypeToBinary if is_binary else writer.SetFileTypeToASCII)()
    return written(writer, data_set, path)


def xml(data_set, path, mode):
    kind = vtkXMLPolyDataWriter if isinstance(data_set, pyvista.PolyData) else vtkXMLUnstructuredGridWriter
    writer = kind()
    writer.SetDataMode({"ascii": 0, "binary": 1, "appended": 2, "raw": 2}[mode])
    writer.SetEncodeAppendedData(mode != "raw")
    return written(writer, data_set, path)


def written(writer, data_set, path):
    writer.SetInputData(data_set)
    writer.SetFileName(str(path))
    assert writer.Write()
    return read_mesh(path)


def assert_is_surface_of(mesh, data_set):
    surface = data_set.extract_surface(algorithm="dataset_surface").triangulate()
    report = inspect_mesh(mesh.vertices, mesh.faces)
    assert report.n_faces == surface.n_cells
    assert report.area == pytest.approx(surface.area, rel=1e-5)
    assert report.is_consistently_oriented
    welded = inspect_mesh(*weld_vertices(mesh.vertices, mesh.faces, "exact"))
    assert welded.is_watertight == (surface.clean().n_open_edges == 0)


@pytest.mark.parametrize("version", [42, 51])
@pytest.mark.parametrize("is_binary", [True, False])
def test_legacy_files_of_every_kind_of_data_have_its_surface(tmp_path, is_binary, version):
    for name, data_set in (SURFACES | GRIDS | STRUCTURED).items():
        assert_is_surface_of(legacy(data_set, tmp_path / f"{name}.vtk", is_binary, version), data_set)


@pytest.mark.parametrize("mode", ["ascii", "binary", "appended", "raw"])
def test_xml_files_of_every_encoding_have_its_surface(tmp_path, mode):
    for suffix, data_sets in ((".vtp", SURFACES), (".vtu", GRIDS)):
        for name, data_set in data_sets.items():
            assert_is_surface_of(xml(data_set, tmp_path / f"{name}{suffix}", mode), data_set)


def test_vertices_and_triangles_keep_their_order(tmp_path):
    sphere = SURFACES["triangles"]
    for mesh in (legacy(sphere, tmp_path / "a.vtk", True, 42), xml(sphere, tmp_path / "a.VTP", "raw")):
        assert np.array_equal(mesh.vertices, sphere.points.astype(float))
        assert np.array_equal(mesh.faces, sphere.regular_faces)
        assert mesh.notes == ()


def grid(points, cells, kinds):
    rows = [f"{len(cell)} {' '.join(map(str, cell))}" for cell in cells]
    size = sum(len(cell) + 1 for cell in cells)
    points = [" ".join(map(str, point)) for point in points]
    header = ["# vtk DataFile Version 3.0", "title", "ASCII", "DATASET UNSTRUCTURED_GRID"]
    cell_rows = [f"CELLS {len(cells)} {size}", *rows, f"CELL_TYPES {len(kinds)}", *map(str, kinds)]
    return "\n".join([*header, f"POINTS {len(points)} double", *points, *cell_rows, ""])


def read(tmp_path, text, suffix=".vtk"):
    path = tmp_path / f"mesh{suffix}"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_mesh(path)


CUBE = CUBE_VERTICES.tolist()
HEXAHEDRON = [0, 1, 3, 2, 4, 5, 7, 6]


def test_faces_of_the_file_and_of_its_volume_cells_are_there_once(tmp_path):
    top = CUBE_QUADS[0]
    fin = [[0.5, 0, 2], [0.5, 1, 2]]
    mesh = read(tmp_path, grid(CUBE + fin, [HEXAHEDRON, top, [4, 5, 8], [0, 1]], [12, 9, 5, 3]))
    assert mesh.notes == (
        "triangulated 7 faces into 13 triangles",
        "added 5 boundary faces of 1 volume cell to the 2 faces of the file",
        "ignored 1 cell of points or lines",
        "dropped 1 vertices that belong to no face",
    )
    assert inspect_mesh(mesh.vertices, mesh.faces).n_duplicate_faces == 0
    mesh = read(tmp_path, grid(CUBE, [HEXAHEDRON, *CUBE_QUADS], [12] + 6 * [9]))
    assert mesh.notes[1] == "ignored 1 volume cell, whose boundary is among the faces of the file"
    assert len(mesh.faces) == 12


def test_neighbouring_cells_of_several_kinds_have_no_face_between_them(tmp_path):
    apex = [[0.5, 0.5, 2]]
    mesh = read(tmp_path, grid(CUBE + apex, [HEXAHEDRON, [4, 5, 7, 6, 8]], [12, 14]))
    report = inspect_mesh(mesh.vertices, mesh.faces)
    assert (report.n_faces, report.is_watertight, report.is_consistently_oriented) == (14, True, True)
    turned = read(tmp_path, grid(CUBE + apex, [HEXAHEDRON[4:] + HEXAHEDRON[:4], [4, 5, 7, 6, 8]], [12, 14]))
    assert inspect_mesh(turned.vertices, turned.faces).is_consistently_oriented  # inside out as VTK numbers it


def test_cells_of_higher_order_are_read_by_their_corners(tmp_path):
    for cell, n_triangles in ((CELLS.QuadraticTriangle, 1), (CELLS.QuadraticHexahedron, 12), (CELLS.LagrangeWedge, 8)):
        mesh = legacy(cell(), tmp_path / "a.vtk", True, 42)
        assert len(mesh.faces) == n_triangles
        assert "read 1 cell of higher order by the corners alone" in mesh.notes


def test_concave_polygons_are_covered_once(tmp_path):
    dart = [[2, -1, 0], [0, 3, 0], [-2, -1, 0], [0, 0, 0]]
    for start in range(4):
        mesh = read(tmp_path, grid(dart, [np.roll(range(4), start).tolist()], [9]))
        assert inspect_mesh(mesh.vertices, mesh.faces).area == pytest.approx(6)


def test_attributes_fields_and_comments_are_passed_over(tmp_path):
    text = grid(CUBE, CUBE_QUADS, 6 * [9])
    field = "FIELD FieldData 2\nTIME 1 1 double\n0.5\nnames 1 2 string\none of them\nCELLS\n"
    metadata = "METADATA\nINFORMATION 0\n\n"
    attributes = "CELL_DATA 6\nSCALARS a float\nLOOKUP_TABLE default\n1 2 3 4 5 6\nPOINT_DATA 8\nNORMALS n float\n"
    text = text.replace("POINTS", f"{field}POINTS").replace("CELLS 6", f"{metadata}CELLS 6") + attributes
    for ends in ("\n", "\r\n"):
        mesh = read(tmp_path, text.replace("\n", ends))
        assert (len(mesh.vertices), len(mesh.faces)) == (8, 12)


QUADS = grid(CUBE, CUBE_QUADS, 6 * [9])
BROKEN = {
    "index": (QUADS.replace("4 0 2 3 1", "4 0 2 8 1"), "cell 0 (counted from 0) refers to vertex 8, but there are 8"),
    "negative": (QUADS.replace("4 0 2 3 1", "4 0 2 -1 1"), "cell 0 (counted from 0) refers to vertex -1"),
    "size": (QUADS.replace("4 0 2 3 1", "5 0 2 3 1"), "the lists of the section CELLS do not have the lengths"),
    "too few": (grid(CUBE, [[0, 1, 2]], [9]), "cell 0 (counted from 0) has 3 vertices, but its type requires 4"),
    "points": (grid(CUBE, [[0], [1]], [1, 1]), "has no faces"),
    "cloud": (QUADS[: QUADS.index("CELLS")], "contains no faces"),
    "types": (QUADS.replace("CELL_TYPES 6\n9", "CELL_TYPES 5"), "has 6 cells, but the types of 5"),
    "no types": (QUADS[: QUADS.index("CELL_TYPES")], "has CELLS but no CELL_TYPES"),
    "polyhedron": (grid(CUBE, [HEXAHEDRON], [42]), "contains polyhedra, which are not read"),
    "unknown": (grid(CUBE, [HEXAHEDRON], [99]), "contains cells of VTK's type 99"),
    "number": (QUADS.replace("0.0 0.0 1.0", "0.0 zero 1.0"), "POINTS declares 24 values but contains"),
    "fraction": (QUADS.replace("4 0 2 3 1", "4 0 2.5 3 1"), "CELLS contains a number that is not an integer"),
    "more": (QUADS.replace("POINTS 8", "POINTS 7"), "POINTS declares 21 values but contains 24"),
    "kind": (QUADS.replace("UNSTRUCTURED_GRID", "TREE"), "a data set of the kind 'TREE'"),
    "unprintable kind": (QUADS.replace("UNSTRUCTURED_GRID", "TR\x07EE"), r"a data set of the kind 'TR\x07EE'"),
    "XML": ("<VTKFile>", "not a legacy VTK file"),
}


@pytest.mark.parametrize(("text", "message"), BROKEN.values(), ids=BROKEN)
def test_what_is_wrong_in_a_legacy_file_is_said(tmp_path, text, message):
    with pytest.raises(MeshError, match=re.escape(message)):
        read(tmp_path, text)


def test_what_is_wrong_in_an_xml_file_is_said_and_vtk_prints_nothing(tmp_path, capfd):
    xml(SURFACES["quads"], tmp_path / "a.vtp", "ascii")
    text = (tmp_path / "a.vtp").read_text()
    far = re.sub(r'(Name="connectivity".*?>\s*)0', r"\g<1>17", text, flags=re.DOTALL)
    cases = (
        (far, ".vtp", "refers to vertex 17, but there are 8 vertices"),
        (text.replace("</Points>", ""), ".vtp", "VTK cannot read it: "),
        (text[:-20], ".vtp", "the end tag </VTKFile> is missing: the file is truncated"),
        (text, ".vtu", "not an XML file of VTK of the type UnstructuredGrid"),
        ("# vtk DataFile Version 3.0\n", ".vtp", "not an XML file of VTK of the type PolyData"),
    )
    for broken, suffix, message in cases:
        with pytest.raises(MeshError, match=re.escape(message)):
            read(tmp_path, broken, suffix)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize("is_binary", [True, False])
def test_a_legacy_file_cut_within_its_cells_is_an_error(tmp_path, is_binary):
    legacy(SURFACES["triangles"], tmp_path / "whole.vtk", is_binary, 51)
    data = (tmp_path / "whole.vtk").read_bytes()
    end = data.index(b"CONNECTIVITY") + 200
    for length in np.linspace(1, end, 40).astype(int):
        with pytest.raises(MeshError, match=r"mesh\.vtk: "):
            read(tmp_path, data[:length])


def test_infinite_coordinates_are_left_to_the_checks_of_the_mesh(tmp_path):
    mesh = read(tmp_path, QUADS.replace("0.0 0.0 1.0", "nan -inf 1.0"))
    assert inspect_mesh(mesh.vertices, mesh.faces).problem == "1 of 8 vertices have NaN or infinite coordinates: 4"


@pytest.mark.parametrize("is_binary", [True, False])
@pytest.mark.parametrize("length", [0, 5, 63, 64, 16_383, 16_384])
def test_fields_of_texts_and_bits_are_passed_over(tmp_path, is_binary, length):
    data_set = SURFACES["quads"].copy()
    data_set.field_data["names"] = ["x" * length, "of\nthe", ""]
    data_set.field_data["flags"] = np.array([True, False, True])
    data_set.user_dict["author"] = "somebody"
    assert_is_surface_of(legacy(data_set, tmp_path / "a.vtk", is_binary, 51), data_set)
    data_set.save(tmp_path / "b.vtk", binary=is_binary)
    assert_is_surface_of(read_mesh(tmp_path / "b.vtk"), data_set)
