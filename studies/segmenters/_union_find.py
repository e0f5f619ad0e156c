"""Disjoint sets."""

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled


@compiled
def root(parent: NDArray[np.int64], node: int) -> int:
    """The root of a node, to which half of the nodes on the way are linked."""
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node
