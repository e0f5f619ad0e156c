"""Clustering of points by k-means."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

# Passes after which an iteration that has not converged ends; nearly all converge in fewer than 50.
_MAX_PASSES = 100


def k_means(
    points: NDArray[np.float64],
    n_clusters: int,
    rng: np.random.Generator,
    *,
    weights: NDArray[np.float64] | None = None,
    n_starts: int = 10,
) -> NDArray[np.int64]:
    """The best of several clusterings by Lloyd's iteration, each from centres drawn by k-means++.

    SciPy's k-means does not weight points, and meshes have more vertices where they are finer.

    Parameters
    ----------
    points : (n, d) float array
    n_clusters : int
        at most so many clusters: fewer if fewer points differ
    rng : numpy.random.Generator
    weights : (n,) float array, optional
        how much each point counts, such as its area, not negative; by default all alike
    n_starts : int
        number of iterations, of which the one with the least sum of squared distances is the result

    Returns
    -------
    (n,) int64 array
        numbers of the clusters 0, 1, 2 …, each of which has a point

    References
    ----------
    D. Arthur, S. Vassilvitskii, "k-means++: the advantages of careful seeding", 2007

    Examples
    --------
    >>> points = np.array([[0.0], [0.1], [5.0], [5.1]])
    >>> labels = k_means(points, 2, np.random.default_rng(0))
    >>> labels[0] == labels[1], labels[2] == labels[3], len(set(labels.tolist()))
    (np.True_, np.True_, 2)
    """
    points = np.asarray(points, np.float64)
    weights = np.ones(len(points)) if weights is None else np.asarray(weights, np.float64)
    if not weights.sum() > 0:
        weights = np.ones(len(points))
    points = points - np.average(points, axis=0, weights=weights)
    best, least = np.zeros(len(points), dtype=np.int64), np.inf
    for _ in range(n_starts):
        labels, cost = _lloyd(points, weights, _seeds(points, weights, n_clusters, rng))
        if cost < least:
            best, least = labels, cost
    return np.unique(best, return_inverse=True)[1].astype(np.int64)


def squared_distances(points: NDArray[np.float64], centres: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared distances of points (n, d) from centres (k, d): (n, k), not negative."""
    squares = (points**2).sum(axis=1)[:, None] + (centres**2).sum(axis=1) - 2 * points @ centres.T
    return np.maximum(squares, 0.0)


def _seeds(
    points: NDArray[np.float64], weights: NDArray[np.float64], n_clusters: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    """Centres drawn one by one, with probabilities in proportion to weight and squared distance from those so far."""
    chosen: list[int] = []
    chances = weights
    nearest = np.full(len(points), np.inf)
    while len(chosen) < n_clusters and (total := chances.sum()) > 0:
        chosen.append(int(rng.choice(len(points), p=chances / total)))
        nearest = np.minimum(nearest, ((points - points[chosen[-1]]) ** 2).sum(axis=1))
        chances = weights * nearest
    return points[chosen]


def _lloyd(
    points: NDArray[np.float64], weights: NDArray[np.float64], centres: NDArray[np.float64]
) -> tuple[NDArray[np.int64], float]:
    """Clusters around the nearest centre, and their weighted sum of squared distances, once no point changes."""
    labels = np.full(len(points), -1)
    everyone = np.arange(len(points))
    for _ in range(_MAX_PASSES):
        squares = squared_distances(points, centres)
        nearest = squares.argmin(axis=1)
        if (nearest == labels).all():
            break
        labels = nearest
        total = np.bincount(labels, weights, len(centres))
        sums = np.column_stack([np.bincount(labels, weights * column, len(centres)) for column in points.T])
        # A centre that has lost all its points stays where it is.
        centres = np.where(total[:, None] > 0, sums / np.where(total > 0, total, 1)[:, None], centres)
    return labels, float(weights @ squares[everyone, nearest])
