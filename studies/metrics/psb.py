"""The four metrics of the Princeton Segmentation Benchmark, as the benchmark's own evaluator computes them.

X. Chen, A. Golovinskiy, T. Funkhouser, A Benchmark for 3D Mesh Segmentation, ACM Trans. Graph. 28 (3), 2009,
doi:10.1145/1531326.1531379, section 4. Where the evaluator differs from that text, this module follows the
evaluator: see the Notes of `evaluate`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heatwalk.meshes import face_areas
from studies.columns import Column
from studies.metrics.contingency import Cells, numbered
from studies.metrics.metric import TriangleMesh
from studies.metrics.rand_index import error_of_counts
from studies.metrics.rand_index import rand_index_error as rand_index_error  # one of the benchmark's metrics, too


def _column(name: str, heading: str, help: str) -> Column:
    """A column of the benchmark: a number without unit, 0 for equal segmentations."""
    return Column(name=name, heading=heading, format=".3f", lower_is_better=True, help=help)


#: Columns of the values of `evaluate`, in its order.
COLUMNS: tuple[Column, ...] = (
    _column(
        "cut_discrepancy",
        "CD",
        "Cut discrepancy: mean distance from a cut to the nearest cut of the other segmentation, relative to the mean "
        "distance of the surface from its centroid.",
    ),
    _column("rand_index_error", "RI", "Rand Index error: share of pairs of faces on which the segmentations disagree."),
    _column("hamming", "HD", "Hamming distance: mean of missing rate and false alarm rate."),
    _column(
        "missing_rate",
        "missing rate",
        "Share of the area outside the best-overlapping computed segment, over the reference segments.",
    ),
    _column(
        "false_alarm_rate",
        "false alarm rate",
        "Share of the area outside the best-overlapping reference segment, over the computed segments.",
    ),
    _column("gce", "GCE", "Global consistency error, by number of faces: refinement in one direction is free."),
    _column("lce", "LCE", "Local consistency error, by number of faces: refinement in any direction is free."),
    _column("gce_area", "GCE area", "Global consistency error, by area."),
    _column("lce_area", "LCE area", "Local consistency error, by area."),
)

#: Names of the five metrics that the benchmark's publication and its tables show.
MAIN = ("cut_discrepancy", "rand_index_error", "hamming", "gce", "lce")


def evaluate(mesh: TriangleMesh, face_labels_a: ArrayLike, face_labels_b: ArrayLike) -> dict[str, float]:
    """Compare a segmentation of a mesh with a reference segmentation of it.

    Parameters
    ----------
    mesh : TriangleMesh
        vertices (n, 3) and faces (m, 3)
    face_labels_a : (m,) int array
        the segmentation to be judged
    face_labels_b : (m,) int array
        the reference segmentation, by a person

    Returns
    -------
    dict of str to float
        The values of `COLUMNS`, in their order, all without unit and 0 for equal partitions:

        cut_discrepancy
            mean distance along edges from a vertex on a cut to the nearest cut of the other segmentation, in mean
            distances of the surface from its centroid; 0 if either has no cut, infinite if a cut belongs to a
            component of the mesh on which the other segmentation has none
        rand_index_error
            as `studies.metrics.rand_index_error`, over faces
        hamming
            mean of the following two rates
        missing_rate
            share of the area outside the best-overlapping segment of `a`, over segments of `b`
        false_alarm_rate
            the same with `a` and `b` exchanged
        gce, lce
            global and local consistency error, by number of faces
        gce_area, lce_area
            the same by area

    Raises
    ------
    ValueError
        If the labels are not integers or not one per face.

    Notes
    -----
    All but the two rates are symmetric in `a` and `b`. In the evaluator the cut discrepancy is one mean over
    the cut vertices of both segmentations (the text: the sum of two means), and the area versions of the
    consistency errors weight a face's error by areas, but average it over faces without weights. The
    evaluator's Rand Index error divides by (m - 1) / 2 rounded down, which for even m makes it too large by
    one part in m - 2; this one does not.

    Examples
    --------
    >>> import numpy as np, trimesh
    >>> box = trimesh.creation.box()
    >>> halves, whole = np.arange(12) // 6, np.zeros(12, int)
    >>> values = evaluate(box, halves, whole)
    >>> round(values["hamming"], 3), values["missing_rate"], values["gce"]
    (0.25, 0.5, 0.0)
    """
    return Evaluator(mesh, [np.asarray(face_labels_b)], name="face_labels_b").evaluate(face_labels_a)[0]


class Evaluator:
    """Several reference segmentations of a mesh, with which others are compared as by `evaluate`.

    What depends on the mesh or on the references alone is computed once, so that a comparison with all references costs
    little more than one with a single reference.

    Parameters
    ----------
    mesh : TriangleMesh
        vertices (n, 3) and faces (m, 3)
    references : sequence of (m,) int array
        labels of the faces
    name : str
        what messages call the references

    Raises
    ------
    ValueError
        If the labels are not integers or not one per face.

    Examples
    --------
    >>> import numpy as np, trimesh
    >>> box = trimesh.creation.box()
    >>> halves, whole = np.arange(12) // 6, np.zeros(12, int)
    >>> [values["hamming"] for values in Evaluator(box, [halves, whole]).evaluate(halves)]
    [0.0, 0.25]
    """

    def __init__(
        self, mesh: TriangleMesh, references: Sequence[NDArray[np.integer]], *, name: str = "references"
    ) -> None:
        vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
        self._areas = face_areas(vertices, faces)
        self._cuts = _Cuts(vertices, faces, self._areas)
        self._references = [np.asarray(labels) for labels in references]
        for labels in self._references:
            self._check(labels, name)

    @cached_property
    def _reference_cuts(self) -> list[_Cut]:
        return [self._cuts.of(labels) for labels in self._references]

    @cached_property
    def _numbered_references(self) -> list[tuple[NDArray[np.int64], int]]:
        return [numbered(labels) for labels in self._references]

    def evaluate(self, face_labels: ArrayLike) -> list[dict[str, float]]:
        """The values of `COLUMNS` of a segmentation for each reference, as `evaluate` returns them.

        Parameters
        ----------
        face_labels : (m,) int array
            the segmentation to be judged

        Raises
        ------
        ValueError
            If the labels are not integers or not one per face.
        """
        labels = np.asarray(face_labels)
        self._check(labels, "face_labels_a")
        cut, own = self._cuts.of(labels), numbered(labels)
        return [
            {"cut_discrepancy": self._cuts.discrepancy(cut, reference_cut)} | self._overlap(Cells.of(own, reference))
            for reference, reference_cut in zip(self._numbered_references, self._reference_cuts, strict=True)
        ]

    def _overlap(self, cells: Cells) -> dict[str, float]:
        """The values that depend on how segments overlap, and not on where their cuts are."""
        by_count, by_area = _Overlap(cells, cells.counts), _Overlap(cells, cells.totals(self._areas))
        false_alarm_rate, missing_rate = by_area.outside_best_matches()
        gce, lce = _consistency_errors(by_count, by_count)
        gce_area, lce_area = _consistency_errors(by_area, by_count)
        rows, columns = by_count.rows.astype(np.int64), by_count.columns.astype(np.int64)
        return {
            "rand_index_error": error_of_counts(cells.counts, rows, columns),
            "hamming": (missing_rate + false_alarm_rate) / 2,
            "missing_rate": missing_rate,
            "false_alarm_rate": false_alarm_rate,
            "gce": gce,
            "lce": lce,
            "gce_area": gce_area,
            "lce_area": lce_area,
        }

    def _check(self, labels: NDArray[Any], name: str) -> None:
        if labels.shape != self._areas.shape:
            raise ValueError(
                f"{name} must have one label for each of the {len(self._areas)} faces, got the shape {labels.shape}"
            )
        if labels.dtype.kind not in "iu":
            raise ValueError(f"{name} must hold integers, got {labels.dtype}")


class _Overlap:
    """How large the intersections of the segments of two segmentations are, by number of faces or by area."""

    def __init__(self, cells: Cells, sizes: NDArray[Any]) -> None:
        self.cells, self.sizes = cells, sizes
        self.rows, self.columns = cells.row_sums(sizes), cells.column_sums(sizes)
        self.total = sizes.sum()

    def outside_best_matches(self) -> tuple[float, float]:
        """The share of the total outside the best match of each row, and of each column."""
        shares = []
        for sums, index in ((self.rows, self.cells.row), (self.columns, self.cells.column)):
            best = np.zeros(len(sums))
            np.maximum.at(best, index, self.sizes)
            # Subtracted per segment, so that the result is exactly 0 for equal segments and never negative.
            shares.append(float((sums - best).sum() / self.total))
        return shares[0], shares[1]


def _consistency_errors(sizes: _Overlap, counts: _Overlap) -> tuple[float, float]:
    """GCE and LCE: local refinement errors computed from ``sizes``, their mean weighted by ``counts``."""
    errors = [
        # A segment without area counts as entirely inside the other.
        1 - np.divide(sizes.sizes, segment, out=np.ones(len(segment)), where=segment > 0)
        for segment in (sizes.rows[sizes.cells.row], sizes.columns[sizes.cells.column])
    ]
    gce = min(counts.sizes @ error for error in errors) / counts.total
    lce = counts.sizes @ np.minimum(*errors) / counts.total
    return float(gce), float(lce)


@dataclass(frozen=True)
class _Cut:
    """The vertices on the cuts of a segmentation, and the distance of every vertex from the nearest of them."""

    vertices: NDArray[np.int64]
    distance: NDArray[np.float64]


class _Cuts:
    """The cuts of segmentations of one mesh, and distances along its edges."""

    def __init__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64], areas: NDArray[np.float64]) -> None:
        from scipy.sparse import coo_array

        # Each side of each face as one number, sorted, so that the sides that form one edge are adjacent.
        sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
        number = sides[:, 0].astype(np.int64) * len(vertices) + sides[:, 1]
        order = np.argsort(number, kind="stable")
        self._sides, self._face = sides[order], order // 3
        self._shared = np.diff(number[order]) == 0  # side i + 1 is the same edge as side i

        edges = self._sides[np.concatenate([[True], ~self._shared])]
        lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
        self._graph = coo_array((lengths, edges.T), shape=(len(vertices), len(vertices))).tocsr()
        self._mean_radius = _mean_radius(vertices, faces, areas)

    def of(self, labels: NDArray[np.integer]) -> _Cut:
        """The cuts of a segmentation of the faces."""
        from scipy.sparse.csgraph import dijkstra

        vertices = np.unique(self._sides[1:][self._shared & (np.diff(labels[self._face]) != 0)])
        if len(vertices) == 0:
            return _Cut(vertices, np.empty(0))
        return _Cut(vertices, dijkstra(self._graph, directed=False, indices=vertices, min_only=True))

    def discrepancy(self, a: _Cut, b: _Cut) -> float:
        """Mean distance between the cuts of two segmentations, relative to the mean radius of the surface."""
        if len(a.vertices) == 0 or len(b.vertices) == 0:
            return 0.0
        mean_distance = np.concatenate([b.distance[a.vertices], a.distance[b.vertices]]).mean()
        return float(mean_distance / self._mean_radius)


def _mean_radius(vertices: NDArray[np.float64], faces: NDArray[np.int64], areas: NDArray[np.float64]) -> float:
    """Mean distance of the surface from its centroid."""
    centres = vertices[faces].mean(axis=1)
    centroid = np.average(centres, axis=0, weights=areas)
    return float(np.average(np.linalg.norm(centres - centroid, axis=1), weights=areas))
