"""XML files of VTK: polygons (.vtp) and unstructured grids (.vtu), in any encoding, read by VTK itself."""

import re
from typing import Any

import numpy as np

from heatwalk.io.cells import POLYGON, STRIP, surface_mesh
from heatwalk.io.polygons import Polygons, RawMesh
from heatwalk.meshes import MeshError


def read_vtp(data: bytes) -> RawMesh:
    """Read the contents of an XML file with polygons."""
    from vtkmodules.vtkIOXML import vtkXMLPolyDataReader

    data_set = _read(vtkXMLPolyDataReader(), data, "PolyData")
    groups = (
        (2, data_set.GetVerts()),
        (4, data_set.GetLines()),
        (POLYGON, data_set.GetPolys()),
        (STRIP, data_set.GetStrips()),
    )
    parts = [_cells(cells) for _, cells in groups]
    kinds = np.repeat([kind for kind, _ in groups], [len(part.sizes) for part in parts])
    cells = Polygons(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
    return surface_mesh(_points(data_set), kinds, cells)


def read_vtu(data: bytes) -> RawMesh:
    """Read the contents of an XML file with an unstructured grid."""
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOXML import vtkXMLUnstructuredGridReader

    data_set = _read(vtkXMLUnstructuredGridReader(), data, "UnstructuredGrid")
    points = _points(data_set)
    return surface_mesh(points, vtk_to_numpy(data_set.GetCellTypes()).astype(np.int64), _cells(data_set.GetCells()))


def _read(reader: Any, data: bytes, kind: str) -> Any:
    """What a reader reads of a file of a kind; MeshError with VTK's words where it cannot."""
    from vtkmodules.vtkCommonCore import vtkLogger, vtkOutputWindow, vtkStringOutputWindow

    if b"<VTKFile" not in data[:4096] or kind.encode() not in data[:4096]:
        raise MeshError(f"not an XML file of VTK of the type {kind}")
    if b"</VTKFile>" not in data[-4096:]:
        raise MeshError("the end tag </VTKFile> is missing: the file is truncated")
    window, window_before = vtkStringOutputWindow(), vtkOutputWindow.GetInstance()
    verbosity_before = vtkLogger.GetCurrentVerbosityCutoff()
    vtkOutputWindow.SetInstance(window)  # VTK would print its messages
    vtkLogger.SetStderrVerbosity(vtkLogger.VERBOSITY_OFF)
    try:
        reader.ReadFromInputStringOn()
        reader.SetInputString(data)
        reader.Update()
    finally:
        vtkOutputWindow.SetInstance(window_before)
        vtkLogger.SetStderrVerbosity(verbosity_before)
    said = (line.strip() for line in window.GetOutput().splitlines())
    problems = [line.partition("): ")[2] or line for line in said if not re.match("ERROR: In|Warning: In|$", line)]
    if problems:
        raise MeshError(f"VTK cannot read it: {problems[0]}")
    return reader.GetOutput()


def _points(data_set: Any) -> Any:
    """The vertices, (n, 3)."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    if data_set.GetPoints() is None or not data_set.GetNumberOfCells():
        raise MeshError("contains no faces: a point cloud cannot be read as a mesh")
    return vtk_to_numpy(data_set.GetPoints().GetData()).astype(np.float64)


def _cells(cells: Any) -> Polygons:
    """The number of vertices of each of VTK's cells, and all vertices."""
    from vtkmodules.util.numpy_support import vtk_to_numpy

    offsets = vtk_to_numpy(cells.GetOffsetsArray()).astype(np.int64)
    corners = vtk_to_numpy(cells.GetConnectivityArray()).astype(np.int64)
    if len(offsets) and (offsets[0] != 0 or (np.diff(offsets) < 0).any() or offsets[-1] != len(corners)):
        raise MeshError("the offsets of the cells do not ascend from 0 to the number of their corners")
    return Polygons(np.diff(offsets), corners)
