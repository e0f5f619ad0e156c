"""OBJ files (Wavefront).

Not read by trimesh: trimesh 5.2 sorts faces by material, splits vertices at texture seams (or fails if asked not to),
resolves relative indices from the end of the file, and reads the invalid index 0 as 1.
"""

from collections.abc import Iterator
from typing import NoReturn

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.numbers import BYTE_ORDER_MARK, is_number, parse_numbers, shown, to_integers
from heatwalk.io.polygons import Polygons, RawMesh, raw_mesh
from heatwalk.meshes import MeshError

_FACE = (b"f", b"fo")  # "fo" is the keyword of version 2 of the format


def read_obj(data: bytes) -> RawMesh:
    """Read the vertices and faces of an OBJ file; all other statements are ignored."""
    data = data.removeprefix(BYTE_ORDER_MARK)
    statements = _continued(data) if b"\\" in data else enumerate(data.splitlines(), start=1)
    coordinates: list[bytes] = []
    vertex_lines: list[int] = []
    corners: list[bytes] = []
    face_lines: list[int] = []
    sizes: list[int] = []
    n_before: list[int] = []  # vertices before each face
    for number, line in statements:
        if b"#" in line:
            line = line[: line.index(b"#")]
        words = line.split()
        if not words:
            continue
        if words[0] == b"v":
            coordinates += words[1:4]
            vertex_lines.append(number)
            if len(words) < 4:
                raise MeshError(f"line {number}: a vertex needs three coordinates, but has {len(words) - 1}")
        elif words[0] in _FACE:
            corners += [word.partition(b"/")[0] for word in words[1:]] if b"/" in line else words[1:]
            face_lines.append(number)
            sizes.append(len(words) - 1)
            n_before.append(len(vertex_lines))

    values, bad_word = parse_numbers(b" ".join(coordinates))
    if bad_word is not None or len(values) != len(coordinates):
        _reject(coordinates, np.repeat(vertex_lines, 3), "a coordinate")
    indices = _parse_indices(corners, np.repeat(face_lines, sizes))
    if (indices == 0).any():
        number = int(np.repeat(face_lines, sizes)[np.argmax(indices == 0)])
        raise MeshError(f"line {number}: a face refers to vertex 0, but OBJ counts vertices from 1")
    indices = np.where(indices < 0, indices + np.repeat(n_before, sizes).astype(np.int64), indices - 1)
    return raw_mesh(values.reshape(-1, 3), Polygons(np.array(sizes, dtype=np.int64), indices))


def _continued(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Line number and text of each statement of a file with backslashes.

    A backslash continues a vertex or a face on the next line, also if blanks follow it; at the end of a comment or a
    name it is a part of that.
    """
    lines = enumerate(data.splitlines(), start=1)
    for number, line in lines:
        statement = line.partition(b"#")[0].strip()
        if statement.split(maxsplit=1)[:1] and statement.split(maxsplit=1)[0].rstrip(b"\\") in (b"v", *_FACE):
            while statement.endswith(b"\\"):
                _, following = next(lines, (0, b""))
                statement = statement[:-1] + b" " + following.partition(b"#")[0].strip()
        yield number, statement


def _parse_indices(corners: list[bytes], lines: NDArray) -> NDArray[np.int64]:
    """The corners of all faces as integers."""
    values, bad_word = parse_numbers(b" ".join(corners))
    if bad_word is None and len(values) == len(corners):
        integers = to_integers(values)
        if integers is not None:
            return integers
    _reject(corners, lines, "a vertex index")


def _reject(words: list[bytes], lines: NDArray, expected: str) -> NoReturn:
    """Raise MeshError for the first word that is not a number, or not an integer if an index is expected."""
    for word, number in zip(words, lines, strict=True):
        if not is_number(word) or ("index" in expected and to_integers(np.array([float(word)])) is None):
            raise MeshError(f"line {number}: {shown(word)} is not {expected}")
    raise MeshError(f"contains {expected} that is not a number")
