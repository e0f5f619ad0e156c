"""The inner loop of graph-based segmentation."""

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled
from studies.segmenters._union_find import root


@compiled
def grown_regions(
    edges: NDArray[np.int64], weights: NDArray[np.float64], n_vertices: int, threshold: float, min_vertices: int
) -> NDArray[np.int64]:
    """Grow regions by the edges of a graph in their order; then join small ones.

    Parameters
    ----------
    edges : (e, 2) int array
        vertices that are adjacent, ascending by weight
    weights : (e,) float array
        how different the ends of each edge are
    n_vertices : int
    threshold : float
        an edge joins two regions if its weight is at most w + threshold / size of each, w being the largest weight by
        which the region was joined
    min_vertices : int
        smaller regions are joined to a neighbour by the first edge between them

    Returns
    -------
    (n,) int64 array
        a vertex of the region of each vertex, the same for all of its vertices
    """
    parent = np.arange(n_vertices)
    size = np.ones(n_vertices, np.int64)
    limit = np.full(n_vertices, threshold)
    for may_be_large in (True, False):
        for i in range(len(edges)):
            a, b = root(parent, edges[i, 0]), root(parent, edges[i, 1])
            if a == b:
                continue
            if may_be_large:
                joins = weights[i] <= limit[a] and weights[i] <= limit[b]
            else:
                joins = size[a] < min_vertices or size[b] < min_vertices
            if joins:
                parent[b] = a
                size[a] += size[b]
                limit[a] = weights[i] + threshold / size[a]
    for vertex in range(n_vertices):
        parent[vertex] = root(parent, vertex)
    return parent
