"""An exact search for vertices that are near in space but far apart along the surface.

For each source vertex:

1. Mark the vertices within ``near`` in space (the ball), and slightly beyond (the rim), using a grid of cells.
2. Search breadth-first inside ball and rim. A ball vertex reached by any path of at most ``far`` is not far.
3. If ball vertices remain, follow shortest paths of at most ``far`` through the whole mesh.
4. Ball vertices that are still unreached are near but far.

Step 2 dismisses nearly all sources, without shortest paths.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from heatwalk.numerics.compilation import compiled

if TYPE_CHECKING:
    from scipy.sparse import csr_array

RIM_RATIO = 1.1  # Vertices near the border of a ball are often connected only through vertices just outside it.
MAX_CELLS_PER_AXIS = 50  # more cells would mostly be empty

OUTSIDE, RIM, BALL, REACHED = range(4)  # status of a vertex during the search from one source


def search_near_but_far(
    vertices: np.ndarray, graph: csr_array, sources: np.ndarray, near: float, far: float
) -> Iterator[tuple[int, np.ndarray]]:
    """Find, for each source, the vertices within `near` in space and beyond `far` along the edges.

    Parameters
    ----------
    vertices : (n, 3) float array
    graph : (n, n) scipy.sparse.csr_array
        Symmetric, the lengths of the edges. Vertices without edges are ignored.
    sources : (k,) int array
        Vertices with edges, searched in this order, and only as far as the iterator is consumed.
    near : float
        The largest distance in space, above 0.
    far : float
        The distance along the edges that must be exceeded.

    Yields
    ------
    i : int
        Position in `sources` of a source that has such vertices.
    ends : (p,) int array
        All such vertices, ascending.
    """
    used = np.flatnonzero(np.diff(graph.indptr))
    corner, extents = vertices[used].min(axis=0), np.ptp(vertices[used], axis=0)
    size = max(RIM_RATIO * near, extents.max() / MAX_CELLS_PER_AXIS)
    n_cells = (extents // size).astype(np.int64) + 1
    position = ((vertices - corner) // size).astype(np.int64)
    cell = np.ravel_multi_index(position[used].T, n_cells)
    start = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=n_cells.prod()))])
    grid = position, n_cells, start, used[np.argsort(cell)]
    n = len(vertices)
    work = np.zeros(n, np.int8), np.full(n, np.inf), np.empty(n, np.int64), np.empty(n, np.int64), np.zeros(n, bool)
    first = 0
    while first < len(sources):
        found, ends = _search_next(
            vertices, graph.indptr, graph.indices, graph.data, sources, first, near, far, *grid, *work
        )
        if len(ends) > 0:
            yield found, np.sort(ends)
        first = found + 1


def search_detours(
    vertices: np.ndarray, graph: csr_array, sources: np.ndarray, near: float, ratio: float
) -> Iterator[tuple[int, np.ndarray]]:
    """Find, for each source, the vertices within `near` in space to which the way along the edges is a detour.

    Parameters
    ----------
    vertices, graph, sources, near
        As in `search_near_but_far`.
    ratio : float
        The smallest distance along the edges, as a multiple of that in space.

    Yields
    ------
    i : int
        Position in `sources` of a source that has such vertices.
    ends : (p,) int array
        All such vertices, ascending; those at the very place of the source are none.
    """
    from scipy.sparse.csgraph import dijkstra
    from scipy.spatial import KDTree

    used = np.flatnonzero(np.diff(graph.indptr))
    tree = KDTree(vertices[used])
    for i, source in enumerate(sources):
        around = used[np.sort(tree.query_ball_point(vertices[source], near))]
        in_space = np.linalg.norm(vertices[around] - vertices[source], axis=1)
        along_edges = dijkstra(graph, indices=source, limit=ratio * near)[around]
        ends = around[(along_edges >= ratio * in_space) & (in_space > 0)]
        if len(ends) > 0:
            yield i, ends


@compiled
def _search_next(
    vertices: np.ndarray, indptr: np.ndarray, neighbours: np.ndarray, lengths: np.ndarray,
    sources: np.ndarray, first: int, near: float, far: float,
    position: np.ndarray, n_cells: np.ndarray, start: np.ndarray, members: np.ndarray,
    status: np.ndarray, distance: np.ndarray, ball: np.ndarray, queue: np.ndarray, queued: np.ndarray,
) -> tuple[int, np.ndarray]:  # fmt: skip
    """Return the position of the next source with such vertices, from `first` on, and these; len(sources) if none."""
    for i in range(first, len(sources)):
        source = sources[i]
        n_marked, n_unreached = 0, 0
        low, high = np.maximum(position[source] - 1, 0), np.minimum(position[source] + 2, n_cells)
        for a in range(low[0], high[0]):
            for b in range(low[1], high[1]):
                row = (a * n_cells[1] + b) * n_cells[2]
                for v in members[start[row + low[2]] : start[row + high[2]]]:
                    squared = _squared_distance(vertices, source, v)
                    if squared <= (RIM_RATIO * near) ** 2:
                        status[v] = RIM
                        if squared <= near**2:
                            status[v] = BALL
                            n_unreached += 1
                        ball[n_marked] = v
                        n_marked += 1

        n_unreached -= _search_breadth_first(
            indptr, neighbours, lengths, source, far, n_unreached, status, distance, queue
        )
        if n_unreached > 0:
            n_unreached -= _search_shortest_paths(
                vertices, indptr, neighbours, lengths, source, near, far, n_unreached, status, distance, queue, queued
            )
        ends = np.empty(n_unreached, np.int64)
        for v in ball[:n_marked]:
            if status[v] == BALL:
                n_unreached -= 1
                ends[n_unreached] = v
            status[v] = OUTSIDE
        if len(ends) > 0:
            return i, ends
    return len(sources), np.empty(0, np.int64)


@compiled
def _search_breadth_first(
    indptr: np.ndarray, neighbours: np.ndarray, lengths: np.ndarray,
    source: int, far: float, n_targets: int,
    status: np.ndarray, distance: np.ndarray, queue: np.ndarray,
) -> int:  # fmt: skip
    """Search through the ball and its rim until `n_targets` ball vertices are reached; return how many were."""
    status[source] = REACHED
    distance[source] = 0.0
    queue[0] = source
    head, tail, n_reached = 0, 1, 1
    while head < tail and n_reached < n_targets:
        v = queue[head]
        head += 1
        for edge in range(indptr[v], indptr[v + 1]):
            w = neighbours[edge]
            if (status[w] == BALL or status[w] == RIM) and distance[v] + lengths[edge] <= far:
                n_reached += status[w] == BALL
                status[w] = REACHED
                distance[w] = distance[v] + lengths[edge]
                queue[tail] = w
                tail += 1
    for v in queue[:tail]:
        distance[v] = np.inf
    return n_reached


@compiled
def _search_shortest_paths(
    vertices: np.ndarray, indptr: np.ndarray, neighbours: np.ndarray, lengths: np.ndarray,
    source: int, near: float, far: float, n_targets: int,
    status: np.ndarray, distance: np.ndarray, queue: np.ndarray, queued: np.ndarray,
) -> int:  # fmt: skip
    """The same along shortest paths of at most `far`, by Moore's algorithm: paths are shortened until none can be.

    It needs no heap, and reaches most vertices long before their distance is final.
    """
    n = len(queue)
    queued[:] = False
    distance[source] = 0.0
    queue[0], queued[source] = source, True
    head, queue_length, n_reached = 0, 1, 0
    while queue_length > 0 and n_reached < n_targets:
        v = queue[head]
        queued[v] = False
        head, queue_length = head + 1 if head + 1 < n else 0, queue_length - 1
        for edge in range(indptr[v], indptr[v + 1]):
            w, length = neighbours[edge], distance[v] + lengths[edge]
            too_long = length > far or length >= distance[w]
            # The remainder of `far` must suffice to return to the ball, with a margin for rounding.
            if too_long or _squared_distance(vertices, source, w) > 1.000001 * (far - length + near) ** 2:
                continue
            distance[w] = length
            if status[w] == BALL:
                status[w] = REACHED
                n_reached += 1
            if not queued[w]:
                queued[w] = True
                tail = head + queue_length
                queue[tail if tail < n else tail - n] = w
                queue_length += 1
    distance[:] = np.inf
    return n_reached


@compiled
def _squared_distance(vertices: np.ndarray, v: int, w: int) -> float:
    """Return the squared distance in space."""
    total = 0.0
    for axis in range(3):
        total += (vertices[v, axis] - vertices[w, axis]) ** 2
    return total
