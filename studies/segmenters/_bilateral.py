"""Smoothing values on a graph without blurring their steps."""

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled


@compiled
def bilateral(
    values: NDArray[np.float64], starts: NDArray[np.int32], neighbours: NDArray[np.int32], window: int
) -> NDArray[np.float64]:
    """The mean of each node and of those within some steps, weighted by nearness and by similarity of the values.

    Both weights are normal distributions: of the number of steps, with the standard deviation window / 2; and of the
    difference, with the root mean square of the differences from the node as standard deviation.

    Parameters
    ----------
    values : (n,) float array
    starts, neighbours : int arrays
        the graph, as ``indptr`` and ``indices`` of a sparse matrix in compressed rows
    window : int
        most steps between nodes that are averaged

    Returns
    -------
    (n,) float array
    """
    n = len(values)
    smoothed = np.empty(n)
    queue = np.empty(n, np.int64)
    steps = np.full(n, -1, np.int64)
    for node in range(n):
        queue[0], steps[node] = node, 0
        size, position, squares = 1, 0, 0.0
        while position < size:
            reached = queue[position]
            squares += (values[reached] - values[node]) ** 2
            position += 1
            if steps[reached] == window:
                continue
            for neighbour in neighbours[starts[reached] : starts[reached + 1]]:
                if steps[neighbour] < 0:
                    steps[neighbour] = steps[reached] + 1
                    queue[size] = neighbour
                    size += 1
        variance = squares / size
        total = weights = 0.0
        for reached in queue[:size]:
            exponent = 2.0 * (steps[reached] / window) ** 2
            if variance > 0:
                exponent += 0.5 * (values[reached] - values[node]) ** 2 / variance
            weight = np.exp(-exponent)
            total += weight * values[reached]
            weights += weight
            steps[reached] = -1
        smoothed[node] = total / weights
    return smoothed
