"""How the inner loops of the package are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

# What LLVM may do to sums so that they use the vector registers; infinities and NaNs keep their meaning.
FAST_MATH = {"reassoc", "contract"}

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function with numba when it is first called, and cache it on disk for later processes if possible."""
    return _compile(function, forceinline=False)


def inlined(function: Function) -> Function:
    """Compile a phase of a larger compiled function: a call of it costs nothing."""
    return _compile(function, forceinline=True)


def _compile(function: Function, forceinline: bool) -> Function:
    """Compile a function, with a cache if possible."""
    try:
        return cast(Function, njit(nogil=True, fastmath=FAST_MATH, forceinline=forceinline, cache=True)(function))
    except RuntimeError:  # neither the folder of the package nor the user's cache folder is writable
        return cast(Function, njit(nogil=True, fastmath=FAST_MATH, forceinline=forceinline)(function))
