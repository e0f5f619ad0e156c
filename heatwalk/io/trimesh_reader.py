"""Reading the formats that trimesh reads correctly."""

import io
import logging
import warnings

import numpy as np
from numpy.typing import NDArray

# Without a handler, Python prints trimesh's log messages about malformed files to stderr.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


def read_with_trimesh(data: bytes, file_type: str) -> tuple[NDArray, NDArray]:
    """Vertices (n, 3) and faces (m, 3) of a file, in the order of the file."""
    import trimesh  # takes longer to import than most meshes to segment

    with warnings.catch_warnings(action="ignore"):
        mesh = trimesh.load_mesh(io.BytesIO(data), file_type, process=False, fix_texture=False, skip_materials=True)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)
