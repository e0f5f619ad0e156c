"""MSH files of Gmsh, versions 2 and 4.1, ASCII or binary.

Not read by meshio: meshio 5.3 takes the last node for one that does not exist, reads a truncated file of version 2 as
far as it goes, and is one more library.
"""

import re

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.cells import surface_mesh
from heatwalk.io.numbers import BYTE_ORDER_MARK, is_number, line_number, parse_numbers, shown
from heatwalk.io.polygons import Polygons, RawMesh
from heatwalk.meshes import MeshError

# For each type of element: VTK's number for one with the same corners, and the number of nodes.
_ELEMENTS = {
    15: (1, 1), 1: (3, 2), 8: (21, 3), 26: (35, 4), 27: (68, 5), 28: (68, 6),
    2: (5, 3), 9: (22, 6), 20: (69, 9), 21: (69, 10), 22: (69, 12), 23: (69, 15), 24: (69, 15), 25: (69, 21),
    3: (9, 4), 10: (28, 9), 16: (23, 8), 36: (70, 16), 37: (70, 25),
    4: (10, 4), 11: (24, 10), 29: (71, 20), 30: (71, 35), 31: (71, 56),
    5: (12, 8), 12: (29, 27), 17: (25, 20), 92: (72, 64), 93: (72, 125),
    6: (13, 6), 13: (32, 18), 18: (26, 15), 7: (14, 5), 14: (27, 14), 19: (27, 13),
}  # fmt: skip

# The first section is the format, or comments and the like.
_HEADER = re.compile(
    rb"(?:\s*\$(?!MeshFormat)\w+.*?\$End\w+)*\s*\$MeshFormat\s+(\S+)\s+(\S+)\s+(\S+)[ \t]*\r?\n", re.DOTALL
)
_MAX_TAGS = 10_000  # of one element: groups, and partitions that it is in


def read_msh(data: bytes) -> RawMesh:
    """Read the contents of an MSH file."""
    data = data.removeprefix(BYTE_ORDER_MARK)
    if re.match(rb"\s*\$NOD\b", data):
        raise MeshError(
            "is version 1 of Gmsh's format; versions 2 and 4.1 are read: gmsh -save -format msh41 converts it"
        )
    header = _HEADER.match(data)
    if header is None:
        raise MeshError("not a file of Gmsh: it has no section $MeshFormat")
    version = header[1].decode("ascii", errors="replace")
    if not (re.fullmatch(r"2(\.\d+)?", version) or version == "4.1"):
        raise MeshError(
            f"is version {version} of Gmsh's format; versions 2 and 4.1 are read: gmsh -save -format msh41 converts it"
        )
    order = ""
    if header[2] == b"1":
        order = "<" if data[header.end() : header.end() + 4] == b"\1\0\0\0" else ">"
    size_type = "u8" if header[3] == b"8" else "u4"
    nodes_at = _section(data, b"Nodes", header.end())
    read_nodes, read_elements = (_nodes_41, _elements_41) if version == "4.1" else (_nodes_2, _elements_2)
    nodes = _Section(data, nodes_at, order, "Nodes", size_type)
    tags, points = read_nodes(nodes)
    elements = _Section(data, _section(data, b"Elements", nodes.end()), order, "Elements", size_type)
    kinds, corners = read_elements(elements)
    elements.end()
    return surface_mesh(points, kinds, Polygons(corners.sizes, _positions(tags, corners.corners)))


def _section(data: bytes, name: bytes, start: int) -> int:
    """Where the contents of a section begin."""
    begin = re.compile(rb"\$" + name + rb"[ \t]*\r?\n").search(data, start)
    if begin is None:
        raise MeshError(f"has no section ${name.decode()}: the file is truncated, or has no mesh")
    return begin.end()


def _positions(tags: NDArray[np.int64], corners: NDArray[np.int64]) -> NDArray[np.int64]:
    """The place in the file of nodes that are referred to by their numbers."""
    order = np.argsort(tags, kind="stable")
    ordered = tags[order]
    repeated = np.flatnonzero(ordered[1:] == ordered[:-1])
    if len(repeated):
        raise MeshError(f"defines node {ordered[repeated[0]]} more than once")
    if not len(tags):
        raise MeshError("defines no nodes: the file is truncated, or has no mesh")
    if ordered[-1] - ordered[0] == len(ordered) - 1:  # numbers without gaps, as usual
        at = np.clip(corners - ordered[0], 0, len(tags) - 1)
    else:
        at = np.minimum(np.searchsorted(ordered, corners), len(tags) - 1)
    missing = np.flatnonzero(ordered[at] != corners)
    if len(missing):
        raise MeshError(f"an element refers to node {corners[missing[0]]}, which the file does not define")
    return order[at]


