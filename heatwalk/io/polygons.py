"""What the readers of the mesh formats share: their result, completeness check and triangulation."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.meshes import MeshError


class RawMesh(NamedTuple):
    """The contents of a mesh file, unchecked: vertices (n, 3), triangles (m, 3), and the number of polygons."""

    vertices: NDArray
    faces: NDArray
    n_polygons: int


def check_complete(n_declared: int, n_found: int) -> None:
    """Raise MeshError if a file contains fewer faces than it declares."""
    if n_found < n_declared:
        raise MeshError(f"declares {n_declared:,} faces but contains {n_found:,}: the file is truncated")


def triangulate(polygons: Sequence[Sequence[int]]) -> NDArray[np.int64]:
    """Triangles of polygons of any size, (m, 3): triangles first, then the halves of quads, then fans of the rest."""
    if all(len(polygon) == 3 for polygon in polygons):
        return np.array(polygons, dtype=np.int64)
    from trimesh.geometry import triangulate_quads  # trimesh takes longer to import than most meshes to segment

    return triangulate_quads(polygons)
