"""Small holes of a surface filled, so that heat flows across them as it did before.

A boundary of the surface is traced around its vertices: from an edge with one face through the faces around its end to
the next edge with one face. Where two holes touch in a vertex, the trace runs through both; it is split wherever it
meets itself, and each piece is the outline of one hole.

    3 edges     a triangle
    otherwise   the triangulation of the outline of least cost, found exactly by dynamic programming: its area plus a
                fiftieth of the squares of the new edges, so that of two that are equally large, as all triangulations
                of a flat hole are, the one with the shorter edges is taken; a new edge is never one that the mesh has

Faces that are joined to others in vertices alone, as what is left between removed triangles, would be closed to a
double layer, and the hole around them as if they were not there: such islands are left out, unless a vertex would
thereby lose its last face.

Only holes that are small against the shape are filled: an outline of length l can bound at most l² / 4π, the area of a
disc, and this must be within a share of the area of the surface. So the rims of open surfaces remain as they are.

References
----------
P. Liepa, "Filling holes in meshes", 2003, doi:10.2312/SGP/SGP03/200-206;
G. Barequet, M. Sharir, "Filling gaps in the boundary of a polyhedron", 1995, doi:10.1016/0167-8396(94)00011-G
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heatwalk.laplacian import vertex_components
from heatwalk.numerics.compilation import compiled
from heatwalk.numerics.triangles import areas
from heatwalk.robust.half_edges import BOUNDARY, adjacency, head, other_side, partners, tail

# Cost of the square of the length of a new edge, relative to that of area.
CHORD_COST = 0.02

# Outlines of more edges are filled by a fan around their centre: the time of the triangulation grows with the cube.
MAX_TRIANGULATED = 150


@dataclass(frozen=True)
class Loops:
    """Closed chains of edges: the vertices of loop i are ``vertices[starts[i]:starts[i + 1]]``.

    Each is traversed against the direction in which the face at its first edge traverses that edge.
    """

    starts: NDArray[np.int64]
    vertices: NDArray[np.int64]

    def __len__(self) -> int:
        return len(self.starts) - 1

    def __getitem__(self, i: int) -> NDArray[np.int64]:
        return self.vertices[self.starts[i] : self.starts[i + 1]]

    def subset(self, kept: NDArray[np.bool_]) -> "Loops":
        """The loops (p,) bool, in their order."""
        sizes = np.diff(self.starts)
        return Loops(np.concatenate([[0], np.cumsum(sizes[kept])]), self.vertices[np.repeat(kept, sizes)])


def boundary_loops(faces: NDArray[np.int64], n_vertices: int) -> Loops:
    """Outlines of the holes of a surface, no vertex twice in one of them.

    Parameters
    ----------
    faces : (m, 3) int array
        without repeated corners
    n_vertices : int

    Returns
    -------
    Loops
        Boundaries that end at an edge of more than two faces are left out.

    Examples
    --------
    >>> loops = boundary_loops(np.array([[0, 1, 2], [2, 1, 3]]), 4)
    >>> loops.starts, loops.vertices
    (array([0, 4]), array([1, 0, 2, 3]))
    """
    return Loops(*_trace(faces, partners(faces, n_vertices), n_vertices))


def loop_lengths(vertices: NDArray[np.float64], loops: Loops) -> NDArray[np.float64]:
    """Length of each loop: (p,) float array.

    Examples
    --------
    >>> loops = Loops(np.array([0, 3]), np.array([0, 1, 2]))
    >>> loop_lengths(np.array([[0.0, 0, 0], [3, 0, 0], [3, 4, 0]]), loops)
    array([12.])
    """
    following = np.arange(1, len(loops.vertices) + 1)
    following[loops.starts[1:] - 1] = loops.starts[:-1]
    steps = np.linalg.norm(vertices[loops.vertices[following]] - vertices[loops.vertices], axis=1)
    return np.add.reduceat(steps, loops.starts[:-1]) if len(loops) else np.empty(0)


# The vertices of a surface, given by vertices and faces, without spikes and noise.
Denoised = Callable[[NDArray[np.float64], NDArray[np.int64]], NDArray[np.float64]]


def unchanged(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """The vertices of a surface that is taken as it is."""
    return vertices


def fill_small_holes(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], max_share: float, denoised: Denoised = unchanged
) -> tuple[NDArray[np.float64], NDArray[np.int64], int]:
    """Fill the holes that are small against the surface.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
        without repeated corners
    max_share : float
        of the area of the surface that a disc with the perimeter of a hole may have
    denoised : callable
        on what both are measured: noise inflates them

    Returns
    -------
    vertices : (n', 3) float array
        with the centres of fans appended
    faces : (m', 3) int array
        with the fills appended
    n_filled : int

    Examples
    --------
    >>> corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    >>> fill_small_holes(corners, np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2]]), max_share=1.0)[1]
    array([[0, 2, 1],
           [0, 1, 3],
           [0, 3, 2],
           [1, 2, 3]])
    """
    faces = _without_islands(vertices, faces, max_share)
    loops = boundary_loops(faces, len(vertices))
    if not len(loops):
        return vertices, faces, 0
    smooth = denoised(vertices, faces)
    small = loop_lengths(smooth, loops) ** 2 / (4 * np.pi) <= max_share * areas(smooth, faces).sum()
    return (*fill(vertices, faces, loops.subset(small)), int(np.count_nonzero(small)))


def fill(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], loops: Loops
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Add a disc of triangles bounded by each loop.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    loops : Loops

    Returns
    -------
    vertices : (n', 3) float array
        with the centres of fans appended
    faces : (m', 3) int array
        with the discs appended
    """
    if not len(loops):
        return vertices, faces
    sizes = np.diff(loops.starts)
    triangulated = sizes <= MAX_TRIANGULATED
    neighbours = adjacency(faces, len(vertices))
    while True:
        patch, done = _triangulate(vertices, loops.starts, loops.vertices, triangulated, *neighbours)
        # An edge that two fills share would have four faces: a fan instead of the later one.
        again = _shared_edges(patch, np.repeat(np.arange(len(sizes)), np.where(done, sizes - 2, 0)), len(vertices))
        triangulated = done.copy()
        triangulated[again] = False
        if not len(again):
            break
    patches = [faces, patch]
    centres: list[NDArray[np.float64]] = []
    for i in np.flatnonzero(~done).tolist():
        loop, centre = loops[i], len(vertices) + len(centres)
        centres.append(vertices[loop].mean(axis=0))
        patches.append(np.column_stack([loop, np.roll(loop, -1), np.full(len(loop), centre)]))
    return np.concatenate([vertices, np.reshape(centres, (-1, 3))]), np.concatenate(patches)


