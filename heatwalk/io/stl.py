"""STL files (stereolithography), ASCII or binary; equal corners are merged.

Not read by trimesh: trimesh 5.2 reads names of solids as data, accepts truncated files, and refuses trailing bytes.
"""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.numbers import BYTE_ORDER_MARK, line_number, parse_numbers, reject_bad_word
from heatwalk.io.polygons import RawMesh, check_complete, surplus_note
from heatwalk.meshes import MeshError
from heatwalk.numerics.rows import merge_equal

_HEADER_SIZE = 84  # 80 bytes of any content, and the number of triangles
_RECORD = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])

# The words of the normal are ignored, whatever they are.
_FACET = re.compile(
    rb"\bfacet(?:\s+(?!outer\b|facet\b|vertex\b)\S+){0,9}\s+outer\s+loop"
    + 3 * rb"\s+vertex\s+(\S+)\s+(\S+)\s+(\S+)"
    + rb"\s+endloop\s+endfacet\b"
)
_FACET_BEGINS = re.compile(rb"\bfacet\s+(?:normal|outer)\b")
# Between two facets: nothing, or the end of a solid and the beginning of the next one, each perhaps with a name.
_BETWEEN = re.compile(rb"\s*|\s*end\s*solid\b.*\bsolid\b.*", re.DOTALL)
# The lines that begin and end a solid may contain any words.
_NAME = re.compile(rb"(?:\A\s*|(?<=[\r\n])[ \t]*)(?:end[ \t]*)?solid\b[^\r\n]*[\r\n]")
_BEFORE = re.compile(rb"\s*solid\b.*", re.DOTALL)
_AFTER = re.compile(rb"\s*end\s*solid\b.*", re.DOTALL)

# The words of a facet as programs write it, where the keywords are, and where coordinates begin and end.
_VERTEX = [b"vertex", b"", b"", b""]
_WORDS = [b"facet", b"normal", b"", b"", b"", b"outer", b"loop", *_VERTEX, *_VERTEX, *_VERTEX, b"endloop", b"endfacet"]
_KEYWORDS = [(place, word) for place, word in enumerate(_WORDS) if word]
_RUNS = [8, 11, 12, 15, 16, 19]
_LAST_WORD = _WORDS[-1]
_CONTROL = bytes(set(range(ord(" "))) - set(b"\t\n\v\f\r"))  # characters that are neither printed nor space
_PART = 2_000_000  # bytes of a file that are read at a time
_MARGIN = 10_000  # more than any facet, or what is around all facets, has as a rule


def read_stl(data: bytes) -> RawMesh:
    """Read the contents of an STL file; corners with exactly equal coordinates become one vertex."""
    n_declared = int.from_bytes(data[_HEADER_SIZE - 4 : _HEADER_SIZE], "little")
    is_binary = len(data) >= _HEADER_SIZE and len(data) == _HEADER_SIZE + n_declared * _RECORD.itemsize
    notes: tuple[str, ...] = ()
    corners: NDArray
    if not is_binary and _is_text(data):
        corners = _read_text(data)
    else:
        corners, notes = _read_binary(data, n_declared)
    corners += 0.0  # turns -0 into 0
    vertices, rank = merge_equal(corners)
    faces = rank.reshape(-1, 3)
    return RawMesh(vertices, faces, len(faces), notes)


def _is_text(data: bytes) -> bool:
    """Whether a file that is not a complete binary one is ASCII."""
    text = data.removeprefix(BYTE_ORDER_MARK).rstrip(b"\0\x1a")
    return b"\0" not in text and re.match(rb"\s*solid\b", text, re.IGNORECASE) is not None


def _read_binary(data: bytes, n_declared: int) -> tuple[NDArray[np.float32], tuple[str, ...]]:
    """The corners in a binary file, (3m, 3), and what was ignored."""
    size = _HEADER_SIZE + n_declared * _RECORD.itemsize
    if len(data) < size or len(data) < _HEADER_SIZE:
        n_found = max(len(data) - _HEADER_SIZE, 0) // _RECORD.itemsize
        raise MeshError(
            "not an STL file, or it is truncated: ASCII files begin with 'solid', and as a binary file it "
            + (
                f"declares {n_declared:,} triangles but contains {n_found:,}"
                if len(data) >= _HEADER_SIZE
                else f"lacks the {_HEADER_SIZE} bytes of the header"
            )
        )
    notes = surplus_note(data[size:], _RECORD.itemsize, "triangles")
    records = np.frombuffer(data, _RECORD, count=n_declared, offset=_HEADER_SIZE)
    return records["corners"].reshape(-1, 3).astype(np.float32), notes


def _read_text(data: bytes) -> NDArray[np.float64]:
    """The corners in an ASCII file, (3m, 3)."""
    text = data.removeprefix(BYTE_ORDER_MARK).rstrip(b"\0\x1a")
    corners = _read_plain_text(text)
    return _read_any_text(text.lower()) if corners is None else corners


