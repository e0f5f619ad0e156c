"""Legacy VTK files (.vtk), ASCII or binary: polygons, unstructured and structured grids.

Not read by VTK: VTK 9.7 crashes on damaged files of this format.
"""

import re
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.cells import POLYGON, STRIP, surface_mesh
from heatwalk.io.numbers import BYTE_ORDER_MARK, parse_numbers, shown, to_integers
from heatwalk.io.polygons import Polygons, RawMesh, check_complete
from heatwalk.meshes import MeshError

_TYPES = {
    "char": "i1", "unsigned_char": "u1", "short": "i2", "unsigned_short": "u2", "int": "i4", "unsigned_int": "u4",
    "long": "i8", "unsigned_long": "u8", "float": "f4", "double": "f8", "vtkidtype": "i4", "vtktypeint64": "i8",
    "vtktypeuint64": "u8", "vtktypeint32": "i4", "vtktypeuint32": "u4", "vtktypefloat32": "f4", "vtktypefloat64": "f8",
}  # fmt: skip

# VTK's numbers of the cells of polygonal data.
_POLYGONAL = {"VERTICES": 2, "LINES": 4, "POLYGONS": POLYGON, "TRIANGLE_STRIPS": STRIP}
_LINE, _QUAD, _HEXAHEDRON = 3, 9, 12

_HEADER = re.compile(rb"\s*# vtk DataFile Version[^\n]*\n[^\n]*\n[ \t]*(ASCII|BINARY)\b[ \t]*\r?\n", re.IGNORECASE)
_WORD = re.compile(rb"\s*(\S+)")
# What ends the numbers of an ASCII section: a word that begins with a letter, other than nan and inf.
_NUMBER_IN_LETTERS = re.compile(rb"(?:nan|inf|infinity)\b", re.IGNORECASE)
_IS_LETTER = np.array([chr(octet).isalpha() or chr(octet) == "_" for octet in range(128)] + 128 * [False])
_IS_SPACE = np.array([bytes([octet]).isspace() for octet in range(256)])
_PART = 1_000_000  # bytes that are searched at a time


class _Cells(NamedTuple):
    """Cells of one section: what VTK calls their kind, if it follows from the section, and their vertices."""

    kind: int | None
    cells: Polygons


def read_vtk(data: bytes) -> RawMesh:
    """Read the contents of a legacy VTK file."""
    data = data.removeprefix(BYTE_ORDER_MARK)
    header = _HEADER.match(data)
    if header is None:
        raise MeshError(
            "not a legacy VTK file: it does not begin with '# vtk DataFile Version', a title, and ASCII or BINARY; XML "
            "files of VTK end in .vtp or .vtu"
        )
    return _File(data, header.end(), header[1].upper() == b"BINARY").read()


