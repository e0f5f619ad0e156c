"""Vertices that coincide: how many there are, and merging them."""

import numbers

import numpy as np
from numpy.typing import NDArray

from heatwalk.meshes import MeshError
from heatwalk.numerics.rows import merge_equal

# Vertices nearer to each other than this fraction of the bounding-box diagonal are meant to be one vertex: about a
# hundred times the rounding of single precision.
NEAR = 1e-5

# Near vertices are counted only where edges are much longer than the distance: at this many times, at least, for half
# of the edges. On a small mesh with a speck far away, everything is near in comparison with the diagonal.
_MIN_EDGES = 10

# Neighbours in the sorted order that are compared with each vertex at most: it bounds the time for dense meshes.
_MAX_COMPARED = 256

# More than what rounding adds to a coordinate's share of a distance.
_ROUNDING = 1 + 1e-9

# Faces whose edges are measured for that.
_SAMPLE = 1000

# Pairs of near vertices, per vertex, above which a tolerance is refused: it would merge whole regions.
_MAX_PAIRS = 200

Weld = str | float | None


def check_weld(weld: Weld) -> None:
    """Raise MeshError unless a value of the option ``weld`` is None, "exact", or a number between 0 and 1."""
    is_number = isinstance(weld, numbers.Real) and not isinstance(weld, bool)
    if not (weld is None or weld == "exact" or (is_number and 0 < float(weld) < 1)):
        raise MeshError(
            f"weld={weld!r} must be 'exact' or a positive number below 1, the distance in bounding-box diagonals"
        )


def count_coincident(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[int, int]:
    """Number of vertices that coincide with another one, exactly and nearly.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array

    Returns
    -------
    exact : int
        vertices whose coordinates are exactly those of another vertex
    near : int
        other vertices within `NEAR` bounding-box diagonals of another vertex that no edge connects with them; 0 if
        half of the edges are shorter than ten times that

    Examples
    --------
    >>> count_coincident(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 1e-9], [1, 1, 0]]),
    ...                  np.array([[0, 1, 2], [3, 5, 4]]))
    (2, 2)
    """
    points, radius = _scaled(vertices)
    has_long_edges = radius > 0 and _has_long_edges(points, faces, radius)
    # In the order of their distance along a direction that no mesh has, coincident vertices are next to each other.
    distance = points[:, 0] * 0.5377 + points[:, 1] * 0.6341 + points[:, 2] * 0.5557
    order = np.argsort(distance)
    ordered = distance[order]
    ties = ordered[1:] == ordered[:-1]
    if ties.any():  # only then a stable sort, which takes longer, has another result
        order = np.argsort(distance, kind="stable")
    distance, points = ordered, points[order]
    is_exact = np.zeros(len(points), dtype=bool)
    if ties.any():
        tied = np.flatnonzero(np.append(ties, False) | np.append(False, ties))
        _, rank = merge_equal(points[tied])
        is_exact[tied] = np.bincount(rank)[rank] > 1
    is_near = np.zeros(len(points), dtype=bool)
    if has_long_edges:
        first, second = _near_pairs(distance, points, radius)
        apart = ~_are_edges(order[first], order[second], faces, len(points))
        is_near[first[apart]] = is_near[second[apart]] = True
    return int(np.count_nonzero(is_exact)), int(np.count_nonzero(is_near & ~is_exact))


def coincidence_notes(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> tuple[str, ...]:
    """Sentences on the vertices that coincide, and how to weld them."""
    exact, near = count_coincident(vertices, faces)
    notes = []
    if exact:
        notes.append(
            f"{exact:,} of {len(vertices):,} vertices coincide exactly with another one, as if cut apart there; "
            'weld="exact" (--weld exact) merges them'
        )
    if near:
        notes.append(
            f"{near:,} of {len(vertices):,} vertices nearly coincide with another one, within {NEAR:g} of the "
            f"bounding-box diagonal; weld={NEAR:g} (--weld {NEAR:g}) merges them"
        )
    return tuple(notes)


def weld_vertices(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], weld: Weld
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Merge vertices that coincide.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    weld : None, "exact" or float
        None: merge nothing; "exact": vertices of exactly equal coordinates; a number: vertices at most that far apart,
        relative to the bounding-box diagonal, and chains of them

    Returns
    -------
    vertices : (p, 3) float array
        the first vertex of each group, in the order of the mesh
    faces : (m, 3) int array
        all faces in their order, so that labels of faces stay valid; one that collapses has a repeated corner

    Raises
    ------
    MeshError
        if the value is none of these, or so large that it would merge whole regions of the mesh

    Examples
    --------
    >>> vertices = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 1e-9], [1, 1, 0]])
    >>> weld_vertices(vertices, np.array([[0, 1, 2], [3, 5, 4]]), "exact")[1]
    array([[0, 1, 2],
           [1, 4, 3]])
    >>> weld_vertices(vertices, np.array([[0, 1, 2], [3, 5, 4]]), 1e-5)[1]
    array([[0, 1, 2],
           [1, 3, 2]])
    """
    check_weld(weld)
    if weld is None:
        return vertices, faces
    points, _ = _scaled(vertices)
    _, group = merge_equal(points)
    if weld != "exact":
        group = _near_groups(points, group, float(weld))
    _, first = np.unique(group, return_index=True)
    kept = np.sort(first)
    new_index = np.empty(len(first), dtype=np.int64)
    new_index[np.argsort(first)] = np.arange(len(first))
    return vertices[kept], new_index[group][faces]


def _scaled(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """The vertices with zeros of one sign, scaled to a size without overflow, and `NEAR` diagonals in that scale.

    Scaling by a power of two keeps equal coordinates equal and different ones different.
    """
    largest = float(np.abs(vertices).max(initial=0.0))
    if not np.isfinite(largest):
        largest = float(np.abs(vertices[np.isfinite(vertices)]).max(initial=0.0))
    if largest == 0:
        return vertices + 0.0, 0.0
    exponent = -int(np.frexp(largest)[1])
    is_power = abs(exponent) < 1000  # 2.0**1075 would overflow; a product takes less time
    scaled = vertices * 2.0**exponent if is_power else np.ldexp(vertices, exponent)
    scaled += 0.0
    with np.errstate(invalid="ignore"):
        diagonal = float(np.linalg.norm(_extents(scaled)))
    return scaled, NEAR * diagonal if np.isfinite(diagonal) else 0.0


def _extents(points: NDArray[np.float64]) -> NDArray[np.float64]:
    """The extent of points along each axis, (3,)."""
    return np.array([np.ptp(points[:, axis]) for axis in range(points.shape[1])])


def _has_long_edges(points: NDArray[np.float64], faces: NDArray[np.int64], radius: float) -> bool:
    """Whether half of the edges, of a sample of the faces, are at least `_MIN_EDGES` times as long as the radius."""
    corners = points[faces[:: max(1, len(faces) // _SAMPLE)]]
    with np.errstate(invalid="ignore"):
        lengths = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
    return bool(np.median(lengths) >= _MIN_EDGES * radius)


def _near_pairs(
    distance: NDArray[np.float64], points: NDArray[np.float64], radius: float
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Pairs of points within a radius of each other, for points that are sorted by ``distance``."""
    firsts, seconds = [], []
    # Most are told apart by a single coordinate.
    across = np.ascontiguousarray(points[:, np.argmax(_extents(points))])
    active = np.arange(len(points) - 1)
    for step in range(1, _MAX_COMPARED + 1):
        active = active[: np.searchsorted(active, len(points) - step)]
        active = active[distance[active + step] - distance[active] <= radius]
        if not len(active):
            break
        similar = active[np.abs(across[active + step] - across[active]) <= radius * _ROUNDING]
        gap = points[similar + step] - points[similar]
        near = np.einsum("ij,ij->i", gap, gap) <= radius**2
        firsts.append(similar[near])
        seconds.append(similar[near] + step)
    empty = np.empty(0, dtype=np.int64)
    return np.concatenate([empty, *firsts]), np.concatenate([empty, *seconds])


