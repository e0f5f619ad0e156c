"""STL files (stereolithography), ASCII or binary: read by trimesh, equal corners merged here."""

import re

import numpy as np

from heatwalk.io.polygons import RawMesh, check_complete
from heatwalk.io.trimesh_reader import read_with_trimesh


def read_stl(data: bytes) -> RawMesh:
    """Read the contents of an STL file; corners with exactly equal coordinates become one vertex."""
    corners, faces = read_with_trimesh(data, "stl")
    # trimesh skips a solid without an end.
    check_complete(len(re.findall(rb"^[ \t]*facet\b", data.lower(), flags=re.MULTILINE)), len(faces))
    vertices, rank = np.unique(corners + 0.0, axis=0, return_inverse=True)  # + 0.0 turns -0 into 0
    return RawMesh(vertices, rank.reshape(-1)[faces], len(faces))
