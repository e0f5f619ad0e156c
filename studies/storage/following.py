"""Rows that another process is writing: each look reads what is new, and nothing twice."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from studies.storage.rows import parse_line


class FollowedRows:
    """The rows of a file that grows.

    Parameters
    ----------
    path : Path
        need not exist yet
    note : callable
        called with each row
    forget : callable
        called when the file is another one than before, or shorter: the rows that were noted no longer count

    Examples
    --------
    >>> import tempfile
    >>> path, noted = Path(tempfile.mkdtemp(), "trials.jsonl"), []
    >>> followed = FollowedRows(path, noted.append, noted.clear)
    >>> _ = path.write_text('{"trial_id": "a", "status": "ok"}\\n{"trial_id": "b", "sta')
    >>> followed.read()
    >>> with path.open("a") as file:
    ...     _ = file.write('tus": "ok"}\\n')
    >>> followed.read()
    >>> [row["trial_id"] for row in noted]
    ['a', 'b']
    """

    def __init__(self, path: Path, note: Callable[[dict[str, Any]], None], forget: Callable[[], None]) -> None:
        self._path = path
        self._note = note
        self._forget = forget
        self._position = 0
        self._identity: tuple[int, int] | None = None  # device and number of the file that was read

    def read(self) -> None:
        """Note the rows whose lines are complete and were not read before; damaged lines are left out.

        Raises
        ------
        OSError
            If the file is there and cannot be read.
        """
        try:
            file = self._path.open("rb")
        except FileNotFoundError:
            self._start_again(None)
            return
        with file:
            state = os.fstat(file.fileno())
            identity = state.st_dev, state.st_ino
            if identity != self._identity or state.st_size < self._position:
                self._start_again(identity)
            file.seek(self._position)
            for line in file:
                if not line.endswith(b"\n"):
                    break  # it is being written
                self._position += len(line)
                row = parse_line(line)
                if row is not None:
                    self._note(row)

    def _start_again(self, identity: tuple[int, int] | None) -> None:
        if self._identity is not None:
            self._forget()
        self._identity, self._position = identity, 0
