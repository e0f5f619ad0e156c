"""OFF files (Geomview's Object File Format, ASCII).

Not read by trimesh: trimesh 5.2 accepts truncated files, reads the lines before a comment twice, and fails on most
pentagons.
"""

import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.numbers import (
    BYTE_ORDER_MARK,
    Numbers,
    format_rows,
    line_number,
    parse_numbers,
    reject_bad_word,
    shown,
    to_integers,
)
from heatwalk.io.polygons import Polygons, RawMesh, check_complete, raw_mesh
from heatwalk.meshes import MeshError

# What a vertex has besides its position: ST texture, C colour, N normal, 4 a fourth coordinate; n: the dimension
# follows the keyword. Other spellings than upper case are read too; "noff" means NOFF.
_KEYWORD = re.compile(rb"\s*(?:(?P<extra>[STCN]*)(?P<w>4?)(?P<n>n?)OFF|(?P<lower>[STCNstcn]*4?)[Oo][Ff][Ff])")
_COUNT = re.compile(rb"\s*(\d+)(?!\S)")
# The number of edges, which is not needed and may be missing: on the line of the other counts, or alone on its line.
_EDGES = re.compile(rb"[ \t]+\d+(?!\S)|[ \t]*[\r\n]\s*\d+[ \t]*(?=[\r\n]|\Z)")
_NOT_OFF = "not an OFF file, or its header lacks the vertex and face counts"


class _Header(NamedTuple):
    """What the header of a file declares, and where its body begins."""

    n_vertices: int
    n_faces: int
    dimension: int  # numbers of a position
    strides: tuple[int, ...]  # the numbers that a vertex may have, the likeliest first
    end: int


def read_off(data: bytes) -> RawMesh:
    """Read the contents of an OFF file, with or without colours, normals and texture coordinates."""
    text = data.removeprefix(BYTE_ORDER_MARK).rstrip(b"\0\x1a")
    if b"#" in text:
        text = re.sub(rb"#[^\r\n]*", b"", text)
    header = _read_header(text)
    body = text[header.end :]
    numbers = parse_numbers(body)
    found = _read_free(numbers, header)
    if found is None:
        found = _read_plain_lines(body, numbers, header) or _read_lines(body, header)
    if found is None:
        _reject_body(text, body, numbers, header)
        raise MeshError("the rows of the file do not contain the vertices and faces that its header declares")
    positions, polygons = found
    return raw_mesh(_three_coordinates(positions), polygons)


def _read_header(text: bytes) -> _Header:
    """The keyword and the counts."""
    keyword = _KEYWORD.match(text)
    extra, has_w, has_dimension = b"", False, False
    end = 0
    if keyword is not None:
        end = keyword.end()
        spelled = (keyword["extra"] or b"") + (keyword["w"] or b"") + (keyword["lower"] or b"").upper()
        extra, has_w, has_dimension = spelled.replace(b"4", b""), b"4" in spelled, bool(keyword["n"])
        if re.match(rb"\s*BINARY\b", text[end:], re.IGNORECASE):
            raise MeshError("a binary OFF file; save it as ASCII OFF, or as PLY")
    dimension = 3
    if has_dimension:
        declared = _COUNT.match(text, end)
        if declared is None:
            raise MeshError("the keyword nOFF is not followed by the dimension, as in 'nOFF 3'")
        dimension, end = int(declared[1]), declared.end()
        if dimension != 3:
            raise MeshError(f"the vertices have {dimension} coordinates (nOFF {dimension}); three are required")
    counts = []
    for _ in range(2):
        count = _COUNT.match(text, end)
        if count is None:
            raise MeshError(_NOT_OFF)
        counts.append(int(count[1]))
        end = count.end()
    edges = _EDGES.match(text, end)
    dimension += has_w
    fixed = dimension + 3 * (b"N" in extra) + 2 * (b"T" in extra)
    strides = (fixed + 4, fixed + 3) if b"C" in extra else (fixed,)
    return _Header(counts[0], counts[1], dimension, strides, edges.end() if edges else end)


def _read_free(numbers: Numbers, header: _Header) -> tuple[NDArray[np.float64], Polygons] | None:
    """Positions and polygons of a body that is nothing but the declared numbers, however they are broken into lines.

    None if there are more or fewer numbers.
    """
    for stride in header.strides:
        n_coordinates = header.n_vertices * stride
        values = numbers.values
        if numbers.bad_word is not None or len(values) < n_coordinates + header.n_faces:
            continue
        rows = to_integers(values[n_coordinates:])
        polygons = None if rows is None else _split(rows, header.n_faces)
        if polygons is not None:
            positions = values[:n_coordinates].reshape(header.n_vertices, stride)[:, : header.dimension]
            return positions, polygons
    return None


def _split(rows: NDArray[np.int64], n_faces: int) -> Polygons | None:
    """Polygons of rows of a number of corners and these corners; None if the last one does not end with the rows."""
    width = len(rows) // max(n_faces, 1)
    if n_faces and len(rows) == n_faces * width:
        table = rows.reshape(n_faces, width)
        if (table[:, 0] == width - 1).all():
            return Polygons(np.full(n_faces, width - 1), table[:, 1:].ravel())
    values = rows.tolist()
    starts, at = [], 0
    for _ in range(n_faces):
        if at >= len(values) or values[at] < 0:
            return None
        starts.append(at)
        at += 1 + values[at]
    if at != len(values):
        return None
    is_corner = np.ones(len(rows), dtype=bool)
    is_corner[starts] = False
    return Polygons(rows[starts], rows[is_corner])


