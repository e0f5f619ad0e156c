"""Spikes removed: vertices far from where all of their neighbours are.

A spike inflates the area of the surface, and time is measured on the scale of the area, so that a few spikes shorten
the heat flow everywhere. The place where a vertex should be is the geometric median of its neighbours, of which up to a
half may be spikes themselves. It is moved there if its distance from it is beyond what is usual around:

    repeat at most 6 times, until no vertex is moved:
        for each vertex v:
            w(v) = geometric median of the neighbours of v;  r(v) = |v - w(v)|
            l(v) = median length of the edges of v
        move each vertex v to w(v) where
            r(v) > .75 · median of l over the neighbours of v, and r(v) > 3 · median of r over the neighbours of v,
            and every chord between two neighbours of v is farther away than .4 · median of l
        if there is none:
            for each vertex v:
                W(v) = geometric median of the vertices up to two edges away from v;  R(v) = |v - W(v)|
            move each vertex v to W(v) where
                R(v) > 8 · median of l over these vertices, and R(v) > 4 · median of R over them

Where edges are long, or where the surface is rough, the neighbours of a vertex have the same; and a vertex on a sharp
edge of the shape lies on the chord along that edge. On clean meshes of the benchmark no vertex moves, or a few.

Three or four spikes next to one another hide: half of the neighbours of each may be spikes, and what is usual among
them is what spikes have. Up to two edges away there are some eighteen vertices, of which they are few. But there the
shape bends, too, so that only what is far away is moved.

Other than the componentwise median, the geometric median does not depend on how the shape is turned.
"""

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled

# Vertices are moved at most so often: a spike among spikes may need several times.
PASSES = 6

# How many edge lengths a vertex may be away from the median of its neighbours.
MAX_EDGES = 0.75

# How many times the median residual of its neighbours a vertex may be away from their median.
MAX_RESIDUAL = 3.0

# How many edge lengths a vertex is away from that median if it is a spike whatever chords there are.
CERTAIN_EDGES = 3.0

# How many edge lengths a vertex must be away from each chord between two of its neighbours.
MIN_CHORD = 0.4

# How many edge lengths a vertex may be away from the median of the vertices up to two edges away.
MAX_EDGES_OF_SECOND_RING = 8.0

# How many times what is the median of this distance among them.
MAX_RESIDUAL_OF_SECOND_RING = 4.0

# The vertices around one with more neighbours have no more in common than that: the second ring does not cross it.
MAX_DEGREE = 64

# Steps of Weiszfeld's iteration for the geometric median.
MEDIAN_STEPS = 12


