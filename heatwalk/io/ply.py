"""PLY files (Stanford polygon format).

Not read by trimesh: trimesh 5.2 reads binary faces of several sizes as if all had that of the first, accepts truncated
ASCII files, and refuses blank lines and old Macintosh line ends.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heatwalk.io.colours import label_colours
from heatwalk.io.numbers import (
    BYTE_ORDER_MARK,
    format_rows,
    line_number,
    parse_numbers,
    reject_bad_word,
    shown,
    to_integers,
)
from heatwalk.io.polygons import Polygons, RawMesh, check_complete, raw_mesh, surplus_note
from heatwalk.meshes import MeshError

_TYPES = {
    "char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4", "float": "f4",
    "double": "f8", "int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4",
    "int64": "i8", "uint64": "u8", "float32": "f4", "float64": "f8",
}  # fmt: skip
_BYTE_ORDERS = {"binary_little_endian": "<", "binary_big_endian": ">"}
_CORNER_LISTS = ("vertex_indices", "vertex_index")
# The plural of an element's name in messages.
_PLURALS = {"vertex": "vertices", "face": "faces"}

# Single precision suffices if it moves no vertex by more than this fraction of the shortest edge around it.
_MAX_MOVE = 1e-3

_WRITTEN_HEADER = """\
ply
format binary_little_endian 1.0
comment heatwalk
{comments}element vertex {n_vertices}
property {real} x
property {real} y
property {real} z
property uchar red
property uchar green
property uchar blue
property uchar alpha
property int label
{properties}element face {n_faces}
property list uchar int vertex_indices
end_header
"""
# Names of the properties of vertices in that header.
_WRITTEN = ("x", "y", "z", "red", "green", "blue", "alpha", "label")
_TEXT_HEADER = """\
ply
format ascii 1.0
element vertex {n_vertices}
property double x
property double y
property double z
element face {n_faces}
property list uchar int vertex_indices
end_header
"""


class _Property(NamedTuple):
    """A property of an element: its type, and for lists the type of the number of values."""

    name: str
    kind: str
    count_kind: str | None = None


@dataclass
class _Element:
    """An element that the header declares: vertex, face, …"""

    name: str
    count: int
    properties: list[_Property] = field(default_factory=list)

    @property
    def plural(self) -> str:
        """Its name in messages."""
        return _PLURALS.get(self.name, f"rows of the element {self.name}")

    @property
    def has_lists(self) -> bool:
        """Whether its rows can differ in size."""
        return any(prop.count_kind for prop in self.properties)


class _Header(NamedTuple):
    """What a header declares, and where the data begin; the byte order is "" for ASCII."""

    order: str
    elements: list[_Element]
    end: int


# The columns that are needed: single values by name, and the polygons of faces.
_Columns = tuple[dict[str, NDArray], Polygons | None]


def read_ply(data: bytes) -> RawMesh:
    """Read the contents of a PLY file, ASCII or binary of either byte order."""
    data = data.removeprefix(BYTE_ORDER_MARK)
    header = _read_header(data)
    _check_elements(header.elements)
    found, notes = _read_binary(data, header) if header.order else _read_text(data, header)
    positions, (_, polygons) = found["vertex"][0], found["face"]
    assert polygons is not None
    vertices = np.column_stack([positions[name].astype(np.float64) for name in "xyz"])
    return raw_mesh(vertices, polygons, notes)


def _read_header(data: bytes) -> _Header:
    """The format and the elements; lines end with LF, CR LF or CR, as the first one does."""
    first = re.match(rb"ply[ \t]*(\r\n|\n|\r)", data, re.IGNORECASE)
    if first is None:
        raise MeshError("not a PLY file: it does not begin with a line 'ply'")
    line_end = first[1]
    order: str | None = None
    elements: list[_Element] = []
    number, at = 1, first.end()
    while True:
        number += 1
        end = data.find(line_end, at)
        line = data[at : end if end >= 0 else None]
        at = end + len(line_end)
        words = [_printable(word) for word in line[:1000].decode("utf-8", errors="replace").split()]
        if words[:1] == ["end_header"]:
            break
        if end < 0:
            raise MeshError("the header has no line 'end_header': the file is truncated, or not a PLY file")
        if words[:1] == ["format"] and len(words) > 1:
            if words[1] not in ("ascii", *_BYTE_ORDERS):
                raise MeshError(f"line {number}: unknown format {words[1]!r}; PLY has ascii, {', '.join(_BYTE_ORDERS)}")
            order = _BYTE_ORDERS.get(words[1], "")
        elif words and words[0] not in ("comment", "obj_info"):
            _read_declaration(words, number, elements)
    if order is None:
        raise MeshError("the header has no line 'format': the file is damaged, or not a PLY file")
    return _Header(order, elements, at if end >= 0 else len(data))


def _printable(word: str) -> str:
    """A word that messages and notes may contain as it is."""
    return word if word.isprintable() else repr(word)[1:-1]


def _read_declaration(words: Sequence[str], number: int, elements: list[_Element]) -> None:
    """Add what a line of the header declares: an element, or a property of the last element."""
    match words:
        case ["element", name, count] if count.isdecimal():
            elements.append(_Element(name, int(count)))
        case ["property", "list", count_kind, kind, name] if elements:
            counts = _type(count_kind, number)
            if counts.startswith("f"):
                raise MeshError(f"line {number}: the number of values of the list {name} is declared as {count_kind}")
            elements[-1].properties.append(_Property(name, _type(kind, number), counts))
        case ["property", kind, name] if elements:
            elements[-1].properties.append(_Property(name, _type(kind, number)))
        case _:
            text = " ".join(words).encode("utf-8", errors="replace")
            raise MeshError(f"line {number}: {shown(text)} does not belong in the header of a PLY file")


def _type(name: str, number: int) -> str:
    """NumPy's code of a type of the format."""
    if name not in _TYPES:
        raise MeshError(f"line {number}: unknown type {name!r}; PLY has {', '.join(_TYPES)}")
    return _TYPES[name]


