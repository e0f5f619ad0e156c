"""Randomized cuts: many random cuts of each segment, and the one that most of them agree with."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from studies.segmenters._boundaries import moved_to_cheapest, without_islands
from studies.segmenters._cut_costs import cut_costs, large_components, number_of_regions, regularised_areas
from studies.segmenters._dual_graph import DualGraph
from studies.segmenters._merging import merge_by_normalised_cut
from studies.segmenters._orientation import outward
from studies.segmenters._random import random_generator
from studies.segmenters._unit_size import unit_size
from studies.segmenters.about import About
from studies.segmenters.normalized_cuts import NormalizedCuts

# What a difference between unit normals counts, in units of the size of the mesh, in the search for the nearest face:
# without it a face would find the other side of a thin part.
_NORMAL = 0.05
# How much worse than its rivals a cut may be that every random cut agrees with, see `RandomizedCuts`.
_INCONSISTENCY = 1.2
# Faces that a component keeps at least when it is decimated, and the share of the area below which a piece of it that
# decimation has broken off is ignored.
_FEWEST, _SMALLEST_PIECE = 100, 1e-3
# How far a border moves when it is carried to the mesh, in units of the mean distance of coarse faces.
_REACH = 2.0
_TINY = np.finfo(float).tiny


@dataclass(frozen=True)
class RandomizedCuts:
    """Segments are cut in two, one after the other, where many random cuts agree that it costs little.

    Parameters
    ----------
    n_cuts : int
        random segmentations of each segment
    n_faces : int
        the mesh is decimated to about this many faces
    max_regions : int
        the most regions of a random segmentation, each of which cut off is a candidate
    concavity_exponent : float
        an edge with the exterior dihedral angle θ costs its length times w = min((θ / π)^concavity_exponent, 1), so
        that concave edges are cheap to cut
    least_cost : float
        w is raised to (w + least_cost) / (1 + least_cost), so that sharp creases are not free
    cost_noise, area_noise : float
        standard deviations of the normal distributions by whose exponentials the costs of the edges, and the areas of
        the faces, are multiplied in each random segmentation
    regularisation : float
        share of the mean area of a face that is added to the area of each

    Notes
    -----
    Source: A. Golovinskiy, T. Funkhouser, Randomized Cuts for 3D Mesh Analysis, 2008. From the paper: the mesh is
    decimated; random segmentations of a segment, here by hierarchical clustering as in `NormalizedCuts`, give each edge
    a consistency, the share of them that cut it; the consistency of a cut is the mean of its edges', by length;
    borders are carried to the mesh and moved, by a minimum cut, to where they cost least.

    Ours: how the clustering is randomised; a cut is chosen, and the next segment to be cut, by the least
    (cost / area of one side + cost / area of the other) (1.2 - consistency), where the paper takes the most consistent
    cut of a segment; `least_cost`; and what happens to several components and to faces that are turned over, as in
    `NormalizedCuts`.

    Rand Index error, as the mean over the second and third model of each category of the Princeton Segmentation
    Benchmark's development half (the parameters were chosen on the first): 0.106 over the eleven non-rigid categories
    (22 models) and 0.121 over all nineteen (38); the Heat Walk's paper prints 0.093 for the authors' program, without
    naming the models. Single models differ by up to 0.1 with other random numbers.

    The random numbers are seeded by the mesh. Time grows with n_cuts · n_faces, and for meshes of more faces in
    proportion to these.

    Examples
    --------
    >>> import trimesh
    >>> balls = [trimesh.creation.icosphere(2).apply_translation([x, 0, 0]) for x in (0, 3)]
    >>> both = trimesh.util.concatenate(balls)
    >>> np.unique(RandomizedCuts()(both.vertices, both.faces, n_segments=2), return_counts=True)[1].tolist()
    [320, 320]
    """

    n_cuts: int = 20
    n_faces: int = 4000
    max_regions: int = 4
    concavity_exponent: float = 10.0
    least_cost: float = 0.1
    cost_noise: float = 0.5
    area_noise: float = 0.5
    regularisation: float = 0.1

    algorithm_version: ClassVar[int] = 1
    labels_of: ClassVar[str] = "faces"
    about: ClassVar[About] = About(
        title="Randomized cuts",
        source=NormalizedCuts.about.source,
        bibtex=NormalizedCuts.about.bibtex,
        seeded=True,
    )

    def __post_init__(self) -> None:
        for name, least in (("n_cuts", 1), ("n_faces", 100), ("max_regions", 2)):
            value = getattr(self, name)
            if not (isinstance(value, int) and value >= least):
                raise ValueError(f"segmenter.{name} is {value!r}: it must be an integer of at least {least}")
        for name in ("concavity_exponent", "least_cost", "cost_noise", "area_noise", "regularisation"):
            value = getattr(self, name)
            if not 0 <= value < np.inf:
                raise ValueError(f"segmenter.{name} is {value!r}: it must be at least 0 and finite")

    def __call__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64], n_segments: int) -> NDArray[np.int64]:
        """Labels of the faces.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face
        n_segments : int
            how many segments

        Returns
        -------
        (m,) int64 array

        Raises
        ------
        ValueError
            If there are no faces, a coordinate is not finite, or `n_segments` is below 1.
        """
        rng = random_generator(vertices, faces)
        vertices = unit_size(vertices, faces)
        faces = outward(vertices, faces)
        graph = DualGraph.of(vertices, faces)
        component, n_regions = graph.components(), number_of_regions(graph, n_segments)
        if component.max() + 1 >= n_regions:
            return component
        is_large = large_components(graph)
        coarse = self._decimated(vertices, faces, np.where(is_large[component], component, -1))
        n_regions -= int(np.count_nonzero(~is_large))
        coarse = coarse.with_largest_pieces(n_regions)
        labels = self._cut(coarse, n_regions, rng)
        labels = without_islands(graph, coarse.carried(labels, graph, component))
        spacing = coarse.graph.distances.sum() / max(len(coarse.graph.pairs), 1)
        labels = moved_to_cheapest(graph, self._costs(graph), labels, reach=_REACH * spacing)
        return np.unique(without_islands(graph, labels), return_inverse=True)[1]

    def _costs(self, graph: DualGraph) -> NDArray[np.float64]:
        """What it costs to separate each pair of faces."""
        return cut_costs(graph, self.concavity_exponent, self.least_cost)

    def _decimated(
        self, vertices: NDArray[np.float64], faces: NDArray[np.int64], component: NDArray[np.int64]
    ) -> _Coarse:
        """The components decimated one by one, except those numbered -1."""
        points, triangles, origin = [], [], []
        n_points, share = 0, self.n_faces / max(int(np.count_nonzero(component >= 0)), 1)
        for number in np.unique(component[component >= 0]):
            part = faces[component == number]
            new_vertices, new_faces = _simplified(vertices, part, max(_FEWEST, round(share * len(part))))
            triangles.append(new_faces + n_points)
            points.append(new_vertices)
            n_points += len(new_vertices)
            origin.append(np.full(len(new_faces), number))
        return _Coarse(DualGraph.of(np.concatenate(points), np.concatenate(triangles)), np.concatenate(origin))

    def _cut(self, coarse: _Coarse, n_regions: int, rng: np.random.Generator) -> NDArray[np.int64]:
        """Labels of the coarse faces, from cuts of which each gives one side of a segment a new label."""
        costs, areas = self._costs(coarse.graph), regularised_areas(coarse.graph, self.regularisation)
        labels = coarse.graph.components()
        best = [self._best_cut(coarse.graph, costs, areas, labels == label, rng) for label in range(labels.max() + 1)]
        while len(best) < n_regions:
            label = min(range(len(best)), key=lambda label: best[label][0])
            value, side = best[label]
            if value == np.inf:
                break
            labels[side] = len(best)
            best.append((np.inf, side))
            for changed in (label, len(best) - 1):
                best[changed] = self._best_cut(coarse.graph, costs, areas, labels == changed, rng)
        return labels

    def _best_cut(
        self,
        graph: DualGraph,
        costs: NDArray[np.float64],
        areas: NDArray[np.float64],
        is_inside: NDArray[np.bool_],
        rng: np.random.Generator,
    ) -> tuple[float, NDArray[np.int64]]:
        """The best of random cuts of a segment: its value, and the faces on one side of it."""
        inside, edges = np.flatnonzero(is_inside), np.flatnonzero(is_inside[graph.pairs].all(axis=1))
        pairs, costs = np.searchsorted(inside, graph.pairs[edges]), costs[edges]
        lengths, areas = graph.lengths[edges], areas[inside]
        candidates: list[NDArray[np.bool_]] = []
        consistency = np.zeros(len(edges))
        for regions in self._random_segmentations(pairs, costs, areas, rng):
            consistency += regions[pairs[:, 0]] != regions[pairs[:, 1]]
            candidates += _bipartitions(pairs, regions)
        best, side = np.inf, inside
        for is_side in candidates:
            is_cut = is_side[pairs[:, 0]] != is_side[pairs[:, 1]]
            cost, area = costs[is_cut].sum(), areas[is_side].sum()
            agreement = np.average(consistency[is_cut], weights=np.maximum(lengths[is_cut], _TINY)) / self.n_cuts
            value = (cost / area + cost / (areas.sum() - area)) * (_INCONSISTENCY - agreement)
            if value < best:
                best, side = value, inside[is_side]
        return best, side

    def _random_segmentations(
        self, pairs: NDArray[np.int64], costs: NDArray[np.float64], areas: NDArray[np.float64], rng: np.random.Generator
    ) -> Iterator[NDArray[np.int64]]:
        """Random segmentations of a segment into a few regions."""
        for _ in range(self.n_cuts):
            yield merge_by_normalised_cut(
                pairs,
                costs * np.exp(self.cost_noise * rng.normal(size=len(costs))),
                areas * np.exp(self.area_noise * rng.normal(size=len(areas))),
                int(rng.integers(2, self.max_regions + 1)),
            )


@dataclass(frozen=True)
class _Coarse:
    """The dual graph of a decimated mesh, and for each of its faces the component of the mesh that it comes from."""

    graph: DualGraph
    origin: NDArray[np.int64]

    def with_largest_pieces(self, n_pieces: int) -> _Coarse:
        """Without small pieces that decimation has broken off: a piece per component, then the largest, are left."""
        piece = self.graph.components()
        areas, origin = np.bincount(piece, self.graph.areas), np.zeros(piece.max() + 1, dtype=np.int64)
        origin[piece] = self.origin
        order = np.argsort(-areas, kind="stable")
        first = order[np.unique(origin[order], return_index=True)[1]]
        others = order[~np.isin(order, first) & (areas[order] >= _SMALLEST_PIECE * areas.sum())]
        kept = np.isin(piece, np.concatenate([first, others[: n_pieces - len(first)]]))
        return self if kept.all() else _Coarse(_subgraph(self.graph, kept), self.origin[kept])

    def carried(self, labels: NDArray[np.int64], graph: DualGraph, component: NDArray[np.int64]) -> NDArray[np.int64]:
        """Labels of the faces of the mesh: that of the nearest coarse face of the same component, or one of its own."""
        carried = component + labels.max() + 1
        for number in np.unique(self.origin):
            coarse, fine = self.origin == number, np.flatnonzero(component == number)
            carried[fine] = labels[coarse][cKDTree(_places(self.graph)[coarse]).query(_places(graph)[fine])[1]]
        return carried


def _subgraph(graph: DualGraph, kept: NDArray[np.bool_]) -> DualGraph:
    """The dual graph of some of the faces."""
    number, is_pair = np.cumsum(kept) - 1, kept[graph.pairs].all(axis=1)
    of_faces = {name: getattr(graph, name)[kept] for name in ("areas", "centres", "normals")}
    of_pairs = {name: getattr(graph, name)[is_pair] for name in ("edges", "lengths", "angles", "distances")}
    return DualGraph(int(kept.sum()), pairs=number[graph.pairs[is_pair]], **of_faces, **of_pairs)


def _places(graph: DualGraph) -> NDArray[np.float64]:
    """Where faces are and what they face: (m, 6)."""
    return np.concatenate([graph.centres, _NORMAL * graph.normals], axis=1)


def _simplified(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], n_faces: int
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """A mesh decimated to about a number of faces, or as it is if it has no more or nothing would be left of it."""
    used, renumbered = np.unique(faces, return_inverse=True)
    vertices, faces = vertices[used], renumbered.reshape(-1, 3)
    if len(faces) <= n_faces:
        return vertices, faces
    import fast_simplification

    points, triangles = fast_simplification.simplify(
        vertices.astype(np.float32), faces.astype(np.int32), target_count=n_faces
    )
    return (points.astype(float), triangles.astype(np.int64)) if len(triangles) else (vertices, faces)


def _bipartitions(pairs: NDArray[np.int64], regions: NDArray[np.int64]) -> Iterator[NDArray[np.bool_]]:
    """Each of a few connected regions, if all others together are connected too; if there are two, only one."""
    number = int(regions.max()) + 1
    touching = np.eye(number)
    first, second = regions[pairs].T
    touching[first, second] = touching[second, first] = 1
    for region in range(number if number > 2 else number - 1):
        others = np.delete(np.arange(number), region)
        if (np.linalg.matrix_power(touching[np.ix_(others, others)], number) > 0).all():
            yield regions == region
