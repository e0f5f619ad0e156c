"""Thin handles cut: bridges that join parts far from each other along the surface, where a scanner fused them.

A handle is thin if the shape around it is much larger than it is itself. That shows in the shortest loop around it. At
the end of a handle the surface turns outwards, by 2π in all (Gauss-Bonnet): the angles around the vertices exceed
those of a flat surface by so much. The handle of a cup has rounded ends away from its waist, and its shortest loop has
next to no excess; a tube between two limbs, a strip or two fingers that touch are nothing but ends. So it is cut if

    its shortest loop is short against the shape, up to a share of the square root of the area, and
    the excess of angles on it and within an eighth of its length is more than half of 2π.

How many edges the loop has plays no role. Both are measured on the surface without its spikes and noise: these inflate
the area, and turn the surface around any loop, so that the handles of cups and chairs would be cut.

    remove spikes whose tips touch the surface in a vertex: what a single triangle between two parts is, once filled
    repeat while something is cut:
        on a copy whose holes are closed by cones, without faces at edges of more than two faces:
            none has to be sought if the Euler characteristic says genus 0
            words of the edges: a closed loop separates exactly if the XOR of its words is 0        `signatures`
            the shortest non-separating loop through each vertex where one can pass                 `_shortest_loops`
        for each class of loops (equal words), the one of the shortest loop first, unless it is cut already:
            cut along the loop, so that the smaller shore has copies of its vertices
            remove the faces at the copies, which are all of a tube without vertices of its own; fill what is opened

What is shaped like a real handle cannot be told apart from one: a tube longer than wide that has rings of vertices of
its own, and is narrowest there, looks like the rung of a chair, and stays. Parts that are welded, vertex by vertex,
are parted by `heatwalk.robust.welds` before.

References
----------
J. Erickson, K. Whittlesey, "Greedy optimal homotopy and homology generators", 2005 (tree and cotree);
Z. Wood, H. Hoppe, M. Desbrun, P. Schröder, "Removing excess topology from isosurfaces", 2004,
doi:10.1145/990002.990007
"""

import heapq
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heatwalk.laplacian import vertex_components
from heatwalk.numerics.compilation import compiled
from heatwalk.numerics.triangles import areas
from heatwalk.robust.half_edges import BOUNDARY, NON_MANIFOLD, head, partners, tail
from heatwalk.robust.holes import Denoised, Loops, boundary_loops, fill, unchanged

# Rounds of cutting: loops that share a vertex with one that is cut have to wait for the next.
MAX_ROUNDS = 12

# How far around a loop the excess of angles is summed, relative to its length. At an eighth, the shortest loops of the
# benchmark's real handles have up to 3.5 (1.1 of those up to `max_length`); tubes, touching fingers and the like 4.7.
NEIGHBOURHOOD = 1 / 8

# A spike that touches the surface with its tip is removed if it is longer than this, in perimeters of its base.
MIN_SPIKE = 0.5


def cut_thin_handles(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int64],
    max_length: float,
    min_excess: float,
    denoised: Denoised = unchanged,
) -> tuple[NDArray[np.float64], NDArray[np.int64], int, int]:
    """Cut thin handles, and spikes that touch the surface with their tips.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
        without repeated corners
    max_length : float
        of the loops that are cut, relative to the square root of the area
    min_excess : float
        angle by which the surface around a loop exceeds a flat one, in radians; 2π at the sharp end of a tube
    denoised : callable
        on what lengths and angles are measured: noise inflates the area, and turns the surface around any loop

    Returns
    -------
    vertices : (n', 3) float array
        with copies of vertices on loops, and centres of fans, appended
    faces : (m', 3) int array
    n_cut : int
        handles cut
    n_parted : int
        spikes removed
    """
    vertices, faces, n_parted = _part_contacts(vertices, faces)
    n_cut = 0
    for _ in range(MAX_ROUNDS):
        found = _thin_loops(vertices, faces, max_length, min_excess, denoised)
        if found is None:
            break
        vertices, faces, count = _cut(vertices, faces, *found)
        n_cut += count
    return vertices, faces, n_cut, n_parted