def _without_islands(vertices: NDArray[np.float64], faces: NDArray[np.int64], max_share: float) -> NDArray[np.int64]:
    """The faces without pieces, up to a share of the area, all of whose vertices have faces of other pieces."""
    partner = partners(faces, len(vertices))
    joined = np.flatnonzero(partner != BOUNDARY)
    if len(joined) == len(partner):
        return faces
    inner = joined[partner[joined] >= 0]
    piece = vertex_components(len(faces), np.column_stack([inner // 3, partner[inner] // 3]))
    area = np.bincount(piece, areas(vertices, faces))
    # A piece with an edge of more than two faces is no island.
    area[piece[joined[partner[joined] < 0] // 3]] = np.inf
    order = np.argsort(piece, kind="stable")
    bounds = np.searchsorted(piece[order], np.arange(len(area) + 1))
    n_faces_at = np.bincount(faces.ravel(), minlength=len(vertices))
    largest = max_share * area[np.isfinite(area)].sum()
    kept = np.ones(len(faces), np.bool_)
    for i in np.argsort(area, kind="stable").tolist():
        if area[i] > largest:
            break
        island = order[bounds[i] : bounds[i + 1]]
        corners, own = np.unique(faces[island], return_counts=True)
        if (n_faces_at[corners] > own).all():
            kept[island] = False
            n_faces_at[corners] -= own
    return faces[kept]


def _shared_edges(patch: NDArray[np.int64], loop: NDArray[np.int64], n_vertices: int) -> NDArray[np.int64]:
    """The later of each two loops whose fills have an inner edge in common."""
    if not len(patch):
        return np.empty(0, np.int64)
    start, end = patch[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2).T
    key = np.minimum(start, end) * n_vertices + np.maximum(start, end)
    of_loop = np.repeat(loop, 3)
    edge, per_loop = np.unique(np.column_stack([key, of_loop]), axis=0, return_counts=True)
    inner = edge[per_loop == 2]
    return np.unique(inner[1:][inner[1:, 0] == inner[:-1, 0], 1])


@compiled
def _trace(
    faces: NDArray[np.int64], partner: NDArray[np.int64], n_vertices: int
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Starts and vertices of the loops of boundary sides."""
    n_boundary = np.count_nonzero(partner == BOUNDARY)
    starts, loops = np.zeros(n_boundary + 1, np.int64), np.empty(n_boundary, np.int64)
    n_loops = 0
    visited = np.zeros(len(partner), np.bool_)
    trace = np.empty(n_boundary, np.int64)
    place = np.full(n_vertices, -1, np.int64)
    for first in range(len(partner)):
        if partner[first] != BOUNDARY or visited[first]:
            continue
        length, side, vertex = 0, first, head(faces, first)
        while side >= 0 and not visited[side]:
            visited[side] = True
            trace[length] = vertex
            length += 1
            vertex = tail(faces, side) if head(faces, side) == vertex else head(faces, side)
            side = _next_on_boundary(faces, partner, side, vertex)
        if side == first:
            n_loops = _split(trace[:length], place, starts, loops, n_loops)
    return starts[: n_loops + 1].copy(), loops[: starts[n_loops]].copy()


@compiled
def _next_on_boundary(faces: NDArray[np.int64], partner: NDArray[np.int64], side: int, vertex: int) -> int:
    """The other boundary side of the faces around a vertex, reached from a boundary side; negative if there is none."""
    while True:
        side = other_side(faces, side, vertex)
        if partner[side] == BOUNDARY:
            return side
        side = partner[side]
        if side < 0:
            return side


@compiled
def _split(
    trace: NDArray[np.int64],
    place: NDArray[np.int64],
    starts: NDArray[np.int64],
    loops: NDArray[np.int64],
    n_loops: int,
) -> int:
    """Append the pieces of a closed trace between its self-contacts to the loops; return how many loops there are."""
    path = np.empty_like(trace)
    length = 0
    for vertex in trace:
        if place[vertex] >= 0:
            n_loops = _append(path[place[vertex] : length], starts, loops, n_loops)
            for i in range(place[vertex] + 1, length):
                place[path[i]] = -1
            length = place[vertex] + 1
        else:
            place[vertex] = length
            path[length] = vertex
            length += 1
    place[path[:length]] = -1
    return _append(path[:length], starts, loops, n_loops)


@compiled
def _append(loop: NDArray[np.int64], starts: NDArray[np.int64], loops: NDArray[np.int64], n_loops: int) -> int:
    """Append a loop; return how many there are."""
    loops[starts[n_loops] : starts[n_loops] + len(loop)] = loop
    starts[n_loops + 1] = starts[n_loops] + len(loop)
    return n_loops + 1


@compiled
def _triangulate(
    vertices: NDArray[np.float64],
    starts: NDArray[np.int64],
    loops: NDArray[np.int64],
    wanted: NDArray[np.bool_],
    neighbour_starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Triangles of least cost in the wanted loops, and which loops have them: not those that would reuse an edge."""
    n_loops = len(starts) - 1
    triangles = np.empty((len(loops), 3), np.int64)
    done = np.zeros(n_loops, np.bool_)
    count = 0
    for i in range(n_loops):
        if not wanted[i]:
            continue
        loop = loops[starts[i] : starts[i + 1]]
        size = len(loop)
        middle = _best_middles(vertices, loop, neighbour_starts, neighbours)
        if middle[0, size - 1] < 0:
            continue
        done[i] = True
        stack = [(0, size - 1)]
        while len(stack) > 0:
            a, c = stack.pop()
            b = middle[a, c]
            triangles[count] = loop[a], loop[b], loop[c]
            count += 1
            if c - b > 1:
                stack.append((b, c))
            if b - a > 1:
                stack.append((a, b))
    return triangles[:count].copy(), done


@compiled
def _best_middles(
    vertices: NDArray[np.float64],
    loop: NDArray[np.int64],
    neighbour_starts: NDArray[np.int64],
    neighbours: NDArray[np.int64],
) -> NDArray[np.int64]:
    """The third corner of the triangle on the chord of corners a < c, on the side of b in between; -1 if there is none.

    Cost of the part of the loop from a to c: least sum of the areas of its triangles and of its share of the chords.
    """
    size = len(loop)
    middle = np.full((size, size), -1, np.int64)
    cost = np.zeros((size, size))
    for span in range(2, size):
        for a in range(size - span):
            c = a + span
            cost[a, c] = np.inf
            chord = CHORD_COST * _squared_distance(vertices[loop[a]], vertices[loop[c]]) if span < size - 1 else 0.0
            if span < size - 1 and _is_edge(loop[a], loop[c], neighbour_starts, neighbours):
                continue
            for b in range(a + 1, c):
                rest = chord + cost[a, b] + cost[b, c]
                if rest < cost[a, c]:
                    total = rest + _triangle_area(vertices[loop[a]], vertices[loop[b]], vertices[loop[c]])
                    if total < cost[a, c]:
                        cost[a, c], middle[a, c] = total, b
    return middle


@compiled
def _is_edge(a: int, b: int, starts: NDArray[np.int64], neighbours: NDArray[np.int64]) -> bool:
    """Whether two vertices are neighbours."""
    if starts[a + 1] - starts[a] > starts[b + 1] - starts[b]:
        a, b = b, a
    return bool(np.any(neighbours[starts[a] : starts[a + 1]] == b))


@compiled
def _squared_distance(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Square of the distance of two points."""
    return (a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2


@compiled
def _triangle_area(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> float:
    """Area of a triangle."""
    ux, uy, uz = b[0] - a[0], b[1] - a[1], b[2] - a[2]
    vx, vy, vz = c[0] - a[0], c[1] - a[1], c[2] - a[2]
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return 0.5 * np.sqrt(x * x + y * y + z * z)
