"""How far apart the cuts of two segmentations of a mesh are."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.columns import Column
from studies.metrics.metric import Comparison, Metric, TriangleMesh


def boundary_distances(
    mesh: TriangleMesh, a: ArrayLike, b: ArrayLike, points: ArrayLike | None = None
) -> NDArray[np.float64]:
    """Distances from the cuts of each of two segmentations to the nearest cut of the other.

    The cuts are the midpoints of the edges between vertices of different segments. Distances are straight, so that they
    are finite across the components of a mesh, and those of both directions are returned together.

    Parameters
    ----------
    mesh : TriangleMesh
        vertices (n, 3) and faces (m, 3)
    a, b : (p,) int array
        labels of the same vertices
    points : (p,) int array, optional
        which vertices; all by default. Edges that end at another vertex are ignored.

    Returns
    -------
    (k,) float array
        as shares of the diagonal of the bounding box of the mesh: one for each edge on a cut of `a`, then one for each
        on a cut of `b`. Empty if either has no cut.

    Raises
    ------
    ValueError
        If there is not one label for each vertex.

    References
    ----------
    A. A. Taha, A. Hanbury, Metrics for evaluating 3D medical image segmentation, BMC Medical Imaging 15, 2015,
    doi:10.1186/s12880-015-0068-x: their mean and their 95th percentile are the average distance and HD95.

    Examples
    --------
    >>> import numpy as np, trimesh
    >>> mesh = trimesh.creation.cylinder(1, segment=[[0, 0, 0], [0, 0, 4]], sections=64).subdivide().subdivide()
    >>> z = mesh.vertices[:, 2]
    >>> distances = boundary_distances(mesh, np.int64(z > 1.5), np.int64(z > 2.5))
    >>> bool(np.allclose(distances * np.linalg.norm(mesh.extents), 1))
    True
    """
    from scipy.spatial import KDTree

    vertices, faces = np.asarray(mesh.vertices, dtype=np.float64), np.asarray(mesh.faces, dtype=np.int64)
    kept = np.arange(len(vertices)) if points is None else np.asarray(points)
    labelings = [np.asarray(labels) for labels in (a, b)]
    for labels in labelings:
        if labels.shape != kept.shape:
            raise ValueError(f"there are {len(labels)} labels for {len(kept)} vertices; one per vertex is required")
    is_kept = np.isin(np.arange(len(vertices)), kept)
    sides = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    sides = sides[is_kept[sides].all(axis=1)]
    cuts = [_cut(vertices, sides, kept, labels) for labels in labelings]
    if any(len(cut) == 0 for cut in cuts):
        return np.empty(0)
    diagonal = np.linalg.norm(np.ptp(vertices[np.unique(faces)], axis=0))
    there, back = (KDTree(cuts[1 - i]).query(cuts[i])[0] for i in (0, 1))
    return np.concatenate([there, back]) / diagonal


def _cut(
    vertices: NDArray[np.float64], sides: NDArray[np.int64], kept: NDArray[np.integer], labels: NDArray[np.integer]
) -> NDArray[np.float64]:
    """The midpoints of the edges, given as sides of faces, between kept vertices of different labels."""
    label_of = np.zeros(len(vertices), dtype=np.int64)
    label_of[kept] = labels
    return vertices[np.unique(sides[np.diff(label_of[sides])[:, 0] != 0], axis=0)].mean(axis=1)


def _summary(statistic: Callable[[NDArray[np.float64]], np.floating], comparison: Comparison) -> float | None:
    """A statistic of the distances; None where a segmentation has no cut."""
    assert comparison.mesh is not None  # the metrics below need a mesh
    distances = boundary_distances(comparison.mesh, comparison.reference, comparison.labels, comparison.points)
    return float(statistic(distances)) if len(distances) else None


def _metric(name: str, heading: str, help: str, statistic: Callable[[NDArray[np.float64]], np.floating]) -> Metric:
    return Metric(
        column=Column(
            name=name,
            heading=heading,
            format=".4f",
            unit="bounding-box diagonal",
            lower_is_better=True,
            help=f"{help} from the cuts of each segmentation to the nearest cut of the other on the original mesh, "
            "over the bounding-box diagonal; missing where a segmentation has no cut.",
            compact=False,
        ),
        function=partial(_summary, statistic),
        symmetric=True,
        needs_mesh=True,
        may_be_missing=True,
    )


METRICS = (
    _metric("boundary_distance", "BD", "Boundary distance: mean distance", np.mean),
    _metric("boundary_distance_95", "BD 95", "95th percentile of the distances", partial(np.percentile, q=95)),
)