def _part_contacts(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], int]:
    """Remove spikes whose tips touch the surface elsewhere, in a vertex alone.

    Other contacts in a vertex stay: they conduct next to nothing, and keep small pieces with what they belong to.
    """
    n = len(vertices)
    partner = partners(faces, n)
    n_fans, n_used = count_fans(faces, partner), np.count_nonzero(np.bincount(faces.ravel(), minlength=n))
    if n_fans == n_used:
        return vertices, faces, 0
    open_at = np.zeros(n, np.bool_)
    sides = np.flatnonzero(partner < 0)
    open_at[faces[sides // 3, sides % 3]] = open_at[faces[sides // 3, (sides + 1) % 3]] = True
    parted, origin = split_fans(faces, partner, n, corner_angles(vertices, faces), ~open_at)
    if len(origin) == n:
        return vertices, faces, 0
    vertices = vertices[origin]
    at_copies = parted[(parted >= n).any(axis=1)]
    spike = np.zeros(len(origin), np.bool_)
    for copy in range(n, len(origin)):
        fan = at_copies[(at_copies == copy).any(axis=1)]
        base = fan[fan != copy].reshape(-1, 2)
        perimeter = np.linalg.norm(vertices[base[:, 0]] - vertices[base[:, 1]], axis=1).sum()
        height = np.linalg.norm(vertices[copy] - vertices[base].mean(axis=(0, 1)))
        spike[copy] = (base < n).all() and height > MIN_SPIKE * perimeter
    gone = spike[parted].any(axis=1)
    rim = np.zeros(n, np.bool_)
    rim[origin[parted[gone]]] = True
    return (*_fill_loops_among(vertices[:n], origin[parted[~gone]], rim), int(np.count_nonzero(spike)))


def _fill_loops_among(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], allowed: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Fill the boundary loops all of whose vertices are allowed."""
    loops = boundary_loops(faces, len(vertices))
    if not len(loops):
        return vertices, faces
    return fill(vertices, faces, loops.subset(np.logical_and.reduceat(allowed[loops.vertices], loops.starts[:-1])))


def _thin_loops(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], max_length: float, min_excess: float, denoised: Denoised
) -> tuple[Loops, NDArray[np.uint64]] | None:
    """Loops of vertices around thin handles, the shortest first, and their words; None if there are none."""
    closed = closed_copy(faces, len(vertices))
    if closed.genus == 0:
        return None
    vertices = denoised(vertices, faces)
    word = signatures(closed.faces, closed.partner, len(closed.origin))
    graph = _edges_around(closed.faces, closed.partner, word, vertices, closed.origin)
    starts, members, lengths, words = _shortest_loops(*graph, max_length * np.sqrt(areas(vertices, faces).sum()))
    excess = _angle_excess(vertices[np.maximum(closed.origin, 0)], closed.faces[: len(closed.face)])
    around = _sum_within(*graph[:3], excess, starts, members, NEIGHBOURHOOD * lengths)
    order = np.argsort(lengths, kind="stable")
    # The shortest loop of a class decides: at its two ends, any handle has loops around which the surface turns.
    _, shortest, of_class = np.unique(words[order], return_index=True, return_inverse=True)
    order = order[(around[order[shortest]] >= min_excess)[of_class]]
    if not len(order):
        return None
    chosen = [closed.origin[members[starts[i] : starts[i + 1]]] for i in order.tolist()]
    sizes = [len(loop) for loop in chosen]
    return Loops(np.concatenate([[0], np.cumsum(sizes)]), np.concatenate(chosen)), words[order]


def _cut(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], loops: Loops, words: NDArray[np.uint64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], int]:
    """Cut disjoint loops of independent classes, and fill what is opened; also the number of handles cut."""
    n = len(vertices)
    at_cut = np.zeros(n, np.bool_)
    basis: list[int] = []
    edges = []
    for i in range(len(loops)):
        loop, rest = loops[i], _reduced(int(words[i]), basis)
        if rest != 0 and not at_cut[loop].any() and len(np.unique(loop)) == len(loop):
            basis.append(rest)
            edges.append(np.column_stack([loop, np.roll(loop, -1)]))
            at_cut[loop] = True
    partner = partners(faces, n)
    cut = np.sort(np.concatenate(edges), axis=1)
    a, b = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    partner[np.isin(np.minimum(a, b) * n + np.maximum(a, b), cut[:, 0] * n + cut[:, 1])] = BOUNDARY
    faces, origin = split_fans(faces, partner, n, corner_angles(vertices, faces), at_cut)
    # Copies have no label: the faces at them can go, and with them what is left of a tube without vertices of its own.
    gone = (faces >= n).any(axis=1)
    bare = np.ones(len(origin), np.bool_)
    bare[faces[~gone]] = False
    bare[n:] = False
    gone &= ~bare[faces].any(axis=1)
    opened = at_cut[origin]
    opened[faces[gone]] = True
    return (*_fill_loops_among(vertices[origin], faces[~gone], opened), len(edges))


def _reduced(word: int, basis: list[int]) -> int:
    """What remains of a word modulo the XORs of a basis; 0 if it is one of them."""
    for other in basis:
        word = min(word, word ^ other)
    return word


def _angle_excess(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Sum of the angles around each vertex minus 2π: (n,) float array."""
    angles = np.bincount(faces.ravel(), corner_angles(vertices, faces), len(vertices))
    return np.asarray(angles - 2 * np.pi, np.float64)


def corner_angles(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Angle of each corner of each face: (3 m,) float array."""
    angles = np.empty(faces.shape)
    for i in range(3):
        a, b, c = (vertices[faces[:, (i + k) % 3]] for k in range(3))
        u, v = b - a, c - a
        angles[:, i] = np.arctan2(np.linalg.norm(np.cross(u, v), axis=1), np.einsum("ij,ij->i", u, v))
    return angles.ravel()


@compiled
def fan_of_corners(faces: NDArray[np.int64], partner: NDArray[np.int64]) -> NDArray[np.int64]:
    """The fan of each corner, the smallest of its corners: (3 m,) int array.

    Corner i of face f is number 3 f + i. Corners at a vertex belong to one fan if their faces are joined by sides with
    partners.
    """
    parent = np.arange(3 * len(faces))
    for side in range(3 * len(faces)):
        other = partner[side]
        if other <= side:
            continue
        for corner in (side, side - side % 3 + (side + 1) % 3):
            vertex = faces[corner // 3, corner % 3]
            twin = other if tail(faces, other) == vertex else other - other % 3 + (other + 1) % 3
            a, b = _root(parent, corner), _root(parent, twin)
            parent[max(a, b)] = min(a, b)
    for corner in range(len(parent)):
        parent[corner] = _root(parent, corner)
    return parent


@compiled
def count_fans(faces: NDArray[np.int64], partner: NDArray[np.int64]) -> int:
    """Number of fans; that of the vertices with faces if there is one around each."""
    fan = fan_of_corners(faces, partner)
    return int(np.count_nonzero(fan == np.arange(len(fan))))


@compiled
def _root(parent: NDArray[np.int64], node: int) -> int:
    """Root of the tree of a node; shortens the path to it on the way."""
    while parent[node] != node:
        parent[node] = parent[parent[node]]
        node = parent[node]
    return node


def split_fans(
    faces: NDArray[np.int64],
    partner: NDArray[np.int64],
    n_vertices: int,
    angle: NDArray[np.float64],
    allowed: NDArray[np.bool_] | None = None,
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Give each fan of faces around a vertex a vertex of its own: the fan of the largest angle keeps the vertex.

    Parameters
    ----------
    faces : (m, 3) int array
    partner : (3 m,) int array
    n_vertices : int
    angle : (3 m,) float array
        of each corner
    allowed : (n_vertices,) bool array, optional
        the vertices that are split; all by default

    Returns
    -------
    faces : (m, 3) int array
        with copies n, n + 1 …
    origin : (n',) int array
        the vertex of which each vertex is a copy; the first n are their own
    """
    fan = fan_of_corners(faces, partner)
    fans, of_corner = np.unique(fan, return_inverse=True)
    vertex = faces.ravel()[fans]
    order = np.lexsort((fans, -np.bincount(of_corner, angle), vertex))
    first = np.ones(len(fans), np.bool_)
    first[1:] = vertex[order[1:]] != vertex[order[:-1]]
    if allowed is not None:
        first |= ~allowed[vertex[order]]
    number = np.empty(len(fans), np.int64)
    number[order[first]] = vertex[order[first]]
    number[order[~first]] = n_vertices + np.arange(np.count_nonzero(~first))
    return number[of_corner].reshape(-1, 3), np.concatenate([np.arange(n_vertices), vertex[order[~first]]])


@dataclass(frozen=True)
class ClosedCopy:
    """A closed manifold for looking for loops: without the faces at non-manifold edges, with cones over the holes.

    Attributes
    ----------
    faces : (m', 3) int array
        those of the surface first, then those of the cones
    partner : (3 m',) int array, none negative
    origin : (n',) int array
        the vertex of which each vertex is a copy; -1 for the tip of a cone
    face : (p,) int array
        the faces of the surface that are here, in this order
    """

    faces: NDArray[np.int64]
    partner: NDArray[np.int64]
    origin: NDArray[np.int64]
    face: NDArray[np.int64]

    @property
    def genus(self) -> int:
        """Sum over the components of 1 - χ / 2 with the Euler characteristic χ; twice that if it is not orientable."""
        used = np.bincount(self.faces.ravel(), minlength=len(self.origin)) > 0
        component = vertex_components(len(self.origin), self.faces)
        n_components = np.count_nonzero(np.bincount(component[used]))
        euler = np.count_nonzero(used) - len(self.partner) // 2 + len(self.faces)
        return int(n_components - euler // 2)


def closed_copy(faces: NDArray[np.int64], n_vertices: int) -> ClosedCopy:
    """Make the closed copy of a surface."""
    partner = partners(faces, n_vertices)
    face = np.flatnonzero((partner != NON_MANIFOLD).reshape(-1, 3).all(axis=1))
    if len(face) < len(faces):
        partner = partners(faces[face], n_vertices)
    copy, origin = split_fans(faces[face], partner, n_vertices, np.ones(3 * len(face)))
    loops = boundary_loops(copy, len(origin)) if (partner < 0).any() else None
    if loops is not None and len(loops):
        sizes = np.diff(loops.starts)
        following = np.arange(1, len(loops.vertices) + 1)
        following[loops.starts[1:] - 1] = loops.starts[:-1]
        tips = len(origin) + np.repeat(np.arange(len(sizes)), sizes)
        copy = np.concatenate([copy, np.column_stack([loops.vertices, loops.vertices[following], tips])])
        origin = np.concatenate([origin, np.full(len(sizes), -1)])
        partner = partners(copy, len(origin))
    return ClosedCopy(copy, partner, origin, face)


@compiled
def signatures(faces: NDArray[np.int64], partner: NDArray[np.int64], n_vertices: int) -> NDArray[np.uint64]:
    """A word for each side: a closed loop of edges separates the surface exactly if the XOR of its words is 0.

    Of a closed manifold. A spanning tree of the faces is grown breadth first; a spanning forest of the vertices along
    the edges that it does not cross. Each edge that is left over closes a loop of faces, and has a random word; an
    edge has the XOR of the words of the loops that cross it. (2 genus random words of 64 bits: two combinations are
    equal with a probability of 2^-64.)
    """
    n_faces = len(faces)
    order, entry = np.empty(n_faces, np.int64), np.full(n_faces, -2, np.int64)  # the side through which it was reached
    count = 0
    for seed in range(n_faces):
        if entry[seed] != -2:
            continue
        entry[seed] = -1
        order[count] = seed
        first = count
        count += 1
        while first < count:
            f = order[first]
            first += 1
            for i in range(3):
                other = partner[3 * f + i]
                if entry[other // 3] == -2:
                    entry[other // 3] = other
                    order[count] = other // 3
                    count += 1
    crossed = np.zeros(3 * n_faces, np.bool_)
    for f in range(n_faces):
        if entry[f] >= 0:
            crossed[entry[f]] = crossed[partner[entry[f]]] = True
    parent = np.arange(n_vertices)
    word = np.zeros(3 * n_faces, np.uint64)
    of_face = np.zeros(n_faces, np.uint64)
    state = np.uint64(0)
    for side in range(3 * n_faces):
        other = partner[side]
        if other < side or crossed[side]:
            continue
        a, b = _root(parent, tail(faces, side)), _root(parent, head(faces, side))
        if a != b:
            parent[max(a, b)] = min(a, b)
            continue
        state += np.uint64(0x9E3779B97F4A7C15)  # splitmix64
        z = state
        z = (z ^ (z >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
        z = (z ^ (z >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
        z = z ^ (z >> np.uint64(31))
        word[side] = word[other] = z
        of_face[side // 3] ^= z
        of_face[other // 3] ^= z
    for i in range(n_faces - 1, -1, -1):
        f = order[i]
        if entry[f] >= 0:
            before = partner[entry[f]]
            word[entry[f]] = word[before] = of_face[f]
            of_face[before // 3] ^= of_face[f]
    return word


@compiled
def _edges_around(
    faces: NDArray[np.int64],
    partner: NDArray[np.int64],
    word: NDArray[np.uint64],
    vertices: NDArray[np.float64],
    origin: NDArray[np.int64],
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.uint64]]:
    """For each vertex the edges to others: starts, ends, lengths, words. Those of cones are left out."""
    n = len(origin)
    starts = np.zeros(n + 1, np.int64)
    for side in range(len(partner)):
        a, b = tail(faces, side), head(faces, side)
        if side < partner[side] and origin[a] >= 0 and origin[b] >= 0:
            starts[a + 1] += 1
            starts[b + 1] += 1
    for v in range(n):
        starts[v + 1] += starts[v]
    place = starts[:-1].copy()
    ends, lengths, words = np.empty(starts[n], np.int64), np.empty(starts[n]), np.empty(starts[n], np.uint64)
    for side in range(len(partner)):
        a, b = tail(faces, side), head(faces, side)
        if side < partner[side] and origin[a] >= 0 and origin[b] >= 0:
            x, y = vertices[origin[a]], vertices[origin[b]]
            length = np.sqrt((x[0] - y[0]) ** 2 + (x[1] - y[1]) ** 2 + (x[2] - y[2]) ** 2)
            for p, q in ((a, b), (b, a)):
                ends[place[p]], lengths[place[p]], words[place[p]] = q, length, word[side]
                place[p] += 1
    return starts, ends, lengths, words


@compiled
def _shortest_loops(
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    lengths: NDArray[np.float64],
    words: NDArray[np.uint64],
    longest: float,
) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.float64], NDArray[np.uint64]]:
    """Shortest non-separating loops through the vertices of edges with words, up to a length.

    Returns
    -------
    starts, vertices, lengths, words
        of the loops, one for each vertex through which there is one
    """
    n = len(starts) - 1
    distance, parent, settled = np.full(n, np.inf), np.full(n, -1, np.int64), np.zeros(n, np.bool_)
    signature = np.zeros(n, np.uint64)
    loop_starts, loop_vertices = [0], [0]
    loop_vertices.pop()
    loop_lengths, loop_words = [0.0], [np.uint64(0)]
    loop_lengths.pop()
    loop_words.pop()
    for source in range(n):
        if not np.any(words[starts[source] : starts[source + 1]] != 0):
            continue
        touched = [source]
        distance[source] = 0.0
        signature[source] = 0
        queue = [(0.0, source)]
        best, best_a, best_b, best_word = longest, -1, -1, np.uint64(0)
        while len(queue) > 0:
            d, a = heapq.heappop(queue)
            if settled[a]:
                continue
            if 2 * d > best:
                break
            settled[a] = True
            for i in range(starts[a], starts[a + 1]):
                b, step = ends[i], d + lengths[i]
                if settled[b]:
                    if parent[a] != b and parent[b] != a:
                        word = signature[a] ^ signature[b] ^ words[i]
                        if word != 0 and step + distance[b] < best:
                            best, best_a, best_b, best_word = step + distance[b], a, b, word
                elif step < distance[b] and 2 * step <= best:
                    if distance[b] == np.inf:
                        touched.append(b)
                    distance[b] = step
                    parent[b] = a
                    signature[b] = signature[a] ^ words[i]
                    heapq.heappush(queue, (step, b))
        if best_a >= 0:
            left, right = [best_a], [best_b]
            while left[-1] != source:
                left.append(parent[left[-1]])
            while right[-1] != source:
                right.append(parent[right[-1]])
            while len(left) > 1 and len(right) > 1 and left[-2] == right[-2]:
                left.pop()
                right.pop()
            if left[-1] == source:  # otherwise the loop is found from its own vertices
                for v in left:
                    loop_vertices.append(v)
                for k in range(len(right) - 2, -1, -1):
                    loop_vertices.append(right[k])
                loop_starts.append(len(loop_vertices))
                loop_lengths.append(best)
                loop_words.append(best_word)
        for v in touched:
            distance[v], parent[v], settled[v] = np.inf, -1, False
    return np.array(loop_starts), np.array(loop_vertices), np.array(loop_lengths), np.array(loop_words)


@compiled
def _sum_within(
    starts: NDArray[np.int64],
    ends: NDArray[np.int64],
    lengths: NDArray[np.float64],
    values: NDArray[np.float64],
    loop_starts: NDArray[np.int64],
    loops: NDArray[np.int64],
    radii: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Sum of the values of the vertices within a radius of each loop along the edges: (p,) float array."""
    n = len(starts) - 1
    distance, settled = np.full(n, np.inf), np.zeros(n, np.bool_)
    total = np.zeros(len(radii))
    for i in range(len(radii)):
        touched = [loops[loop_starts[i]]]
        queue = [(0.0, loops[loop_starts[i]])]
        for v in loops[loop_starts[i] : loop_starts[i + 1]]:
            distance[v] = 0.0
            touched.append(v)
            heapq.heappush(queue, (0.0, v))
        while len(queue) > 0:
            d, a = heapq.heappop(queue)
            if settled[a]:
                continue
            settled[a] = True
            total[i] += values[a]
            for k in range(starts[a], starts[a + 1]):
                b, step = ends[k], d + lengths[k]
                if step <= radii[i] and step < distance[b]:
                    distance[b] = step
                    touched.append(b)
                    heapq.heappush(queue, (step, b))
        for v in touched:
            distance[v], settled[v] = np.inf, False
    return total
