"""VTK files: legacy (.vtk), polygons (.vtp) and unstructured grids (.vtu), ASCII or binary, read by VTK itself."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.cells import POLYGON, STRIP, surface_mesh
from heatwalk.io.polygons import Polygons, RawMesh
from heatwalk.meshes import MeshError


def read_vtk(data: bytes) -> RawMesh:
    """Read the contents of a legacy file with polygons or a grid of any kind."""
    if not data.lstrip().startswith(b"# vtk DataFile"):
        raise MeshError("not a legacy VTK file: it does not begin with '# vtk DataFile'; XML files end in .vtp or .vtu")
    from vtkmodules.vtkIOLegacy import vtkDataSetReader

    reader = vtkDataSetReader()
    reader.ReadFromInputStringOn()
    reader.SetBinaryInputString(data, len(data))
    return _surface(_output(reader))


def read_vtp(data: bytes) -> RawMesh:
    """Read the contents of an XML file with polygons."""
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    return _surface(_read_xml(vtkXMLPolyDataReader(), data, "PolyData"))


def read_vtu(data: bytes) -> RawMesh:
    """Read the contents of an XML file with an unstructured grid."""
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    return _surface(_read_xml(vtkXMLUnstructuredGridReader(), data, "UnstructuredGrid"))


def _read_xml(reader: Any, data: bytes, kind: str) -> Any:
    """What a reader of one kind of XML file reads."""
    if f'"{kind}"'.encode() not in data[:4096] and f"'{kind}'".encode() not in data[:4096]:
        raise MeshError(f"not a VTK file of the type {kind}")
    if b"</VTKFile>" not in data[-4096:]:
        raise MeshError("the end tag </VTKFile> is missing: the file is truncated")
    reader.ReadFromInputStringOn()
    reader.SetInputString(data.decode("latin-1"))
    return _output(reader)


def _output(reader: Any) -> Any:
    """The data set that a reader reads; MeshError with VTK's words where it cannot."""
    from vtkmodules.vtkCommonCore import vtkOutputWindow, vtkStringOutputWindow

    before = vtkOutputWindow.GetInstance()
    window = vtkStringOutputWindow()
    vtkOutputWindow.SetInstance(window)  # VTK would print them
    try:
        reader.Update()
    finally:
        vtkOutputWindow.SetInstance(before)
    said = [line.strip() for line in window.GetOutput().splitlines()]
    errors = [line.partition("): ")[2] or line for line in said if line and not line.startswith("ERROR: In")]
    if errors:
        raise MeshError(f"VTK cannot read it: {errors[0]}")
    if reader.GetOutput() is None:
        raise MeshError("contains no polygons and no grid that VTK can read")
    return reader.GetOutput()


def _surface(grid: Any) -> RawMesh:
    """The triangles of polygons, and of the boundary of volume cells."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    if not (grid.IsA("vtkPolyData") or grid.IsA("vtkUnstructuredGrid")):
        import pyvista

        grid = pyvista.wrap(grid).cast_to_unstructured_grid()
    points = grid.GetPoints()
    if points is None or not grid.GetNumberOfCells():
        raise MeshError("contains no faces: a point cloud cannot be read as a mesh")
    vertices = vtk_to_numpy(points.GetData()).astype(np.float64)
    if grid.IsA("vtkPolyData"):
        groups = ((1, grid.GetVerts()), (3, grid.GetLines()), (POLYGON, grid.GetPolys()), (STRIP, grid.GetStrips()))
        parts = [_cells(cells) for _, cells in groups]
        kinds = np.repeat([kind for kind, _ in groups], [len(part.sizes) for part in parts])
        cells = Polygons(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
    else:
        cells, kinds = _cells(grid.GetCells()), vtk_to_numpy(grid.GetCellTypesArray())
    return surface_mesh(vertices, np.asarray(kinds, dtype=np.int64), cells)


def _cells(cells: Any) -> Polygons:
    """The number of vertices of each of VTK's cells, and all vertices."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    offsets: NDArray[np.int64] = vtk_to_numpy(cells.GetOffsetsArray()).astype(np.int64)
    corners: NDArray[np.int64] = vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    if len(offsets) and (offsets[0] != 0 or (np.diff(offsets) < 0).any() or offsets[-1] != len(corners)):
        raise MeshError("the offsets of the cells are not ascending, or do not end at the number of their corners")
    return Polygons(np.diff(offsets), corners)