def _check_elements(elements: Sequence[_Element]) -> None:
    """Raise MeshError unless there are vertices with coordinates, and faces with corners."""
    named = {element.name: element for element in elements}
    if "face" not in named:
        others = f"; it declares {', '.join(named)}" if named else ""
        raise MeshError(f"the header declares no faces{others}: a point cloud or strips cannot be read as a mesh")
    for name in ("vertex", "face"):
        if sum(element.name == name for element in elements) != 1:
            raise MeshError(f"the header must declare one element {name!r}")
    scalars = {prop.name for prop in named["vertex"].properties if not prop.count_kind}
    if not set("xyz") <= scalars:
        raise MeshError("the header declares vertices without the properties x, y and z")
    lists = [prop for prop in named["face"].properties if prop.count_kind and prop.name in _CORNER_LISTS]
    if len(lists) != 1 or lists[0].kind.startswith("f"):
        raise MeshError("the header must declare one list of integers 'vertex_indices' for the faces")


# --- binary


def _read_binary(data: bytes, header: _Header) -> tuple[dict[str, _Columns], tuple[str, ...]]:
    """The columns of each element of a binary file, and what was ignored after the last one."""
    found: dict[str, _Columns] = {}
    at, row_size, last = header.end, 0, ""
    for element in header.elements:
        reader = _read_rows if element.has_lists else _read_records
        before = at
        found[element.name], at = reader(data, at, element, header.order)
        if element.count:
            row_size, last = (at - before) // element.count, element.plural
    return found, surplus_note(data[at:], row_size, last)


