"""Which file a request is about: one below the folder of results, or none."""

from __future__ import annotations

import os
from pathlib import Path
from urllib.parse import quote, unquote_to_bytes

_FORBIDDEN = ("\\", "\0")  # another system's separator; the end of a name in C


class Site:
    """The folder of results, and the paths of its files in addresses.

    Parameters
    ----------
    root : Path
        whose files can be read; nothing else can

    Examples
    --------
    >>> site = Site(Path("results"))
    >>> site.find(b"/shot_noise/../../etc/passwd") is None, site.href(Path("results/my study/ant"))
    (True, '/my%20study/ant')
    """

    def __init__(self, root: Path) -> None:
        self.root = root
        self._real_root = Path(os.path.realpath(root))

    def find(self, raw_path: bytes) -> Path | None:
        """The file or folder of an address.

        Parameters
        ----------
        raw_path : bytes
            the path of the address, with its percent signs

        Returns
        -------
        Path or None
            None if there is none, if it is hidden, or if it is elsewhere, be it through a symbolic link
        """
        names = os.fsdecode(unquote_to_bytes(raw_path)).removeprefix("/").removesuffix("/").split("/")
        if names == [""]:
            return self.root
        # An empty name would make the rest an absolute path. Hidden files, "." and ".." begin with a period.
        if any(not name or name.startswith(".") or any(sign in name for sign in _FORBIDDEN) for name in names):
            return None
        path = self.root.joinpath(*names)
        return path if self.contains(path) and os.path.exists(path) else None

    def contains(self, path: Path) -> bool:
        """Whether a path is below the folder of results, wherever symbolic links lead."""
        try:
            return Path(os.path.realpath(path)).is_relative_to(self._real_root)
        except (OSError, ValueError):  # a name that the system refuses
            return False

    def href(self, path: Path) -> str:
        """The path of a file's address."""
        names = path.relative_to(self.root).parts
        return "/" + "/".join(quote(os.fsencode(name)) for name in names)
