"""Borders stitched: vertices at the same position joined, where the surface is open.

Files whose format has no indices have three vertices per triangle, and exports split vertices where textures or normals
change, so that heat does not flow from one side of such a seam to the other. Vertices are joined only if

    they are on the boundary of the surface: closed surfaces that touch each other stay apart; and
    their coordinates are equal, bit by bit: how near others may be is left to whoever reads the file (``weld``).
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.rows import merge_equal
from heatwalk.robust.half_edges import BOUNDARY, partners


class Stitched(NamedTuple):
    """A mesh some of whose vertices are joined.

    Attributes
    ----------
    origin : (k,) int array
        of each vertex of it, the first of those that it was made of, ascending
    number : (n,) int array
        what became of each vertex: ``number[origin]`` is 0 … k - 1
    faces : (m, 3) int array
        the faces, at the joined vertices
    """

    origin: NDArray[np.int64]
    number: NDArray[np.int64]
    faces: NDArray[np.int64]

    @classmethod
    def unchanged(cls, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> "Stitched":
        """The mesh as it is."""
        number = np.arange(len(vertices))
        return cls(number, number, faces)


def stitch_borders(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Stitched:
    """Join vertices at the same position on the boundary.

    Parameters
    ----------
    vertices : (n, 3) float array, finite
    faces : (m, 3) int array

    Returns
    -------
    Stitched

    Examples
    --------
    Twenty triangles, each with corners of its own, make an icosahedron again:

    >>> import trimesh
    >>> ball = trimesh.creation.icosahedron()
    >>> corners = np.array(ball.vertices)[ball.faces.ravel()]
    >>> stitched = stitch_borders(corners, np.arange(60).reshape(20, 3))
    >>> len(stitched.origin), trimesh.Trimesh(corners[stitched.origin], stitched.faces).is_watertight
    (12, True)
    """
    n = len(vertices)
    proper = faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)]
    open_sides = np.flatnonzero(partners(proper, n) == BOUNDARY)
    on_boundary = np.zeros(n, np.bool_)
    for corner in (open_sides % 3, (open_sides + 1) % 3):
        on_boundary[proper[open_sides // 3, corner]] = True
    candidates = np.flatnonzero(on_boundary)
    position = merge_equal(vertices[candidates] + 0.0)[1]
    first = np.full(position.max(initial=-1) + 1, n)
    np.minimum.at(first, position, candidates)
    if len(first) == len(candidates):
        return Stitched.unchanged(vertices, faces)
    joined_to = np.arange(n)
    joined_to[candidates] = first[position]
    origin = np.flatnonzero(joined_to == np.arange(n))
    number = np.searchsorted(origin, joined_to)
    return Stitched(origin, number, number[faces])
