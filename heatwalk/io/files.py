"""Meshes and segmentations in files.

trimesh reads PLY and STL files, and splits polygons. OFF and OBJ files are read here, because trimesh 5.2 reads some of
them wrongly without a word (see `_read_off`, `_read_obj`).
"""

import errno
import io
import logging
import re
import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import trimesh
from trimesh.geometry import triangulate_quads

from heatwalk.meshes import MeshError, check_arrays, referenced, shortened

# Twenty colours that stay apart from each other and from the dissipator region's grey, those most unlike each other
# first; after Trubetskoy 2017, "List of 20 Simple, Distinct Colors", without its grey, black, white and beige, the last
# two added.
_PALETTE = np.array(
    [
        [230, 25, 75], [0, 130, 200], [255, 225, 25], [60, 180, 75], [245, 130, 48],
        [145, 30, 180], [70, 240, 240], [240, 50, 230], [170, 110, 40], [0, 128, 128],
        [210, 245, 60], [0, 0, 128], [250, 190, 212], [128, 128, 0], [220, 190, 255],
        [128, 0, 0], [170, 255, 195], [255, 215, 180], [100, 60, 220], [255, 110, 110],
    ],
    dtype=np.uint8,
)  # fmt: skip
_DISSIPATOR_GREY = np.array([175, 175, 175], dtype=np.uint8)


@dataclass(frozen=True)
class LoadedMesh:
    """A triangle mesh as `read_mesh` gives it."""

    vertices: np.ndarray  # (n, 3) float64
    faces: np.ndarray  # (m, 3) int64
    notes: tuple[str, ...]  # what reading changed, a sentence each; empty where the arrays are what the file says


# What trimesh logs about a broken file would reach stderr where nobody has set up logging.
logging.getLogger("trimesh").addHandler(logging.NullHandler())


def read_mesh(path):
    """Read an OFF, OBJ, PLY (ASCII, binary) or STL (ASCII, binary) file as a triangle mesh.

    Only positions and faces are read: texture seams, normals and colours split no vertex, and all objects or groups of
    a file are one mesh. Vertices and triangles keep the order of the file. Where there are other polygons, trimesh
    splits them, and puts triangles first, then halves of quads, then the rest; a binary PLY file with faces of several
    sizes is refused. The corners of an STL file that have exactly the same coordinates become one vertex, and vertices
    are sorted by these. Vertices that belong to no face are dropped. `notes` tell which of this changed the mesh.

    Raises
    ------
    MeshError
        For a file that is missing, not readable, of an unknown suffix, empty, cut short, not what its suffix says,
        without faces, or with indices out of range; the message begins with the path. A file of correct form may still
        be refused by `check_mesh`.
    """
    path = Path(path)
    kind = path.suffix[1:].upper()
    try:
        reader = _READERS.get(path.suffix.lower())
        if reader is None:
            raise MeshError(f"unknown suffix {path.suffix!r}; can read {', '.join(_READERS)}")
        data = path.read_bytes()
        if not data.strip():
            raise MeshError("the file is empty")
        vertices, faces, n_polygons = reader(data)
        if not len(faces):
            raise MeshError(f"no {kind} file, or one that has no faces or is cut short")
        vertices, faces = check_arrays(vertices, faces)
    except MeshError as error:
        raise MeshError(f"{path}: {error}") from error
    except OSError as error:
        raise MeshError(f"{path}: cannot be read: {error.strerror or error}") from error
    except Exception as error:  # whatever a broken file leads to, in trimesh or here
        raise MeshError(f"{path}: no {kind} file, or a broken one: {shortened(error)}") from error

    notes = []
    if n_polygons != len(faces):
        notes.append(f"{n_polygons:,} faces, not all of them triangles, became {len(faces):,} triangles")
    if kind == "STL" and len(vertices) < faces.size:
        notes.append(f"merged {faces.size:,} duplicated STL vertices into {len(vertices):,}")
    used = referenced(faces, len(vertices))
    if not used.all():
        notes.append(f"dropped {np.count_nonzero(~used):,} vertices that belong to no face")
        faces = (np.cumsum(used) - 1)[faces]
    return LoadedMesh(vertices[used], faces, tuple(notes))


# Each gives vertices (n, 3), triangles (m, 3), and how many faces the file has.


def _read_off(data):
    """Not by trimesh: it takes files cut short, reads the lines before a comment twice, fails on most pentagons."""
    text = re.sub(r"#[^\r\n]*", "", data.decode("utf-8-sig", errors="replace"))
    header = re.match(r"\s*[STCN]*OFF\s*(\d+)[ \t]+(\d+)[^\r\n]*", text)
    if header is None:
        raise MeshError("no OFF file, or one that does not begin with its counts of vertices and faces")
    n_vertices, n_faces = int(header[1]), int(header[2])
    rows = [row.split() for row in text[header.end() :].splitlines() if row.strip()]
    vertices = [row[:3] for row in rows[:n_vertices]]
    rows = rows[n_vertices : n_vertices + n_faces]
    _check_not_cut(n_faces, sum(len(row) > int(row[0]) for row in rows))
    polygons = [[int(corner) for corner in row[1 : 1 + int(row[0])]] for row in rows]
    return np.array(vertices, dtype=float), triangulate_quads(polygons), n_faces


