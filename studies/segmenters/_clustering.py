"""Clustering of points by k-means."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
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


def bisect(
    points: NDArray[np.float64], n_clusters: int, weights: NDArray[np.float64] | None = None
) -> NDArray[np.int64]:
    """Clusters made by bisection: 2-means of one after the other, each time that which lowers the sum of squares most.

    The iteration starts from the halves on the two sides of the mean, in the direction in which the points vary most,
    so that nothing is random.

    Parameters
    ----------
    points : (n, d) float array
    n_clusters : int
        at most so many clusters: fewer if fewer points differ
    weights : (n,) float array, optional
        how much each point counts, above 0; by default all alike

    Returns
    -------
    (n,) int64 array
        numbers of the clusters 0, 1, 2 …, each of which has a point

    References
    ----------
    D. Boley, "Principal direction divisive partitioning", 1998

    Examples
    --------
    >>> first, second, third = bisect(np.array([[0.0], [0.1], [5.0]]), 2)
    >>> first == second, second == third
    (np.True_, np.False_)
    """
    points = np.asarray(points, np.float64)
    weights = np.ones(len(points)) if weights is None else weights
    clusters = [np.arange(len(points))]
    splits = [_split(points, weights, clusters[0])]
    while len(clusters) < n_clusters:
        widest = int(np.argmax([gain for gain, _ in splits]))
        gain, parts = splits[widest]
        if gain <= 0:
            break
        clusters[widest : widest + 1] = parts
        splits[widest : widest + 1] = [_split(points, weights, part) for part in parts]
    labels = np.empty(len(points), dtype=np.int64)
    for label, members in enumerate(clusters):
        labels[members] = label
    return labels


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
    n = len(points)
    own_squares = (points**2).sum(axis=1)
    labels = np.full(n, -1)
    for _ in range(_MAX_PASSES):
        # Squared distances without the part that all centres share.
        squares = points @ (-2 * centres.T)
        squares += (centres**2).sum(axis=1)
        nearest = squares.argmin(axis=1)
        if (nearest == labels).all():
            break
        labels = nearest
        members = sp.csc_array((weights, labels, np.arange(n + 1)), (len(centres), n))
        total = np.bincount(labels, weights, len(centres))[:, None]
        # A centre that has lost all its points stays where it is.
        centres = np.where(total > 0, members @ points / np.where(total > 0, total, 1), centres)
    return labels, float(weights @ np.maximum(own_squares + squares[np.arange(n), nearest], 0.0))


def _split(
    points: NDArray[np.float64], weights: NDArray[np.float64], members: NDArray[np.int64]
) -> tuple[float, list[NDArray[np.int64]]]:
    """By how much bisecting a cluster lowers its sum of squares, 0 if its points are all the same; and its parts."""
    points, weights = points[members], weights[members]
    points = points - np.average(points, axis=0, weights=weights)
    squares = (points * weights[:, None]).T @ points
    side = points @ np.linalg.eigh(squares)[1][:, -1] > 0
    if side.all() or not side.any():
        return 0.0, [members]
    centres = np.stack([np.average(points[half], axis=0, weights=weights[half]) for half in (side, ~side)])
    labels, cost = _lloyd(points, weights, centres)
    parts = [members[labels == label] for label in (0, 1)]
    if not (len(parts[0]) and len(parts[1])):
        return 0.0, [members]
    return float(np.trace(squares)) - cost, parts
