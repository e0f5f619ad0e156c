"""How the package's inner loops are compiled."""

from numba import njit


def compiled(function):
    """``function`` compiled by numba when first called, and kept on disk for later processes where that is possible."""
    options = {"nogil": True, "fastmath": {"reassoc", "contract"}}
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:  # neither the package's folder nor the user's cache can be written
        return njit(**options)(function)
