"""Regions of the seeds that random walks reach first, merged."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from studies.segmenters._bridges import connected_dual_graph
from studies.segmenters._distances import angular_distances, check_shares, farthest_points, outermost_face
from studies.segmenters._dual_graph import DualGraph
from studies.segmenters.about import About

_LEAST = 1e-12  # of a weight relative to the mean length of edges: every face can be reached
_BLOCK = 32  # seeds for which equations are solved at a time


@dataclass(frozen=True)
class RandomWalks:
    """Each face belongs to the seed that a random walk from it most probably reaches first; then regions are merged.

    Parameters
    ----------
    n_seeds : int
        regions before merging; at least three times the number of segments are used
    convex_weight : float
        η, by which the angular distance across a convex edge is multiplied, from 0 to 1; concave edges have 1
    bandwidth : float
        σ: a walk crosses an edge with a probability in proportion to its length times exp(-d / σ), where d is the
        angular distance ``1 - cos(angle)`` relative to its mean
    merging_bandwidth : float
        as `bandwidth`, for the strength of the border between regions

    Notes
    -----
    Source: Y.-K. Lai, S.-M. Hu, R. R. Martin, P. L. Rosin, Fast Mesh Segmentation using Random Walks, SPM 2008:
    probabilities as above, with η = 0.2 and σ = 1; regions are merged in the order of the relative length of their
    common border.

    Ours: seeds are farthest points along the dual graph. Of the pairs of neighbouring regions, always that is merged
    with the largest strength of the common border / perimeter of the union / area of the smaller one, until as many
    as the method is told are left; strengths are sums of length times exp(-d / merging_bandwidth). Without the
    area, large regions swallow each other before the small ones. Components are connected by bridges, see
    `studies.segmenters._bridges`.

    Takes one sparse factorisation of the m faces, O(n_seeds m log m) for the solutions, and O(n_seeds^3) for merging;
    memory of 8 n_seeds bytes per face beside the factor.

    Rand Index error on the benchmark's second and third model of each category, with options chosen on the first ones:
    0.131 over the eleven non-rigid categories, 0.188 over all nineteen; 0.164 is published for the former (Benjamin et
    al. 2011, Table 1). Merging without regard to areas is worse than published, in trials
    with the first models.

    Examples
    --------
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(2)
    >>> np.unique(RandomWalks()(sphere.vertices, sphere.faces, n_segments=3)).tolist()
    [0, 1, 2]
    """

    n_seeds: int = 60
    convex_weight: float = 0.2
    bandwidth: float = 1.0
    merging_bandwidth: float = 3.0

    algorithm_version: ClassVar[int] = 1
    labels_of: ClassVar[str] = "faces"
    about: ClassVar[About] = About(
        title="Random walks",
        source="Lai, Hu, Martin, Rosin: Fast Mesh Segmentation using Random Walks, 2008",
        bibtex="""\
