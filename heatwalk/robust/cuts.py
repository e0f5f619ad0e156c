"""What it costs to cut a surface along a line, little where it is narrow and concave, and the cheapest cuts.

People see the border between two parts where the surface is concave (the minima rule of Hoffman and Richards 1984) and
narrow. A cut separates the vertices of the mesh into two sets; it costs, for each edge from one set to the other,

    c = length of the edge of the dual mesh / (1 + concavity / limit)

where the concavity is the curvature of the surface along the edge if that is concave, otherwise zero, on a mesh of
area 1. It is estimated from the normals of the vertices, on a surface without bumps smaller than `SMOOTHING`, so that a
crease costs as little whether the mesh is coarse or fine, and noise hardly changes anything.

References
----------
D. D. Hoffman, W. A. Richards, "Parts of recognition", Cognition 18, 1984, doi:10.1016/0010-0277(84)90022-2; S. Katz,
A. Tal, "Hierarchical mesh decomposition using fuzzy clustering and cuts", 2003, doi:10.1145/882262.882369
"""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from heatwalk.laplacian import unit_area
from heatwalk.meshes import mesh_edges
from heatwalk.numerics.compilation import compiled
from heatwalk.robust.fairing import smoothed
from heatwalk.robust.half_edges import adjacency, partners

# SciPy's maximum flow has 32-bit integers: the mean of the capacities, and what their sum must not exceed.
_MEAN_CAPACITY = 1000
_TOTAL_CAPACITY = 2**30

# Bumps smaller than this, on a mesh of area 1, play no role for what a cut costs: noise would make it jump.
SMOOTHING = 0.09
MAX_SWEEPS = 512


@dataclass(frozen=True)
class CutGraph:
    """The vertices of a mesh of area 1 and what it costs to separate adjacent ones.

    Attributes
    ----------
    edges : (e, 2) int array
    costs : (e,) float array, at least 0
    areas : (n,) float array
        of the surface around each vertex
    vertices : (n, 3) float array
    faces : (m, 3) int array
    factors : (m, 3) float array
        what a cut costs per length across the side from each corner of a face to the next one, at most 1
    """

    edges: NDArray[np.int64]
    costs: NDArray[np.float64]
    areas: NDArray[np.float64]
    vertices: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))
    faces: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 3), np.int64))
    factors: NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, 3)))

    @classmethod
    def of(
        cls,
        vertices: NDArray[np.float64],
        faces: NDArray[np.int64],
        areas: NDArray[np.float64],
        max_curvature: float,
    ) -> "CutGraph":
        """The graph of a mesh.

        Parameters
        ----------
        vertices : (n, 3) float array
            in any unit
        faces : (m, 3) int array
            in any orientation
        areas : (n,) float array
            of the surface around each vertex, whose sum is 1
        max_curvature : float, above 0
            concave curvature at which a cut costs half as much as on a flat surface, on the mesh of area 1
        """
        proper = np.ascontiguousarray(faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)])
        scaled = _smooth(unit_area(vertices, proper), proper)
        edges = mesh_edges(proper)[0]
        number = _numbers_of_sides(proper, edges, len(scaled))
        normals = _outward_normals(scaled, proper)
        way = scaled[edges[:, 1]] - scaled[edges[:, 0]]
        bend = np.einsum("ij,ij->i", normals[edges[:, 1]] - normals[edges[:, 0]], way)
        curvature = bend / np.maximum(np.einsum("ij,ij->i", way, way), np.finfo(float).tiny)
        factors = 1 / (1 + np.maximum(-curvature, 0) / max_curvature)
        widths = np.bincount(number.ravel(), _to_centres(scaled, proper).ravel(), len(edges))
        return cls(edges, widths * factors, areas, scaled, proper, factors[number])


