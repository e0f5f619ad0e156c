"""One process at a time writes to a results folder."""

import contextlib
import os
import socket
from datetime import datetime
from pathlib import Path

from filelock import FileLock, Timeout

from studies.storage.folders import LOCK_FILE

HOLDER_FILE = f"{LOCK_FILE}.holder"  # who holds the lock: locking may empty the lock file itself
LOCK_TIMEOUT_SECONDS = 0.5  # `lock_holder` of another process may take the lock for a moment


class StoreLockedError(OSError):
    """Another process writes to a results folder; the message names it."""


class FolderLock:
    """The lock of a results folder, held from the start until `release`; the system releases it if the process dies.

    Parameters
    ----------
    folder : Path

    Raises
    ------
    StoreLockedError
        If it is held already, by this process or another.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / LOCK_FILE
        self._holder = folder / HOLDER_FILE
        self._lock = FileLock(self._path, thread_local=False)
        try:
            self._lock.acquire(timeout=LOCK_TIMEOUT_SECONDS)
        except Timeout:
            raise StoreLockedError(
                f"{folder}: {_read(self._holder)} writes to this folder; wait until it ends, or choose another "
                "results_dir"
            ) from None
        since = datetime.now().astimezone().isoformat(timespec="seconds")
        try:
            self._holder.write_text(f"process {os.getpid()} on {socket.gethostname()} since {since}", "utf-8")
        except BaseException:
            self.release()
            raise

    def release(self) -> None:
        """Release the lock and remove its files."""
        self._holder.unlink(missing_ok=True)
        # While it is locked: who opened it before will see that it was removed, and open a new one. Windows removes no
        # file that is open, and filelock does so itself there.
        with contextlib.suppress(OSError):
            self._path.unlink()
        self._lock.release()


def lock_holder(folder: Path) -> str | None:
    """Who writes to a results folder.

    Returns
    -------
    str or None
        "process 123 on host since 2026-01-31T12:00:00+01:00"; None if nobody does
    """
    holder = folder / HOLDER_FILE
    if not (holder.exists() and (folder / LOCK_FILE).exists()):
        return None
    lock = FileLock(folder / LOCK_FILE, thread_local=False)
    try:
        # Not at once: another process may just be asking the same.
        lock.acquire(timeout=LOCK_TIMEOUT_SECONDS / 5)
    except Timeout:
        return _read(holder)
    except OSError:  # the folder is read-only here
        return None
    lock.release()
    return None  # a process that was killed left the file


def _read(holder: Path) -> str:
    try:
        return holder.read_text("utf-8") or "another process"
    except OSError:
        return "another process"
