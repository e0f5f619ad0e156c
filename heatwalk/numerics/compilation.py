"""How the inner loops of the package are compiled."""

import contextlib
from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit
from numba.core.caching import FunctionCache

# What LLVM may do to sums so that they use the vector registers; infinities and NaNs keep their meaning.
FAST_MATH = {"reassoc", "contract"}

Function = TypeVar("Function", bound=Callable[..., Any])


class _OptionalCache(FunctionCache):
    """The cache on disk, done without if its folder cannot be read or written (a full disk, a quota, permissions)."""

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The compiled function for a signature, or None."""
        try:
            return super().load_overload(sig, target_context)
        except OSError:
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the compiled function for a signature if possible."""
        with contextlib.suppress(OSError):
            super().save_overload(sig, data)


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