def _read_records(data: bytes, at: int, element: _Element, order: str) -> tuple[_Columns, int]:
    """The columns of an element without lists, and where it ends."""
    dtype = np.dtype([(f"{i}", order + prop.kind) for i, prop in enumerate(element.properties)])
    if dtype.itemsize:
        check_complete(element.count, max(len(data) - at, 0) // dtype.itemsize, element.plural)
        records = np.frombuffer(data, dtype, count=element.count, offset=min(at, len(data)))
    else:
        records = np.empty(0, dtype)
    columns = {prop.name: records[f"{i}"] for i, prop in enumerate(element.properties)}
    return (columns, None), at + element.count * dtype.itemsize


def _read_rows(data: bytes, at: int, element: _Element, order: str) -> tuple[_Columns, int]:
    """The columns of an element with lists, and where it ends."""
    return _read_equal_rows(data, at, element, order) or _read_unequal_rows(data, at, element, order)


def _read_equal_rows(data: bytes, at: int, element: _Element, order: str) -> tuple[_Columns, int] | None:
    """The columns if all rows have lists as long as those of the first row; else None."""
    fields: list[tuple] = []
    end = at
    for i, prop in enumerate(element.properties):
        length = 1
        if prop.count_kind:
            count_type = np.dtype(order + prop.count_kind)
            if end + count_type.itemsize > len(data):
                return None
            length = int(np.frombuffer(data, count_type, 1, end)[0])
            fields.append((f"count {i}", count_type))
            end += count_type.itemsize
        if not 0 <= length <= len(data):
            return None
        kind = np.dtype(order + prop.kind)
        fields.append((f"{i}", kind, (length,) if prop.count_kind else ()))
        end += length * kind.itemsize
    dtype = np.dtype(fields)
    if at + element.count * dtype.itemsize > len(data):
        return None
    records = np.frombuffer(data, dtype, count=element.count, offset=at)
    columns: dict[str, NDArray] = {}
    polygons = None
    for i, prop in enumerate(element.properties):
        if not prop.count_kind:
            columns[prop.name] = records[f"{i}"]
            continue
        sizes = records[f"count {i}"]
        if len(sizes) and not (sizes == sizes[0]).all():
            return None
        if prop.name in _CORNER_LISTS:
            polygons = Polygons(sizes.astype(np.int64), records[f"{i}"].astype(np.int64).ravel())
    return (columns, polygons), at + element.count * dtype.itemsize


def _read_unequal_rows(data: bytes, at: int, element: _Element, order: str) -> tuple[_Columns, int]:
    """The columns of rows whose lists have different lengths, one row after the other.

    Single values are skipped unless they are vertex coordinates.
    """
    starts: dict[int, list[int]] = {i: [] for i, prop in enumerate(element.properties) if _is_needed(element, prop)}
    sizes: list[int] = []
    byte_order = "little" if order == "<" else "big"
    layout = [
        (i, np.dtype(prop.kind).itemsize, np.dtype(prop.count_kind).itemsize if prop.count_kind else 0,
         (prop.count_kind or "").startswith("i"), prop.name in _CORNER_LISTS)
        for i, prop in enumerate(element.properties)
    ]  # fmt: skip
    for row in range(element.count):
        for i, item_size, count_size, is_signed, are_corners in layout:
            length = 1
            if count_size:
                length = int.from_bytes(data[at : at + count_size], byte_order, signed=is_signed)  # type: ignore[arg-type]
                at += count_size
                if length < 0:
                    name = element.properties[i].name
                    raise MeshError(f"{element.name} {row} (counted from 0) has {length} values in the list {name}")
            if i in starts:
                starts[i].append(at)
                if are_corners:
                    sizes.append(length)
            at += length * item_size
        if at > len(data):
            check_complete(element.count, row, element.plural)
    polygons = None
    columns: dict[str, NDArray] = {}
    for i, begins in starts.items():
        prop = element.properties[i]
        kind = np.dtype(order + prop.kind)
        lengths = np.array(sizes if prop.count_kind else [1] * len(begins), dtype=np.int64)
        values = _gather(data, np.array(begins, dtype=np.int64), lengths, kind)
        if prop.count_kind:
            polygons = Polygons(lengths, values.astype(np.int64))
        else:
            columns[prop.name] = values
    return (columns, polygons), at


def _gather(data: bytes, starts: NDArray[np.int64], lengths: NDArray[np.int64], kind: np.dtype) -> NDArray:
    """The values of runs that begin at the positions ``starts`` of the data, one run after the other."""
    step = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
    positions = np.repeat(starts, lengths) + step * kind.itemsize
    octets = np.frombuffer(data, np.uint8)[positions[:, None] + np.arange(kind.itemsize)]
    return np.ascontiguousarray(octets).view(kind).ravel()


def _is_needed(element: _Element, prop: _Property) -> bool:
    """Whether a property is a coordinate of the vertices or the corners of the faces."""
    if element.name == "vertex":
        return prop.name in "xyz" and not prop.count_kind
    return element.name == "face" and prop.name in _CORNER_LISTS and bool(prop.count_kind)


# --- ASCII


def _read_text(data: bytes, header: _Header) -> tuple[dict[str, _Columns], tuple[str, ...]]:
    """The columns of each element of an ASCII file, and what was ignored after the last one.

    Values are read one after the other: blank lines, and rows broken into several lines, do no harm.
    """
    body = data[header.end :].rstrip(b"\0\x1a \t\r\n")
    numbers = parse_numbers(body)
    found: dict[str, _Columns] = {}
    at: int | None = 0
    for element in header.elements:
        if at is not None:
            found[element.name], at = _take(numbers.values, at, element)
    if at is None or at < len(numbers.values):
        first_line = line_number(data, header.end)
        if at is None and numbers.bad_word is not None:
            reject_bad_word(body, numbers.bad_word, first_line)
        _check_lines(body, first_line, header.elements)
        if at is None:
            raise MeshError("the rows of the file do not contain the values that its header declares")
    if at < len(numbers.values) or numbers.bad_word is not None:
        return found, ("ignored what follows the last declared element",)
    return found, ()


def _take(values: NDArray[np.float64], at: int, element: _Element) -> tuple[_Columns, int | None]:
    """The columns of an element whose values begin at ``at``, and where they end; None if they are not all there."""
    width = len(element.properties)
    if not element.has_lists:
        end = at + element.count * width
        if end > len(values):
            return ({}, None), None
        table = values[at:end].reshape(element.count, width)
        return ({prop.name: _declared(table[:, i], prop) for i, prop in enumerate(element.properties)}, None), end
    is_needed = [_is_needed(element, prop) for prop in element.properties]
    if width == 1:  # nothing but corners, usually the same number in each row
        size = values[at] if at < len(values) else 0.0
        end = at + element.count * (int(size) + 1) if 0 <= size <= len(values) else len(values) + 1
        if end <= len(values):
            table = values[at:end].reshape(element.count, int(size) + 1)
            if (table[:, 0] == size).all():
                sizes = np.full(element.count, int(size), dtype=np.int64)
                return ({}, Polygons(sizes, _corners(table[:, 1:].ravel())) if is_needed[0] else None), end
    return _take_unequal(values, at, element, is_needed)


def _take_unequal(
    values: NDArray[np.float64], at: int, element: _Element, is_needed: Sequence[bool]
) -> tuple[_Columns, int | None]:
    """`_take` for rows of different lengths."""
    numbers = values[at:].tolist()
    starts: dict[int, list[int]] = {i: [] for i, needed in enumerate(is_needed) if needed}
    sizes: list[int] = []
    here = 0
    for row in range(element.count):
        for i, prop in enumerate(element.properties):
            size = 1
            if prop.count_kind:
                if here >= len(numbers):
                    return ({}, None), None
                declared = numbers[here]
                if not (declared >= 0 and declared == declared // 1 and declared < 2**31):
                    raise MeshError(
                        f"{element.name} {row} (counted from 0) has {declared:g} values in the list {prop.name}"
                    )
                size = int(declared)
                here += 1
            if is_needed[i]:
                starts[i].append(here)
                if prop.count_kind:
                    sizes.append(size)
            here += size
        if here > len(numbers):
            return ({}, None), None
    columns: dict[str, NDArray] = {}
    polygons = None
    for i, begins in starts.items():
        first = np.array(begins, dtype=np.int64) + at
        if not element.properties[i].count_kind:
            columns[element.properties[i].name] = _declared(values[first], element.properties[i])
            continue
        lengths = np.array(sizes, dtype=np.int64)
        step = np.arange(lengths.sum()) - np.repeat(np.cumsum(lengths) - lengths, lengths)
        polygons = Polygons(lengths, _corners(values[np.repeat(first, lengths) + step]))
    return (columns, polygons), at + here


def _declared(values: NDArray[np.float64], prop: _Property) -> NDArray:
    """The values in the precision that the header declares."""
    with np.errstate(over="ignore"):
        return values.astype(np.float32) if prop.kind == "f4" else values


def _corners(values: NDArray[np.float64]) -> NDArray[np.int64]:
    """The corners of faces as integers."""
    integers = to_integers(values)
    if integers is None:
        bad = values[np.argmax((values != np.rint(values)) | ~(np.abs(values) < 2.0**53))]
        raise MeshError(f"a face has the corner {bad:g}, which is not the number of a vertex")
    return integers


def _check_lines(body: bytes, first_line: int, elements: Sequence[_Element]) -> None:
    """Raise MeshError for the first line that does not have the values of one row of its element."""
    lines = [(number, line.split()) for number, line in enumerate(body.splitlines(), start=first_line) if line.strip()]
    at = 0
    for element in elements:
        if not element.properties:
            continue
        for row in range(element.count):
            if at == len(lines):
                check_complete(element.count, row, element.plural)
            number, words = lines[at]
            n_expected = 0
            for prop in element.properties:
                is_list = prop.count_kind and n_expected < len(words) and words[n_expected].isdigit()
                n_expected += 1 + int(words[n_expected]) if is_list else 1
            if len(words) < n_expected and at == len(lines) - 1:
                check_complete(element.count, row, element.plural)
            if len(words) != n_expected:
                raise MeshError(
                    f"line {number}: {len(words)} values, where the header declares {n_expected} for the "
                    f"{element.name} {row} (counted from 0)"
                )
            at += 1


# --- writing


def write_ply(
    path: str | Path,
    vertices: ArrayLike,
    faces: ArrayLike,
    vertex_labels: ArrayLike,
    dissipator: int | None = None,
    comments: Sequence[str] = (),
    properties: Mapping[str, ArrayLike] | None = None,
) -> None:
    """Write a mesh as binary PLY, with its vertices labelled, and coloured by label.

    Parameters
    ----------
    path : str or Path
    vertices : (n, 3) float array
    faces : (m, 3) int array
    vertex_labels : (n,) int array, 0 or more
        written as the vertex property ``label`` too
    dissipator : int, optional
        the label shown in grey
    comments : sequence of str
        lines of the header, in ASCII
    properties : mapping of str to (n,) array, optional
        more properties of the vertices, by name: integers (written in 32 bits) or real numbers (in double precision)

    Raises
    ------
    ValueError
        if a property has another number of values than the mesh vertices, no numbers, integers beyond 32 bits, or a
        name that is taken or is not letters, digits and underscores
    OSError
        if the file cannot be written

    Notes
    -----
    Coordinates are written in single precision, which every program reads, unless that would move a vertex by more
    than a thousandth of the shortest edge around it, as it does far from the origin; then in double precision.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from heatwalk.io import read_mesh, write_ply
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "triangle.ply")
    ...     write_ply(path, [[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]], vertex_labels=[0, 0, 1], dissipator=1)
    ...     read_mesh(path).faces
    array([[0, 1, 2]])
    """
    vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces)
    is_single = _single_suffices(vertices, faces)
    added = {name: _written_property(name, values, len(vertices)) for name, values in (properties or {}).items()}
    columns = [(f"property {name}", values.dtype) for name, values in added.items()]
    vertex_rows = np.empty(
        len(vertices), [("position", "<f4" if is_single else "<f8", 3), ("colour", "u1", 4), ("label", "<i4"), *columns]
    )
    vertex_rows["position"], vertex_rows["colour"] = vertices, label_colours(vertex_labels, dissipator)
    vertex_rows["label"] = vertex_labels
    for name, values in added.items():
        vertex_rows[f"property {name}"] = values
    face_rows = np.empty(len(faces), [("n_corners", "u1"), ("corners", "<i4", 3)])
    face_rows["n_corners"], face_rows["corners"] = 3, faces
    header = _WRITTEN_HEADER.format(
        comments="".join(f"comment {comment}\n" for comment in comments),
        real="float" if is_single else "double",
        n_vertices=len(vertices),
        properties="".join(
            f"property {'int' if values.dtype.kind == 'i' else 'double'} {name}\n" for name, values in added.items()
        ),
        n_faces=len(faces),
    ).encode("ascii")
    Path(path).write_bytes(header + vertex_rows.tobytes() + face_rows.tobytes())


def write_text_ply(path: str | Path, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> None:
    """Write a triangle mesh as ASCII PLY with all digits of its coordinates; OSError if the file cannot be written."""
    header = _TEXT_HEADER.format(n_vertices=len(vertices), n_faces=len(faces)).encode("ascii")
    Path(path).write_bytes(header + format_rows([*vertices.T]) + format_rows(["3", *faces.T]))


def _written_property(name: str, values: ArrayLike, n_vertices: int) -> NDArray:
    """The values of a property of the vertices in the type they are written in; ValueError if it cannot be written."""
    array = np.asarray(values)
    if not re.fullmatch(r"[A-Za-z_][A-Za-z0-9_]*", name) or name in _WRITTEN:
        raise ValueError(f"the property {name!r} must be letters, digits and underscores, and none of {_WRITTEN}")
    if array.shape != (n_vertices,) or array.dtype.kind not in "biuf":
        raise ValueError(f"the property {name!r} must have one number for each of the {n_vertices:,} vertices")
    if array.dtype.kind == "f":
        return array.astype("<f8")
    if array.size and not (array.min() >= -(2**31) and array.max() < 2**31):
        raise ValueError(f"the property {name!r} has integers beyond 32 bits")
    return array.astype("<i4")


def _single_suffices(vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> bool:
    """Whether single precision moves no vertex by more than `_MAX_MOVE` of the shortest edge around it."""
    columns = [np.ascontiguousarray(column) for column in vertices.T]
    # Lengths by the largest difference of coordinates, and moves likewise: squares could overflow or underflow.
    with np.errstate(over="ignore", invalid="ignore"):
        moves = np.sqrt(3) * reduce(np.maximum, [np.abs(column.astype(np.float32) - column) for column in columns])
        largest = moves.max(initial=0.0)
        if not np.isfinite(largest):
            return False
        sides = [(faces[:, start], faces[:, end]) for start, end in ((0, 1), (1, 2), (2, 0))]
        lengths = [reduce(np.maximum, [np.abs(column[a] - column[b]) for column in columns]) for a, b in sides]
        for side in lengths:
            side[side == 0] = np.inf  # ends that coincide stay together
        if all(largest <= _MAX_MOVE * side.min(initial=np.inf) for side in lengths):  # as for most meshes
            return True
        shortest = np.full(len(vertices), np.inf)
        for (a, b), side in zip(sides, lengths, strict=True):
            np.minimum.at(shortest, a, side)
            np.minimum.at(shortest, b, side)
        return bool((moves <= _MAX_MOVE * shortest).all())


def comments_of(path: str | Path) -> list[str]:
    """The comments in the header of a PLY file; empty for any other file."""
    with Path(path).open("rb") as file:
        lines = file.read(4096).partition(b"end_header")[0].splitlines()
    if lines[:1] != [b"ply"]:
        return []
    return [line[8:].decode("utf-8", errors="replace") for line in lines if line.startswith(b"comment ")]
