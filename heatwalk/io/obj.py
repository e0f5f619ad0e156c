"""OBJ files (Wavefront).

Not read by trimesh: trimesh 5.2 sorts faces by material, splits vertices at texture seams (or fails if asked not to),
resolves relative indices from the end of the file, and reads the invalid index 0 as 1.
"""

import re
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.numbers import BYTE_ORDER_MARK, is_number, parse_numbers, shown, to_integers
from heatwalk.io.polygons import Polygons, RawMesh, raw_mesh
from heatwalk.meshes import MeshError

_VERTEX = (b"v ", b"v\t")
_FACE = (b"f ", b"f\t", b"fo ", b"fo\t")  # "fo" is the keyword of version 2 of the format
# A backslash at the end of one of these continues it; at the end of a name it is a part of the name.
_CONTINUED = (b"v", b"f", b"fo")


def read_obj(data: bytes) -> RawMesh:
    """Read the vertices and faces of an OBJ file; all other statements are ignored."""
    lines = _statements(data.removeprefix(BYTE_ORDER_MARK))
    vertex_lines = [line for line in lines if line.startswith(_VERTEX)]
    face_lines = [line for line in lines if line.startswith(_FACE)]
    vertices = _parse_vertices(vertex_lines)
    polygons = _parse_faces(face_lines)
    if vertices is None or polygons is None:
        _reject(lines)
    sizes, corners = polygons
    if (corners < 0).any():  # counted back from the vertices so far
        is_vertex = np.array([line.startswith(_VERTEX) for line in lines])
        is_face = np.array([line.startswith(_FACE) for line in lines])
        n_before = np.repeat(np.cumsum(is_vertex)[is_face], sizes)
        corners = np.where(corners < 0, corners + n_before, corners - 1)
    else:
        corners = corners - 1
    return raw_mesh(vertices, Polygons(sizes, corners))


def _statements(data: bytes) -> list[bytes]:
    """The lines without comments and indents, each continued line followed by empty ones: numbers of lines stay."""
    lines = data.splitlines()
    if b"#" in data:
        lines = [line.partition(b"#")[0] for line in lines]
    lines = [line.strip() for line in lines]
    if b"\\" in data:
        for i in range(len(lines)):
            if lines[i].endswith(b"\\") and lines[i].rstrip(b"\\").split(maxsplit=1)[:1] in [[k] for k in _CONTINUED]:
                end = i + 1
                while lines[i].endswith(b"\\"):
                    following = lines[end] if end < len(lines) else b""
                    lines[i] = lines[i][:-1].rstrip() + b" " + following
                    lines[end : end + 1] = [b""] if end < len(lines) else []
                    end += 1
    return lines


def _parse_vertices(lines: list[bytes]) -> NDArray[np.float64] | None:
    """The coordinates of the vertices, (n, 3); None if a line does not have them."""
    text = b"\n".join(lines)
    words = text.split()
    if len(words) != 4 * len(lines) or words[::4].count(b"v") != len(lines):  # colours or weights as well
        rows = [line.split(maxsplit=4)[1:4] for line in lines]
        if any(len(row) < 3 for row in rows):
            return None
        words = [word for row in rows for word in row]
        text = b" ".join(words)
        n_expected, n_keywords = len(words), 0
    else:
        n_expected, n_keywords = 3 * len(lines), len(lines)
    if text.count(b"v") != n_keywords:
        return None
    values, bad_word = parse_numbers(text.translate(None, b"v"))
    return values.reshape(-1, 3) if bad_word is None and len(values) == n_expected else None


def _parse_faces(lines: list[bytes]) -> Polygons | None:
    """The faces as the file counts their corners; None if a line does not have them."""
    text = b"\n".join(lines)
    if b"/" in text:  # numbers of texture coordinates and normals
        text = re.sub(rb"/\S*", b"", text)
    words = text.split()
    if len(words) == 4 * len(lines) and words[::4].count(b"f") == len(lines):
        sizes = np.full(len(lines), 3, dtype=np.int64)
    else:
        sizes = np.array([len(line.split()) - 1 for line in lines], dtype=np.int64)
    if text.count(b"f") != len(lines) or text.count(b"o") > text.count(b"fo"):
        return None
    values, bad_word = parse_numbers(text.translate(None, b"fo"))
    corners = to_integers(values)
    if bad_word is not None or corners is None or len(corners) != sizes.sum() or (corners == 0).any():
        return None
    return Polygons(sizes, corners)


def _reject(lines: list[bytes]) -> NoReturn:
    """Raise MeshError for the first line that is not a valid vertex or face."""
    for number, line in enumerate(lines, start=1):
        words = line.split()
        if line.startswith(_VERTEX):
            if len(words) < 4:
                raise MeshError(f"line {number}: a vertex needs three coordinates, but has {len(words) - 1}")
            for word in words[1:4]:
                if not is_number(word):
                    raise MeshError(f"line {number}: {shown(word)} is not a coordinate")
        elif line.startswith(_FACE):
            for word in words[1:]:
                index = word.partition(b"/")[0]
                if not is_number(index) or to_integers(np.array([float(index)])) is None:
                    raise MeshError(f"line {number}: {shown(word)} is not a corner of a face")
                if float(index) == 0:
                    raise MeshError(f"line {number}: a face refers to vertex 0, but OBJ counts vertices from 1")
    raise MeshError("contains a vertex or a face that cannot be read")
