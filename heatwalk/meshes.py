"""Requirements that a triangle mesh must meet to be segmented, and a report on its properties."""

import textwrap
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

# A triangle is degenerate if its height over its longest edge is at most this fraction of that edge. Rounding alone
# gives collinear corners about 1e-16; single-precision files give 1e-7, which is a harmless sliver.
DEGENERATE_RATIO = 1e-12

# Vertices that an error message lists.
_MAX_LISTED = 5


class MeshError(ValueError):
    """A mesh that cannot be segmented, or a file that cannot be read; the message is one line."""


def check_mesh(vertices: ArrayLike, faces: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Check that a triangle mesh can be segmented, and convert its arrays to the types used by the package.

    Boundaries, several components, non-manifold edges, duplicate faces, some degenerate triangles and coordinates of
    any finite magnitude are all valid.

    Parameters
    ----------
    vertices : (n, 3) array of real numbers, n >= 4
    faces : (m, 3) array of integers in 0 … n-1, m >= 1

    Returns
    -------
    vertices : (n, 3) float64 array, C-contiguous
    faces : (m, 3) int64 array, C-contiguous

    Raises
    ------
    MeshError
        if an array has the wrong shape or type, an index is out of range, there are no faces or fewer than 4 vertices,
        a coordinate is NaN or infinite, a vertex belongs to no face, all triangles are degenerate, or all triangles of
        a vertex are collapsed to an edge or a point, so that nothing connects it to the rest

    Examples
    --------
    >>> check_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    Traceback (most recent call last):
    heatwalk.meshes.MeshError: the mesh has 3 vertices; at least 4 are required
    """
    vertices, faces = check_arrays(vertices, faces)
    n = len(vertices)
    if n < 4:
        raise MeshError(f"the mesh has {n} vertices; at least 4 are required")
    _reject_vertices(~np.all(np.isfinite(vertices), axis=1), "have NaN or infinite coordinates")
    _reject_vertices(~referenced(faces, n), "belong to no face (remove them)")
    degenerate, collapsed = _degenerate_faces(vertices, faces)
    if degenerate.all():
        raise MeshError(f"all {len(faces)} triangles are degenerate: the mesh has no area")
    if collapsed.any():
        _reject_vertices(
            ~referenced(faces[~collapsed], n),
            "have only triangles collapsed to an edge or a point (merge coincident vertices, remove collapsed "
            "triangles)",
        )
    return vertices, faces


@dataclass(frozen=True)
class MeshReport:
    """Properties of a mesh, and whether it can be segmented.

    Attributes
    ----------
    n_vertices, n_faces : int
    n_components : int
        parts that share no vertex; unreferenced vertices are not counted
    n_boundary_edges : int
        edges with one face
    n_boundary_loops : int
        connected sets of boundary edges
    n_nonmanifold_edges : int
        edges with more than two faces
    n_degenerate_faces : int
        faces with a repeated corner or no height beyond rounding (`DEGENERATE_RATIO`)
    n_duplicate_faces : int
        faces that repeat the corners of an earlier face, in any order
    n_unreferenced_vertices : int
        vertices that belong to no face
    n_coincident_vertices : int
        vertices with exactly the coordinates of another one
    n_nearly_coincident_vertices : int
        other vertices within 1e-5 bounding-box diagonals of another one that no edge connects with them; 0 where edges
        are not much longer than that
    is_watertight : bool
        every edge has exactly two faces
    is_consistently_oriented : bool
        wherever an edge has two faces, they traverse it in opposite directions
    euler_characteristic : int
        vertices − edges + faces
    area, mean_edge_length, bounding_box_diagonal : float
        in the unit of the mesh; NaN if a coordinate is NaN or infinite
    problem : str or None
        the message of the `MeshError` that `check_mesh` raises; None if the mesh can be segmented

    Notes
    -----
    Edges, duplicates and everything derived from edges refer to the faces with three different corners.
    """

    n_vertices: int
    n_faces: int
    n_components: int
    n_boundary_edges: int
    n_boundary_loops: int
    n_nonmanifold_edges: int
    n_degenerate_faces: int
    n_duplicate_faces: int
    n_unreferenced_vertices: int
    n_coincident_vertices: int
    n_nearly_coincident_vertices: int
    is_watertight: bool
    is_consistently_oriented: bool
    euler_characteristic: int
    area: float
    mean_edge_length: float
    bounding_box_diagonal: float
    problem: str | None


def inspect_mesh(vertices: ArrayLike, faces: ArrayLike) -> MeshReport:
    """Describe a mesh, whether or not it can be segmented.

    Parameters
    ----------
    vertices : (n, 3) array of real numbers
    faces : (m, 3) array of integers in 0 … n-1, m >= 1

    Returns
    -------
    MeshReport

    Raises
    ------
    MeshError
        if the arrays are not a triangle mesh at all: wrong shape or type, no faces, or indices out of range

    Examples
    --------
    >>> report = inspect_mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], [[0, 1, 2], [2, 1, 3]])
    >>> report.n_boundary_edges, report.is_watertight, report.euler_characteristic
    (4, False, 1)
    """
    from heatwalk.io.welding import count_coincident

    vertices, faces = check_arrays(vertices, faces)
    n_coincident, n_nearly_coincident = count_coincident(vertices, faces)
    try:
        check_mesh(vertices, faces)
        problem = None
    except MeshError as error:
        problem = str(error)

    scaled, scale = _scaled(vertices)
    repeated = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    degenerate = repeated | _degenerate_faces(vertices, faces)[0]  # faces with NaNs count only if corners repeat
    proper = faces[~repeated]
    edges, faces_of_edge, n_forward = mesh_edges(proper)
    boundary = edges[faces_of_edge == 1]
    lengths = np.linalg.norm(scaled[edges[:, 0]] - scaled[edges[:, 1]], axis=1)
    return MeshReport(
        n_vertices=len(vertices),
        n_faces=len(faces),
        n_components=_n_pieces(faces),
        n_boundary_edges=len(boundary),
        n_boundary_loops=_n_pieces(boundary),
        n_nonmanifold_edges=int(np.count_nonzero(faces_of_edge > 2)),
        n_degenerate_faces=int(np.count_nonzero(degenerate)),
        n_duplicate_faces=int(np.count_nonzero(repeats_earlier_face(proper))),
        n_unreferenced_vertices=int(np.count_nonzero(~referenced(faces, len(vertices)))),
        n_coincident_vertices=n_coincident,
        n_nearly_coincident_vertices=n_nearly_coincident,
        is_watertight=bool(len(edges) and (faces_of_edge == 2).all()),
        is_consistently_oriented=bool(len(edges) and (n_forward[faces_of_edge == 2] == 1).all()),
        euler_characteristic=int(np.count_nonzero(referenced(proper, len(vertices)))) - len(edges) + len(proper),
        area=float(face_areas(scaled, proper).sum()) * scale * scale,
        mean_edge_length=float(lengths.mean()) * scale if len(lengths) else 0.0,
        bounding_box_diagonal=float(np.linalg.norm(np.ptp(scaled, axis=0))) * scale,
        problem=problem,
    )


def check_arrays(vertices: ArrayLike, faces: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Check that two arrays are a triangle mesh: their shapes, types and indices, but not their coordinates.

    Parameters
    ----------
    vertices : (n, 3) array of real numbers
    faces : (m, 3) array of integers in 0 … n-1, m >= 1

    Returns
    -------
    vertices : (n, 3) float64 array, C-contiguous
    faces : (m, 3) int64 array, C-contiguous

    Raises
    ------
    MeshError
        if an array has the wrong shape or type, there are no faces, or an index is out of range

    Examples
    --------
    >>> check_arrays([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]])
    Traceback (most recent call last):
    heatwalk.meshes.MeshError: face 0 (counted from 0) refers to vertex 3, but there are 3 vertices
    """
    vertices = _check_triples(vertices, "vertices", "iuf", "real numbers")
    faces = _check_triples(faces, "faces", "iu", "integers")
    if not len(faces):
        raise MeshError(f"the mesh has {len(vertices)} vertices and no faces; at least one face is required")
    if faces.min() < 0 or faces.max() >= len(vertices):
        i, j = np.argwhere((faces < 0) | (faces >= len(vertices)))[0]
        raise MeshError(
            f"face {i} (counted from 0) refers to vertex {faces[i, j]}, but there are {len(vertices)} vertices"
        )
    with np.errstate(over="ignore"):  # a long double out of range becomes infinite, which check_mesh rejects
        return np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)


