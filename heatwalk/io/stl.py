"""STL files (stereolithography), ASCII or binary; equal corners are merged.

Not read by trimesh: trimesh 5.2 reads names of solids as data, accepts truncated files, and refuses trailing bytes.
"""

import re

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.numbers import BYTE_ORDER_MARK, line_number, parse_numbers, reject_bad_word
from heatwalk.io.polygons import RawMesh, check_complete, surplus_note
from heatwalk.meshes import MeshError

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


def read_stl(data: bytes) -> RawMesh:
    """Read the contents of an STL file; corners with exactly equal coordinates become one vertex."""
    n_declared = int.from_bytes(data[_HEADER_SIZE - 4 : _HEADER_SIZE], "little")
    is_binary = len(data) >= _HEADER_SIZE and len(data) == _HEADER_SIZE + n_declared * _RECORD.itemsize
    notes: tuple[str, ...] = ()
    if not is_binary and _is_text(data):
        corners = _read_text(data)
    else:
        corners, notes = _read_binary(data, n_declared)
    vertices, rank = np.unique(corners + 0.0, axis=0, return_inverse=True)  # + 0.0 turns -0 into 0
    faces = rank.reshape(-1, 3)
    return RawMesh(vertices, faces, len(faces), notes)


def _is_text(data: bytes) -> bool:
    """Whether a file that is not a complete binary one is ASCII."""
    text = data.removeprefix(BYTE_ORDER_MARK).rstrip(b"\0\x1a")
    return b"\0" not in text and re.match(rb"\s*solid\b", text, re.IGNORECASE) is not None


def _read_binary(data: bytes, n_declared: int) -> tuple[NDArray[np.float64], tuple[str, ...]]:
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
    return records["corners"].reshape(-1, 3).astype(np.float64), notes


def _read_text(data: bytes) -> NDArray[np.float64]:
    """The corners in an ASCII file, (3m, 3)."""
    text = data.removeprefix(BYTE_ORDER_MARK).rstrip(b"\0\x1a").lower()
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