class _File:
    """A file, read one section after the other."""

    def __init__(self, data: bytes, at: int, is_binary: bool):
        self._data, self._at, self._is_binary = data, at, is_binary
        self._points: NDArray[np.float64] | None = None
        self._cells: list[_Cells] = []
        self._kinds: NDArray[np.int64] | None = None
        self._grid: dict[str, NDArray[np.float64]] = {}

    def read(self) -> RawMesh:
        """The mesh of all sections."""
        while True:
            keyword = self._word(is_optional=True).upper()
            if keyword in ("", "POINT_DATA", "CELL_DATA"):
                break
            self._section(keyword)
        if "DIMENSIONS" in self._grid:
            return self._structured()
        if self._points is None or not self._cells:
            raise MeshError("contains no faces: a point cloud cannot be read as a mesh, and a truncated file neither")
        kinds = [
            self._kinds if cells.kind is None else np.full(len(cells.cells.sizes), cells.kind) for cells in self._cells
        ]
        parts = [cells.cells for cells in self._cells]
        joined = Polygons(*(np.concatenate(arrays) for arrays in zip(*parts, strict=True)))
        known = [kind for kind in kinds if kind is not None]
        if len(known) < len(kinds):
            raise MeshError("has CELLS but no CELL_TYPES: the file is truncated")
        if sum(map(len, known)) != len(joined.sizes):
            raise MeshError(f"has {len(joined.sizes):,} cells, but the types of {sum(map(len, known)):,}")
        return surface_mesh(self._points, np.concatenate(known), joined)

    def _section(self, keyword: str) -> None:
        """Read the section of a keyword."""
        match keyword:
            case "DATASET":
                kind = self._word().upper()
                known = ("POLYDATA", "UNSTRUCTURED_GRID", "STRUCTURED_GRID", "STRUCTURED_POINTS", "RECTILINEAR_GRID")
                if kind not in known:
                    raise MeshError(f"contains a data set of the kind {kind!r}; read are {', '.join(known)}")
            case "POINTS":
                self._points = self._values(3 * self._count(), self._type(), keyword).reshape(-1, 3)
            case "CELLS" | "VERTICES" | "LINES" | "POLYGONS" | "TRIANGLE_STRIPS":
                self._cells.append(_Cells(_POLYGONAL.get(keyword), self._read_cells(keyword)))
            case "CELL_TYPES":
                self._kinds = self._integers(self._count(), "i4", keyword)
            case "DIMENSIONS":
                self._grid[keyword] = np.array([self._count() for _ in range(3)], dtype=np.float64)
            case "ORIGIN" | "SPACING" | "ASPECT_RATIO":
                words = [self._word().encode() for _ in range(3)]
                values, bad_word = parse_numbers(b" ".join(words))
                if bad_word is not None:
                    raise MeshError(f"{keyword} is followed by {shown(bad_word)}, which is not a number")
                self._grid["SPACING" if keyword == "ASPECT_RATIO" else keyword] = values
            case "X_COORDINATES" | "Y_COORDINATES" | "Z_COORDINATES":
                self._grid[keyword] = self._values(self._count(), self._type(), keyword)
            case "METADATA":  # ends with a blank line
                end = re.compile(rb"\r?\n[ \t]*\r?\n").search(self._data, self._at)
                self._at = end.end() if end else len(self._data)
            case "FIELD":
                self._skip_field()
            case _:
                raise MeshError(f"has {shown(keyword.encode())} where a section of a VTK file should begin")

    def _skip_field(self) -> None:
        """Pass over the arrays of a field, which are no part of the mesh."""
        self._word()
        for _ in range(self._count()):
            name = self._word()
            if name.upper() == "METADATA":
                self._section("METADATA")
                name = self._word()
            n_components, n_rows, kind = self._count(), self._count(), self._word().lower()
            if kind == "string":
                self._skip_texts(n_components * n_rows)
            elif kind == "bit" and self._is_binary:
                self._values((n_components * n_rows + 7) // 8, "u1", name)
            elif kind == "bit" or kind in _TYPES:
                self._values(n_components * n_rows, _TYPES.get(kind, "u1"), name)
            else:
                raise MeshError(f"has the field {name!r} of the type {kind!r}, which is not read")

    def _skip_texts(self, count: int) -> None:
        """Pass over texts: a line each, or in binary the length in one, two, four or eight bytes, and the text."""
        self._at = self._data.find(b"\n", self._at) + 1 or len(self._data)
        for _ in range(count):
            if not self._is_binary:
                self._at = self._data.find(b"\n", self._at) + 1 or len(self._data)
                continue
            check_complete(1, int(self._at < len(self._data)), "texts of a field")
            n_bytes = (8, 4, 2, 1)[self._data[self._at] >> 6]  # the first two bits tell
            length = int.from_bytes(self._data[self._at : self._at + n_bytes], "big") & (1 << (8 * n_bytes - 2)) - 1
            self._at += n_bytes + length

    def _read_cells(self, keyword: str) -> Polygons:
        """The cells of a section, as lists of vertices, each after its length, or as offsets and vertices."""
        count, size = self._count(), self._count()
        before = self._at
        if self._word(is_optional=True).upper() == "OFFSETS":
            offsets = self._integers(count, self._type(), f"OFFSETS of {keyword}") if count else np.zeros(1, np.int64)
            if self._word().upper() != "CONNECTIVITY":
                raise MeshError(f"the section {keyword} has no CONNECTIVITY: the file is truncated")
            corners = self._integers(size, self._type(), f"CONNECTIVITY of {keyword}")
            if offsets[0] != 0 or (np.diff(offsets) < 0).any() or offsets[-1] != len(corners):
                raise MeshError(f"the OFFSETS of {keyword} do not ascend from 0 to the number of corners")
            return Polygons(np.diff(offsets), corners)
        self._at = before
        values = self._integers(size, "i4", keyword)
        return _split_lists(values, count, keyword)

    def _word(self, is_optional: bool = False) -> str:
        """The next word."""
        found = _WORD.match(self._data, self._at)
        if found is None:
            if is_optional:
                return ""
            raise MeshError("ends within a section: the file is truncated")
        self._at = found.end()
        return found[1][:200].decode("utf-8", errors="replace")

    def _count(self) -> int:
        """The next word as a number of things."""
        word = self._word()
        if not re.fullmatch(r"[0-9]{1,15}", word):
            raise MeshError(f"has {shown(word.encode())} where a number of rows is required")
        return int(word)

    def _type(self) -> str:
        """The next word as the type of values."""
        word = self._word().lower()
        if word not in _TYPES:
            raise MeshError(f"has {shown(word.encode())} where the type of values is required")
        return _TYPES[word]

    def _integers(self, count: int, kind: str, section: str) -> NDArray[np.int64]:
        """The next values as integers."""
        integers = to_integers(self._values(count, kind, section))
        if integers is None:
            raise MeshError(f"the section {section} contains a number that is not an integer")
        return integers

    def _values(self, count: int, kind: str, section: str) -> NDArray[np.float64]:
        """The next ``count`` values."""
        if self._is_binary:
            dtype = np.dtype(f">{kind}")
            begin = self._data.find(b"\n", self._at) + 1
            available = (len(self._data) - begin) // dtype.itemsize if begin else 0
            check_complete(count, available, f"values of the section {section}")
            self._at = begin + count * dtype.itemsize
            return np.frombuffer(self._data, dtype, count, begin).astype(np.float64)
        end = _next_keyword(self._data, self._at)
        text = self._data[self._at : end]
        values, bad_word = parse_numbers(text)
        if bad_word is not None:
            raise MeshError(f"the section {section} contains {shown(bad_word)}, which is not a number")
        if end is None:  # the last number may be cut
            check_complete(count, len(values), f"values of the section {section}")
        if len(values) != count:
            raise MeshError(f"the section {section} declares {count:,} values but contains {len(values):,}")
        self._at = len(self._data) if end is None else end
        return values.astype(kind).astype(np.float64) if kind == "f4" else values

    def _structured(self) -> RawMesh:
        """The quads or hexahedra of a structured grid."""
        n_x, n_y, n_z = dimensions = [int(n) for n in self._grid["DIMENSIONS"]]
        points = self._points
        if points is None:
            axes = [self._axis(axis, n) for axis, n in enumerate(dimensions)]
            z, y, x = np.meshgrid(axes[2], axes[1], axes[0], indexing="ij")
            points = np.column_stack([x.ravel(), y.ravel(), z.ravel()])
        if len(points) != n_x * n_y * n_z:
            raise MeshError(f"has {len(points):,} points, but its dimensions are {n_x} × {n_y} × {n_z}")
        numbers = np.arange(len(points)).reshape(n_z, n_y, n_x)
        flat = [axis for axis in range(3) if numbers.shape[axis] == 1]
        if len(flat) > 1:
            raise MeshError("is a grid of points or lines: it has no faces")
        if flat:
            square = numbers.squeeze(flat[0])
            cells = _corners(square)
            kind = _QUAD
        else:
            low, high = _corners_of_slices(numbers)
            cells = np.hstack([low, high])
            kind = _HEXAHEDRON
        polygons = Polygons(np.full(len(cells), cells.shape[1]), cells.ravel())
        return surface_mesh(points, np.full(len(cells), kind), polygons)

    def _axis(self, axis: int, count: int) -> NDArray[np.float64]:
        """The coordinates of a structured grid along an axis."""
        name = f"{'XYZ'[axis]}_COORDINATES"
        if name in self._grid:
            return self._grid[name]
        origin, spacing = self._grid.get("ORIGIN", np.zeros(3)), self._grid.get("SPACING", np.ones(3))
        return origin[axis] + spacing[axis] * np.arange(count)


def _next_keyword(data: bytes, at: int) -> int | None:
    """Where the next word begins that is letters and no number; None if there is none."""
    for begin in range(at, len(data), _PART):
        octets = np.frombuffer(data, np.uint8, min(_PART, len(data) - begin), begin)
        before = np.append(data[begin - 1] if begin else ord(" "), octets[:-1])
        places = np.flatnonzero(_IS_LETTER[octets] & _IS_SPACE[before]) + begin
        for place in places.tolist():
            if not _NUMBER_IN_LETTERS.match(data, place):
                return place
    return None


def _corners(square: NDArray[np.int64]) -> NDArray[np.int64]:
    """The quads of a (p, q) grid of vertices."""
    rings = (square[:-1, :-1], square[:-1, 1:], square[1:, 1:], square[1:, :-1])
    return np.column_stack([ring.ravel() for ring in rings])


def _corners_of_slices(numbers: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The lower and the upper quads of the hexahedra of a (p, q, r) grid of vertices."""
    quads = [_corners(square) for square in numbers]
    return np.vstack(quads[:-1]), np.vstack(quads[1:])


def _split_lists(values: NDArray[np.int64], count: int, section: str) -> Polygons:
    """Lists of vertices, each after its length."""
    if count and len(values) % count == 0 and (values[:: len(values) // count] == len(values) // count - 1).all():
        rows = values.reshape(count, -1)
        return Polygons(rows[:, 0].copy(), rows[:, 1:].ravel())
    numbers = values.tolist()
    sizes, at = [], 0
    for _ in range(count):
        if at >= len(numbers) or not 0 <= numbers[at] <= len(numbers):
            raise MeshError(f"the lists of the section {section} do not have the lengths that it declares")
        sizes.append(numbers[at])
        at += 1 + numbers[at]
    if at != len(numbers):
        raise MeshError(f"the lists of the section {section} do not have the lengths that it declares")
    lengths = np.array(sizes, dtype=np.int64)
    is_corner = np.ones(len(values), dtype=bool)
    is_corner[np.cumsum(lengths + 1) - lengths - 1] = False
    return Polygons(lengths, values[is_corner])
