import numpy as np
import pytest

from heatwalk.meshes import MeshError
from tests.helpers.mesh_files import TETRAHEDRON, is_mesh, read_bytes, stl_text_bytes


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
