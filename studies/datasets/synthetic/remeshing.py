"""Well-shaped triangles on an implicit surface: collapses, splits, flips and tangential smoothing, in whole arrays.

M. Botsch, L. Kobbelt, A Remeshing Approach to Multiresolution Modeling, Symposium on Geometry Processing, 2004,
doi:10.1145/1057432.1057457. Operations that do not touch each other are made at once, so that NumPy suffices, and the
order of vertices and faces decides ties, so that the result is the same in every process.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array, csr_array

from studies.datasets.synthetic.fields import Field
from studies.datasets.synthetic.solids import Array, dot

Faces = NDArray[np.int64]

SHORTEST, LONGEST = 0.75, 1.4  # edges, in target lengths
ROUNDS = 3
MOST_PASSES = 100  # of independent collapses, splits or flips
SMOOTHING_STEPS = 2
FEWEST_EDGES = 4  # at a vertex


@dataclass(frozen=True, eq=False)
class Edges:
    """The edges of a closed manifold mesh.

    Parameters
    ----------
    ends : (e, 2) int array
        ascending
    faces : (e, 2) int array
        the faces on both sides
    opposite : (e, 2) int array
        the corners of these faces that are not on the edge
    """

    ends: Faces
    faces: Faces
    opposite: Faces


def edges_of(faces: Faces) -> Edges:
    """The edges of a closed manifold mesh."""
    ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    opposite = faces[:, [2, 0, 1]].ravel()
    order = np.argsort(ends[:, 0] * (faces.max() + 1) + ends[:, 1], kind="stable")
    pairs = order.reshape(-1, 2)
    return Edges(ends[pairs[:, 0]], pairs // 3, opposite[pairs])


def remesh(vertices: Array, faces: Faces, field: Field, length: float) -> tuple[Array, Faces]:
    """A mesh of the same surface whose edges have about the same length.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
        closed, manifold and oriented
    field : Field
        whose zeros are the surface
    length : float
        of the edges

    Returns
    -------
    vertices, faces
    """
    for _ in range(ROUNDS):
        vertices, faces = split_long(vertices, faces, LONGEST * length)
        vertices, faces = collapse_short(vertices, faces, SHORTEST * length)
        faces = flip_to_delaunay(vertices, faces)
        for _ in range(SMOOTHING_STEPS):
            vertices = smooth(vertices, faces, field)
    vertices = field.projected(vertices)
    return vertices, flip_to_delaunay(vertices, faces)


def collapse_short(vertices: Array, faces: Faces, shortest: float) -> tuple[Array, Faces]:
    """Collapse edges below a length to their midpoints, short ones first, where the surface stays a manifold."""
    for _ in range(MOST_PASSES):
        edges = edges_of(faces)
        lengths = _lengths(vertices, edges.ends)
        short = np.flatnonzero(lengths < shortest)
        if not len(short):
            break
        neighbours = _adjacency(edges.ends, len(vertices))
        degree = np.diff(neighbours.indptr)
        common = np.asarray(
            neighbours[edges.ends[short, 0]].multiply(neighbours[edges.ends[short, 1]]).sum(axis=1)
        ).ravel()
        allowed = (common == 2) & (degree[edges.opposite[short]] > FEWEST_EDGES).all(axis=1)
        short = short[allowed]
        if not len(short):
            break
        rank = np.empty(len(short))
        rank[np.argsort(lengths[short], kind="stable")] = np.arange(len(short))
        # Ends of two chosen edges are no neighbours, and a corner is opposite to one of them at most: so neither
        # changes whether the other may be collapsed.
        corners = np.column_stack([edges.ends[short], edges.opposite[short]])
        best = _least(corners, rank, len(vertices))
        near = _least_of_neighbours(neighbours, _least(corners[:, :2], rank, len(vertices)))
        first = (best[corners] == rank[:, None]).all(axis=1) & (near[corners[:, :2]] >= rank[:, None]).all(axis=1)
        chosen = corners[first, :2]
        vertices = vertices.copy()
        vertices[chosen[:, 0]] = (vertices[chosen[:, 0]] + vertices[chosen[:, 1]]) / 2
        target = np.arange(len(vertices))
        target[chosen[:, 1]] = chosen[:, 0]
        vertices, faces = _without_degenerate(vertices, target[faces])
    return vertices, faces


def split_long(vertices: Array, faces: Faces, longest: float) -> tuple[Array, Faces]:
    """Split edges above a length at their midpoints."""
    for _ in range(MOST_PASSES):
        edges = edges_of(faces)
        lengths = _lengths(vertices, edges.ends)
        long = np.flatnonzero(lengths > longest)
        if not len(long):
            break
        rank = np.empty(len(long))
        rank[np.argsort(-lengths[long], kind="stable")] = np.arange(len(long))
        best = _least(edges.faces[long], rank, len(faces))
        long = long[(best[edges.faces[long]] == rank[:, None]).all(axis=1)]
        middle = len(vertices) + np.arange(len(long))
        vertices = np.vstack([vertices, vertices[edges.ends[long]].mean(axis=1)])
        halves = []
        for side in range(2):
            face, corner = edges.faces[long, side], edges.opposite[long, side]
            at = (faces[face] == corner[:, None]).argmax(axis=1)
            first, second = faces[face, (at + 1) % 3], faces[face, (at + 2) % 3]
            halves.append((face, np.column_stack([corner, first, middle]), np.column_stack([corner, middle, second])))
        faces = faces.copy()
        for face, one, _ in halves:
            faces[face] = one
        faces = np.vstack([faces, *(other for _, _, other in halves)])
    return vertices, faces


def flip_to_delaunay(vertices: Array, faces: Faces) -> Faces:
    """Flip edges whose opposite angles sum up to more than two right angles."""
    for _ in range(MOST_PASSES):
        edges = edges_of(faces)
        excess = _angles_opposite(vertices, edges).sum(axis=1) - np.pi
        candidates = np.flatnonzero(excess > 1e-6)
        if not len(candidates):
            break
        new = np.sort(edges.opposite[candidates], axis=1)
        count = len(vertices)
        exists = np.isin(new[:, 0] * count + new[:, 1], edges.ends[:, 0] * count + edges.ends[:, 1])
        degree = np.bincount(edges.ends.ravel(), minlength=count)
        keeps = (degree[edges.ends[candidates]] >= FEWEST_EDGES).all(axis=1)
        candidates = candidates[~exists & keeps]
        if not len(candidates):
            break
        corners = np.column_stack([edges.ends[candidates], edges.opposite[candidates]])
        rank = np.empty(len(candidates))
        rank[np.argsort(-excess[candidates], kind="stable")] = np.arange(len(candidates))
        best = _least(corners, rank, count)
        chosen = candidates[(best[corners] == rank[:, None]).all(axis=1)]
        one, other = edges.faces[chosen].T
        c, d = edges.opposite[chosen].T
        at = (faces[one] == c[:, None]).argmax(axis=1)
        a, b = faces[one, (at + 1) % 3], faces[one, (at + 2) % 3]  # the first face is c a b, the other d b a
        faces = faces.copy()
        faces[one], faces[other] = np.column_stack([c, a, d]), np.column_stack([c, d, b])
    return faces


def smooth(vertices: Array, faces: Faces, field: Field) -> Array:
    """Move each vertex to the mean of its neighbours, along the surface."""
    ends = edges_of(faces).ends
    neighbours = _adjacency(ends, len(vertices))
    degree = np.diff(neighbours.indptr)
    mean = (neighbours @ vertices) / degree[:, None]
    value, gradient = field.value_and_gradient(vertices)
    length = np.sqrt(dot(gradient, gradient))
    normal = gradient / length[:, None]
    step = mean - vertices
    return vertices + step - dot(step, normal)[:, None] * normal - (value / length)[:, None] * normal


def _lengths(vertices: Array, ends: Faces) -> Array:
    step = vertices[ends[:, 1]] - vertices[ends[:, 0]]
    return np.sqrt(dot(step, step))


def _angles_opposite(vertices: Array, edges: Edges) -> Array:
    """The two angles opposite each edge, (e, 2)."""
    corner = vertices[edges.opposite]
    a, b = vertices[edges.ends[:, :1]] - corner, vertices[edges.ends[:, 1:]] - corner
    return np.arccos(np.clip(dot(a, b) / np.sqrt(dot(a, a) * dot(b, b)), -1, 1))


def _adjacency(ends: Faces, count: int) -> csr_array:
    """The symmetric 0/1 matrix of neighbours."""
    i, j = ends.T
    matrix = coo_array(
        (np.ones(2 * len(ends)), (np.concatenate([i, j]), np.concatenate([j, i]))), shape=(count, count)
    ).tocsr()
    matrix.sort_indices()
    return matrix


def _least(indices: Faces, values: Array, count: int) -> Array:
    """For each index the least value of the rows in which it occurs; infinite for none."""
    least = np.full(count, np.inf)
    for column in indices.T:
        np.minimum.at(least, column, values)
    return least


def _least_of_neighbours(neighbours: csr_array, values: Array) -> Array:
    return np.minimum.reduceat(values[neighbours.indices], neighbours.indptr[:-1])


def _without_degenerate(vertices: Array, faces: Faces) -> tuple[Array, Faces]:
    """The mesh without faces that have a corner twice, and without the vertices that this leaves unused."""
    a, b, c = faces.T
    faces = faces[(a != b) & (b != c) & (c != a)]
    used = np.zeros(len(vertices), dtype=bool)
    used[faces] = True
    return vertices[used], (np.cumsum(used) - 1)[faces]
