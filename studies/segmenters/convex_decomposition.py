"""Parts that are nearly convex."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from scipy.spatial import ConvexHull, QhullError
from threadpoolctl import threadpool_limits

from heatwalk.meshes import repeats_earlier_face
from studies.segmenters._dual_graph import shared_edges
from studies.segmenters._optional import optional
from studies.segmenters._unit_size import unit_size
from studies.segmenters.about import About

Arrays = tuple[NDArray[np.float64], NDArray[np.int64]]


@dataclass(frozen=True)
class ConvexDecomposition:
    """The hulls of CoACD, an approximate convex decomposition of the solid, carried to the faces.

    The solid is cut by planes until every piece is nearly its convex hull: no point inside or on one is further than
    ``threshold`` from the other. A tree search finds the planes. A face belongs to the hull in which its centre is
    deepest, or to the nearest if it is in none.

    Parameters
    ----------
    threshold : float
        largest concavity of a part, relative to half the longest side of the bounding box; 0.01 to 1
    iterations : int
        of the tree search for each cut, 60 to 2,000
    depth : int
        cuts that the search looks ahead, 2 to 7
    resolution : int
        samples per piece by which the concavity is measured, 1,000 to 10,000
    search_faces : int
        faces to which larger meshes are decimated for the search; at least 100
    max_faces : int
        larger meshes are refused

    Notes
    -----
    X. Wei, M. Liu, Z. Ling, H. Su, Approximate Convex Decomposition for 3D Meshes with Collision-Aware Concavity and
    Tree Search, ACM Transactions on Graphics 41 (4), 2022; the authors' package coacd. The publication does not segment
    surfaces.

    Ours: a threshold of 0.1, twice the package's, which keeps limbs in one piece; fewer iterations (its default: 150),
    a lower depth (3) and resolution (2,000), to save time; the seed is 0; hulls carried to faces. Coincident vertices
    are merged, holes closed (by MeshLab), and meshes decimated before the search, whose time is proportional to their
    faces, but the labels are of the faces given. Where the quick decimation does not leave a closed surface, MeshLab's
    does. What is no closed surface before is refused. The package's own preprocessing is off: it would replace what
    intersects itself, or is not closed, by a thin shell around it, which has dozens of parts and takes minutes. One
    thread.

    On the Princeton benchmark, its Rand Index error is .140 over the second and third model of the eleven non-rigid
    categories; there is no published value.

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> ConvexDecomposition()(box.vertices, box.faces).tolist()
    [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]
    """

    threshold: float = 0.1
    iterations: int = 60
    depth: int = 2
    resolution: int = 1000
    search_faces: int = 300
    max_faces: int = 200_000

    algorithm_version: ClassVar[int] = 2
    labels_of: ClassVar[str] = "faces"
    about: ClassVar[About] = About(
        title="Convex decomposition",
        source=(
            "X. Wei, M. Liu, Z. Ling, H. Su: Approximate Convex Decomposition for 3D Meshes with Collision-Aware "
            "Concavity and Tree Search (2022)"
        ),
        bibtex="""@article{wei2022approximate,
  author  = {Wei, Xinyue and Liu, Minghua and Ling, Zhan and Su, Hao},
  title   = {Approximate Convex Decomposition for {3D} Meshes with Collision-Aware Concavity and Tree Search},
  journal = {ACM Transactions on Graphics},
  volume  = {41},
  number  = {4},
  year    = {2022},
  doi     = {10.1145/3528223.3530103},
}""",
        licences={"coacd": "MIT"},
        extra="peers",
    )

    def __post_init__(self) -> None:
        for option, low, high in (
            ("threshold", 0.01, 1), ("iterations", 60, 2000), ("depth", 2, 7), ("resolution", 1000, 10_000)
        ):  # fmt: skip
            if not low <= getattr(self, option) <= high:
                raise ValueError(f"segmenter.{option} is {getattr(self, option)!r}: it must be from {low} to {high}")
        for option, least in (("search_faces", 100), ("max_faces", 1)):
            if getattr(self, option) < least:
                raise ValueError(f"segmenter.{option} is {getattr(self, option)!r}: it must be at least {least}")

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

        Raises
        ------
        ValueError
            If a coordinate is not finite, or the mesh has too many faces, is flat, or bounds no solid.
        ImportError
            If the package coacd is missing.
        """
        if len(faces) > self.max_faces:
            raise ValueError(
                f"the mesh has {len(faces)} faces, more than segmenter.max_faces={self.max_faces}: decimate it first"
            )
        points = unit_size(vertices, faces)
        depths = [_outside(points[faces].mean(axis=1), hull) for hull in self._hulls(points, faces)]
        return np.argmin(depths, axis=0).astype(np.int64)

    def _hulls(self, points: NDArray[np.float64], faces: NDArray[np.int64]) -> list[NDArray[np.float64]]:
        """The vertices of each convex part."""
        coacd = optional("coacd", "convex_decomposition")
        if np.linalg.matrix_rank(points[faces].reshape(-1, 3), tol=1e-6) < 3:
            raise ValueError("the mesh is flat: a convex decomposition needs a solid")
        solid = _solid(points, faces, self.search_faces)
        coacd.set_log_level("off")
        with threadpool_limits(1):
            parts = coacd.run_coacd(
                coacd.Mesh(*solid),
                threshold=self.threshold,
                mcts_iterations=self.iterations,
                mcts_max_depth=self.depth,
                resolution=self.resolution,
                preprocess_mode="off",
                seed=0,
            )
        hulls = [np.asarray(part[0]) for part in parts if np.isfinite(part[0]).all() and len(part[0]) > 3]
        if not hulls:
            raise ValueError("coacd returned no convex part")
        return hulls


