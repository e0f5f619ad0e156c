"""How the triangles of a mesh are joined along their edges, whatever their orientation.

Side i of a face leads from its corner i to corner i + 1; side i of face f is number 3 f + i.
"""

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled

# What a side may have instead of a partner.
BOUNDARY = -1
NON_MANIFOLD = -2


@compiled
def partners(faces: NDArray[np.int64], n_vertices: int) -> NDArray[np.int64]:
    """The side of another face along each side: (3 m,) int array; `BOUNDARY` if there is none, `NON_MANIFOLD` if many.

    Parameters
    ----------
    faces : (m, 3) int array
        without repeated corners
    n_vertices : int

    Examples
    --------
    >>> partners(np.array([[0, 1, 2], [2, 1, 3]]), 4)
    array([-1,  3, -1,  1, -1, -1])
    """
    n_sides = 3 * len(faces)
    low, high = np.empty(n_sides, np.int64), np.empty(n_sides, np.int64)
    for side in range(n_sides):
        a, b = tail(faces, side), head(faces, side)
        low[side], high[side] = min(a, b), max(a, b)
    order = _order_by(low, _order_by(high, np.arange(n_sides), n_vertices), n_vertices)
    partner = np.empty(n_sides, np.int64)
    first = 0
    while first < n_sides:
        last = first
        while last < n_sides and low[order[last]] == low[order[first]] and high[order[last]] == high[order[first]]:
            last += 1
        if last == first + 1:
            partner[order[first]] = BOUNDARY
        elif last == first + 2:
            partner[order[first]], partner[order[first + 1]] = order[first + 1], order[first]
        else:
            for i in range(first, last):
                partner[order[i]] = NON_MANIFOLD
        first = last
    return partner


@compiled
def _order_by(key: NDArray[np.int64], order: NDArray[np.int64], n_keys: int) -> NDArray[np.int64]:
    """``order`` sorted stably by the keys, 0 … n_keys - 1, in linear time."""
    place = np.zeros(n_keys + 1, np.int64)
    for i in range(len(order)):
        place[key[i] + 1] += 1
    for i in range(n_keys):
        place[i + 1] += place[i]
    result = np.empty_like(order)
    for i in range(len(order)):
        result[place[key[order[i]]]] = order[i]
        place[key[order[i]]] += 1
    return result


@compiled
def tail(faces: NDArray[np.int64], side: int) -> int:
    """The vertex at which a side starts."""
    return faces[side // 3, side % 3]


@compiled
def head(faces: NDArray[np.int64], side: int) -> int:
    """The vertex at which a side ends."""
    return faces[side // 3, (side + 1) % 3]


@compiled
def other_side(faces: NDArray[np.int64], side: int, vertex: int) -> int:
    """The other side of the same face at one of the ends of a side."""
    return side - side % 3 + (side + (1 if head(faces, side) == vertex else 2)) % 3


@compiled
def adjacency(faces: NDArray[np.int64], n_vertices: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The neighbours of vertex v are ``neighbours[starts[v]:starts[v + 1]]``, ascending, each once."""
    starts = np.zeros(n_vertices + 1, np.int64)
    n_sides = 3 * len(faces)
    ends = np.empty((2, 2 * n_sides), np.int64)
    for side in range(n_sides):
        a, b = tail(faces, side), head(faces, side)
        ends[0, 2 * side], ends[1, 2 * side] = a, b
        ends[0, 2 * side + 1], ends[1, 2 * side + 1] = b, a
    order = _order_by(ends[0], _order_by(ends[1], np.arange(2 * n_sides), n_vertices), n_vertices)
    neighbours = np.empty(2 * n_sides, np.int64)
    count = 0
    for i in range(len(order)):
        a, b = ends[0, order[i]], ends[1, order[i]]
        if a != b and (i == 0 or ends[0, order[i - 1]] != a or ends[1, order[i - 1]] != b):
            neighbours[count] = b
            count += 1
            starts[a + 1] = count
    for vertex in range(n_vertices):
        starts[vertex + 1] = max(starts[vertex + 1], starts[vertex])
    return starts, neighbours[:count].copy()


@compiled
def without_long_edges(
    vertices: NDArray[np.float64], starts: NDArray[np.int64], neighbours: NDArray[np.int64], most: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The neighbours, as of `adjacency`, along edges of at most so many times the median length at an end."""
    n = len(vertices)
    lengths, median = np.zeros(len(neighbours)), np.zeros(n)
    for v in range(n):
        for i in range(starts[v], starts[v + 1]):
            square = 0.0
            for k in range(3):
                square += (vertices[v, k] - vertices[neighbours[i], k]) ** 2
            lengths[i] = np.sqrt(square)
        if starts[v] < starts[v + 1]:
            median[v] = np.median(lengths[starts[v] : starts[v + 1]])
    kept, kept_starts = np.empty_like(neighbours), np.zeros_like(starts)
    count = 0
    for v in range(n):
        for i in range(starts[v], starts[v + 1]):
            if lengths[i] <= most * max(median[v], median[neighbours[i]]):
                kept[count] = neighbours[i]
                count += 1
        kept_starts[v + 1] = count
    return kept_starts, kept[:count].copy()