def _read_plain_text(text: bytes) -> NDArray[np.float64] | None:
    """The corners in a file of one solid whose facets have normals of three words; else None.

    Whatever is unusual, or wrong, is left to `_read_any_text`.
    """
    head = text[:_MARGIN].lower()
    first = _FACET.search(head)
    if first is None:
        return None
    at = first.start()
    before = head[:at]
    if not _BEFORE.fullmatch(before) or _FACET_BEGINS.search(_NAME.sub(b"", before)):
        return None
    last = _end_of_last_facet(text, at, len(text))
    if last is None or not _AFTER.fullmatch(text[last:].lower()):
        return None
    parts: list[NDArray[np.float64]] = []
    while at < last:  # in parts that the processor's cache can hold
        end = _end_of_last_facet(text, at, min(at + _PART, last))
        values = None if end is None else _coordinates(text[at:end].lower())
        if end is None or values is None:
            return None
        parts.append(values)
        at = end
    return np.concatenate(parts).reshape(-1, 3)


def _end_of_last_facet(text: bytes, begin: int, end: int) -> int | None:
    """Where the last facet between two positions ends; None if it is not in their last `_MARGIN` bytes."""
    begin = max(begin, end - _MARGIN)
    at = text[begin:end].lower().rfind(_LAST_WORD)
    return None if at < 0 else begin + at + len(_LAST_WORD)


def _coordinates(facets: bytes) -> NDArray[np.float64] | None:
    """The coordinates of the corners of facets that have all of `_WORDS`; None unless there is nothing else."""
    if len(facets.translate(None, _CONTROL)) < len(facets):
        return None
    octets = np.frombuffer(facets, np.uint8)
    is_space = np.append(True, octets <= ord(" "))
    words = np.flatnonzero(is_space[:-1] > is_space[1:])
    if not len(words) or len(words) % len(_WORDS):
        return None
    words = np.ascontiguousarray(words.reshape(-1, len(_WORDS)).T)
    padded = np.append(octets, np.zeros(len(_LAST_WORD) + 1, np.uint8))
    # The eight octets from each position on, as a number.
    eights = np.ndarray((len(octets) + 1,), "<u8", padded, strides=(1,))
    for place, word in _KEYWORDS:
        at = words[place]
        bits = np.uint64(2 ** (8 * len(word)) - 1)
        if (eights[at] & bits != int.from_bytes(word, "little")).any() or (padded[at + len(word)] > ord(" ")).any():
            return None
    runs = words[_RUNS].T.ravel()
    is_coordinate = np.arange(len(runs) + 1) % 2 == 1
    chosen = octets[np.repeat(is_coordinate, np.diff(runs, prepend=0, append=len(octets)))]
    values, bad_word = parse_numbers(chosen.tobytes())
    return values if bad_word is None else None


def _read_any_text(text: bytes) -> NDArray[np.float64]:
    """The corners in an ASCII file in lower case, (3m, 3), or MeshError."""
    facets: list[bytes] = []
    position = 0
    n_facets = 0
    for facet in _FACET.finditer(text):
        gap = text[position : facet.start()]
        if not (_BETWEEN if n_facets else _BEFORE).fullmatch(gap) or _FACET_BEGINS.search(_NAME.sub(b"", gap)):
            _reject_gap(text, position, n_facets)
        facets += facet.groups()
        position = facet.end()
        n_facets += 1
    if not _AFTER.fullmatch(text[position:]) and n_facets:
        _reject_gap(text, position, n_facets)
    if not n_facets:
        check_complete(len(_FACET_BEGINS.findall(text)), 0)
        raise MeshError("not an STL file, or it has no faces or is truncated")
    values, bad_word = parse_numbers(b" ".join(facets))
    if bad_word is not None:
        reject_bad_word(text, bad_word)
    return values.reshape(-1, 3)


def _reject_gap(text: bytes, position: int, n_before: int) -> None:
    """Raise MeshError for what follows the ``n_before``-th facet, which is not a facet."""
    n_declared = n_before + len(_FACET_BEGINS.findall(text, position))
    n_complete = n_before + len(_FACET.findall(text, position))
    if n_complete == n_before:  # nothing valid follows
        check_complete(n_declared, n_complete)
        raise MeshError("the last solid has no 'endsolid': the file is truncated")
    begins = _FACET_BEGINS.search(text, position)
    at = begins.start() if begins else position
    raise MeshError(
        f"line {line_number(text, at)}: not a facet of one loop of three vertices (face {n_before}, counted from 0)"
    )


def write_stl(path: str | Path, vertices: NDArray[np.float64], faces: NDArray[np.integer]) -> None:
    """Write a triangle mesh as binary STL, in single precision; OSError if the file cannot be written."""
    records = np.zeros(len(faces), _RECORD)
    corners = vertices[faces]
    with np.errstate(all="ignore"):  # coordinates may be huge
        normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        lengths = np.linalg.norm(normals, axis=1, keepdims=True)
        records["normal"] = np.nan_to_num(normals / np.where(lengths > 0, lengths, 1))
        records["corners"] = corners
    header = b"heatwalk".ljust(_HEADER_SIZE - 4) + len(faces).to_bytes(4, "little")
    Path(path).write_bytes(header + records.tobytes())
