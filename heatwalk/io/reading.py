"""Reading a mesh file: the format follows from the suffix."""

import bz2
import gzip
import lzma
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.gltf import external_buffers, read_gltf
from heatwalk.io.msh import read_msh
from heatwalk.io.obj import read_obj
from heatwalk.io.off import read_off
from heatwalk.io.ply import read_ply
from heatwalk.io.polygons import RawMesh
from heatwalk.io.stl import read_stl
from heatwalk.io.threemf import read_threemf
from heatwalk.io.vtk_legacy import read_vtk
from heatwalk.io.vtk_xml import read_vtp, read_vtu
from heatwalk.io.welding import Weld, check_weld, coincidence_notes, weld_vertices
from heatwalk.meshes import MeshError, check_arrays, describe_error, drop_unreferenced, repeats_earlier_face

READERS: dict[str, Callable[..., RawMesh]] = {
    ".off": read_off,
    ".obj": read_obj,
    ".ply": read_ply,
    ".stl": read_stl,
    ".glb": read_gltf,
    ".gltf": read_gltf,
    ".3mf": read_threemf,
    ".vtk": read_vtk,
    ".vtp": read_vtp,
    ".vtu": read_vtu,
    ".msh": read_msh,
}

# Formats of several files: their readers need the folder.
_IN_FOLDERS = (".glb", ".gltf")

DECOMPRESSORS: dict[str, Callable[[bytes], bytes]] = {
    ".gz": gzip.decompress,
    ".bz2": bz2.decompress,
    ".xz": lzma.decompress,
}

# What can be read, for messages.
READABLE = f"{', '.join(READERS)}, each also with {', '.join(DECOMPRESSORS)} after it"


@dataclass(frozen=True)
class LoadedMesh:
    """A triangle mesh, as returned by `read_mesh`.

    Attributes
    ----------
    vertices : (n, 3) float64 array, in the unit of the file
    faces : (m, 3) int64 array of vertex indices
    notes : tuple of str
        one sentence per change made while reading, per thing in the file that is no part of the mesh, and on the unit
        where the file tells it
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    notes: tuple[str, ...]


def read_mesh(path: str | Path, weld: Weld = None) -> LoadedMesh:
    """Read a file in one of the common formats as a triangle mesh.

    Parameters
    ----------
    path : str or Path
        the suffix selects the format: .off, .obj, .ply, .stl, .glb, .gltf, .3mf, .vtk, .vtp, .vtu or .msh (of Gmsh),
        each also compressed, as in .off.gz, .bz2 or .xz; in upper or lower case
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
    that fits them best, others as fans around their first corner. The parts of a scene (glTF, 3MF) are placed by its
    transforms and joined; coordinates stay in the unit of the file, and the axes what they are. Of volume cells (VTK,
    Gmsh) the boundary is taken, and cells of higher order are read by their corners. STL corners with exactly equal
    coordinates are merged into one vertex, and the vertices are sorted by coordinates. Unreferenced vertices are
    dropped. Vertices that coincide, exactly or within 1e-5 of the bounding-box diagonal, stay separate unless ``weld``
    is given, and a note counts them.

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
    file_format = split_suffix(path.name)[1].lstrip(".").partition(".")[0].upper()
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
    notes += coincidence_notes(vertices, faces)
    # Arrays that a library owns can be read-only, and callers may write to a mesh.
    return LoadedMesh(np.require(vertices, requirements=["C", "W"]), np.require(faces, requirements=["C", "W"]), notes)


def split_suffix(name: str) -> tuple[str, str]:
    """Split the name of a mesh file into the part before its suffix, and the suffix.

    Parameters
    ----------
    name : str

    Returns
    -------
    stem : str
        the name itself if it has no suffix of a format that `read_mesh` reads
    suffix : str
        as in the name, with that of the compression: ".OFF", ".ply.gz"; "" for any other name

    Examples
    --------
    >>> split_suffix("cat.1.OFF"), split_suffix("cat.ply.gz"), split_suffix("cat.dae")
    (('cat.1', '.OFF'), ('cat', '.ply.gz'), ('cat.dae', ''))
    """
    path = Path(name)
    compression = path.suffix if path.suffix.lower() in DECOMPRESSORS else ""
    suffix = Path(path.stem).suffix if compression else path.suffix
    if suffix.lower() not in READERS:
        return name, ""
    return name[: len(name) - len(suffix) - len(compression)], suffix + compression


def files_of(path: Path) -> list[Path]:
    """The files that a mesh is read from: the file itself, and those that it refers to."""
    if split_suffix(path.name)[1].lower() != ".gltf":
        return [path]
    try:
        return [path, *external_buffers(path.read_bytes(), path.parent)]
    except (MeshError, OSError):  # reading it gives the reason
        return [path]


def _read_arrays(path: Path, file_format: str) -> tuple[NDArray[np.float64], NDArray[np.int64], int, tuple[str, ...]]:
    """Vertices, triangles, the number of polygons in a file, and notes on what was ignored."""
    suffix = split_suffix(path.name)[1].lower()
    if not suffix:
        raise MeshError(f"unknown suffix {path.suffix!r}; supported: {READABLE}")
    data = path.read_bytes()
    mesh_suffix, dot, compression = suffix[1:].partition(".")
    if dot and data:
        data = _decompress(data, f".{compression}")
    if not data or data.isspace():
        raise MeshError("the file is empty")
    reader = READERS[f".{mesh_suffix}"]
    raw = reader(data, path.parent) if f".{mesh_suffix}" in _IN_FOLDERS else reader(data)
    if not len(raw.faces):
        raise MeshError(f"not a {file_format} file, or it has no faces or is truncated")
    vertices, faces = check_arrays(raw.vertices, raw.faces)
    return vertices, faces, raw.n_polygons, raw.notes


def _decompress(data: bytes, suffix: str) -> bytes:
    """The contents of a compressed file."""
    try:
        return DECOMPRESSORS[suffix](data)
    except (OSError, EOFError, ValueError, zlib.error, lzma.LZMAError) as error:
        raise MeshError(f"cannot be decompressed as {suffix}, or is truncated: {error}") from error
