"""Limbs around a core, found in an embedding that the pose does not change."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError

from studies.segmenters._border import cut_capacities, minimum_cut
from studies.segmenters._bridges import connected_dual_graph
from studies.segmenters._distances import check_shares, farthest_points, outermost_face
from studies.segmenters._dual_graph import DualGraph
from studies.segmenters.about import About

_LEAST_SAMPLES = 6  # of an embedding in space that has an inside
_DEPTHS = np.linspace(0.99, 0.3, 40)  # of the core's surface that are tried
_TINY = 1e-12


@dataclass(frozen=True)
class CoreExtraction:
    """The core of a surface, and the limbs around it that end in feature points. Finds their number.

    Parameters
    ----------
    n_samples : int
        faces, spread over the surface, that are embedded
    iterations : int
        of the multi-dimensional scaling
    convex_weight : float
        η, by which the angular distance across a convex edge is multiplied, from 0 to 1; concave edges have 1
    limb_share : float
        share of the area that a part outside the core has at least
    centre_share : float
        share of the area, the part of the core with the least sums of distances, that no limb reaches

    Notes
    -----
    Source: S. Katz, G. Leifman, A. Tal, Mesh segmentation using feature point and core extraction, The Visual Computer
    21 (8-10), 2005. Samples are embedded so that their distances in space are those along the surface, which the pose
    does not change, by multi-dimensional scaling (SMACOF, from the classical solution). Feature points are the samples
    on the convex hull of the embedding with a larger sum of distances to all than their neighbours. Spherical
    mirroring turns the embedding inside out; the core is what is then near the convex hull. What remains falls into
    parts, and those with feature points are limbs. Minimum cuts of the dual graph, with capacities that are least along
    concave edges, are their borders.

    Ours: samples are farthest points along the dual graph, instead of the vertices of a decimated mesh, which a mesh of
    many components does not have. The core is the smallest that separates the largest number of parts with feature
    points; too small parts do not count. A limb is cut anywhere between its part outside the core and the centre of
    the core, where edges are short: the core's surface is not exact enough for the paper's narrow band. One level; the
    paper's recursion into limbs is left out. Components are connected by bridges, see `studies.segmenters._bridges`.

    Takes O(n_samples m log m) for m faces and O(n_samples^3) for the embedding, and memory of 8 n_samples bytes per
    face.

    Rand Index error on the benchmark's second and third model of each category, with options chosen on the first ones:
    0.113 over the eleven non-rigid categories, 0.155 over all nineteen; 0.159 is published for the former (Benjamin et
    al. 2011, Table 1). With the core's surface as the border of limbs, without cuts, it is 0.27
    for the first models.

    Examples
    --------
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(2)
    >>> np.unique(CoreExtraction()(sphere.vertices, sphere.faces)).tolist()
    [0]
    """

    n_samples: int = 400
    iterations: int = 60
    convex_weight: float = 0.1
    limb_share: float = 0.01
    centre_share: float = 0.01

    algorithm_version: ClassVar[int] = 1
    labels_of: ClassVar[str] = "faces"
    about: ClassVar[About] = About(
        title="Core extraction",
        source="Katz, Leifman, Tal: Mesh segmentation using feature point and core extraction, 2005",
        bibtex="""\