def minimum_cut(graph: CutGraph, source: NDArray[np.bool_], sink: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """The vertices on the source's side of the cheapest cut between two sets of vertices.

    Parameters
    ----------
    graph : CutGraph
        of n vertices; costs are rounded to a thousandth of their mean, and to at least that
    source, sink : (n,) bool array
        disjoint, and neither empty

    Returns
    -------
    (n,) bool array
        of several cheapest cuts that nearest to the source

    Examples
    --------
    >>> edges = np.array([[0, 1], [1, 2], [2, 3]])
    >>> chain = CutGraph(edges, np.array([3.0, 1, 2]), np.full(4, 0.25))
    >>> minimum_cut(chain, np.arange(4) == 0, np.arange(4) == 3)
    array([ True,  True, False, False])
    """
    import scipy.sparse as sp
    from scipy.sparse.csgraph import breadth_first_order, maximum_flow

    # The source becomes node 0, the sink node 1.
    is_free = ~(source | sink)
    node = np.where(sink, 1, 0)
    node[is_free] = 2 + np.arange(np.count_nonzero(is_free))
    first, second = node[graph.edges].T
    between = first != second
    first, second, costs = first[between], second[between], graph.costs[between]
    total, count = costs.sum(), 2 + int(np.count_nonzero(is_free))
    scale = min(_MEAN_CAPACITY * len(costs), _TOTAL_CAPACITY) / total if total > 0 else 1.0
    whole = np.tile(np.maximum(np.rint(scale * costs), 1).astype(np.int32), 2)
    rows, columns = np.concatenate([first, second]), np.concatenate([second, first])
    network = sp.csr_array(sp.coo_array((whole, (rows, columns)), (count, count)))
    residual = sp.csr_array(network - maximum_flow(network, 0, 1).flow)
    residual.eliminate_zeros()
    reached = np.zeros(count, dtype=bool)
    reached[breadth_first_order(residual, 0, return_predecessors=False)] = True
    return reached[node]


def level_costs(graph: CutGraph, values: NDArray[np.float64], levels: NDArray[np.float64]) -> NDArray[np.float64]:
    """What it costs to cut along the level sets of a function that is linear on each face, and not along edges.

    Parameters
    ----------
    graph : CutGraph
    values : (n,) float array
        of the function at the vertices; -inf where it is not defined
    levels : (k,) float array, descending

    Returns
    -------
    (k,) float array
        the length of each level set, divided as the costs of edges are where the surface is concave

    Examples
    --------
    A square of area 1, cut in the middle and at an edge:

    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> square = CutGraph.of(corners, np.array([[0, 1, 2], [0, 2, 3]]), np.full(4, 0.25), 2.0)
    >>> level_costs(square, corners[:, 0], np.array([0.5, 0.25]))
    array([1., 1.])
    """
    return np.asarray(_level_costs(graph.vertices, graph.faces, graph.factors, values, levels))


@compiled
def _level_costs(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    factors: NDArray[np.float64],
    values: NDArray[np.float64],
    levels: NDArray[np.float64],
) -> NDArray[np.float64]:
    """As `level_costs`; ``factors`` (m, 3) of the side from each corner to the next one."""
    costs = np.zeros(len(levels))
    points = np.empty((2, 3))
    for f in range(len(faces)):
        low = min(values[faces[f, 0]], values[faces[f, 1]], values[faces[f, 2]])
        high = max(values[faces[f, 0]], values[faces[f, 1]], values[faces[f, 2]])
        if not (low > -np.inf and high > low):
            continue
        first = np.searchsorted(-levels, -high)
        for j in range(first, len(levels)):
            level = levels[j]
            if level <= low:
                break
            count, factor = 0, 0.0
            for i in range(3):
                a, b = faces[f, i], faces[f, (i + 1) % 3]
                if (values[a] >= level) != (values[b] >= level) and count < 2:
                    share = (level - values[a]) / (values[b] - values[a])
                    for k in range(3):
                        points[count, k] = vertices[a, k] + share * (vertices[b, k] - vertices[a, k])
                    factor += factors[f, i]
                    count += 1
            length = 0.0
            for k in range(3):
                length += (points[0, k] - points[1, k]) ** 2
            costs[j] += 0.5 * factor * np.sqrt(length)
    return costs


def _smooth(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """The vertices of a mesh of area 1 without what is smaller than `SMOOTHING`: (n, 3) float array."""
    starts, neighbours = adjacency(faces, len(vertices))
    way = vertices[np.repeat(np.arange(len(vertices)), np.diff(starts))] - vertices[neighbours]
    length = np.linalg.norm(way, axis=1).mean() if len(way) else 1.0
    sweeps = min(round((SMOOTHING / length) ** 2), MAX_SWEEPS)
    return smoothed(vertices, starts, neighbours, sweeps) if sweeps else vertices


def _numbers_of_sides(faces: NDArray[np.int64], edges: NDArray[np.int64], n_vertices: int) -> NDArray[np.int64]:
    """The number of the edge from each corner of a face to the next one: (m, 3) int array."""
    ends = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)]), axis=0)
    keys = edges[:, 0] * n_vertices + edges[:, 1]
    return np.searchsorted(keys, ends[0] * n_vertices + ends[1])


def _to_centres(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Distance of the middle of the side from each corner of a face to the next one from its centre: (m, 3)."""
    corners = vertices[faces]
    middles = (corners + np.roll(corners, -1, axis=1)) / 2
    return np.asarray(np.linalg.norm(middles - corners.mean(axis=1, keepdims=True), axis=2))


def _outward_normals(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit normals of the vertices, weighted by area, outwards whatever way the faces turn: (n, 3) float array."""
    corners = vertices[faces]
    double = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    turns, piece = _turns(faces, partners(faces, len(vertices)))
    double *= turns[:, None]
    area = np.linalg.norm(double, axis=1)
    middle = corners.mean(axis=1)
    weights = np.maximum(np.bincount(piece, area), np.finfo(float).tiny)
    centroid = np.column_stack([np.bincount(piece, area * middle[:, i]) for i in range(3)]) / weights[:, None]
    volume = np.bincount(piece, np.einsum("ij,ij->i", middle - centroid[piece], double))
    double *= np.where(volume < 0, -1.0, 1.0)[piece][:, None]
    normals = np.column_stack([np.bincount(faces.ravel(), np.repeat(double[:, i], 3), len(vertices)) for i in range(3)])
    return np.asarray(normals / np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None])


@compiled
def _turns(faces: NDArray[np.int64], partner: NDArray[np.int64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """1 or -1 for each face, so that neighbours agree, and the number of the piece within which they do."""
    turns, piece = np.zeros(len(faces)), np.full(len(faces), -1, np.int64)
    queue = np.empty(len(faces), np.int64)
    count = 0
    for first in range(len(faces)):
        if piece[first] >= 0:
            continue
        turns[first], piece[first], queue[0] = 1.0, count, first
        done, size = 0, 1
        while done < size:
            face = queue[done]
            done += 1
            for side in range(3 * face, 3 * face + 3):
                if partner[side] < 0 or piece[partner[side] // 3] >= 0:
                    continue
                other = partner[side] // 3
                same = faces[face, side % 3] == faces[other, partner[side] % 3]
                turns[other], piece[other] = turns[face] * (-1.0 if same else 1.0), count
                queue[size] = other
                size += 1
        count += 1
    return turns, piece
