"""Files that are replaced as a whole or not at all."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path


@contextmanager
def atomic_write(path: Path) -> Iterator[Path]:
    """A path to write to, which replaces ``path`` when the block ends without an error.

    A process that is killed at any moment leaves the old file or the new one, never a part.

    Parameters
    ----------
    path : Path
        the file to be written or replaced

    Yields
    ------
    Path
        a file next to it, with the same suffix

    Examples
    --------
    >>> import tempfile
    >>> path = Path(tempfile.mkdtemp(), "table.csv")
    >>> with atomic_write(path) as part:
    ...     _ = part.write_text("level,mean\\n")
    >>> path.read_text()
    'level,mean\\n'
    """
    part = path.with_name(f".{path.stem}.{os.getpid()}.part{path.suffix}")
    try:
        yield part
        with part.open("r+b") as file:  # Windows flushes files only that are open for writing
            os.fsync(file.fileno())
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