class _Section:
    """The numbers of a section, taken one group after the other."""

    def __init__(self, data: bytes, at: int, order: str, name: str, size_type: str):
        self._data, self._at, self._order, self._name = data, at, order, name
        self._types = {"i": f"{order}i4", "s": f"{order}{size_type}", "d": f"{order}f8"}
        self._values = np.empty(0)
        self._next = 0
        self._look_ahead = 16
        self.is_binary = bool(order)
        if not order:
            self._parse()

    def _parse(self) -> None:
        """All numbers of a section in ASCII."""
        stop = self._data.find(f"$End{self._name}".encode(), self._at)
        if stop < 0:
            raise MeshError(f"the section ${self._name} has no end: the file is truncated")
        self._values, bad_word = parse_numbers(self._data[self._at : stop])
        if bad_word is not None and not is_number(bad_word):
            number = line_number(self._data, self._data.find(bad_word, self._at))
            raise MeshError(f"line {number}: {shown(bad_word)} is not a number")
        self._at = stop

    def take(self, count: int, kinds: str) -> NDArray[np.float64]:
        """``count`` rows of values of the ``kinds`` i (int), s (size) and d (double), (count, len(kinds))."""
        if self.is_binary:
            is_uniform = len(set(kinds)) == 1
            fields = ",".join(self._types[kind] for kind in kinds) if not is_uniform else ""
            record = np.dtype((self._types[kinds[0]], len(kinds))) if is_uniform else np.dtype(fields)
            self._check(count, max(len(self._data) - self._at, 0) // record.itemsize)
            rows = np.frombuffer(self._data, record, count, self._at)
            self._at += count * record.itemsize
            if is_uniform:
                return rows.reshape(count, len(kinds)).astype(np.float64)
            return np.column_stack([rows[name].astype(np.float64) for name in rows.dtype.names or ()])
        self._check(count, (len(self._values) - self._next) // len(kinds))
        begin = self._next
        self._next += count * len(kinds)
        return self._values[begin : self._next].reshape(count, len(kinds))

    def integers(self, count: int, kinds: str) -> NDArray[np.int64]:
        """``count`` rows of integers."""
        values = self.take(count, kinds)
        integers = values.astype(np.int64)
        if not (integers == values).all():
            bad = values[integers != values][0]
            raise MeshError(f"the section ${self._name} has {bad:g} where an integer is required")
        return integers

    def peek(self, count: int) -> list[int]:
        """The next integers of a section in ASCII, which stay."""
        here = self._next
        values = self.integers(1, "i" * count)[0].tolist()
        self._next = here
        return values

    def n_alike(self, width: int) -> int:
        """How many of the next rows of an ASCII section have the width, type and number of tags of the first one."""
        rows = self._values[self._next :]
        rows = rows[: len(rows) // max(width, 1) * width].reshape(-1, max(width, 1))[: self._look_ahead]
        if not len(rows):
            return 1
        differs = np.flatnonzero((rows[:, 1:3] != rows[0, 1:3]).any(axis=1))
        n_alike = int(differs[0]) if len(differs) else len(rows)
        self._look_ahead = max(16, 2 * n_alike)  # looking at all rows each time would take a square of them
        return n_alike

    def count(self) -> int:
        """A number in a line of its own, in ASCII in binary files too."""
        if not self.is_binary:
            return int(self.integers(1, "i")[0, 0])
        line = re.compile(rb"\s*(\d+)[ \t]*\r?\n").match(self._data, self._at)
        if line is None:
            raise MeshError(f"the section ${self._name} does not begin with the number of its rows")
        self._at = line.end()
        return int(line[1])

    def end(self) -> int:
        """Where the section ends; MeshError if something else follows."""
        if self._next < len(self._values):
            raise MeshError(f"the section ${self._name} contains more numbers than it declares")
        if not self._data[self._at : self._at + 100].lstrip().startswith(f"$End{self._name}".encode()):
            raise MeshError(f"the section ${self._name} does not end where it should: the file is damaged or truncated")
        return self._at

    def _check(self, count: int, available: int) -> None:
        """Raise MeshError if a section has fewer rows than required."""
        if not 0 <= count <= available:
            raise MeshError(f"the section ${self._name} contains fewer numbers than it declares: the file is truncated")


def _nodes_2(section: _Section) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Numbers and coordinates of the nodes of version 2."""
    rows = section.take(section.count(), "iddd")
    return rows[:, 0].astype(np.int64), rows[:, 1:]


def _nodes_41(section: _Section) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Numbers and coordinates of the nodes of version 4.1."""
    n_blocks, n_nodes, _, _ = section.integers(1, "ssss")[0]
    tags, points = [np.empty(0, dtype=np.int64)], [np.empty((0, 3))]
    for _ in range(n_blocks):
        dimension, _, is_parametric, count = section.integers(1, "iiis")[0]
        tags.append(section.integers(count, "s")[:, 0])
        rows = section.take(count, "ddd" + "d" * int(dimension if is_parametric else 0))
        points.append(rows[:, :3])
    found = np.concatenate(tags)
    if len(found) != n_nodes:
        raise MeshError(f"declares {n_nodes:,} nodes but contains {len(found):,}")
    return found, np.vstack(points)


def _elements_2(section: _Section) -> tuple[NDArray[np.int64], Polygons]:
    """Types and nodes of the elements of version 2."""
    n_elements = section.count()
    kinds: list[NDArray[np.int64]] = []
    sizes: list[NDArray[np.int64]] = []
    corners: list[NDArray[np.int64]] = []
    n_read = 0
    while n_read < n_elements:
        if section.is_binary:
            element_type, count, n_tags = section.integers(1, "iii")[0].tolist()
            n_before = 1
        else:
            element_type, n_tags = section.peek(3)[1:]
            n_before = 3
        kind, n_nodes = _element(element_type)
        if not 0 <= n_tags <= _MAX_TAGS:
            raise MeshError(f"element {n_read} (counted from 0) has {n_tags} tags: the file is damaged")
        if not section.is_binary:
            count = min(section.n_alike(3 + n_tags + n_nodes), n_elements - n_read)
        skipped = n_before + n_tags
        rows = section.integers(count, "i" * (skipped + n_nodes))
        kinds.append(np.full(len(rows), kind))
        sizes.append(np.full(len(rows), n_nodes))
        corners.append(rows[:, skipped:].ravel())
        n_read += len(rows)
    return _joined(kinds, sizes, corners)


def _elements_41(section: _Section) -> tuple[NDArray[np.int64], Polygons]:
    """Types and nodes of the elements of version 4.1."""
    n_blocks, n_elements, _, _ = section.integers(1, "ssss")[0]
    kinds: list[NDArray[np.int64]] = []
    sizes: list[NDArray[np.int64]] = []
    corners: list[NDArray[np.int64]] = []
    for _ in range(n_blocks):
        _, _, element_type, count = section.integers(1, "iiis")[0]
        kind, n_nodes = _element(int(element_type))
        rows = section.integers(int(count), "s" * (1 + n_nodes))
        kinds.append(np.full(len(rows), kind))
        sizes.append(np.full(len(rows), n_nodes))
        corners.append(rows[:, 1:].ravel())
    n_found = sum(map(len, kinds))
    if n_found != n_elements:
        raise MeshError(f"declares {n_elements:,} elements but contains {n_found:,}")
    return _joined(kinds, sizes, corners)


def _joined(*parts: list[NDArray[np.int64]]) -> tuple[NDArray[np.int64], Polygons]:
    """Types and nodes of all blocks."""
    kinds, sizes, corners = (np.concatenate([np.empty(0, dtype=np.int64), *part]) for part in parts)
    return kinds, Polygons(sizes, corners)


def _element(element_type: int) -> tuple[int, int]:
    """VTK's type and the number of nodes of one of Gmsh's types of elements."""
    if element_type not in _ELEMENTS:
        raise MeshError(f"contains elements of Gmsh's type {element_type}, which are not read")
    return _ELEMENTS[element_type]
