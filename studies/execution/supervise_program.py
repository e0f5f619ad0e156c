"""Run a program that ends when the process that asked for it ends, however that ends.

``python supervise_program.py PACKAGES FOLDER PROGRAM [ARGUMENT ...]`` runs PROGRAM and exits as it does (with 128 + the
signal if a signal ended it). The process that asks for it holds the other end of standard input. When that is closed,
even because the process was killed, PROGRAM and all that it started are killed, and FOLDER, which belonged to that
process, is removed. What PROGRAM leaves running when it ends is killed too. PACKAGES is the folder that psutil is
imported from: Python starts faster without its site packages.

A process of its own, because the process that asks may be killed before it can clean up; processes are found by a mark
in their environment, because that reaches those whose parent has ended, on every system.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
import uuid
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Collection

    import psutil

MARK = "STUDIES_SUPERVISED_BY"  # environment variable, which the program's own children inherit
POLL_SECONDS = 0.01
ATTEMPTS = 10  # to kill all processes, some of which may be starting others


def main(packages: str, folder: str, *command: str) -> int:
    """Run the program; returns its exit code."""
    # Not SIG_IGN, which the program would inherit; and Ctrl-C does not reach its session.
    signal.signal(signal.SIGINT, lambda *_: None)
    mark = uuid.uuid4().hex
    try:
        program = subprocess.Popen(
            command, stdin=subprocess.DEVNULL, env=os.environ | {MARK: mark}, start_new_session=True
        )
    except OSError as error:
        print(f"{command[0]}: {error.strerror}", file=sys.stderr, flush=True)
        return 127

    sys.path.append(packages)
    import psutil

    tree = ProcessTree(psutil.Process(program.pid), mark)
    asker_ended = threading.Event()

    def end_with_asker() -> None:
        os.read(0, 1)  # blocks until the other end is closed
        asker_ended.set()
        tree.kill()
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(1)

    ending = threading.Thread(target=end_with_asker, daemon=True)
    ending.start()
    code = program.wait()
    if asker_ended.is_set():
        ending.join()  # it is removing the folder, and exits then
    tree.kill()
    return code if code >= 0 else 128 - code


class ProcessTree:
    """A program and all processes that it started, directly or not."""

    def __init__(self, program: "psutil.Process", mark: str) -> None:
        self._program = program
        self._mark = mark

    def kill(self) -> None:
        """Kill them, and those that they start meanwhile."""
        import psutil

        for _ in range(ATTEMPTS):
            alive = self._alive()
            if not alive:
                return
            for process in alive:
                with contextlib.suppress(psutil.Error):
                    process.kill()
            wait_until_ended(alive, 1.0)

    def _alive(self) -> "list[psutil.Process]":
        import psutil

        found = set()
        with contextlib.suppress(psutil.Error):  # it has ended
            found = {self._program, *self._program.children(recursive=True)}
        for process in psutil.process_iter():
            with contextlib.suppress(psutil.Error, OSError):  # not one of ours
                if process.environ().get(MARK) == self._mark:
                    found.add(process)
        return [process for process in found if is_alive(process)]


def is_alive(process: "psutil.Process") -> bool:
    """Whether a process has not ended, not even as a zombie, whose parent has not collected its exit code yet."""
    import psutil

    with contextlib.suppress(psutil.Error):
        return process.is_running() and process.status() != psutil.STATUS_ZOMBIE
    return False


def wait_until_ended(processes: "Collection[psutil.Process]", timeout: float) -> "list[psutil.Process]":
    """Wait for the end of processes, at most so many seconds; returns those that are still alive.

    `psutil.wait_procs` waits until they have been collected. Orphans may never be in a container whose first process is
    an ordinary program.
    """
    end = time.monotonic() + timeout
    while (alive := list(filter(is_alive, processes))) and time.monotonic() < end:
        time.sleep(POLL_SECONDS)
    return alive


if __name__ == "__main__":
    os._exit(main(*sys.argv[1:]))
