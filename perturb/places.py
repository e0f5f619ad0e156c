"""Vertices near in space and far along the surface: an exact search."""

from collections.abc import Iterator

import numpy as np
from scipy.sparse import csr_array

from heatwalk.numerics.compilation import compiled

RIM = 1.1  # Vertices at the border of a ball often hang together only through what is just outside of it.
MOST_CELLS = 50  # in each direction; more would only be empty

ELSEWHERE, RIM_OF_BALL, IN_BALL, REACHED = range(4)


def near_but_far(
    vertices: np.ndarray, graph: csr_array, sources: np.ndarray, near: float, far: float
) -> Iterator[tuple[int, np.ndarray]]:
    """Yield (i, ends): the position of each source that has vertices near and far, and all these, ascending.

    vertices : (n, 3) float.
    graph : (n, n) symmetric, the lengths of the edges. Vertices without edges are not looked at.
    sources : (k,) int, searched in this order, and no further than the iterator is asked for.
    near : the largest distance in space, above 0.
    far : the distance along the edges that is exceeded.

    Nearly all sources are dismissed without shortest paths: a vertex is not far if any path of at most `far` leads
    to it, and those inside the ball of radius `near` are quickly followed. Where they leave something unreached,
    shortest paths decide.
    """
    used = np.flatnonzero(np.diff(graph.indptr))
    corner, extents = vertices[used].min(axis=0), np.ptp(vertices[used], axis=0)
    size = max(RIM * near, extents.max() / MOST_CELLS)
    cells = (extents // size).astype(np.int64) + 1
    position = ((vertices - corner) // size).astype(np.int64)
    cell = np.ravel_multi_index(position[used].T, cells)
    start = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=cells.prod()))])
    grid = position, cells, start, used[np.argsort(cell)]
    n = len(vertices)
    state = np.zeros(n, np.int8), np.full(n, np.inf), np.empty(n, np.int64), np.empty(n, np.int64), np.zeros(n, bool)
    first = 0
    while first < len(sources):
        found, ends = _next(vertices, graph.indptr, graph.indices, graph.data, sources, first, near, far, *grid, *state)
        if len(ends) > 0:
            yield found, np.sort(ends)
        first = found + 1


@compiled
def _next(
    vertices, indptr, neighbours, lengths, sources, first, near, far,
    position, cells, start, members, place, distance, ball, queue, waiting,
):  # fmt: skip
    """The next source, from `first` on, that has vertices near and far, and these; none at the end of all sources."""
    for i in range(first, len(sources)):
        source = sources[i]
        in_reach, unreached = 0, 0
        low, high = np.maximum(position[source] - 1, 0), np.minimum(position[source] + 2, cells)
        for a in range(low[0], high[0]):
            for b in range(low[1], high[1]):
                row = (a * cells[1] + b) * cells[2]
                for v in members[start[row + low[2]] : start[row + high[2]]]:
                    squared = _squared(vertices, source, v)
                    if squared <= (RIM * near) ** 2:
                        place[v] = RIM_OF_BALL
                        if squared <= near**2:
                            place[v] = IN_BALL
                            unreached += 1
                        ball[in_reach] = v
                        in_reach += 1

        unreached -= _follow_any_paths(indptr, neighbours, lengths, source, far, unreached, place, distance, queue)
        if unreached > 0:
            unreached -= _follow_shortest_paths(
                vertices, indptr, neighbours, lengths, source, near, far, unreached, place, distance, queue, waiting
            )
        ends = np.empty(unreached, np.int64)
        for v in ball[:in_reach]:
            if place[v] == IN_BALL:
                unreached -= 1
                ends[unreached] = v
            place[v] = ELSEWHERE
        if len(ends) > 0:
            return i, ends
    return len(sources), np.empty(0, np.int64)


@compiled
def _follow_any_paths(indptr, neighbours, lengths, source, far, wanted, place, distance, queue):
    """Breadth first through the ball and its rim, until `wanted` vertices of the ball are reached; how many were."""
    place[source] = REACHED
    distance[source] = 0.0
    queue[0] = source
    head, tail, reached = 0, 1, 1
    while head < tail and reached < wanted:
        v = queue[head]
        head += 1
        for edge in range(indptr[v], indptr[v + 1]):
            w = neighbours[edge]
            if (place[w] == IN_BALL or place[w] == RIM_OF_BALL) and distance[v] + lengths[edge] <= far:
                reached += place[w] == IN_BALL
                place[w] = REACHED
                distance[w] = distance[v] + lengths[edge]
                queue[tail] = w
                tail += 1
    for v in queue[:tail]:
        distance[v] = np.inf
    return reached


@compiled
def _follow_shortest_paths(
    vertices, indptr, neighbours, lengths, source, near, far, wanted, place, distance, queue, waiting
):
    """The same along shortest paths of at most `far`, by Moore's algorithm: paths are shortened until none can be.

    It needs no heap, and reaches most vertices long before their distance is final.
    """
    n = len(queue)
    waiting[:] = False
    distance[source] = 0.0
    queue[0], waiting[source] = source, True
    head, in_queue, reached = 0, 1, 0
    while in_queue > 0 and reached < wanted:
        v = queue[head]
        waiting[v] = False
        head, in_queue = head + 1 if head + 1 < n else 0, in_queue - 1
        for edge in range(indptr[v], indptr[v + 1]):
            w, length = neighbours[edge], distance[v] + lengths[edge]
            too_long = length > far or length >= distance[w]
            # What is left of `far` must lead back to the ball; a little more, for the rounding.
            if too_long or _squared(vertices, source, w) > 1.000001 * (far - length + near) ** 2:
                continue
            distance[w] = length
            if place[w] == IN_BALL:
                place[w] = REACHED
                reached += 1
            if not waiting[w]:
                waiting[w] = True
                tail = head + in_queue
                queue[tail if tail < n else tail - n] = w
                in_queue += 1
    distance[:] = np.inf
    return reached


@compiled
def _squared(vertices, v, w):
    """The squared distance in space."""
    total = 0.0
    for axis in range(3):
        total += (vertices[v, axis] - vertices[w, axis]) ** 2
    return total
