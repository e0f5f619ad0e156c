"""How the inner loops of the package are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

# What LLVM may do to sums so that they use the vector registers; infinities and NaNs keep their meaning.
FAST_MATH = {"reassoc", "contract"}

Function = TypeVar("Function", bound=Callable[..., Any])


def compiled(function: Function) -> Function:
    """Compile a function with numba when it is first called, and cache it on disk for later processes if possible."""
    try:
        return cast(Function, njit(nogil=True, fastmath=FAST_MATH, cache=True)(function))
    except RuntimeError:  # neither the folder of the package nor the user's cache folder is writable
        return cast(Function, njit(nogil=True, fastmath=FAST_MATH)(function))
