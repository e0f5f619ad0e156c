"""The dual graph of a mesh: its faces, and the edges that they share."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components

_TINY = np.finfo(np.float64).tiny


@dataclass(frozen=True)
class DualGraph:
    """Faces of a mesh and the pairs of them that share an edge.

    An edge of more than two faces joins each to the next one in the order of the faces.

    Attributes
    ----------
    n_faces : int
    areas : (m,) float array
        area of each face
    centres : (m, 3) float array
        mean of the corners of each face
    normals : (m, 3) float array
        unit normal of each face, as its corners are oriented; zero for a face without area
    pairs : (p, 2) int array
        faces that share an edge, the smaller index first
    edges : (p, 2) int array
        the vertices of the shared edges
    lengths : (p,) float array
        lengths of the shared edges
    angles : (p,) float array
        angle between the normals in radians, 0 where the faces are coplanar; negative where the edge is concave, seen
        from the side that the first face's normal points to. Faces that traverse the edge in the same direction are
        compared as if the second one were turned over.
    distances : (p,) float array
        length of the way from centre to centre through the midpoint of the edge

    Examples
    --------
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> graph = DualGraph.of(box.vertices, box.faces)
    >>> len(graph.pairs), sorted(set(np.round(graph.angles, 6).tolist()))
    (18, [0.0, 1.570796])
    """

    n_faces: int
    areas: NDArray[np.float64]
    centres: NDArray[np.float64]
    normals: NDArray[np.float64]
    pairs: NDArray[np.int64]
    edges: NDArray[np.int64]
    lengths: NDArray[np.float64]
    angles: NDArray[np.float64]
    distances: NDArray[np.float64]

    @classmethod
    def of(cls, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> DualGraph:
        """The dual graph of a mesh.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face
        """
        vertices, faces = np.asarray(vertices, np.float64), np.asarray(faces, np.int64)
        corners = vertices[faces]
        double = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        size = np.linalg.norm(double, axis=1)
        normals = double / np.maximum(size, _TINY)[:, None]
        centres = corners.mean(axis=1)
        pairs, edges, is_consistent = shared_edges(faces)
        first, second = pairs.T
        ends = vertices[edges]
        middle = ends.mean(axis=1)
        other = np.where(is_consistent[:, None], 1.0, -1.0) * normals[second]
        cosine = np.einsum("ij,ij->i", normals[first], other)
        sine = np.linalg.norm(np.cross(normals[first], other), axis=1)
        to_middle = [np.linalg.norm(centres[side] - middle, axis=1) for side in (first, second)]
        is_concave = np.einsum("ij,ij->i", centres[second] - middle, normals[first]) > 0
        return cls(
            n_faces=len(faces),
            areas=size / 2,
            centres=centres,
            normals=normals,
            pairs=pairs,
            edges=edges,
            lengths=np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1),
            angles=np.where(is_concave, -1.0, 1.0) * np.arctan2(sine, cosine),
            distances=to_middle[0] + to_middle[1],
        )

    def matrix(self, weights: NDArray[np.float64]) -> sp.csr_array:
        """The symmetric sparse matrix (m, m) with a weight for each pair; pairs that occur twice are added."""
        first, second = self.pairs.T
        rows, columns = np.concatenate([first, second]), np.concatenate([second, first])
        matrix = sp.coo_array((np.concatenate([weights, weights]), (rows, columns)), (self.n_faces, self.n_faces))
        return matrix.tocsr()

    def components(self, labels: NDArray[np.int64] | None = None) -> NDArray[np.int64]:
        """For each face the number of its connected component, or of the connected faces with its label: (m,)."""
        pairs = self.pairs if labels is None else self.pairs[labels[self.pairs[:, 0]] == labels[self.pairs[:, 1]]]
        joined = sp.coo_array((np.ones(len(pairs)), tuple(pairs.T)), (self.n_faces, self.n_faces))
        return connected_components(joined, directed=False)[1].astype(np.int64)


def shared_edges(
    faces: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.bool_]]:
    """Pairs of faces (p, 2), the edges they share (p, 2), and whether they traverse these in opposite directions."""
    half_edges = faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2)
    owner = np.repeat(np.arange(len(faces)), 3)
    is_forward = half_edges[:, 0] < half_edges[:, 1]
    ends = np.sort(half_edges, axis=1)
    order = np.lexsort((owner, ends[:, 1], ends[:, 0]))
    ends, owner, is_forward = ends[order], owner[order], is_forward[order]
    is_shared = (ends[1:] == ends[:-1]).all(axis=1) & (owner[1:] != owner[:-1]) & (ends[1:, 0] != ends[1:, 1])
    found = np.flatnonzero(is_shared)
    pairs = np.column_stack([owner[found], owner[found + 1]])
    return pairs, ends[found], is_forward[found] != is_forward[found + 1]
