"""What every command does around its work: output that no terminal can refuse, and exit codes."""

from __future__ import annotations

import errno
import gc
import io
import os
import sys
from collections.abc import Callable
from typing import Any, NoReturn, TextIO

SUCCESS, SOME_FAILED, MISTAKE, INTERRUPTED = 0, 1, 2, 130  # exit codes

# How often Python looks for garbage: what a command imports is none, and looking through it takes a while.
RARELY = (20_000, 10, 10)

# What writing to a pipe raises that nobody reads any more; EINVAL on Windows.
_CLOSED = (errno.EPIPE, errno.EINVAL, errno.ECONNRESET)


def run_command(main: Callable[[], int | None]) -> NoReturn:
    """Run a command and exit with its code: 130 after Ctrl-C.

    Parameters
    ----------
    main : callable
        () -> exit code; None is 0
    """
    prepare_output()
    gc.set_threshold(*RARELY)
    try:
        code = main() or SUCCESS
    except KeyboardInterrupt:
        print("interrupted", file=sys.stderr)
        code = INTERRUPTED
    finally:
        gc.freeze()  # or Python, before it ends, looks for garbage among all that was imported, which takes a second
    sys.exit(code)


def one_line(error: BaseException) -> str:
    """The message of an exception as one line; with its class if that is not one of the classes for mistakes.

    Examples
    --------
    >>> one_line(ValueError("no\\nmesh")), one_line(KeyError("status")), one_line(OSError())
    ('no mesh', "KeyError: 'status'", 'OSError')
    """
    text = " ".join(str(error).split())
    name = type(error).__name__
    if not text:
        return name
    return text if isinstance(error, ValueError | OSError) else f"{name}: {text}"


def prepare_output() -> None:
    """Make standard output and standard error take every text, and go on if a reader such as ``head`` has closed them.

    Characters that the encoding of the terminal lacks are shown as "?", or as a backslash sequence in UTF-8, which
    lacks lone surrogates only: bytes in the names of files that are not text.
    """
    sys.stdout = _forgiving(sys.stdout)
    sys.stderr = _forgiving(sys.stderr)
    # Commands show no window. The backend of a notebook, which its terminals inherit, may not be installed here.
    os.environ["MPLBACKEND"] = "Agg"


def _forgiving(stream: TextIO) -> TextIO:
    if not isinstance(stream, io.TextIOWrapper):  # None without a terminal, or what a test captures
        return stream
    is_unicode = stream.encoding.lower().replace("_", "-").startswith("utf")
    errors = "backslashreplace" if is_unicode else "replace"
    if stream.isatty():
        stream.reconfigure(errors=errors)
        return stream
    stream.flush()
    try:
        raw = _Pipe(stream.fileno(), "w", closefd=False)
    except (OSError, ValueError):  # it is not a file of the system
        stream.reconfigure(errors=errors)
        return stream
    return io.TextIOWrapper(
        io.BufferedWriter(raw), encoding=stream.encoding, errors=errors, line_buffering=stream.line_buffering
    )


class _Pipe(io.FileIO):
    """A file whose output is dropped once nobody reads it any more."""

    def write(self, data: Any) -> int:
        try:
            return super().write(data)
        except OSError as error:
            if error.errno not in _CLOSED:
                raise
            return memoryview(data).nbytes
