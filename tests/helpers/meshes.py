"""Real meshes for the tests."""

from importlib.util import find_spec
from pathlib import Path

import numpy as np
import trimesh

DATA = Path(__file__).parents[3] / "shared" / "data"

BUNDLED = {
    "cow": ("pymeshlab", "tests/sample_meshes/cow.obj"),
    "bunny": ("pymeshlab", "tests/sample_meshes/bunny10k_textured.obj"),
    "bone": ("pymeshlab", "tests/sample_meshes/bone.ply"),
    "ant": ("pyvista", "examples/ant.ply"),
    "airplane": ("pyvista", "examples/airplane.ply"),
}


def bundled_path(name):
    """The file of a mesh that ships in an installed wheel."""
    package, path = BUNDLED[name]
    return Path(find_spec(package).submodule_search_locations[0]) / path


def bundled(name):
    """A mesh that ships in an installed wheel, its duplicated vertices merged: trimesh.Trimesh."""
    mesh = trimesh.load(bundled_path(name), process=False, force="mesh")
    mesh.merge_vertices(merge_tex=True, merge_norm=True)
    return trimesh.Trimesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), process=False)


def coarse(mesh, n_faces):
    """The mesh simplified to so many faces, with the same topology: trimesh.Trimesh."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(mesh.vertices, mesh.faces))
    meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=n_faces, preservetopology=True)
    simplified = meshes.current_mesh()
    return trimesh.Trimesh(simplified.vertex_matrix(), simplified.face_matrix(), process=False)