@inproceedings{lai2008fast,
  author = {Lai, Yu-Kun and Hu, Shi-Min and Martin, Ralph R. and Rosin, Paul L.},
  title = {Fast Mesh Segmentation using Random Walks},
  booktitle = {Proceedings of the ACM Symposium on Solid and Physical Modeling},
  year = {2008},
  doi = {10.1145/1364901.1364927}
}""",
    )

    def __post_init__(self) -> None:
        check_shares(self, "convex_weight")
        if self.n_seeds < 1:
            raise ValueError(f"segmenter.n_seeds is {self.n_seeds!r}: it must be at least 1")
        for name in ("bandwidth", "merging_bandwidth"):
            if not 0 < getattr(self, name) < np.inf:
                raise ValueError(f"segmenter.{name} is {getattr(self, name)!r}: it must be positive and finite")

    def __call__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64], n_segments: int) -> NDArray[np.int64]:
        """Labels of the faces.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face
        n_segments : int
            how many regions are left; as many as there are faces if these are fewer

        Returns
        -------
        (m,) int64 array

        Raises
        ------
        ValueError
            If the mesh has no faces, or if a coordinate is not finite.
        """
        graph = connected_dual_graph(vertices, faces)
        angular = angular_distances(graph, self.convex_weight)
        ways = graph.matrix(np.maximum(graph.distances, _LEAST))
        seeds, _ = farthest_points(ways, outermost_face(graph), max(self.n_seeds, 3 * n_segments))
        regions = regions_of_seeds(graph, _crossings(graph, angular, self.bandwidth), seeds)
        return merged_regions(graph, regions, _crossings(graph, angular, self.merging_bandwidth), n_segments)


def _crossings(graph: DualGraph, angular: NDArray[np.float64], bandwidth: float) -> NDArray[np.float64]:
    """How easily each edge is crossed: its length times exp(-d / bandwidth), 0 < x."""
    scale = graph.lengths.mean() if len(graph.lengths) > 0 else 1.0
    return np.maximum(graph.lengths / (scale or 1.0) * np.exp(-angular / bandwidth), _LEAST)


def regions_of_seeds(graph: DualGraph, crossings: NDArray[np.float64], seeds: NDArray[np.int64]) -> NDArray[np.int64]:
    """For each face the number of the seed that a random walk from it most probably reaches first.

    Parameters
    ----------
    graph : DualGraph
        connected
    crossings : (p,) float array
        for each pair of faces what the probability of a step between them is in proportion to, positive
    seeds : (k,) int array
        distinct faces

    Returns
    -------
    (m,) int64 array
    """
    regions = np.zeros(graph.n_faces, dtype=np.int64)
    regions[seeds] = np.arange(len(seeds))
    free = np.setdiff1d(np.arange(graph.n_faces), seeds)
    if len(free) == 0:
        return regions
    matrix = graph.matrix(crossings)
    inner = sp.diags_array(matrix.sum(axis=1)[free]) - matrix[free][:, free]
    factor = splu(inner.tocsc(), permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}, diag_pivot_thresh=0.0)
    to_seeds = matrix[free].tocsc()[:, seeds]
    best = np.full(len(free), -1.0)
    for start in range(0, len(seeds), _BLOCK):
        probabilities = factor.solve(to_seeds[:, start : start + _BLOCK].toarray())
        likeliest = probabilities.argmax(axis=1)
        probability = probabilities[np.arange(len(free)), likeliest]
        better = probability > best
        best[better] = probability[better]
        regions[free[better]] = start + likeliest[better]
    return regions


def merged_regions(
    graph: DualGraph, regions: NDArray[np.int64], strengths: NDArray[np.float64], number: int
) -> NDArray[np.int64]:
    """Labels of the faces after merging regions, see `RandomWalks`, until a number of them is left.

    Parameters
    ----------
    graph : DualGraph
        connected
    regions : (m,) int array
        labels of the faces, 0, 1, 2 …
    strengths : (p,) float array
        for each pair of faces what it adds to the strength of the border between their regions
    number : int
        how many regions are left

    Returns
    -------
    (m,) int64 array
    """
    count = int(regions.max()) + 1
    borders = _between(graph, regions, graph.lengths, count)
    strong = _between(graph, regions, strengths, count)
    areas = np.bincount(regions, graph.areas, count)
    areas = np.maximum(areas, _LEAST * areas.max() or 1.0)
    merged_into = np.arange(count)
    for _ in range(count - number):
        perimeters = borders.sum(axis=1)
        perimeter_of_union = perimeters[:, None] + perimeters - 2 * borders
        smaller = np.minimum(areas[:, None], areas)
        scores = np.where(strong > 0, strong / (np.maximum(perimeter_of_union, _LEAST) * smaller), -1.0)
        kept, gone = divmod(int(scores.argmax()), count)
        for values in (borders, strong):
            values[kept] += values[gone]
            values[:, kept] += values[:, gone]
            values[gone] = values[:, gone] = values[kept, kept] = 0
        areas[kept] += areas[gone]
        merged_into[merged_into == gone] = kept
    return np.unique(merged_into, return_inverse=True)[1].astype(np.int64)[regions]


def _between(
    graph: DualGraph, regions: NDArray[np.int64], values: NDArray[np.float64], count: int
) -> NDArray[np.float64]:
    """Sums (count, count) of the values of the pairs of faces between each two regions; 0 on the diagonal."""
    ends = regions[graph.pairs]
    ends, values = ends[ends[:, 0] != ends[:, 1]], values[ends[:, 0] != ends[:, 1]]
    sums = np.zeros((count, count))
    np.add.at(sums, tuple(ends.T), values)
    return sums + sums.T