def _read_obj(data):
    """Not by trimesh: it sorts faces by material, splits vertices at texture seams (or fails, asked not to), counts
    relative indices back from the end of the file, and takes the index 0 for 1.
    """
    text = re.sub(r"\\\r?\n", " ", data.decode("utf-8-sig", errors="replace"))
    vertices, polygons = [], []
    for line in text.splitlines():
        keyword, *values = line.partition("#")[0].split() or [""]
        if keyword == "v":
            vertices.append(values[:3])
        elif keyword == "f":
            corners = [int(value.partition("/")[0]) for value in values]
            polygons.append([i + len(vertices) if i < 0 else i - 1 for i in corners])
    return np.array(vertices, dtype=float), triangulate_quads(polygons), len(polygons)


def _read_ply(data):
    header, _, body = data.partition(b"end_header")
    n_before = 0
    for element in re.split(rb"^[ \t]*element\s", header, flags=re.MULTILINE)[1:]:
        name, count = element.split()[:2]
        if name == b"face":
            break
        n_before += int(count)
    else:
        raise MeshError("no PLY file, or one whose header declares no faces")
    n_faces = int(count)
    # trimesh takes text that is cut short; in binary files it checks the length itself.
    if n_faces and b"ascii" in header.split(b"\n")[1].lower():
        rows = body.splitlines()[1 + n_before : 1 + n_before + n_faces] or [b""]
        last = rows[-1].split()
        n_due = 0
        for is_list in re.findall(rb"^[ \t]*property\s+(list)?", element, flags=re.MULTILINE):
            n_due += 1 + int(last[n_due]) if is_list and n_due < len(last) else 1
        _check_not_cut(n_faces, len(rows) - (len(last) < n_due))
    return *_read_by_trimesh(data, "ply"), n_faces


def _read_stl(data):
    corners, faces = _read_by_trimesh(data, "stl")
    # trimesh leaves out a solid without an end.
    _check_not_cut(len(re.findall(rb"^[ \t]*facet\b", data.lower(), flags=re.MULTILINE)), len(faces))
    vertices, place = np.unique(corners + 0.0, axis=0, return_inverse=True)  # + 0.0 makes -0 the same as 0
    return vertices, place.reshape(-1)[faces], len(faces)


_READERS = {".off": _read_off, ".obj": _read_obj, ".ply": _read_ply, ".stl": _read_stl}


def _read_by_trimesh(data, kind):
    with warnings.catch_warnings(action="ignore"):
        mesh = trimesh.load_mesh(io.BytesIO(data), kind, process=False, fix_texture=False, skip_materials=True)
    return np.asarray(mesh.vertices), np.asarray(mesh.faces)


def _check_not_cut(n_declared, n_held):
    if n_held < n_declared:
        raise MeshError(f"declares {n_declared:,} faces and holds {n_held:,}: the file is cut short")


def read_seg(path):
    """Read the labels of faces from a .seg file of the Princeton benchmark: one label a line.

    Parameters
    ----------
    path : str or Path

    Returns
    -------
    (m,) int64 array, the labels from 0 up

    Raises
    ------
    MeshError
        For a file that cannot be read, is empty, or has a line that is not one label; the message names the line.
    """
    try:
        lines = Path(path).read_text("utf-8", errors="replace").rstrip().splitlines()
    except OSError as error:
        raise MeshError(f"{path}: cannot be read: {error.strerror or error}") from error
    if not lines:
        raise MeshError(f"{path}: the file is empty")
    for number, line in enumerate(lines, start=1):
        if not re.fullmatch(r"\s*[0-9]{1,18}\s*", line):
            raise MeshError(f"{path}: line {number} is not a label (0, 1, 2 …): {line[:40]!r}")
    return np.array(lines, dtype=np.int64)


# --- writing


def label_colours(labels, dissipator=None):
    """A colour for each label, the same for the same label wherever it occurs.

    Parameters
    ----------
    labels : (n,) int array, 0 or more
    dissipator : int, optional
        the label of the dissipator region, which becomes grey

    Returns
    -------
    (n, 4) uint8 array, red, green, blue and alpha

    Notes
    -----
    Labels 0 to 19 have colours that are told apart at a glance; 20 to 59 darker shades of them; then they repeat.
    """
    labels = np.asarray(labels)
    shade = np.array([1.0, 0.7, 0.45])[labels // len(_PALETTE) % 3]
    colours = np.rint(_PALETTE[labels % len(_PALETTE)] * shade[:, None]).astype(np.uint8)
    if dissipator is not None:
        colours[labels == dissipator] = _DISSIPATOR_GREY
    return np.column_stack([colours, np.full(len(labels), 255, dtype=np.uint8)])


def write_ply(path, vertices, faces, vertex_labels, dissipator=None):
    """Write a mesh as binary PLY, its vertices coloured by label, coordinates in single precision.

    Parameters
    ----------
    path : str or Path
    vertices : (n, 3) float array
    faces : (m, 3) int array
    vertex_labels : (n,) int array, 0 or more
    dissipator : int, optional
        the label that becomes grey

    Raises
    ------
    OSError
        where the file cannot be written, or single precision cannot hold coordinates of this size
    """
    single = np.finfo(np.float32)
    if not single.tiny <= np.abs(vertices).max() <= single.max:
        raise OSError(errno.ERANGE, "coordinates outside the range of single precision", str(path))
    colours = label_colours(vertex_labels, dissipator)
    mesh = trimesh.Trimesh(vertices, faces, process=False, vertex_colors=colours)
    Path(path).write_bytes(mesh.export(file_type="ply"))


def write_seg(path, face_labels):
    """Write the labels of faces in the benchmark's format: one a line, in the order of the faces.

    Parameters
    ----------
    path : str or Path
    face_labels : (m,) int array

    Raises
    ------
    OSError
        where the file cannot be written
    """
    Path(path).write_text("".join(f"{label}\n" for label in np.asarray(face_labels).tolist()))
