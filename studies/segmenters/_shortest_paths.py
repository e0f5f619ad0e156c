"""Shortest paths from a node of a sparse graph."""

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled


@compiled
def shortest_paths(
    starts: NDArray[np.int64], ends: NDArray[np.int64], lengths: NDArray[np.float64], source: int
) -> NDArray[np.float64]:
    """Lengths of the shortest paths from one node to all, by Dijkstra's algorithm with a binary heap.

    SciPy's transposes an undirected graph in each call, and keeps its queue in a Fibonacci heap. The results are the
    same to the last bit: each is the least of the sums along all paths, in the order of their edges.

    Parameters
    ----------
    starts : (m + 1,) int array
        where the edges of each node start in the other arrays, as in a CSR matrix
    ends : (p,) int array
        the other node of each edge
    lengths : (p,) float array
        of the edges, at least 0
    source : int
        the node from which paths start

    Returns
    -------
    (m,) float array
        infinite for nodes that no path reaches
    """
    distances = np.full(len(starts) - 1, np.inf)
    # Each edge is followed once, so the heap never has more entries. Entries that a shorter path has overtaken remain.
    keys, nodes = np.empty(len(ends) + 1), np.empty(len(ends) + 1, np.int64)
    distances[source] = 0.0
    keys[0], nodes[0], n = 0.0, source, 1
    while n > 0:
        key, node = keys[0], nodes[0]
        n -= 1
        # The last entry moves down from the top.
        last, last_node, place = keys[n], nodes[n], 0
        while 2 * place + 1 < n:
            child = 2 * place + 1
            if child + 1 < n and keys[child + 1] < keys[child]:
                child += 1
            if keys[child] >= last:
                break
            keys[place], nodes[place] = keys[child], nodes[child]
            place = child
        keys[place], nodes[place] = last, last_node
        if key > distances[node]:
            continue
        for edge in range(starts[node], starts[node + 1]):
            other, length = ends[edge], key + lengths[edge]
            if length < distances[other]:
                distances[other] = length
                place = n
                n += 1
                while place > 0 and keys[(place - 1) // 2] > length:
                    keys[place], nodes[place] = keys[(place - 1) // 2], nodes[(place - 1) // 2]
                    place = (place - 1) // 2
                keys[place], nodes[place] = length, other
    return distances