def drop_unreferenced(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.int64]]:
    """Remove the vertices that belong to no face; the others keep their order.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array

    Returns
    -------
    vertices : (p, 3) float array
        the input itself if nothing is removed
    faces : (m, 3) int array
        the same faces, as indices into the new vertices
    kept : (p,) int array, ascending
        the old index of each new vertex

    Examples
    --------
    >>> vertices, faces, kept = drop_unreferenced(np.eye(3)[[0, 0, 1, 2]], np.array([[0, 2, 3]]))
    >>> faces, kept
    (array([[0, 1, 2]]), array([0, 2, 3]))
    """
    used = referenced(faces, len(vertices))
    kept = np.flatnonzero(used)
    if len(kept) == len(vertices):
        return vertices, faces, kept
    return vertices[kept], (np.cumsum(used) - 1)[faces], kept


def face_areas(vertices: ArrayLike, faces: ArrayLike) -> NDArray[np.float64]:
    """Area of each triangle.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array

    Returns
    -------
    (m,) float array, in the squared unit of the vertices

    Examples
    --------
    >>> face_areas([[0, 0, 0], [2, 0, 0], [0, 3, 0]], [[0, 1, 2]])
    array([3.])
    """
    from heatwalk.numerics.triangles import areas  # numba takes longer to import than many callers to run

    return areas(np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64))