def _are_edges(
    first: NDArray[np.int64], second: NDArray[np.int64], faces: NDArray[np.int64], n_vertices: int
) -> NDArray[np.bool_]:
    """Whether each pair of vertices is an edge."""
    if not len(first):
        return np.zeros(0, dtype=bool)
    start, end = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    edges = np.minimum(start, end) * n_vertices + np.maximum(start, end)
    return np.isin(np.minimum(first, second) * n_vertices + np.maximum(first, second), edges)


def _near_groups(points: NDArray[np.float64], group: NDArray[np.int64], tolerance: float) -> NDArray[np.int64]:
    """Groups of points at most ``tolerance`` diagonals apart, and chains of them; ``group``: exactly equal points."""
    from scipy.sparse import coo_matrix
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    _, representative = np.unique(group, return_index=True)
    distinct = points[representative]
    finite = np.flatnonzero(np.isfinite(distinct).all(axis=1))
    if not len(finite):
        return group
    radius = tolerance * float(np.linalg.norm(np.ptp(distinct[finite], axis=0)))
    tree = cKDTree(distinct[finite])
    if tree.count_neighbors(tree, radius) > _MAX_PAIRS * len(finite):
        raise MeshError(f"weld={tolerance:g} would merge whole regions of the mesh; choose a smaller distance")
    first, second = tree.query_pairs(radius, output_type="ndarray").T
    links = coo_matrix((np.ones(len(first)), (finite[first], finite[second])), shape=(len(distinct), len(distinct)))
    return connected_components(links, directed=False)[1].astype(np.int64)[group]
