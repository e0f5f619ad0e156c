"""Clusters of faces around representative faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from studies.segmenters._bridges import connected_dual_graph
from studies.segmenters._distances import (
    check_shares,
    distances_from,
    farthest_points,
    katz_tal_weights,
    outermost_face,
)
from studies.segmenters.about import About


@dataclass(frozen=True)
class KMeans:
    """Clusters of the faces nearest to one of k representative faces, each of which is the medoid of its cluster.

    Parameters
    ----------
    geodesic_share : float
        δ, the weight of lengths in the distance between adjacent faces, from 0 to 1; angles have the rest
    convex_weight : float
        η, by which the angular distance across a convex edge is multiplied, from 0 to 1; concave edges have 1
    iterations : int
        assignments at most, if representatives still move
    n_samples : int
        faces to which the distances in a cluster are added up

    Notes
    -----
    Source: S. Shlafman, A. Tal, S. Katz, Metamorphosis of Polyhedral Surfaces using Decomposition, Computer Graphics
    Forum 21 (3), 2002. The distance between faces is that of the shortest path in the dual graph, with the weights of
    Katz and Tal (2003): see `studies.segmenters._distances.katz_tal_weights`. The first representative is the face with
    the least sum of distances to all, each next one is the farthest from those before it; then faces are assigned
    to the nearest representative, and the face of each cluster with the least sum of distances to it becomes its
    representative, until none moves.

    Ours: η = 0.1 (the paper does not tell concave from convex edges) and δ = 0.5; faces count by area; and the sums of
    distances are over samples, each of which stands for the area nearest to it, because those over all pairs of faces
    need their square in time and memory. Components are connected by bridges, see `studies.segmenters._bridges`.

    Takes O(n_samples m log m) for m faces, and memory of 8 n_samples bytes per face.

    Rand Index error on the benchmark's second and third model of each category, with options chosen on the first ones:
    0.161 over the eleven non-rigid categories, 0.235 over all nineteen; 0.161 is published for the former (Benjamin et
    al. 2011, Table 1). How that implementation weighs edges is not known.

    Examples
    --------
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(2)
    >>> np.unique(KMeans()(sphere.vertices, sphere.faces, n_segments=3)).tolist()
    [0, 1, 2]
    """

    geodesic_share: float = 0.5
    convex_weight: float = 0.1
    iterations: int = 20
    n_samples: int = 200

    algorithm_version: ClassVar[int] = 1
    labels_of: ClassVar[str] = "faces"
    about: ClassVar[About] = About(
        title="K-means",
        source="Shlafman, Tal, Katz: Metamorphosis of Polyhedral Surfaces using Decomposition, 2002",
        bibtex="""\
@article{shlafman2002metamorphosis,
  author = {Shlafman, Shymon and Tal, Ayellet and Katz, Sagi},
  title = {Metamorphosis of Polyhedral Surfaces using Decomposition},
  journal = {Computer Graphics Forum},
  volume = {21},
  number = {3},
  year = {2002},
}""",
    )

    def __post_init__(self) -> None:
        check_shares(self, "geodesic_share", "convex_weight")
        for name in ("iterations", "n_samples"):
            if getattr(self, name) < 1:
                raise ValueError(f"segmenter.{name} is {getattr(self, name)!r}: it must be at least 1")

    def __call__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64], n_segments: int) -> NDArray[np.int64]:
        """Labels of the faces.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face
        n_segments : int
            how many clusters; as many as there are faces if these are fewer

        Returns
        -------
        (m,) int64 array

        Raises
        ------
        ValueError
            If the mesh has no faces, or if a coordinate is not finite.
        """
        graph = connected_dual_graph(vertices, faces)
        ways = graph.matrix(katz_tal_weights(graph, self.geodesic_share, self.convex_weight))
        samples, distances = farthest_points(ways, outermost_face(graph), self.n_samples)
        weights = np.bincount(distances.argmin(axis=0), graph.areas, len(samples)).astype(np.float64)
        representatives, to_faces = farthest_points(ways, int((weights @ distances).argmin()), n_segments)
        labels = to_faces.argmin(axis=0)
        for _ in range(self.iterations):
            moved = _medoids(labels, representatives, samples, distances, weights)
            if (moved == representatives).all():
                break
            representatives = moved
            labels = distances_from(ways, representatives).argmin(axis=0)
        return labels.astype(np.int64)


def _medoids(
    labels: NDArray[np.int64],
    representatives: NDArray[np.int64],
    samples: NDArray[np.int64],
    distances: NDArray[np.float64],
    weights: NDArray[np.float64],
) -> NDArray[np.int64]:
    """For each cluster the face with the least sum of distances to its samples; the same as before if it has none."""
    medoids = representatives.copy()
    for i in range(len(representatives)):
        inside, own = np.flatnonzero(labels == i), np.flatnonzero(labels[samples] == i)
        if len(own) > 0:
            medoids[i] = inside[(weights[own] @ distances[np.ix_(own, inside)]).argmin()]
    return medoids
