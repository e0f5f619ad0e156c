"""Importing, while workers run the trials of a study, what its table needs afterwards: that takes most of a second."""

from __future__ import annotations

import contextlib
import threading
from collections.abc import Iterable
from importlib import import_module

# No modules of this project: those that the table needs are there before trials run, and two threads that import
# modules which import each other can get in each other's way.
OF_TABLE = (
    "pandas",
    "pandas.io.parquet",
    "pandas.io.formats.csvs",
    "pandas.core.arrays.arrow.extension_types",
    "pyarrow.parquet",
    "pyarrow.pandas_compat",
    "rich.table",
)


class ImportsAhead:
    """A thread that imports modules, and has ended when the context does.

    A module that cannot be imported is left to what needs it, which reports the error.

    Parameters
    ----------
    names : iterable of str
        the modules, in the order in which they are imported

    Examples
    --------
    >>> with ImportsAhead(["wave"]) as ahead:
    ...     ahead.start()
    """

    def __init__(self, names: Iterable[str]) -> None:
        self._names = tuple(names)
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._import_all, name="imports ahead")

    def start(self) -> None:
        """Start to import; returns at once. To be called at most once."""
        with contextlib.suppress(RuntimeError):  # no further thread can be started
            self._thread.start()

    def __enter__(self) -> ImportsAhead:
        return self

    def __exit__(self, *_: object) -> None:
        """Wait for the module that is being imported, and import no further one."""
        self._stopped.set()
        if self._thread.ident is not None:
            self._thread.join()

    def _import_all(self) -> None:
        for name in self._names:
            if self._stopped.is_set():
                return
            try:
                import_module(name)
            except BaseException:  # whatever the code of a package raises; in this thread it is not Ctrl-C
                return
