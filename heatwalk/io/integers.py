"""Text files with one integer per line: labels of faces or vertices, vertex numbers."""

import re
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from heatwalk.meshes import MeshError

_UNSIGNED = re.compile(r"\s*[0-9]{1,18}\s*")  # 18 digits always fit into int64
_SIGNED = re.compile(r"\s*[+-]?[0-9]{1,18}\s*")


def parse_integers(text: str, expected: str = "an integer", *, signed: bool = False) -> NDArray[np.int64]:
    """Parse text with one integer per line.

    Parameters
    ----------
    text : str
        blank lines are allowed at the end only
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
        if a line is not one integer; the message gives its number, counted from 1, and its text

    Examples
    --------
    >>> parse_integers("3\\n0\\n12\\n")
    array([ 3,  0, 12])
    >>> parse_integers("3\\n-1\\n", "a label (0, 1, 2 …)")
    Traceback (most recent call last):
    ValueError: line 2 is not a label (0, 1, 2 …): '-1'
    """
    pattern = _SIGNED if signed else _UNSIGNED
    lines = text.rstrip().splitlines()
    for number, line in enumerate(lines, start=1):
        if not pattern.fullmatch(line):
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
