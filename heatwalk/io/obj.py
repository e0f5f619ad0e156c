"""OBJ files (Wavefront).

Not read by trimesh: trimesh 5.2 sorts faces by material, splits vertices at texture seams (or fails if asked not to),
resolves relative indices from the end of the file, and reads the invalid index 0 as 1.
"""

import re
from pathlib import Path
from typing import NamedTuple, NoReturn

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.numbers import BYTE_ORDER_MARK, format_rows, is_number, parse_numbers, shown, to_integers
from heatwalk.io.polygons import Polygons, RawMesh, raw_mesh
from heatwalk.meshes import MeshError

_VERTEX = (b"v ", b"v\t")
_FACE = (b"f ", b"f\t", b"fo ", b"fo\t")  # "fo" is the keyword of version 2 of the format
# A backslash at the end of one of these continues it; at the end of a name it is a part of the name.
_CONTINUED = (b"v", b"f", b"fo")
_LINE_FEED = ord("\n")
_BLANKS = np.frombuffer(b" \t\v\f", np.uint8)
_PART = 4_000_000  # bytes of a file that are read at a time


def read_obj(data: bytes) -> RawMesh:
    """Read the vertices and faces of an OBJ file; all other statements are ignored."""
    data = data.removeprefix(BYTE_ORDER_MARK)
    found = _read_plain(data)
    vertices, polygons = _read_any(data) if found is None else found
    return raw_mesh(vertices, polygons)


# --- files of the usual layout, all lines at once


def _read_plain(data: bytes) -> tuple[NDArray[np.float64], Polygons] | None:
    """Vertices and faces of a file as programs write it: a line per statement, alike for all vertices; else None.

    Whatever is unusual, or wrong, is left to `_read_any`.
    """
    if b"\r" in data and data.count(b"\r") != data.count(b"\r\n"):
        return None
    vertices, sizes, corners = [np.empty((0, 3))], [np.empty(0, np.int64)], [np.empty(0, np.int64)]
    at = n_vertices = 0
    while at < len(data):  # in parts that the processor's cache can hold
        end = data.find(b"\n", at + _PART) + 1 or len(data)
        part = _read_part(data[at:end], n_vertices)
        if part is None:
            return None
        positions, polygons = part
        vertices.append(positions)
        sizes.append(polygons.sizes)
        corners.append(polygons.corners)
        n_vertices += len(positions)
        at = end
    if n_vertices == 0:
        return None
    return np.concatenate(vertices), Polygons(np.concatenate(sizes), np.concatenate(corners))


def _read_part(data: bytes, n_before: int) -> tuple[NDArray[np.float64], Polygons] | None:
    """Vertices and faces, with corners counted from 0, of some lines after ``n_before`` vertices; see `_read_plain`."""
    octets = np.frombuffer(data, np.uint8)
    begins = np.append(0, np.flatnonzero(octets == _LINE_FEED) + 1)
    begins = begins[begins < len(octets)]
    ends = np.append(begins[1:], len(octets))
    first, second = octets[begins], octets[np.minimum(begins + 1, len(octets) - 1)]
    if np.isin(first, _BLANKS).any() or ((first == ord("f")) & (second == ord("o"))).any():
        return None
    if (((first == ord("v")) | (first == ord("f"))) & (second == ord("\\"))).any():  # continued after the keyword
        return None
    has_blank = (second == ord(" ")) | (second == ord("\t"))
    is_vertex, is_face = has_blank & (first == ord("v")), has_blank & (first == ord("f"))
    vertices: NDArray[np.float64] | None = np.empty((0, 3))
    polygons: Polygons | None = Polygons(np.empty(0, np.int64), np.empty(0, np.int64))
    if is_vertex.any():
        vertices = _plain_vertices(_Lines.of(octets, begins[is_vertex], ends[is_vertex]))
    if is_face.any():
        polygons = _plain_faces(_Lines.of(octets, begins[is_face], ends[is_face]))
    if vertices is None or polygons is None:
        return None
    sizes, corners = polygons
    if not len(corners) or corners.min() > 0:
        return vertices, Polygons(sizes, corners - 1)
    so_far = np.repeat(np.searchsorted(begins[is_vertex], begins[is_face]) + n_before, sizes)
    return vertices, Polygons(sizes, np.where(corners < 0, corners + so_far, corners - 1))