def repeats_earlier_face(faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether each face has the same corners, in any order, as one before it.

    Parameters
    ----------
    faces : (m, 3) int array

    Returns
    -------
    (m,) bool array

    Examples
    --------
    >>> repeats_earlier_face(np.array([[0, 1, 2], [0, 1, 3], [2, 1, 0]]))
    array([False, False,  True])
    """
    repeats = np.zeros(len(faces), dtype=bool)
    a, b, c = faces.T
    low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
    middle = a + b + c - low - high
    mixed = (low * 0x9E3779B1 + middle) * 0x85EBCA77 + high  # wraps around: faces with equal corners have equal values
    some = _in_shared_buckets(mixed)
    ordered = np.sort(mixed[some])
    is_repeated = ordered[1:] == ordered[:-1]
    if is_repeated.any():
        similar = some[np.isin(mixed[some], ordered[1:][is_repeated])]
        corners = np.column_stack((low, middle, high))[similar]
        order = np.lexsort(corners.T)  # stable: the first of equal faces stays first
        repeats[similar[order[1:]]] = (corners[order[1:]] == corners[order[:-1]]).all(axis=1)
    return repeats


def _in_shared_buckets(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Places of the values that are in one bucket of a hash table with another: all equal ones, and few others."""
    n_bits = (4 * len(values) + 1).bit_length()
    bucket = ((values.view(np.uint64) * np.uint64(0x9E3779B97F4A7C15)) >> np.uint64(64 - n_bits)).view(np.int64)
    place = np.arange(len(values))
    last = np.empty(2**n_bits, dtype=np.int64)  # in each bucket; what is in others is never read
    last[bucket] = place
    is_shared = np.zeros(2**n_bits, dtype=bool)
    is_shared[bucket[last[bucket] != place]] = True
    return np.flatnonzero(is_shared[bucket])


def without_repeated_faces(faces: NDArray[np.int64]) -> NDArray[np.int64]:
    """The faces that do not repeat an earlier one; not copied if none does.

    Parameters
    ----------
    faces : (m, 3) int array

    Returns
    -------
    (m', 3) int array

    Examples
    --------
    >>> without_repeated_faces(np.array([[0, 1, 2], [0, 1, 3], [2, 1, 0]]))
    array([[0, 1, 2],
           [0, 1, 3]])
    """
    repeats = repeats_earlier_face(faces)
    return faces[~repeats] if repeats.any() else faces


def referenced(faces: NDArray[np.integer], n_vertices: int) -> NDArray[np.bool_]:
    """Whether each vertex belongs to a face: (n_vertices,) bool array."""
    used = np.zeros(n_vertices, dtype=bool)
    used[faces] = True
    return used


def describe_error(error: BaseException) -> str:
    """Type and message of an exception, on one line of at most 200 characters."""
    return textwrap.shorten(repr(error), 200)


def _check_triples(values: ArrayLike, name: str, kinds: str, expected: str) -> NDArray:
    """An array of shape (…, 3) and one of the dtype ``kinds``, else MeshError."""
    try:
        array = np.asarray(values)
    except (ValueError, TypeError) as error:  # usually rows of different lengths
        raise MeshError(f"{name} are not a rectangular array of numbers: {describe_error(error)}") from error
    if array.size and array.dtype.kind not in kinds:
        raise MeshError(f"{name} must be {expected}, got an array of {array.dtype}")
    if array.size and (array.ndim != 2 or array.shape[1] != 3):
        raise MeshError(f"{name} must be an array of shape (…, 3), got {array.shape}")
    return array


def mesh_edges(faces: NDArray[np.int64]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.int64]]:
    """The edges of faces with three different corners, each with its number of faces.

    Returns (e, 2) vertices, smaller first; (e,) number of faces; (e,) number of faces that traverse the edge from its
    smaller to its larger vertex.
    """
    start, end = faces[:, [0, 1, 2]].ravel(), faces[:, [1, 2, 0]].ravel()
    n_vertices = int(faces.max(initial=-1)) + 1
    key, edge_of_side, n_faces = np.unique(
        np.minimum(start, end) * n_vertices + np.maximum(start, end), return_inverse=True, return_counts=True
    )
    n_forward = np.bincount(edge_of_side, weights=start < end, minlength=len(key)).astype(np.int64)
    return np.column_stack(np.divmod(key, max(n_vertices, 1))), n_faces, n_forward


