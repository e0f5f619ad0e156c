"""The four metrics of the Princeton Segmentation Benchmark, as the benchmark's own evaluator computes them.

X. Chen, A. Golovinskiy, T. Funkhouser, A Benchmark for 3D Mesh Segmentation, ACM Trans. Graph. 28 (3), 2009,
doi:10.1145/1531326.1531379, section 4. Where the evaluator and that text differ, this follows the evaluator:
see the Notes of `evaluate`.
"""

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from studies.metrics.contingency import contingency_table
from studies.metrics.rand_index import rand_index_error


class TriangleMesh(Protocol):
    """What `evaluate` needs of a mesh; a `trimesh.Trimesh` or a `heatwalk.LoadedMesh` has it."""

    @property
    def vertices(self) -> NDArray[np.float64]: ...

    @property
    def faces(self) -> NDArray[np.int64]: ...


def evaluate(mesh: TriangleMesh, face_labels_a: ArrayLike, face_labels_b: ArrayLike) -> dict[str, float]:
    """Compare a segmentation of a mesh with a reference segmentation of it.

    Parameters
    ----------
    mesh : vertices (n, 3), faces (m, 3)
    face_labels_a : (m,) integers, the segmentation judged
    face_labels_b : (m,) integers, the reference (a person's)

    Returns
    -------
    dict of float, all without unit and 0 for equal partitions
        cut_discrepancy : mean distance along edges from a vertex on a cut to the nearest cut of the other
            segmentation, in mean distances of the surface from its centroid. 0 where either has no cut;
            infinite where a cut lies on a component of the mesh on which the other segmentation has none.
        rand_index_error : as `studies.metrics.rand_index_error`, over faces
        missing_rate : share of the area outside the best-overlapping segment of `a`, over segments of `b`
        false_alarm_rate : the same with `a` and `b` exchanged
        hamming : the mean of these two rates
        gce, lce : global and local consistency error, by number of faces
        gce_area, lce_area : the same by area

    Raises
    ------
    ValueError
        If the labels are not integers or not one for each face.

    Notes
    -----
    All but the two rates are symmetric in `a` and `b`. In the evaluator the cut discrepancy is one mean over
    the cut vertices of both segmentations (the text: the sum of two means), and the area versions of the
    consistency errors take each face's error by areas, but average it over faces without weights. The
    evaluator's Rand Index error divides by (m - 1) / 2 rounded down, which for even m makes it too large by
    one part in m - 2; this one does not.
    """
    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces)
    a, b = np.asarray(face_labels_a), np.asarray(face_labels_b)
    for name, labels in (("face_labels_a", a), ("face_labels_b", b)):
        if labels.shape != (len(faces),):
            raise ValueError(
                f"{name} must have one label for each of the {len(faces)} faces, got the shape {labels.shape}"
            )

    corners = vertices[faces]
    areas = np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1) / 2
    by_count, by_area = contingency_table(a, b), contingency_table(a, b, areas)
    false_alarm_rate, missing_rate = (_outside_best_match(by_area, axis) for axis in (1, 0))
    gce, lce = _consistency_errors(by_count, by_count)
    gce_area, lce_area = _consistency_errors(by_area, by_count)
    return {
        "cut_discrepancy": _cut_discrepancy(vertices, faces, areas, a, b),
        "rand_index_error": rand_index_error(a, b),
        "hamming": (missing_rate + false_alarm_rate) / 2,
        "missing_rate": missing_rate,
        "false_alarm_rate": false_alarm_rate,
        "gce": gce,
        "lce": lce,
        "gce_area": gce_area,
        "lce_area": lce_area,
    }


def _outside_best_match(by_area: coo_array, axis: int) -> float:
    """Axis 1: the share of area outside the best match of each row. Axis 0: of each column."""
    # Differences a segment, so that equal segments give 0 and nothing gives less.
    outside = by_area.sum(axis=axis) - by_area.max(axis=axis).toarray().ravel()
    return float(outside.sum() / by_area.sum())


def _consistency_errors(sizes: coo_array, counts: coo_array) -> tuple[float, float]:
    """GCE and LCE, with the local refinement errors by `sizes` and their mean by `counts`."""
    errors = [
        # A segment without area counts as wholly inside the other.
        1 - np.divide(sizes.data, segment, out=np.ones(sizes.nnz), where=segment > 0)
        for segment in (sizes.sum(axis=1)[sizes.coords[0]], sizes.sum(axis=0)[sizes.coords[1]])
    ]
    n = counts.sum()
    gce = min(counts.data @ error for error in errors) / n
    lce = counts.data @ np.minimum(*errors) / n
    return float(gce), float(lce)


def _cut_discrepancy(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    areas: NDArray[np.float64],
    a: NDArray[np.integer],
    b: NDArray[np.integer],
) -> float:
    # Each side of each face as one number, sorted, so that the sides which form one edge stand together.
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    number = sides[:, 0].astype(np.int64) * len(vertices) + sides[:, 1]
    order = np.argsort(number, kind="stable")
    sides, face = sides[order], order // 3
    shared = np.diff(number[order]) == 0  # side i + 1 is the same edge as side i

    edges = sides[np.concatenate([[True], ~shared])]
    lengths = np.linalg.norm(vertices[edges[:, 0]] - vertices[edges[:, 1]], axis=1)
    graph = coo_array((lengths, edges.T), shape=(len(vertices), len(vertices))).tocsr()

    cuts, distances = [], []
    for labels in (a, b):
        cut_edges = sides[1:][shared & (np.diff(labels[face]) != 0)]
        cuts.append(np.unique(cut_edges))
        if len(cuts[-1]) == 0:
            return 0.0
        distances.append(dijkstra(graph, directed=False, indices=cuts[-1], min_only=True))
    (cut_a, cut_b), (to_a, to_b) = cuts, distances
    mean_distance = np.concatenate([to_b[cut_a], to_a[cut_b]]).mean()

    centres = vertices[faces].mean(axis=1)
    centroid = np.average(centres, axis=0, weights=areas)
    mean_radius = np.average(np.linalg.norm(centres - centroid, axis=1), weights=areas)
    return float(mean_distance / mean_radius)
