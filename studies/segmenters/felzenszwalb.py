"""Graph-based segmentation of normals, as ScanNet over-segments its scans."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from studies.segmenters._unit_size import unit_size
from studies.segmenters.about import About


@dataclass(frozen=True)
class Felzenszwalb:
    """Vertices joined along the edges of the mesh, the most similar normals first, as long as regions are homogeneous.

    An edge joins two regions if its weight is at most w + threshold / size of each, where w is the largest weight
    inside the region and size its number of vertices. The weight is 1 − n·n', squared where the surface is convex. Then
    regions of fewer than ``min_vertices`` are joined to a neighbour, again the most similar first.

    A baseline: it looks at normals alone, and was made to over-segment rooms.

    Parameters
    ----------
    threshold : float
        preference for large regions; 0 joins only equal normals
    min_vertices : int
        the fewest vertices of a region that has neighbours

    Notes
    -----
    The algorithm is that of P. F. Felzenszwalb and D. P. Huttenlocher, Efficient Graph-Based Image Segmentation,
    International Journal of Computer Vision 59 (2), 2004, with the weights and defaults of ScanNet's segmentator
    (A. Dai et al., CVPR 2017): the normal of a vertex is the mean of the unit normals of its faces, not normalised.

    Ours: an edge is convex if the normals of its ends diverge, (n' − n)·(p' − p) > 0, which does not depend on the
    direction in which it is traversed; faces without area do not contribute to normals; equal weights are taken in the
    order of the vertices; vertices without a face have the label -1.

    On the Princeton benchmark, its Rand Index error is .18 over the second and third model of the eleven non-rigid
    categories and .26 over those of all 19; nobody published one. It takes O(m log m) for m faces.

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box().subdivide_to_size(0.15)
    >>> len(np.unique(Felzenszwalb(threshold=0.001)(box.vertices, box.faces)))
    6
    """

    threshold: float = 0.01
    min_vertices: int = 20

    algorithm_version: ClassVar[int] = 1
    labels_of: ClassVar[str] = "vertices"
    about: ClassVar[About] = About(
        title="Felzenszwalb",
        source=(
            "P. F. Felzenszwalb, D. P. Huttenlocher: Efficient Graph-Based Image Segmentation (2004), on normals as "
            "ScanNet does"
        ),
        bibtex="""@article{felzenszwalb2004efficient,
  author  = {Felzenszwalb, Pedro F. and Huttenlocher, Daniel P.},
  title   = {Efficient Graph-Based Image Segmentation},
  journal = {International Journal of Computer Vision},
  volume  = {59},
  number  = {2},
  pages   = {167--181},
  year    = {2004},
  doi     = {10.1023/B:VISI.0000022288.19776.77},
}""",
        baseline=True,
    )

    def __post_init__(self) -> None:
        if not 0 <= self.threshold < math.inf:
            raise ValueError(f"segmenter.threshold is {self.threshold!r}: it must be at least 0 and finite")
        if self.min_vertices < 1:
            raise ValueError(f"segmenter.min_vertices is {self.min_vertices!r}: it must be at least 1")

    def __call__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """Labels of the vertices.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face

        Returns
        -------
        (n,) int64 array
            -1 for vertices without a face

        Raises
        ------
        ValueError
            If a coordinate is not finite.
        """
        from studies.segmenters._grown_regions import grown_regions  # compiles, which takes long to import

        points = unit_size(vertices, faces)
        normals = _vertex_normals(points, faces)
        edges = _edges(faces)
        weights = _weights(points, normals, edges)
        order = np.argsort(weights, kind="stable")
        region = grown_regions(edges[order], weights[order], len(vertices), self.threshold, self.min_vertices)
        labels = np.full(len(vertices), -1, dtype=np.int64)
        used = np.unique(faces)
        labels[used] = np.unique(region[used], return_inverse=True)[1]
        return labels


def _vertex_normals(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """The mean unit normal of the faces of each vertex: (n, 3); zero where no face has one."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    size = np.linalg.norm(normals, axis=1)
    has_normal = size > 0
    unit = normals[has_normal] / size[has_normal, None]
    corner_vertices = faces[has_normal].ravel()
    counts = np.bincount(corner_vertices, minlength=len(vertices))
    sums = [np.bincount(corner_vertices, np.repeat(unit[:, axis], 3), len(vertices)) for axis in range(3)]
    return np.column_stack(sums) / np.maximum(counts, 1)[:, None]


def _edges(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """Pairs of different vertices that are corners of a face: (e, 2), each once."""
    ends = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    return np.unique(ends[ends[:, 0] != ends[:, 1]], axis=0)


def _weights(
    vertices: NDArray[np.float64], normals: NDArray[np.float64], edges: NDArray[np.int64]
) -> NDArray[np.float64]:
    """How different the normals at the ends of each edge are: (e,)."""
    first, second = edges.T
    difference = 1 - np.einsum("ij,ij->i", normals[first], normals[second])
    along = np.einsum("ij,ij->i", normals[second] - normals[first], vertices[second] - vertices[first])
    return np.where(along > 0, difference**2, difference)