def _n_pieces(simplices: NDArray[np.int64]) -> int:
    """Number of connected pieces of faces (m, 3) or edges (m, 2)."""
    from heatwalk.laplacian import vertex_components

    return len(np.unique(vertex_components(simplices.max(initial=0) + 1, simplices)[simplices]))


def _scaled(vertices: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
    """The vertices divided by their largest coordinate, and that coordinate: squares of 1e200 would overflow."""
    scale = float(np.abs(vertices).max()) or 1.0
    with np.errstate(invalid="ignore"):  # infinity / infinity
        return vertices / scale, scale


def _degenerate_faces(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """Whether each triangle is degenerate (see `DEGENERATE_RATIO`), and whether it is collapsed.

    Collapsed: its shortest edge is at most `DEGENERATE_RATIO` times its longest, so that two corners coincide.
    """
    from heatwalk.numerics.triangles import areas, squared_edge_lengths

    scaled, _ = _scaled(vertices)
    squares = squared_edge_lengths(scaled, faces)
    longest = squares.max(axis=0)
    collapsed = squares.min(axis=0) <= DEGENERATE_RATIO**2 * longest
    return collapsed | (2 * areas(scaled, faces) <= DEGENERATE_RATIO * longest), collapsed


def _reject_vertices(rejected: NDArray[np.bool_], reason: str) -> None:
    """Raise MeshError if any vertex is rejected, listing the first ones."""
    if rejected.any():
        count = int(np.count_nonzero(rejected))
        listed = ", ".join(map(str, np.flatnonzero(rejected)[:_MAX_LISTED])) + (", …" if count > _MAX_LISTED else "")
        raise MeshError(f"{count:,} of {len(rejected):,} vertices {reason}: {listed}")
