"""The variants that a process has made: every method segments the same ones, and some take seconds to make."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable

import perturb

MOST_BYTES = 200_000_000  # of the arrays of the variants that a process keeps

Made = tuple[perturb.Perturbed, float]


class Variants:
    """Variants by their draw, and the seconds that it took to make each; the least recently used are dropped.

    Parameters
    ----------
    most_bytes : int
        of their arrays

    Examples
    --------
    >>> import numpy as np
    >>> import trimesh
    >>> variants, box = Variants(), trimesh.creation.box()
    >>> make = lambda: (perturb.NormalNoise(amount=0.1)(box, np.random.default_rng(0)), 0.01)
    >>> variants.get("a", make) is variants.get("a", make)
    True
    """

    def __init__(self, most_bytes: int = MOST_BYTES) -> None:
        self._most_bytes = most_bytes
        self._made: OrderedDict[str, Made] = OrderedDict()
        self._bytes = 0

    def get(self, draw: str, make: Callable[[], Made]) -> Made:
        """The variant of a draw, and the seconds that it took when it was made.

        Parameters
        ----------
        draw : str
            digest of what determines the variant
        make : callable
            makes it if it is not there
        """
        if draw not in self._made:
            made = make()
            self._made[draw] = made
            self._bytes += _size(made)
            while self._bytes > self._most_bytes and len(self._made) > 1:
                self._bytes -= _size(self._made.popitem(last=False)[1])
        self._made.move_to_end(draw)
        return self._made[draw]


def _size(made: Made) -> int:
    """Bytes of the arrays of a variant."""
    perturbed = made[0]
    arrays = (perturbed.mesh.vertices, perturbed.mesh.faces, perturbed.counterpart)
    return sum(int(array.nbytes) for array in arrays)


MADE = Variants()
"""Those of this process."""
