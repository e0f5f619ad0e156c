"""Spectral clustering of the faces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np
from numpy.typing import NDArray

from studies.segmenters.about import About

if TYPE_CHECKING:
    import scipy.sparse as sp

    from studies.segmenters._dual_graph import DualGraph

_BIBTEX = """\
@inproceedings{liu2004segmentation,
  author = {Liu, Rong and Zhang, Hao},
  title = {Segmentation of {3D} meshes through spectral clustering},
  booktitle = {Pacific Conference on Computer Graphics and Applications},
  pages = {298--305},
  year = {2004}
}"""

# Faces up to which all eigenvectors are computed by a dense solver.
_MAX_DENSE = 200

# The largest eigenvalue of the normalised affinity is 1; the matrix is factorised at a shift slightly above.
_SHIFT = 1 + 1e-6

# The exponent of an affinity, so that none is so small that a face is cut off by rounding.
_MAX_EXPONENT = 30.0


@dataclass(frozen=True)
class Spectral:
    """k-means of the faces in the space of the largest eigenvectors of their normalised affinity.

    The distance of two faces that share an edge is δ times that of their centres along the surface plus 1 - δ times
    η (1 - cos α) with the angle α of their normals, each divided by its mean; their affinity decreases with it
    exponentially. The rows of the eigenvectors, one for each segment, are normalised before they are clustered.

    Parameters
    ----------
    delta : float
        δ, the share of the distance of the centres, 0 to 1
    eta : float
        η of convex edges, above 0 and at most 1; 1 for concave ones
    sharpness : float
        affinities are exp(-sharpness · distance / mean distance)

    Notes
    -----
    Ours: the affinities of the source are those of all pairs of faces, by shortest paths, an (m, m) matrix; here only
    of those that share an edge, a sparse one, which takes seconds for 20,000 faces. So are therefore its width, and
    k-means with several starts instead of the seeds that the source reads off the matrix. Connected components are
    segmented on their own and share the number of segments by area. 11 s for 50,000 faces and 18 segments.

    Rand Index error on the Princeton benchmark, second and third model of each category, parameters chosen on the
    first: .142 over the eleven non-rigid categories (22 models), .179 over all (38). The benchmark is younger than the
    source and does not have it. With the source's small δ, meant for all pairs, the sparse affinity cuts off single
    faces at sharp edges.

    References
    ----------
    R. Liu, H. Zhang, "Segmentation of 3D meshes through spectral clustering", 2004;
    S. Katz, A. Tal, "Hierarchical mesh decomposition using fuzzy clustering and cuts", 2003

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box().subdivide()
    >>> len(np.unique(Spectral()(box.vertices, box.faces, n_segments=3)))
    3
    """

    delta: float = 0.5
    eta: float = 0.15
    sharpness: float = 1.0

    algorithm_version: ClassVar[int] = 1
    labels_of: ClassVar[str] = "faces"
    about: ClassVar[About] = About(
        title="Spectral clustering",
        source="Liu, Zhang: Segmentation of 3D meshes through spectral clustering, 2004",
        bibtex=_BIBTEX,
        seeded=True,
    )

    def __post_init__(self) -> None:
        if not 0 <= self.delta <= 1:
            raise ValueError(f"segmenter.delta is {self.delta!r}: it must be between 0 and 1")
        if not 0 < self.eta <= 1:
            raise ValueError(f"segmenter.eta is {self.eta!r}: it must be above 0 and at most 1")
        if not 0 < self.sharpness < np.inf:
            raise ValueError(f"segmenter.sharpness is {self.sharpness!r}: it must be above 0 and finite")

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
        heatwalk.MeshError
            If a coordinate is NaN or infinite, or the mesh has no area.
        """
        from studies.segmenters._clustering import k_means
        from studies.segmenters._components import segment_components
        from studies.segmenters._dual_graph import DualGraph
        from studies.segmenters._random import random_generator
        from studies.segmenters._spectrum import scaled_to_unit_area

        graph = DualGraph.of(scaled_to_unit_area(vertices, faces), faces)
        affinity = graph.matrix(self._affinities(graph))
        rng = random_generator(vertices, faces)

        def segment(indices: NDArray[np.int64], count: int) -> NDArray[np.int64]:
            rows = _largest_eigenvectors(affinity[indices][:, indices], count)
            rows /= np.maximum(np.linalg.norm(rows, axis=1, keepdims=True), np.finfo(float).tiny)
            return k_means(rows, count, rng, weights=graph.areas[indices])

        return segment_components(graph.centres, graph.components(), graph.areas, n_segments, segment)

    def _affinities(self, graph: DualGraph) -> NDArray[np.float64]:
        """The affinity of each pair of faces."""
        angular = np.where(graph.angles >= 0, self.eta, 1.0) * (1 - np.cos(graph.angles))
        distance = self.delta * _over_mean(graph.distances) + (1 - self.delta) * _over_mean(angular)
        return np.exp(-np.minimum(self.sharpness * _over_mean(distance), _MAX_EXPONENT))


def _over_mean(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """The values divided by their mean, if that is not 0."""
    mean = values.mean() if len(values) else 0.0
    return values / mean if mean > 0 else values


def _largest_eigenvectors(affinity: sp.csr_array, count: int) -> NDArray[np.float64]:
    """Eigenvectors of the largest eigenvalues of D^-1/2 W D^-1/2: (m, count), fewer if m is smaller."""
    import scipy.linalg
    import scipy.sparse as sp
    from scipy.sparse.linalg import eigsh

    n = affinity.shape[0]
    scale = sp.diags_array(affinity.sum(axis=1) ** -0.5)
    normalised = (scale @ affinity @ scale).tocsc()
    if n <= max(_MAX_DENSE, 2 * count + 2):
        return scipy.linalg.eigh(normalised.toarray())[1][:, -count:]
    start = np.random.default_rng(0).standard_normal(n)
    return eigsh(normalised, count, sigma=_SHIFT, v0=start)[1]