class _Lines(NamedTuple):
    """Lines of a file, one after the other, and where each of them, each word and the end of each word is."""

    octets: NDArray[np.uint8]
    begins: NDArray[np.int64]
    words: NDArray[np.int64]
    word_ends: NDArray[np.int64]

    @classmethod
    def of(cls, octets: NDArray[np.uint8], begins: NDArray[np.int64], ends: NDArray[np.int64]) -> "_Lines":
        """The lines between the given positions of a file; each begins with a word."""
        if (begins[1:] == ends[:-1]).all():
            chosen = octets[begins[0] : ends[-1]].copy()
        else:
            is_chosen = np.tile([True, False], len(begins))[:-1]
            lengths = np.diff(np.column_stack([begins, ends]).ravel())
            chosen = octets[begins[0] : ends[-1]][np.repeat(is_chosen, lengths)]
        lengths = ends - begins
        is_space = np.append(chosen <= ord(" "), True)
        words = np.flatnonzero(is_space[:-2] > is_space[1:-1]) + 1
        word_ends = np.flatnonzero(is_space[1:] > is_space[:-1]) + 1
        return cls(chosen, np.cumsum(lengths) - lengths, np.append(0, words), word_ends)

    def words_per_line(self) -> NDArray[np.int64]:
        """The number of words of each line."""
        n_lines, width = len(self.begins), len(self.words) // len(self.begins)
        if len(self.words) == n_lines * width and np.array_equal(self.words[::width], self.begins):
            return np.full(n_lines, width)
        return np.diff(np.append(np.searchsorted(self.words, self.begins), len(self.words)))


def _plain_vertices(lines: _Lines) -> NDArray[np.float64] | None:
    """The coordinates of vertices, (n, 3); None unless the lines have equally many numbers, three at least."""
    n_words = lines.words_per_line()
    width = int(n_words[0])
    if width < 4 or not (n_words == width).all():
        return None
    lines.octets[lines.begins] = ord(" ")
    values, bad_word = parse_numbers(lines.octets.tobytes())
    return values.reshape(-1, width - 1)[:, :3] if bad_word is None else None


def _plain_faces(lines: _Lines) -> Polygons | None:
    """The faces as the file counts their corners; None unless all corners have equally many slashes."""
    sizes = lines.words_per_line() - 1
    octets = lines.octets
    octets[lines.begins] = ord(" ")
    slashes = np.flatnonzero(octets == ord("/"))
    n_corners = int(sizes.sum())
    if sizes.min() < 1 or len(slashes) % n_corners:
        return None
    if len(slashes):  # numbers of texture coordinates and normals follow
        if (octets == ord("#")).any() or (octets == ord("\\")).any():
            return None
        is_corner = np.ones(len(lines.words), dtype=bool)
        is_corner[np.cumsum(sizes + 1) - sizes - 1] = False
        begins, ends = lines.words[is_corner], lines.word_ends[is_corner]
        rows = slashes.reshape(n_corners, -1)
        if not ((rows[:, 0] > begins) & (rows[:, -1] < ends)).all():
            return None
        lengths = np.diff(np.column_stack([rows[:, 0], ends]).ravel(), prepend=0, append=len(octets))
        octets = octets[np.repeat(np.arange(len(lengths)) % 2 == 0, lengths)]
    values, bad_word = parse_numbers(octets.tobytes())
    corners = to_integers(values)
    if bad_word is not None or corners is None or (corners == 0).any():
        return None
    return Polygons(sizes, corners)


# --- any other file, one line after the other


def _read_any(data: bytes) -> tuple[NDArray[np.float64], Polygons]:
    """Vertices and faces of a file, or MeshError."""
    lines = _statements(data)
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
    return vertices, Polygons(sizes, corners)


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


# --- writing


def write_obj(path: str | Path, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> None:
    """Write a triangle mesh with all digits of its coordinates; OSError if the file cannot be written."""
    Path(path).write_bytes(format_rows(["v", *vertices.T]) + format_rows(["f", *(faces.T + 1)]))
