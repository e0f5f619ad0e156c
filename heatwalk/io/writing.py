"""Writing a mesh file: the format follows from the suffix."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heatwalk.io.obj import write_obj
from heatwalk.io.off import write_off
from heatwalk.io.ply import write_text_ply
from heatwalk.io.stl import write_stl
from heatwalk.meshes import MeshError, check_arrays

WRITERS: dict[str, Callable[[Path, NDArray[np.float64], NDArray[np.int64]], None]] = {
    ".off": write_off,
    ".obj": write_obj,
    ".ply": write_text_ply,
    ".stl": write_stl,
}


def write_mesh(path: str | Path, vertices: ArrayLike, faces: ArrayLike) -> None:
    """Write a triangle mesh, its vertices and faces in their order.

    Parameters
    ----------
    path : str or Path
        the suffix selects the format: .off, .obj and .ply (ASCII, with all digits of the coordinates) or .stl (binary,
        in single precision, without the order of the vertices)
    vertices : (n, 3) array of real numbers
    faces : (m, 3) array of integers in 0 … n-1, m >= 1

    Raises
    ------
    MeshError
        if the suffix is another one, or the arrays are not a triangle mesh; see `heatwalk.meshes.check_arrays`
    OSError
        if the file cannot be written

    See Also
    --------
    write_ply : a segmentation, with the colours of its labels

    Examples
    --------
    >>> import tempfile
    >>> from heatwalk.io import read_mesh, write_mesh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "triangle.off")
    ...     write_mesh(path, [[0, 0, 0], [0.1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    ...     read_mesh(path).vertices
    array([[0. , 0. , 0. ],
           [0.1, 0. , 0. ],
           [0. , 1. , 0. ]])
    """
    path = Path(path)
    if path.suffix.lower() not in WRITERS:
        raise MeshError(f"{path}: the suffix must be one of {', '.join(WRITERS)} to write a mesh")
    WRITERS[path.suffix.lower()](path, *check_arrays(vertices, faces))