def remove_spikes(
    vertices: NDArray[np.float64], starts: NDArray[np.int64], neighbours: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Move spikes back to the surface.

    Parameters
    ----------
    vertices : (n, 3) float array
    starts, neighbours
        as from `heatwalk.robust.half_edges.adjacency`

    Returns
    -------
    vertices : (n, 3) float array
    moved : (n,) bool array

    Examples
    --------
    >>> from heatwalk.robust.half_edges import adjacency
    >>> i, j = np.divmod(np.arange(25), 5)
    >>> corner = np.flatnonzero((i < 4) & (j < 4))
    >>> faces = np.vstack([corner + [[0], [5], [6]], corner + [[0], [6], [1]]]).reshape(2, 3, -1)
    >>> faces = faces.transpose(0, 2, 1).reshape(-1, 3)
    >>> vertices = np.column_stack([i, j, 9.0 * (np.arange(25) == 12)])
    >>> mended, moved = remove_spikes(vertices, *adjacency(faces, 25))
    >>> np.flatnonzero(moved), mended[12]
    (array([12]), array([2., 2., 0.]))
    """
    n = len(vertices)
    vertices, moved, stale = vertices.copy(), np.zeros(n, np.bool_), np.ones(n, np.bool_)
    median, residual, length = np.zeros((n, 3)), np.zeros(n), np.zeros(n)
    for _ in range(PASSES):
        _measure(vertices, starts, neighbours, stale, median, residual, length)
        place, spike = median, _find_spikes(vertices, starts, neighbours, residual, length)
        if not spike.any():
            place, spike = _find_hidden_spikes(vertices, starts, neighbours, length)
        if not spike.any():
            break
        vertices[spike] = place[spike]
        moved |= spike
        stale = _with_neighbours(spike, starts, neighbours)
    return vertices, moved


@compiled
def _measure(
    vertices: NDArray[np.float64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
    stale: NDArray[np.bool_],
    median: NDArray[np.float64],
    residual: NDArray[np.float64],
    length: NDArray[np.float64],
) -> None:
    """For each stale vertex the median of its neighbours, its distance from that, and its median edge length."""
    for v in range(len(vertices)):
        around = neighbours[starts[v] : starts[v + 1]]
        if not stale[v] or len(around) < 3:
            continue
        edges = np.empty(len(around))
        for i in range(len(around)):
            edges[i] = _distance(vertices[v], vertices[around[i]])
        length[v] = _median(edges)
        median[v] = _geometric_median(vertices, around)
        residual[v] = _distance(vertices[v], median[v])


@compiled
def _find_spikes(
    vertices: NDArray[np.float64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
    residual: NDArray[np.float64],
    length: NDArray[np.float64],
) -> NDArray[np.bool_]:
    """Which vertices are spikes: (n,) bool array."""
    n = len(residual)
    spike = np.zeros(n, np.bool_)
    for v in range(n):
        around = neighbours[starts[v] : starts[v + 1]]
        if len(around) < 3:
            continue
        usual = _median(length[around])
        if residual[v] > MAX_EDGES * usual and residual[v] > MAX_RESIDUAL * _median(residual[around]):
            spike[v] = (
                residual[v] > CERTAIN_EDGES * usual or _distance_to_chords(vertices, v, around) > MIN_CHORD * usual
            )
    return spike


@compiled
def _find_hidden_spikes(
    vertices: NDArray[np.float64],
    starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
    length: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """The medians of the second rings, and which vertices are spikes by them: (n, 3) float and (n,) bool array."""
    n = len(length)
    median, spike = vertices.copy(), np.zeros(n, np.bool_)
    for v in range(n):
        around = neighbours[starts[v] : starts[v + 1]]
        if not 3 <= len(around) <= MAX_DEGREE or not _has_long_edge(vertices, v, around, length):
            continue
        ring = _second_ring(v, starts, neighbours)
        median[v] = _geometric_median(vertices, ring)
        residual = _distance(vertices[v], median[v])
        if residual > MAX_EDGES_OF_SECOND_RING * _median(length[ring]):
            usual = np.empty(len(ring))
            for i in range(len(ring)):
                median_of_other = _geometric_median(vertices, _second_ring(ring[i], starts, neighbours))
                usual[i] = _distance(vertices[ring[i]], median_of_other)
            spike[v] = residual > MAX_RESIDUAL_OF_SECOND_RING * _median(usual)
    return median, spike


@compiled
def _has_long_edge(
    vertices: NDArray[np.float64], v: int, around: NDArray[np.int64], length: NDArray[np.float64]
) -> bool:
    """Whether a vertex has an edge so long that the second ring is worth looking at."""
    usual, longest = length[v], 0.0
    for w in around:
        usual = min(usual, length[w])
        longest = max(longest, _distance(vertices[v], vertices[w]))
    return longest > MAX_EDGES_OF_SECOND_RING * usual


@compiled
def _second_ring(v: int, starts: NDArray[np.int64], neighbours: NDArray[np.int64]) -> NDArray[np.int64]:
    """The vertices up to two edges away from a vertex, without itself, and not by way of the hub of a large fan."""
    ring = {v}
    for w in neighbours[starts[v] : starts[v + 1]]:
        ring.add(w)
        if starts[w + 1] - starts[w] <= MAX_DEGREE:
            for u in neighbours[starts[w] : starts[w + 1]]:
                ring.add(u)
    ring.remove(v)
    return np.array(sorted(ring))


@compiled
def _distance_to_chords(vertices: NDArray[np.float64], v: int, around: NDArray[np.int64]) -> float:
    """Smallest distance of a vertex from a chord between two of its neighbours."""
    least = np.inf
    for i in range(len(around)):
        a = vertices[around[i]]
        for j in range(i):
            b = vertices[around[j]]
            along = square = 0.0
            for k in range(3):
                along += (vertices[v, k] - a[k]) * (b[k] - a[k])
                square += (b[k] - a[k]) ** 2
            share = min(max(along / square, 0.0), 1.0) if square > 0 else 0.0
            distance = 0.0
            for k in range(3):
                distance += (vertices[v, k] - a[k] - share * (b[k] - a[k])) ** 2
            least = min(least, distance)
    return np.sqrt(least)


@compiled
def _with_neighbours(
    chosen: NDArray[np.bool_], starts: NDArray[np.int64], neighbours: NDArray[np.int64]
) -> NDArray[np.bool_]:
    """The chosen vertices and their neighbours: (n,) bool array."""
    result = chosen.copy()
    for v in np.flatnonzero(chosen):
        result[neighbours[starts[v] : starts[v + 1]]] = True
    return result


@compiled
def _geometric_median(vertices: NDArray[np.float64], chosen: NDArray[np.int64]) -> NDArray[np.float64]:
    """The point of least sum of distances to the chosen vertices, nearly: Weiszfeld's iteration from their mean."""
    x = y = z = 0.0
    for c in chosen:
        x += vertices[c, 0] / len(chosen)
        y += vertices[c, 1] / len(chosen)
        z += vertices[c, 2] / len(chosen)
    for _ in range(MEDIAN_STEPS):
        total = sx = sy = sz = 0.0
        for c in chosen:
            dx, dy, dz = vertices[c, 0] - x, vertices[c, 1] - y, vertices[c, 2] - z
            distance = np.sqrt(dx * dx + dy * dy + dz * dz)
            if distance == 0:
                return np.array([x, y, z])
            total += 1 / distance
            sx += dx / distance
            sy += dy / distance
            sz += dz / distance
        x += sx / total
        y += sy / total
        z += sz / total
    return np.array([x, y, z])


@compiled
def _distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Distance of two points."""
    return np.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@compiled
def _median(values: NDArray[np.float64]) -> float:
    """The median, of an even number the upper one; sorts the values in place."""
    if len(values) > 64:
        return np.sort(values)[len(values) // 2]
    for i in range(1, len(values)):
        value, j = values[i], i
        while j > 0 and values[j - 1] > value:
            values[j] = values[j - 1]
            j -= 1
        values[j] = value
    return values[len(values) // 2]
