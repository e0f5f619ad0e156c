"""Reading a mesh file: the format follows from the suffix."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.obj import read_obj
from heatwalk.io.off import read_off
from heatwalk.io.ply import read_ply
from heatwalk.io.polygons import RawMesh
from heatwalk.io.stl import read_stl
from heatwalk.io.welding import Weld, check_weld, coincidence_notes, weld_vertices
from heatwalk.meshes import MeshError, check_arrays, describe_error, drop_unreferenced, repeats_earlier_face

READERS: dict[str, Callable[[bytes], RawMesh]] = {
    ".off": read_off,
    ".obj": read_obj,
    ".ply": read_ply,
    ".stl": read_stl,
}


@dataclass(frozen=True)
class LoadedMesh:
    """A triangle mesh, as returned by `read_mesh`.

    Attributes
    ----------
    vertices : (n, 3) float64 array, in the unit of the file
    faces : (m, 3) int64 array of vertex indices
    notes : tuple of str
        one sentence per change made while reading; empty if the arrays are exactly those of the file
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    notes: tuple[str, ...]


def read_mesh(path: str | Path, weld: Weld = None) -> LoadedMesh:
    """Read an OFF, OBJ, PLY (ASCII or binary) or STL (ASCII or binary) file as a triangle mesh.

    Parameters
    ----------
    path : str or Path
        the suffix selects the format: .off, .obj, .ply or .stl, in upper or lower case
    weld : None, "exact" or float
        merge vertices that coincide: those of exactly equal coordinates, or those at most that far apart, relative to
        the bounding-box diagonal, and chains of them. All faces are kept, in their order.

    Returns
    -------
    LoadedMesh

    Raises
    ------
    MeshError
        if the file is missing, unreadable, empty, truncated, not in the format of its suffix, or has an unknown
        suffix, no faces or indices out of range, or if ``weld`` is none of the above. The message begins with the
        path. A well-formed file can still be rejected by `heatwalk.check_mesh`.

    Notes
    -----
    Only positions and faces are read: texture seams, normals and colours do not split vertices, and all objects and
    groups of a file form one mesh. Vertices and triangles keep the order of the file. Polygons are triangulated:
    triangles come first, then the halves of the quads, then the rest; concave polygons by ear clipping in the plane
    that fits them best, others as fans around their first corner. STL corners with exactly equal coordinates are
    merged into one vertex, and the vertices are sorted by coordinates. Unreferenced vertices are dropped. Vertices
    that coincide, exactly or within 1e-5 of the bounding-box diagonal, stay separate unless ``weld`` is given, and a
    note counts them.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from heatwalk.io import read_mesh
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "square.off")
    ...     _ = path.write_text("OFF 4 1 0  0 0 0  1 0 0  1 1 0  0 1 0  4 0 1 2 3".replace("  ", chr(10)))
    ...     mesh = read_mesh(path)
    >>> mesh.faces
    array([[0, 1, 2],
           [2, 3, 0]])
    >>> mesh.notes
    ('triangulated 1 face into 2 triangles',)
    """
    path = Path(path)
    file_format = path.suffix[1:].upper()
    try:
        check_weld(weld)
        vertices, faces, n_polygons, ignored = _read_arrays(path, file_format)
        return _finish(vertices, faces, _reading_notes(len(vertices), faces, n_polygons, file_format) + ignored, weld)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from error
    except OSError as error:
        raise MeshError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # a safety net: the readers reject what they foresee by a MeshError
        raise MeshError(f"{path}: not a valid {file_format} file: {describe_error(error)}") from error


def _reading_notes(n_vertices: int, faces: NDArray[np.int64], n_polygons: int, file_format: str) -> tuple[str, ...]:
    """What reading changed."""
    notes = []
    if n_polygons != len(faces):
        notes.append(f"triangulated {n_polygons:,} face{'s' * (n_polygons != 1)} into {len(faces):,} triangles")
    if file_format == "STL" and n_vertices < faces.size:
        notes.append(f"merged {faces.size:,} STL corners into {n_vertices:,} vertices")
    return tuple(notes)


def _finish(vertices: NDArray[np.float64], faces: NDArray[np.int64], notes: tuple[str, ...], weld: Weld) -> LoadedMesh:
    """The mesh without unreferenced vertices, welded if required, with notes on what was done and what coincides."""
    n_read = len(vertices)
    vertices, faces, kept = drop_unreferenced(vertices, faces)
    if len(kept) < n_read:
        notes += (f"dropped {n_read - len(kept):,} vertices that belong to no face",)
    if weld is not None:
        n_before = len(vertices)
        vertices, faces = weld_vertices(vertices, faces, weld)
        if len(vertices) < n_before:
            notes += (f"welded {n_before:,} vertices into {len(vertices):,}",)
    n_repeated = np.count_nonzero(repeats_earlier_face(faces))
    if n_repeated:
        notes += (f"{n_repeated:,} faces repeat the corners of another face, which counts once",)
    return LoadedMesh(vertices, faces, notes + coincidence_notes(vertices, faces))


def _read_arrays(path: Path, file_format: str) -> tuple[NDArray[np.float64], NDArray[np.int64], int, tuple[str, ...]]:
    """Vertices, triangles, the number of polygons in a file, and notes on what was ignored."""
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise MeshError(f"unknown suffix {path.suffix!r}; supported: {', '.join(READERS)}")
    data = path.read_bytes()
    if not data.strip():
        raise MeshError("the file is empty")
    raw = reader(data)
    if not len(raw.faces):
        raise MeshError(f"not a {file_format} file, or it has no faces or is truncated")
    vertices, faces = check_arrays(raw.vertices, raw.faces)
    return vertices, faces, raw.n_polygons, raw.notes
