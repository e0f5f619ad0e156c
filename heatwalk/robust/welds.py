"""Welds parted: places where parts that touch were merged, vertex by vertex.

Where two fingers that touch were merged, the surface is no manifold: edges have four faces, vertices two fans of faces
around them, and heat flows from one finger to the other. The two sheets of the surface face each other there, so that
their normals tell which faces belong together:

    at each edge of more than two faces, join those two on different sides of it whose normals are nearest to each
        other, then the next two; what remains of an odd number is left open
    give each fan of faces around a vertex a vertex of its own, if
        no face is missing around it: holes part fans, too, and are filled later, and
        its fans are joined to each other elsewhere along edges: so no surface falls apart

It is a guess where vertices were merged across each other, so that the sheets are folded, and where a face of one lies
on a face of the other, of which only one is left: the hole in the other sheet is filled with the small holes.
"""

import numpy as np
from numpy.typing import NDArray

from heatwalk.laplacian import vertex_components
from heatwalk.numerics.compilation import compiled
from heatwalk.robust.half_edges import BOUNDARY, NON_MANIFOLD, head, partners, tail
from heatwalk.robust.handles import corner_angles, count_fans, split_fans


def part_welds(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], int]:
    """Part a surface where it was welded to itself.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
        without repeated corners

    Returns
    -------
    vertices : (n', 3) float array
        with copies of vertices appended
    faces : (m, 3) int array
        the same faces, some of them at copies
    n_parted : int
        number of copies

    Examples
    --------
    The two ends of a bent capsule, merged in a vertex:

    >>> import trimesh
    >>> mesh = trimesh.creation.icosphere(2)
    >>> low, high = mesh.vertices[:, 2].argmin(), mesh.vertices[:, 2].argmax()
    >>> faces = np.where(mesh.faces == high, low, mesh.faces)
    >>> part_welds(np.array(mesh.vertices), faces)[2]
    1
    """
    n = len(vertices)
    partner = partners(faces, n)
    if not (partner == NON_MANIFOLD).any():
        n_used = np.count_nonzero(np.bincount(faces.ravel(), minlength=n))
        if count_fans(faces, partner) == n_used:
            return vertices, faces, 0
    missing = np.flatnonzero(partner == BOUNDARY)
    allowed = np.ones(n, np.bool_)
    allowed[faces[missing // 3, missing % 3]] = allowed[faces[missing // 3, (missing + 1) % 3]] = False
    partner = _with_sheets_joined(faces, partner, _unit_normals(vertices, faces), n)
    joined = np.flatnonzero(partner >= 0)
    sheet = np.repeat(vertex_components(len(faces), np.column_stack([joined // 3, partner[joined] // 3])), 3)
    first, last = np.full(n, len(faces)), np.full(n, -1)
    np.minimum.at(first, faces.ravel(), sheet)
    np.maximum.at(last, faces.ravel(), sheet)
    parted, origin = split_fans(faces, partner, n, corner_angles(vertices, faces), allowed & (first == last))
    return vertices[origin], parted, len(origin) - n


def _unit_normals(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Unit normal of each face; zero if it has no area: (m, 3) float array."""
    a, b, c = (vertices[faces[:, i]] for i in range(3))
    normals = np.cross(b - a, c - a)
    return normals / np.maximum(np.linalg.norm(normals, axis=1), np.finfo(float).tiny)[:, None]


def _with_sheets_joined(
    faces: NDArray[np.int64], partner: NDArray[np.int64], normals: NDArray[np.float64], n_vertices: int
) -> NDArray[np.int64]:
    """The partners of the sides, also of those at edges of more than two faces: (3 m,) int array."""
    sides = np.flatnonzero(partner == NON_MANIFOLD)
    a, b = faces[sides // 3, sides % 3], faces[sides // 3, (sides + 1) % 3]
    key = np.minimum(a, b) * n_vertices + np.maximum(a, b)
    order = np.argsort(key, kind="stable")
    starts = np.flatnonzero(np.diff(key[order], prepend=-1, append=-1))
    return _join_sheets(faces, partner.copy(), normals, sides[order], starts)


@compiled
def _join_sheets(
    faces: NDArray[np.int64],
    partner: NDArray[np.int64],
    normals: NDArray[np.float64],
    sides: NDArray[np.int64],
    starts: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Join the sides ``sides[starts[i]:starts[i + 1]]`` at each edge, those of nearest normals first."""
    for group in range(len(starts) - 1):
        around = sides[starts[group] : starts[group + 1]]
        for side in around:
            partner[side] = BOUNDARY
        while True:
            best, best_p, best_q = -2.0, -1, -1
            for i in range(len(around)):
                p = around[i]
                for q in around[:i]:
                    if partner[p] != BOUNDARY or partner[q] != BOUNDARY or tail(faces, p) != head(faces, q):
                        continue
                    nearness = 0.0
                    for k in range(3):
                        nearness += normals[p // 3, k] * normals[q // 3, k]
                    if nearness > best:
                        best, best_p, best_q = nearness, p, q
            if best_p < 0:
                break
            partner[best_p], partner[best_q] = best_q, best_p
    return partner
