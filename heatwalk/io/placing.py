"""Parts of a scene: placed by a transform, and joined to one mesh."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.polygons import RawMesh
from heatwalk.meshes import MeshError


class Part(NamedTuple):
    """The vertices (n, 3) and triangles (m, 3) of one part of a scene."""

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]


def placed(part: Part, matrix: NDArray[np.float64]) -> Part:
    """The part moved by a (4, 4) matrix; a mirrored one has its triangles turned over, so that they face as before."""
    if np.array_equal(matrix, np.eye(4)):
        return part
    with np.errstate(all="ignore"):  # coordinates may be infinite or NaN here
        vertices = part.vertices @ matrix[:3, :3].T + matrix[:3, 3]
        is_mirrored = np.linalg.det(matrix[:3, :3]) < 0
    return Part(vertices, part.faces[:, ::-1] if is_mirrored else part.faces)


def join_parts(parts: Sequence[Part], notes: Sequence[str]) -> RawMesh:
    """One mesh of all parts, in their order."""
    parts = [part for part in parts if len(part.faces)]
    if not parts:
        raise MeshError("has no faces: nothing in it consists of triangles")
    offsets = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = np.vstack([part.faces + offset for part, offset in zip(parts, offsets, strict=True)])
    joined = (f"joined {len(parts):,} parts of the scene",) if len(parts) > 1 else ()
    return RawMesh(np.vstack([part.vertices for part in parts]), faces, len(faces), (*joined, *notes))
