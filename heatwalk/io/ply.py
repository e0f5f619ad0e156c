"""PLY files (Stanford polygon format): read by trimesh, written here."""

import errno
import re
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heatwalk.io.colours import label_colours
from heatwalk.io.polygons import RawMesh, check_complete
from heatwalk.io.trimesh_reader import read_with_trimesh
from heatwalk.meshes import MeshError

_HEADER = """\
ply
format binary_little_endian 1.0
comment heatwalk
element vertex {n_vertices}
property float x
property float y
property float z
property uchar red
property uchar green
property uchar blue
property uchar alpha
element face {n_faces}
property list uchar int vertex_indices
end_header
"""


def read_ply(data: bytes) -> RawMesh:
    """Read the contents of a PLY file, ASCII or binary of either byte order."""
    header, _, body = data.partition(b"end_header")
    n_before = 0  # rows before the faces
    for element in re.split(rb"^[ \t]*element\s", header, flags=re.MULTILINE)[1:]:
        name, count = element.split()[:2]
        if name == b"face":
            break
        n_before += int(count)
    else:
        raise MeshError("not a PLY file, or its header declares no faces")
    n_faces = int(count)
    if n_faces and b"ascii" in header.split(b"\n")[1].lower():
        _check_text_complete(element, body, n_before, n_faces)
    return RawMesh(*read_with_trimesh(data, "ply"), n_faces)


def _check_text_complete(element: bytes, body: bytes, n_before: int, n_faces: int) -> None:
    """Raise MeshError for a truncated ASCII file, which trimesh accepts; it checks the length of binary ones itself.

    The last face is complete if its row has a value for each of the properties that ``element`` declares.
    """
    rows = body.splitlines()[1 + n_before : 1 + n_before + n_faces] or [b""]
    last = rows[-1].split()
    n_expected = 0
    for is_list in re.findall(rb"^[ \t]*property\s+(list)?", element, flags=re.MULTILINE):
        n_expected += 1 + int(last[n_expected]) if is_list and n_expected < len(last) else 1
    check_complete(n_faces, len(rows) - (len(last) < n_expected))


def write_ply(
    path: str | Path, vertices: ArrayLike, faces: ArrayLike, vertex_labels: ArrayLike, dissipator: int | None = None
) -> None:
    """Write a mesh as binary PLY in single precision, with its vertices coloured by label.

    Parameters
    ----------
    path : str or Path
    vertices : (n, 3) float array
    faces : (m, 3) int array
    vertex_labels : (n,) int array, 0 or more
    dissipator : int, optional
        the label shown in grey

    Raises
    ------
    OSError
        if the file cannot be written, or the coordinates are outside the range of single precision

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from heatwalk.io import read_mesh, write_ply
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "triangle.ply")
    ...     write_ply(path, [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], vertex_labels=[0, 0, 1], dissipator=1)
    ...     read_mesh(path).faces
    array([[0, 1, 2]])
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces)
    _check_range(vertices, path)
    vertex_rows = np.empty(len(vertices), [("position", "<f4", 3), ("colour", "u1", 4)])
    vertex_rows["position"], vertex_rows["colour"] = vertices, label_colours(vertex_labels, dissipator)
    face_rows = np.empty(len(faces), [("n_corners", "u1"), ("corners", "<i4", 3)])
    face_rows["n_corners"], face_rows["corners"] = 3, faces
    header = _HEADER.format(n_vertices=len(vertices), n_faces=len(faces)).encode("ascii")
    Path(path).write_bytes(header + vertex_rows.tobytes() + face_rows.tobytes())


def _check_range(vertices: NDArray[np.float64], path: str | Path) -> None:
    """Raise OSError unless single precision can represent the coordinates."""
    single = np.finfo(np.float32)
    if not single.tiny <= np.abs(vertices).max() <= single.max:
        raise OSError(errno.ERANGE, "coordinates outside the range of single precision", str(path))
