"""Which part of one shape is which of another of the same class, where no points correspond: an arm is an arm."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import linear_sum_assignment
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

if TYPE_CHECKING:
    import trimesh

    from studies.figures.views import View

# Distances decide; where these agree, as for the two arms of a person, so does the place in the picture.
PLACE_WEIGHT = 0.1
SIZE_WEIGHT = 0.5


@dataclass(frozen=True, eq=False)
class Parts:
    """What the K parts of a shape are recognised by.

    Parameters
    ----------
    distances : (K, K) float array
        along the surface between their exemplars, in square roots of its area
    remoteness : (K,) float array
        mean distance of their exemplars from all other points, in the same unit
    size : (K,) float array
        square roots of their shares of the area
    place : (K, 2) float array
        middle of each in the picture, in sizes of the shape
    """

    distances: np.ndarray
    remoteness: np.ndarray
    size: np.ndarray
    place: np.ndarray


def describe_parts(mesh: trimesh.Trimesh, labels: np.ndarray, exemplars: np.ndarray, view: View) -> Parts:
    """Measure the parts of a segmentation.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        n vertices
    labels : (n,) int array
        part of each vertex, 0 to K - 1; -1 for the background
    exemplars : (K,) int array
        vertex in the heart of each part
    view : View
        of the shape
    """
    edges = mesh.edges_unique
    lengths = mesh.edges_unique_length / np.sqrt(mesh.area)
    graph = coo_array((lengths, (edges[:, 0], edges[:, 1])), shape=(len(mesh.vertices),) * 2).tocsr()
    distance = np.atleast_2d(dijkstra(graph, directed=False, indices=exemplars))
    finite = np.isfinite(distance)
    distance = np.where(finite, distance, 2 * distance[finite].max(initial=1.0))  # of another component
    mass = np.bincount(mesh.faces.ravel(), np.repeat(mesh.area_faces / 3, 3), len(mesh.vertices))
    turned = (np.asarray(mesh.vertices) - view.centre) @ view.axes[:2].T / view.extent.max()
    weight = np.array([mass * (labels == part) for part in range(len(exemplars))])
    total = np.maximum(weight.sum(axis=1), np.finfo(float).tiny)
    return Parts(
        distances=distance[:, exemplars],
        remoteness=distance @ mass / mass.sum(),
        size=np.sqrt(total / mass.sum()),
        place=weight @ turned / total[:, None],
    )


def match_parts(reference: Parts, parts: Parts) -> np.ndarray:
    """The number that each part has in a reference.

    Parameters
    ----------
    reference, parts : Parts
        of two shapes of a class

    Returns
    -------
    (K,) int array
        for each of ``parts``, a part of the reference; those without a counterpart are numbered on from its last

    Notes
    -----
    The matching has the smallest sum of differences, among all that differ from it by an exchange of two parts.
    """
    unary = (
        np.abs(parts.remoteness[:, None] - reference.remoteness)
        + SIZE_WEIGHT * np.abs(parts.size[:, None] - reference.size)
        + PLACE_WEIGHT * np.linalg.norm(parts.place[:, None] - reference.place, axis=2)
    )
    # Square, with places for parts that have no counterpart.
    n, m = unary.shape
    size = max(n, m)
    padded = np.zeros((size, size))
    padded[:n, :m] = unary
    _, assigned = linear_sum_assignment(padded)
    best = _difference(assigned, padded, parts.distances, reference.distances)
    improved = True
    while improved:
        improved = False
        for i, j in combinations(range(size), 2):
            assigned[[i, j]] = assigned[[j, i]]
            difference = _difference(assigned, padded, parts.distances, reference.distances)
            if difference < best - 1e-9:
                best, improved = difference, True
            else:
                assigned[[i, j]] = assigned[[j, i]]
    numbers = assigned[:n].copy()
    new = numbers >= m
    numbers[new] = m + np.arange(new.sum())
    return numbers


def most_typical(all_parts: Sequence[Parts]) -> int:
    """The first of several shapes that has as many parts as most of them.

    Examples
    --------
    >>> def parts(n):
    ...     return Parts(np.zeros((n, n)), np.zeros(n), np.zeros(n), np.zeros((n, 2)))
    >>> most_typical([parts(4), parts(5), parts(5)])
    1
    """
    counts = [len(parts.size) for parts in all_parts]
    return counts.index(max(dict.fromkeys(counts), key=counts.count))


def _difference(assigned: np.ndarray, unary: np.ndarray, ours: np.ndarray, theirs: np.ndarray) -> float:
    """How much matched parts differ: each by itself, and each pair in its distance."""
    part = np.flatnonzero(assigned[: len(ours)] < len(theirs))
    other = assigned[part]
    pairs = np.abs(ours[np.ix_(part, part)] - theirs[np.ix_(other, other)]).sum() / 2
    return float(unary[part, other].sum() + pairs)