def _read_plain_lines(body: bytes, numbers: Numbers, header: _Header) -> tuple[NDArray[np.float64], Polygons] | None:
    """What `_read_lines` returns, for a body of numbers whose faces have a line each; else None."""
    values = numbers.values
    octets = np.frombuffer(body, np.uint8)
    is_space = np.append(True, octets <= ord(" "))
    words = np.flatnonzero(is_space[:-1] > is_space[1:])
    if numbers.bad_word is not None or len(words) != len(values):
        return None
    line_ends = np.flatnonzero((octets == ord("\n")) | (octets == ord("\r")))
    first = np.unique(np.append(0, np.searchsorted(words, line_ends)))  # the first word of each line that has any
    first = first[first < len(words)]
    width = np.diff(np.append(first, len(words)))
    n_rows = header.n_vertices + header.n_faces
    if len(first) < n_rows or (width[: header.n_vertices] < header.dimension).any():
        return None
    positions = values[first[: header.n_vertices, None] + np.arange(header.dimension)]
    first, width = first[header.n_vertices : n_rows], width[header.n_vertices : n_rows]
    starts = words[first]
    is_digit = (
        (octets[starts] >= ord("0")) & (octets[starts] <= ord("9")) & is_space[np.minimum(starts + 2, len(octets))]
    )
    sizes = values[first].astype(np.int64, copy=False) if is_digit.all() else None
    if sizes is None or (width <= sizes).any():
        return None
    step = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    corners = to_integers(values[np.repeat(first + 1, sizes) + step])
    return None if corners is None else (positions, Polygons(sizes, corners))


def _read_lines(body: bytes, header: _Header) -> tuple[NDArray[np.float64], Polygons] | None:
    """Positions and polygons of a body with one vertex or face per line, each followed by anything; else None.

    A face may be wrapped into several lines.
    """
    rows = [row for row in (line.split() for line in body.splitlines()) if row]
    vertex_rows, face_rows = rows[: header.n_vertices], rows[header.n_vertices :]
    if len(vertex_rows) < header.n_vertices or any(len(row) < header.dimension for row in vertex_rows):
        return None
    positions, bad_word = parse_numbers(b" ".join(word for row in vertex_rows for word in row[: header.dimension]))
    if bad_word is not None:
        return None
    sizes: list[int] = []
    corners: list[bytes] = []
    remaining = iter(face_rows)
    for row in remaining:
        if len(sizes) == header.n_faces:
            break
        if not row[0].isdigit():
            return None
        size = int(row[0])
        while len(row) <= size:
            following = next(remaining, None)
            if following is None:
                return None
            row = row + following
        sizes.append(size)
        corners += row[1 : 1 + size]
    values, bad_word = parse_numbers(b" ".join(corners))
    indices = to_integers(values)
    if len(sizes) < header.n_faces or bad_word is not None or indices is None:
        return None
    return positions.reshape(-1, header.dimension), Polygons(np.array(sizes, dtype=np.int64), indices)


def _three_coordinates(positions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Positions without their fourth coordinate, which must be 1."""
    if positions.shape[1] == 4:
        other = np.flatnonzero(positions[:, 3] != 1)
        if len(other):
            raise MeshError(
                f"vertex {other[0]} (counted from 0) has the fourth coordinate {positions[other[0], 3]:g}: 4OFF is "
                "read only if it is 1 everywhere; convert the file to OFF with three coordinates per vertex"
            )
    return np.ascontiguousarray(positions[:, :3])


def _reject_body(text: bytes, body: bytes, numbers: Numbers, header: _Header) -> None:
    """Raise MeshError for the first row that is not what the header declares."""
    first_line = line_number(text, header.end)
    if numbers.bad_word is not None:
        reject_bad_word(body, numbers.bad_word, first_line)
    n_numbers = len(numbers.values)
    if n_numbers < header.n_vertices * header.dimension:
        check_complete(header.n_vertices, n_numbers // header.dimension, "vertices")
    lines = [(number, line.split()) for number, line in enumerate(body.splitlines(), start=first_line) if line.strip()]
    vertex_rows, face_rows = lines[: header.n_vertices], lines[header.n_vertices :]
    for i, (number, row) in enumerate(vertex_rows):
        if len(row) < header.dimension:
            raise MeshError(f"line {number}: vertex {i} (counted from 0) has {len(row)} coordinates")
    for i, (number, row) in enumerate(face_rows[: header.n_faces]):
        _check_face_row(i, number, row, is_last=number == lines[-1][0], n_faces=header.n_faces)
    check_complete(header.n_faces, len(face_rows))


def _check_face_row(face: int, number: int, row: Sequence[bytes], is_last: bool, n_faces: int) -> None:
    """Raise MeshError unless a row is a number of corners and as many corners."""
    where = f"line {number}: face {face} (counted from 0)"
    size = to_integers(np.array([float(row[0])]))
    if size is None or size[0] < 0:
        raise MeshError(f"{where} has {shown(row[0])} corners")
    if len(row) <= size[0]:
        if is_last:
            check_complete(n_faces, face)
        raise MeshError(f"{where} declares {size[0]} corners but has {len(row) - 1}")
    if to_integers(np.array(row[1 : 1 + int(size[0])], dtype=float)) is None:
        raise MeshError(f"{where} has a corner that is not an integer")


def write_off(path: str | Path, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> None:
    """Write a triangle mesh with all digits of its coordinates; OSError if the file cannot be written."""
    header = f"OFF\n{len(vertices)} {len(faces)} 0\n".encode("ascii")
    Path(path).write_bytes(header + format_rows([*vertices.T]) + format_rows(["3", *faces.T]))