@article{katz2005mesh,
  author = {Katz, Sagi and Leifman, George and Tal, Ayellet},
  title = {Mesh segmentation using feature point and core extraction},
  journal = {The Visual Computer},
  volume = {21},
  number = {8-10},
  year = {2005},
}""",
    )

    def __post_init__(self) -> None:
        check_shares(self, "convex_weight", "limb_share", "centre_share")
        if self.n_samples < _LEAST_SAMPLES:
            raise ValueError(f"segmenter.n_samples is {self.n_samples!r}: it must be at least {_LEAST_SAMPLES}")
        if self.iterations < 0:
            raise ValueError(f"segmenter.iterations is {self.iterations!r}: it must be at least 0")

    def __call__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """Labels of the faces.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face

        Returns
        -------
        (m,) int64 array
            0 for the core, then the limbs

        Raises
        ------
        ValueError
            If the mesh has no faces, or if a coordinate is not finite.
        """
        graph = connected_dual_graph(vertices, faces)
        labels = np.zeros(graph.n_faces, dtype=np.int64)
        samples, cells, distances = _sampled(graph, self.n_samples)
        if len(samples) < _LEAST_SAMPLES:
            return labels
        areas = np.bincount(cells, graph.areas, len(samples)).astype(np.float64)
        remoteness = distances @ areas
        points = embedded(distances, self.iterations)
        points -= np.average(points, axis=0, weights=areas if areas.any() else None)
        neighbours = _neighbours(graph, cells, len(samples))
        features = feature_points(points, remoteness, neighbours)
        limbs = limbs_outside_core(neighbours, core_depths(points), features, areas, self.limb_share * areas.sum())
        centre = _centre(limbs == 0, remoteness, areas, self.centre_share)
        capacities = cut_capacities(graph, self.convex_weight)
        for limb in range(1, int(limbs.max()) + 1):
            rest = centre | (limbs > 0) & (limbs != limb)
            labels[minimum_cut(graph, capacities, (limbs == limb)[cells], rest[cells])] = limb
        return np.unique(labels, return_inverse=True)[1].astype(np.int64)


def _sampled(graph: DualGraph, number: int) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64]]:
    """Sampled faces (k,), for each face the number of the nearest one (m,), and the distances between them (k, k)."""
    ways = graph.matrix(np.maximum(graph.distances, _TINY))
    samples, to_faces = farthest_points(ways, outermost_face(graph), number)
    between = to_faces[:, samples]
    return samples, to_faces.argmin(axis=0).astype(np.int64), (between + between.T) / 2


def embedded(distances: NDArray[np.float64], iterations: int) -> NDArray[np.float64]:
    """Points in space whose distances are like given ones: SMACOF, from the classical multi-dimensional scaling.

    Parameters
    ----------
    distances : (k, k) float array
        symmetric
    iterations : int
        Guttman transforms

    Returns
    -------
    (k, 3) float array
    """
    squares = distances**2
    centred = squares.mean(axis=0) + squares.mean(axis=1)[:, None] - squares - squares.mean()
    values, vectors = np.linalg.eigh(centred / 2)
    points = vectors[:, -3:] * np.sqrt(np.maximum(values[-3:], 0))
    for _ in range(iterations):
        x, y, z = (np.subtract.outer(along, along) ** 2 for along in points.T)
        actual = np.sqrt(x + y + z)
        ratios = np.where(actual > _TINY, distances / np.maximum(actual, _TINY), 0.0)
        points = (ratios.sum(axis=1)[:, None] * points - ratios @ points) / len(points)
    return np.asarray(points, dtype=np.float64)


def feature_points(
    points: NDArray[np.float64], remoteness: NDArray[np.float64], neighbours: sp.csr_array
) -> NDArray[np.int64]:
    """The points on the convex hull that are more remote than each of their neighbours.

    Parameters
    ----------
    points : (k, 3) float array
        embedded samples
    remoteness : (k,) float array
        sums of distances
    neighbours : (k, k) sparse array
        adjacency of the samples

    Returns
    -------
    (f,) int64 array
    """
    edges = neighbours.tocoo()
    largest = np.full(len(points), -np.inf)
    np.maximum.at(largest, edges.coords[0], remoteness[edges.coords[1]])
    hull = _hull(points)
    on_hull = np.arange(len(points)) if hull is None else np.sort(hull.vertices)
    return on_hull[remoteness[on_hull] > largest[on_hull]].astype(np.int64)


def core_depths(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """How near to the convex hull each point is once all are mirrored at a sphere around the origin.

    Parameters
    ----------
    points : (k, 3) float array
        embedded samples, around the origin

    Returns
    -------
    (k,) float array
        distance from the origin as a share of that of the hull in the same direction: 1 on the hull, the core's surface
    """
    radii = np.linalg.norm(points, axis=1)
    largest = radii.max()
    radii = np.maximum(radii, 1e-6 * largest)
    directions = points / np.maximum(radii, _TINY)[:, None]
    mirrored = 2 * largest - radii
    hull = _hull(directions * mirrored[:, None])
    if hull is None:
        return np.ones(len(points))
    slopes = directions @ hull.equations[:, :3].T
    with np.errstate(divide="ignore", invalid="ignore"):
        ways = np.where(slopes > _TINY, -hull.equations[:, 3] / slopes, np.inf).min(axis=1)
    return mirrored / np.maximum(ways, _TINY)


def limbs_outside_core(
    neighbours: sp.csr_array,
    depths: NDArray[np.float64],
    features: NDArray[np.int64],
    areas: NDArray[np.float64],
    least_area: float,
) -> NDArray[np.int64]:
    """Connected parts with feature points outside the core, which is the smallest that separates most of them.

    Parameters
    ----------
    neighbours : (k, k) sparse array
        adjacency of the samples
    depths : (k,) float array
        as `core_depths` returns them; the core are the samples from some depth on
    features : (f,) int array
        feature points
    areas : (k,) float array
        of the samples
    least_area : float
        of a part

    Returns
    -------
    (k,) int64 array
        0 for the core and for other parts; then 1, 2 …
    """
    best = np.zeros(len(depths), dtype=np.int64)
    for depth in _DEPTHS:
        outside = np.flatnonzero(depths < depth)
        parts = connected_components(neighbours[outside][:, outside], directed=False)[1]
        found = np.unique(parts[np.isin(outside, features)])
        found = found[np.bincount(parts, areas[outside])[found] >= least_area]
        if len(found) > best.max():
            best[:] = 0
            best[outside] = (parts[:, None] == found) @ np.arange(1, len(found) + 1)
    return best


def _centre(
    is_core: NDArray[np.bool_], remoteness: NDArray[np.float64], areas: NDArray[np.float64], share: float
) -> NDArray[np.bool_]:
    """The least remote samples of the core (k,) that have a share of all area, at least one."""
    order = np.argsort(np.where(is_core, remoteness, np.inf), kind="stable")
    before = np.concatenate([[0.0], np.cumsum(areas[order])[:-1]])
    centre = np.zeros(len(areas), dtype=bool)
    centre[order] = before < share * areas.sum()
    centre[order[0]] = True
    return centre & is_core


def _neighbours(graph: DualGraph, cells: NDArray[np.int64], count: int) -> sp.csr_array:
    """Which samples have adjacent cells: a symmetric sparse matrix (count, count)."""
    ends = cells[graph.pairs]
    first, second = ends[ends[:, 0] != ends[:, 1]].T
    rows, columns = np.concatenate([first, second]), np.concatenate([second, first])
    return sp.csr_array(sp.coo_array((np.ones(len(rows)), (rows, columns)), (count, count)))


def _hull(points: NDArray[np.float64]) -> ConvexHull | None:
    """The convex hull, of joggled points if they are in a plane; None if there is none even so."""
    for options in ("Qt", "QJ"):
        try:
            return ConvexHull(points, qhull_options=options)
        except QhullError:
            continue
    return None
