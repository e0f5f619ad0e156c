"""Numbers in text files, parsed in bulk."""

import io
import re
import warnings
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.meshes import MeshError

BYTE_ORDER_MARK = b"\xef\xbb\xbf"

# Integers up to here are exact as floats.
_MAX_EXACT = 2.0**53

# Texts of at least so many bytes are parsed by Arrow, which takes a fifth of the time, but some of it to load.
_LARGE = 200_000

# Rows that are formatted at a time.
_BATCH = 65_536

# White space of a text, each byte of it turned into the end of a line.
_LINE_ENDS = bytes.maketrans(b" \t\r\v\f", b"\n\n\n\n\n")


class Numbers(NamedTuple):
    """The numbers at the beginning of a text, and the word that ended them: None if everything is a number."""

    values: NDArray[np.float64]
    bad_word: bytes | None


def parse_numbers(text: bytes) -> Numbers:
    """Parse numbers separated by any white space, up to the first word that is not a number."""
    values = _parse_large(text) if len(text) >= _LARGE else None
    if values is not None:
        return Numbers(values, None)
    try:
        with warnings.catch_warnings(action="error"):
            return Numbers(np.fromstring(text, dtype=np.float64, sep=" "), None)
    except (DeprecationWarning, ValueError):  # NumPy announces that the warning will become an error
        pass
    words = text.split()
    for i, word in enumerate(words):
        if not is_number(word):
            return Numbers(np.array(words[:i], dtype=np.float64), word)
    return Numbers(np.array(words, dtype=np.float64), None)


def _parse_large(text: bytes) -> NDArray[np.float64] | None:
    """The numbers of a text, correctly rounded; None if something in it is not a number, or spelled unusually.

    Arrow reads them as a table of one column whose rows are the words: it skips empty rows.
    """
    import pyarrow as pa
    from pyarrow import csv

    try:
        table = csv.read_csv(
            pa.BufferReader(text.translate(_LINE_ENDS)),
            csv.ReadOptions(use_threads=False, column_names=["value"]),
            csv.ParseOptions(quote_char=False),
            csv.ConvertOptions(
                check_utf8=False, column_types={"value": pa.float64()}, null_values=[], strings_can_be_null=False
            ),
        )
    except pa.ArrowInvalid:
        return None
    return table["value"].to_numpy()


def format_rows(columns: Sequence[str | NDArray]) -> bytes:
    """A line per row, its values separated by blanks; a column is an array of numbers, or one word for all rows.

    Real numbers have the fewest digits from which they can be read back unchanged.
    """
    import pyarrow as pa
    from pyarrow import csv

    n_rows = max(len(column) for column in columns if not isinstance(column, str))
    arrays = [pa.repeat(column, n_rows) if isinstance(column, str) else pa.array(column) for column in columns]
    sink = io.BytesIO()
    csv.write_csv(
        pa.table(arrays, names=[str(i) for i in range(len(arrays))]),
        sink,
        csv.WriteOptions(include_header=False, delimiter=" ", quoting_style="none", batch_size=_BATCH),
    )
    return sink.getvalue()


def is_number(word: bytes) -> bool:
    """Whether a word is a number as text files spell it; Python would also accept underscores."""
    try:
        float(word)
    except ValueError:
        return False
    return b"_" not in word


def to_integers(values: NDArray[np.float64]) -> NDArray[np.int64] | None:
    """The values as integers; None if one of them is not an integer."""
    if not (np.abs(values) <= _MAX_EXACT).all():  # false for NaN too
        return None
    integers = values.astype(np.int64)
    return integers if np.array_equal(integers, values) else None


def line_number(text: bytes, position: int) -> int:
    """Number, counted from 1, of the line that contains a position; lines end with LF, CR LF or CR."""
    return len(re.findall(rb"\r\n|\r|\n", text[:position])) + 1


def shown(word: bytes) -> str:
    """The beginning of a word of a file, quoted for an error message."""
    return repr(word[:40].decode("utf-8", errors="replace"))


def reject_bad_word(text: bytes, bad_word: bytes, first_line: int = 1) -> None:
    """Raise MeshError for the first occurrence of a word that should be a number.

    ``first_line`` is the line of the file at which ``text`` begins.
    """
    for number, line in enumerate(text.splitlines(), start=first_line):
        if bad_word in line.split():
            raise MeshError(f"line {number}: {shown(bad_word)} is not a number")
    raise MeshError(f"{shown(bad_word)} is not a number")