def _solid(points: NDArray[np.float64], faces: NDArray[np.int64], most_faces: int) -> Arrays:
    """The closed surface of a mesh: vertices merged, holes closed, decimated; or ValueError."""
    places, index = np.unique(points, axis=0, return_inverse=True)
    faces = _proper(places, index.ravel()[faces])
    if not _is_closed(faces):
        places, faces = _with_holes_closed(places, faces)
        if not _is_closed(faces):
            raise ValueError(
                "the mesh is not a closed surface, even with its holes closed: a convex decomposition needs a solid"
            )
    return _decimated(places, faces, most_faces) if len(faces) > most_faces else (places, faces)


def _decimated(points: NDArray[np.float64], faces: NDArray[np.int64], n_faces: int) -> Arrays:
    """A closed surface with fewer faces, or the surface itself if neither decimation leaves a closed one."""
    import fast_simplification
    import pymeshlab

    fewer = fast_simplification.simplify(points, faces, target_count=n_faces)
    if _is_closed(fewer[1]):
        return np.asarray(fewer[0], np.float64), np.asarray(fewer[1], np.int64)
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(points, faces.astype(np.int32)))
    meshes.meshing_decimation_quadric_edge_collapse(targetfacenum=n_faces, preservetopology=True)
    result = meshes.current_mesh().vertex_matrix(), meshes.current_mesh().face_matrix().astype(np.int64)
    return result if _is_closed(result[1]) else (points, faces)


def _with_holes_closed(points: NDArray[np.float64], faces: NDArray[np.int64]) -> Arrays:
    """The mesh with triangulated holes, as far as MeshLab can close them."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(points, faces.astype(np.int32)))
    try:
        meshes.meshing_close_holes(maxholesize=len(faces), selfintersection=False)
    except pymeshlab.PyMeshLabException:
        return points, faces  # edges of more than two faces
    closed = meshes.current_mesh()
    return closed.vertex_matrix(), closed.face_matrix().astype(np.int64)


def _is_closed(faces: NDArray[np.int64]) -> bool:
    """Whether every edge has two faces, and the faces can be turned over so that all have the same side outside."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    if not len(faces) or (np.unique(edges, axis=0, return_counts=True)[1] != 2).any():
        return False
    pairs, _, is_consistent = shared_edges(faces)
    m = len(faces)
    first, second = pairs.T
    # Two copies of each face, one turned over: in one component, if a way leads from one side to the other.
    beside = np.where(is_consistent, second, second + m)
    other = np.where(is_consistent, second + m, second)
    ends = np.concatenate([first, first + m]), np.concatenate([beside, other])
    component = connected_components(sp.coo_array((np.ones(len(ends[0])), ends), (2 * m, 2 * m)), directed=False)[1]
    return bool((component[:m] != component[m:]).all())


def _proper(points: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces that have an area and do not repeat another."""
    corners = points[faces]
    has_area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]).any(axis=1)
    return faces[has_area & ~repeats_earlier_face(faces)]


def _outside(points: NDArray[np.float64], hull: NDArray[np.float64]) -> NDArray[np.float64]:
    """How far each point is beyond the planes of a convex hull, at least; negative inside."""
    try:
        planes = ConvexHull(hull).equations
    except QhullError:
        # A part without volume: its nearest vertex.
        return np.linalg.norm(points[:, None] - hull, axis=2).min(axis=1)
    result = np.full(len(points), -np.inf)
    for plane in planes:
        np.maximum(result, points @ plane[:3] + plane[3], out=result)
    return result
