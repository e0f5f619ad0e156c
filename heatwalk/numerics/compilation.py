"""How the inner loops of the package are compiled, and how long that takes."""

import contextlib
import time
from collections.abc import Callable, Iterator
from typing import Any, TypeVar, cast

from numba import njit
from numba.core import event
from numba.core.caching import FunctionCache
from numba.core.runtime import rtsys

# What LLVM may do to sums so that they use the vector registers; infinities and NaNs keep their meaning.
FAST_MATH = {"reassoc", "contract"}

Function = TypeVar("Function", bound=Callable[..., Any])


class _OptionalCache(FunctionCache):
    """The cache on disk, done without if its folder cannot be read or written (a full disk, a quota, permissions)."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function for a signature, or None."""
        # Compiled code needs numba's runtime. The base class loads all that the compiler needs too, which takes longer
        # than to segment a mesh of ten thousand vertices; numba does that itself once there is something to compile.
        rtsys.initialize(target_context)
        try:
            with self._guard_against_spurious_io_errors():
                return self._load_overload(sig, target_context)
        except OSError:
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the compiled function for a signature if possible."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)


class _CompilationClock(event.Listener):
    """How long this process has been compiling; what was found in the cache does not count."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self.announce: Callable[[], None] | None = None
        self._depth = 0  # functions are compiled in the middle of those that call them
        self._start = 0.0

    def on_start(self, event: event.Event) -> None:
        """A function is not in the cache."""
        if self._depth == 0:
            if self.announce is not None:
                self.announce()
            self._start = time.perf_counter()
        self._depth += 1

    def on_end(self, event: event.Event) -> None:
        """It is compiled."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._start


_clock = _CompilationClock()
event.register("numba:compile", _clock)


def seconds_compiled() -> float:
    """Wall-clock seconds that this process has spent on compiling so far."""
    return _clock.seconds


@contextlib.contextmanager
def announced(announce: Callable[[], None]) -> Iterator[None]:
    """Call ``announce`` once, as soon as something has to be compiled within the ``with`` statement."""

    def once() -> None:
        _clock.announce = before
        announce()

    before, _clock.announce = _clock.announce, once
    try:
        yield
    finally:
        _clock.announce = before


def compiled(function: Function) -> Function:
    """Compile a function with numba when it is first called, and cache it on disk for later processes if possible."""
    return _compile(function, forceinline=False)


def inlined(function: Function) -> Function:
    """Compile a phase of a larger compiled function: a call of it costs nothing."""
    return _compile(function, forceinline=True)


def _compile(function: Function, forceinline: bool) -> Function:
    """Compile a function, with a cache if possible."""
    dispatcher = njit(nogil=True, fastmath=FAST_MATH, forceinline=forceinline)(function)
    # Neither the folder of the package nor the user's cache folder may be writable, or NUMBA_CACHE_DIR is not.
    with contextlib.suppress(RuntimeError, OSError):
        dispatcher._cache = _OptionalCache(function)  # type: ignore[attr-defined]
    return cast(Function, dispatcher)
