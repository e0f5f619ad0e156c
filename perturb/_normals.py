"""Vertex normals that remain right on meshes as they are found: two-sided, wound inconsistently, with far specks.

For each vertex, the unit normals of its faces are added, weighted by the angles of the corners. Beyond that:

1. A face that occurs several times, in either winding, counts once.
2. Whether a face is degenerate, and its normal, are decided relative to its own edges, not to the size of the mesh.
3. Where neighbouring faces are wound differently, the minority is reversed: in each patch of faces that are connected
   across edges of exactly two faces or, where a patch is one-sided, around each vertex.
4. Where the sum still cancels (at a zero-thickness fin), all faces are oriented like the one with the largest angle.
"""

from __future__ import annotations

import numpy as np

SLIVER_ANGLE = 1e-8  # radians; arccos is not more precise near 1
FLATNESS = 1e-13  # the cross product of two edges over the squared longest one, below which a face is degenerate
SMALL = 2.0**-20  # a face smaller than this share of the mesh is computed from the coordinates as they are
CANCELLED = 1e-6  # a sum of normals below this share of the sum of their weights has no meaningful direction
TIE = 1e-9  # relative; angles that differ by less are equal


def compute_vertex_normals(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(n, 3) unit normals; zero for a vertex without faces, or with degenerate ones only."""
    from trimesh.util import unitize

    n_vertices = len(vertices)
    faces = faces[distinct_faces(faces)]
    if len(faces) == 0:
        return np.zeros((n_vertices, 3))
    normals, angles, regular = _face_normals_and_angles(vertices, faces)
    signs = consistent_signs(faces)
    # A sliver, the direction of which is unreliable, counts only at vertices that have no other faces.
    angle_sum = np.bincount(faces[regular].ravel(), angles[regular].ravel(), n_vertices)
    angles = np.where(regular[:, None] | (angle_sum[faces] == 0), angles, 0.0)
    angle_sum = np.bincount(faces.ravel(), angles.ravel(), n_vertices)
    total = _weighted_sum(faces, signs * angles, normals, n_vertices)
    cancelled = _norms(total) <= CANCELLED * angle_sum
    if (cancelled & (angle_sum > 0)).any():
        signs *= _signs_towards_widest(faces, signs, angles, normals, cancelled)
        total[cancelled] = _weighted_sum(faces, signs * angles, normals, n_vertices)[cancelled]
    narrow = (angle_sum > 0) & (angle_sum < SLIVER_ANGLE)
    total[narrow] /= angle_sum[narrow, None]
    return unitize(total)


def distinct_faces(faces: np.ndarray) -> np.ndarray:
    """(k,) indices, ascending, of the faces with three different corners; of those with the same three, the first."""
    proper = np.flatnonzero(~has_repeated_corner(faces))
    corners = np.sort(faces[proper], axis=1)
    order = np.lexsort(corners.T)  # stable: of equal faces the first comes first
    is_first = np.ones(len(order), dtype=bool)
    is_first[order[1:]] = (np.diff(corners[order], axis=0) != 0).any(axis=1)
    return proper[is_first]


def has_repeated_corner(faces: np.ndarray) -> np.ndarray:
    """(m,) bool: whether two corners of a face are the same vertex."""
    return (faces == np.roll(faces, 1, axis=1)).any(axis=1)


def is_degenerate(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    """(m,) bool: whether the area of a face is 0, or as small as the rounding of its coordinates."""
    from trimesh.triangles import cross

    if len(faces) == 0:
        return np.zeros(0, dtype=bool)
    triangles, rounding = _local_triangles(vertices, faces)
    return _norms(cross(triangles)) <= np.maximum(FLATNESS, rounding)


def _norms(vectors: np.ndarray) -> np.ndarray:
    return np.linalg.norm(vectors, axis=1)


def _face_normals_and_angles(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return unit normals (m, 3) and angles (m, 3), zero for degenerate faces; and which faces are no slivers (m,)."""
    from trimesh.triangles import angles as angles_by_arccos
    from trimesh.triangles import cross
    from trimesh.util import unitize

    triangles, rounding = _local_triangles(vertices, faces)
    crosses = cross(triangles)
    proper = _norms(crosses) > np.maximum(FLATNESS, rounding)
    normals = np.where(proper[:, None], unitize(crosses, threshold=0.0), 0.0)
    angles = angles_by_arccos(triangles)
    regular = proper & (angles > 0).all(axis=1)
    sliver = proper & ~regular
    angles[sliver] = _angles_by_arctan(triangles[sliver])
    angles[~proper] = 0.0
    return normals, angles, regular


def _local_triangles(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return each face at a scale at which its size is about 1, and how far it is determined by its coordinates.

    Scaling by a power of two changes no digit.

    Returns
    -------
    triangles : (m, 3, 3) float array
        The corners, in different units and with different origins.
    rounding : (m,) float array
        The norm of the cross product of two edges that rounding of the coordinates can make of a degenerate face.
    """
    used = vertices[faces]
    low = used.min(axis=(0, 1))
    box = (used - low) / max((used.max(axis=(0, 1)) - low).max(), np.finfo(float).tiny)
    # Coordinates in the box have lost the digits that a small face consists of.
    exact = used - used[:, :1]
    triangles = np.where((_extents(box) < SMALL)[:, None, None], exact, box)
    triangles = np.ldexp(triangles, -np.frexp(_extents(triangles))[1][:, None, None])
    extent = _extents(exact)
    spacing = np.spacing(np.abs(used).max(axis=(1, 2)))
    rounding = 4 * np.divide(spacing, extent, out=np.full(len(faces), np.inf), where=extent > 0)
    return triangles, rounding


def _extents(triangles: np.ndarray) -> np.ndarray:
    """(m,) the longest side of the bounding box of each triangle (m, 3, 3)."""
    # np.ptp, along an axis of length 3, takes five times as long.
    first, second, third = triangles[:, 0], triangles[:, 1], triangles[:, 2]
    x, y, z = (np.maximum(np.maximum(first, second), third) - np.minimum(np.minimum(first, second), third)).T
    return np.maximum(np.maximum(x, y), z)


def _angles_by_arctan(triangles: np.ndarray) -> np.ndarray:
    """(m, 3) the angles, with small ones precise."""
    to_next, to_last = np.roll(triangles, -1, axis=1) - triangles, np.roll(triangles, 1, axis=1) - triangles
    sine = np.linalg.norm(np.cross(to_next, to_last), axis=2)
    return np.arctan2(sine, (to_next * to_last).sum(axis=2))


def _weighted_sum(faces: np.ndarray, weights: np.ndarray, normals: np.ndarray, n_vertices: int) -> np.ndarray:
    """(n, 3) for each vertex the sum of the normals (m, 3) of its faces, with weights (m, 3) per corner."""
    from trimesh.geometry import index_sparse

    kept = (weights != 0).any(axis=1)
    return index_sparse(n_vertices, faces[kept], data=weights[kept].ravel()).dot(normals[kept])


def consistent_signs(faces: np.ndarray) -> np.ndarray:
    """(m, 3) for each corner 1.0, or -1.0 where the face has to be reversed to be wound like its neighbours."""
    signs = np.ones(faces.shape)
    first, second, opposed = _adjacent_faces(faces)
    if not opposed.any():
        return signs
    face_signs, one_sided = _propagate(len(faces), first // 3, second // 3, opposed)
    signs *= face_signs[:, None]
    if one_sided.any():
        # Around a vertex, faces can always be wound alike. Half-edge 3 f + i runs from corner i to the next one.
        same = faces.ravel()[first] == faces.ravel()[second]  # the half-edges run in the same direction
        next_first, next_second = _next_corner(first), _next_corner(second)
        pairs = (
            np.r_[first, next_first],
            np.r_[np.where(same, second, next_second), np.where(same, next_second, second)],
        )
        corner_signs, _ = _propagate(3 * len(faces), *pairs, np.r_[opposed, opposed])
        signs *= np.where(one_sided[:, None], corner_signs.reshape(-1, 3), 1.0)
    return signs


def _next_corner(corner: np.ndarray) -> np.ndarray:
    """(k,) the corner after each corner of the same face; corner i of face f is 3 f + i."""
    return corner - corner % 3 + (corner + 1) % 3


def _adjacent_faces(faces: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return, for each edge of two faces, their half-edges (k,) and (k,), and whether they are wound differently."""
    start, end = faces.ravel(), np.roll(faces, -1, axis=1).ravel()
    edges = np.stack([np.minimum(start, end), np.maximum(start, end)], axis=1)
    order = np.lexsort(edges.T)
    begins = np.r_[True, (np.diff(edges[order], axis=0) != 0).any(axis=1)]
    position = np.flatnonzero(begins)
    pair = position[np.diff(np.r_[position, len(order)]) == 2]
    first, second = order[pair], order[pair + 1]
    return first, second, start[first] == start[second]


def _propagate(n: int, first: np.ndarray, second: np.ndarray, opposed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Give each of n items a sign such that the two items of an opposed pair differ and those of other pairs agree.

    Returns
    -------
    signs : (n,) float array
        1.0 for the majority of each connected set of items, -1.0 for the others; if there is no majority, 1.0 for the
        first item. 1.0 throughout a set in which no such signs exist.
    contradictory : (n,) bool array
        Whether an item is in such a set.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # Two copies of each item, one for each sign; a pair connects the copies that are compatible.
    rows = np.r_[first, first + n]
    columns = np.r_[np.where(opposed, second + n, second), np.where(opposed, second, second + n)]
    graph = coo_array((np.ones(len(rows), dtype=bool), (rows, columns)), shape=(2 * n, 2 * n))
    n_sets, copy = connected_components(graph, directed=False)
    kept, reversed_ = copy[:n], copy[n:]
    contradictory = kept == reversed_
    # The copies of a set of items form two sets, each with the opposite signs of the other.
    size = np.bincount(kept, minlength=n_sets)
    first_item = np.full(n_sets, n)
    np.minimum.at(first_item, kept, np.arange(n))
    minority = size[kept] < size[reversed_]
    tie_lost = (size[kept] == size[reversed_]) & (first_item[kept] > first_item[reversed_])
    return np.where((minority | tie_lost) & ~contradictory, -1.0, 1.0), contradictory


def _signs_towards_widest(
    faces: np.ndarray, signs: np.ndarray, angles: np.ndarray, normals: np.ndarray, cancelled: np.ndarray
) -> np.ndarray:
    """(m, 3) for corners at the cancelled vertices, 1.0 or -1.0: whether to reverse the face.

    After that, all normals at such a vertex are within 90 degrees of that of the face with the largest angle there, of
    several equal ones that of the first.
    """
    vertex = faces.ravel()
    largest = np.zeros(len(cancelled))
    np.maximum.at(largest, vertex, angles.ravel())
    widest = np.flatnonzero(angles.ravel() >= (1 - TIE) * largest[vertex])[::-1]
    reference = np.zeros(len(cancelled), dtype=np.int64)
    reference[vertex[widest]] = widest  # the last assignment, which is that of the first corner, remains
    signed_normals = signs.ravel()[:, None] * normals[np.arange(len(vertex)) // 3]
    against = (signed_normals * signed_normals[reference[vertex]]).sum(axis=1) < 0
    return np.where(against & cancelled[vertex], -1.0, 1.0).reshape(-1, 3)
