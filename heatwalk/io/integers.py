"""Text files with one integer per line: labels of faces or vertices, vertex numbers."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heatwalk.meshes import MeshError

_UNSIGNED = re.compile(r"\s*[0-9]+\s*")
_SIGNED = re.compile(r"\s*[+-]?[0-9]+\s*")
_PLAIN = re.compile(r"(?:[0-9]{1,18}\n)*+[0-9]{1,18}")  # what nearly every file contains
_LINE_END = re.compile(r"\r\n|\r|\n")  # str.splitlines knows a dozen more
_MAX_DIGITS = 18  # so many always fit into int64
_RANGE = np.iinfo(np.int64)


def parse_integers(text: str, expected: str = "an integer", *, signed: bool = False) -> NDArray[np.int64]:
    """Parse text with one integer per line.

    Parameters
    ----------
    text : str
        blank lines are allowed at the end only, and a byte-order mark at the beginning
    expected : str
        what a line should be, for the error message
    signed : bool
        accept a sign

    Returns
    -------
    (n,) int64 array
        empty for text without lines

    Raises
    ------
    ValueError
        if a line is not one integer, or one beyond 64 bits; the message gives its number, counted from 1, and its text

    Examples
    --------
    >>> parse_integers("3\\n0\\n12\\n")
    array([ 3,  0, 12])
    >>> parse_integers("3\\n-1\\n", "a label (0, 1, 2 …)")
    Traceback (most recent call last):
    ValueError: line 2 is not a label (0, 1, 2 …): '-1'
    """
    pattern = _SIGNED if signed else _UNSIGNED
    text = text.removeprefix("\ufeff").rstrip()
    if _PLAIN.fullmatch(text):
        return np.fromstring(text, dtype=np.int64, sep="\n")
    lines = _LINE_END.split(text) if text else []
    for number, line in enumerate(lines, start=1):
        is_integer = pattern.fullmatch(line) is not None
        if not is_integer or (len(line) > _MAX_DIGITS and not _RANGE.min <= int(line) <= _RANGE.max):
            raise ValueError(f"line {number} is not {expected}: {line[:40]!r}")
    return np.array(lines, dtype=np.int64)


def read_integers(path: str | Path, expected: str = "an integer", *, signed: bool = False) -> NDArray[np.int64]:
    """Read a text file with one integer per line.

    Parameters
    ----------
    path : str, Path or zipfile.Path
    expected, signed
        see `parse_integers`

    Returns
    -------
    (n,) int64 array, n > 0

    Raises
    ------
    MeshError
        (a ValueError) if the file cannot be read, is empty, or has a line that is not one integer; the message begins
        with the path

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = Path(folder, "labels.txt")
    ...     _ = path.write_text("3\\n-1\\n")
    ...     read_integers(path, signed=True)
    array([ 3, -1])
    """
    path = Path(path) if isinstance(path, str) else path
    try:
        text = path.read_text("utf-8", errors="replace")
    except OSError as error:
        raise MeshError(f"{path}: cannot be read: {error.strerror or error}") from error
    if not text.strip():
        raise MeshError(f"{path}: the file is empty")
    try:
        return parse_integers(text, expected, signed=signed)
    except ValueError as error:
        raise MeshError(f"{path}: {error}") from error
