"""Run a program that ends when the process that asked for it ends, however that ends.

``python guard.py FOLDER PROGRAM [ARGUMENT ...]`` runs PROGRAM and exits as it does (128 + the signal, if one ends it).
Whoever asks holds the other end of standard input. When nobody does any more, even because a SIGKILL took him, PROGRAM
and what it started are killed and FOLDER, which was his, is removed. A process of its own, and not a flag such as
Linux' PDEATHSIG, because it reaches the grandchildren, cleans up, and works on macOS.
"""

import contextlib
import os
import shutil
import signal
import subprocess
import sys
import threading


def main(folder, *command):
    try:
        # A session of its own: one signal reaches all of it, and a Ctrl-C in the terminal does not.
        program = subprocess.Popen(command, stdin=subprocess.DEVNULL, start_new_session=True)
    except OSError as error:
        print(f"{command[0]}: {error.strerror}", file=sys.stderr, flush=True)
        return 127

    alone = threading.Event()

    def end_with_asker():
        os.read(0, 1)  # gives nothing, and that not before the other end is closed
        alone.set()
        kill(program)
        shutil.rmtree(folder, ignore_errors=True)
        os._exit(1)

    ending = threading.Thread(target=end_with_asker, daemon=True)
    ending.start()
    code = program.wait()
    if alone.is_set():
        ending.join()  # it is still removing the folder, and exits when it has
    kill(program)  # what it started and left behind
    return code if code >= 0 else 128 - code


def kill(program):
    with contextlib.suppress(OSError):
        os.killpg(program.pid, signal.SIGKILL)


if __name__ == "__main__":
    os._exit(main(*sys.argv[1:]))
