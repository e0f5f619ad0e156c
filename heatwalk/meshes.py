"""What a triangle mesh must be before it can be segmented, and what it is."""

import textwrap
from dataclasses import dataclass

import numpy as np

from heatwalk.laplacian import vertex_components

# A triangle is degenerate where its height over its longest edge is at most this share of that edge. Rounding
# alone gives collinear corners some 1e-16; files in single precision give 1e-7, a sliver and harmless.
DEGENERATE = 1e-12


class MeshError(ValueError):
    """A mesh that cannot be segmented, or a file that cannot be read; the message is one line."""


def check_mesh(vertices, faces):
    """Check that a triangle mesh can be segmented; give its arrays in the form the package works on.

    Boundaries, several components, non-manifold edges, duplicate faces, some degenerate triangles and coordinates of
    any finite size are all valid.

    Parameters
    ----------
    vertices : (n, 3) real numbers, n >= 4
    faces : (m, 3) integers, m >= 1, each in 0 … n-1

    Returns
    -------
    vertices : (n, 3) float64, C-contiguous
    faces : (m, 3) int64, C-contiguous

    Raises
    ------
    MeshError
        for arrays of another shape or type, indices out of range, no faces, fewer than 4 vertices, coordinates that
        are NaN or infinite, vertices that belong to no face, a mesh whose triangles are all degenerate, and vertices
        all of whose triangles are collapsed to an edge or a point: nothing ties those to the rest
    """
    vertices, faces = check_arrays(vertices, faces)
    if len(vertices) < 4:
        raise MeshError(f"the mesh has {len(vertices)} vertices; at least 4 are needed")
    if not np.isfinite(vertices).all():
        _refuse(~np.isfinite(vertices).all(axis=1), "have NaN or infinite coordinates")
    _refuse(~referenced(faces, len(vertices)), "belong to no face (remove them)")
    degenerate, collapsed = _degenerate_faces(vertices, faces)
    if degenerate.all():
        raise MeshError(f"all {len(faces)} triangles are degenerate: the mesh has no area")
    if collapsed.any():
        _refuse(
            ~referenced(faces[~collapsed], len(vertices)),
            "have only triangles collapsed to an edge or a point (merge coincident vertices, remove collapsed "
            "triangles)",
        )
    return vertices, faces


@dataclass(frozen=True)
class MeshReport:
    """What a mesh is, and whether it can be segmented.

    Lengths and areas are in the mesh's own unit, and NaN where a coordinate is NaN or infinite. Edges, duplicates and
    what is made of edges are those of the faces with three different corners.
    """

    n_vertices: int
    n_faces: int
    n_components: int  # parts that share no vertex; vertices without faces are not counted
    n_boundary_edges: int  # edges with one face
    n_boundary_loops: int  # connected sets of boundary edges
    n_nonmanifold_edges: int  # edges with more than two faces
    n_degenerate_faces: int  # with a repeated corner, or no thicker than rounding makes them (`DEGENERATE`)
    n_duplicate_faces: int  # those that repeat the corners of an earlier one, in whatever order
    n_unreferenced_vertices: int  # vertices that belong to no face
    is_watertight: bool  # every edge has exactly two faces
    is_consistently_oriented: bool  # where an edge has two faces, they run along it in opposite directions
    euler_characteristic: int  # vertices - edges + faces
    area: float
    mean_edge_length: float
    bounding_box_diagonal: float
    problem: str | None  # the message of the `MeshError` that `check_mesh` raises; None where it raises none


def inspect_mesh(vertices, faces):
    """Describe a mesh, whether or not it can be segmented.

    Parameters
    ----------
    vertices : (n, 3) real numbers
    faces : (m, 3) integers, m >= 1, each in 0 … n-1

    Returns
    -------
    MeshReport

    Raises
    ------
    MeshError
        for arrays that are no triangle mesh at all: of another shape or type, without faces, indices out of range
    """
    vertices, faces = check_arrays(vertices, faces)
    try:
        check_mesh(vertices, faces)
        problem = None
    except MeshError as error:
        problem = str(error)

    import trimesh  # here, because it takes longer to import than most meshes to segment

    scaled, scale = _scaled(vertices)
    repeated = (faces == np.roll(faces, 1, axis=1)).any(axis=1)
    degenerate = repeated | _degenerate_faces(vertices, faces)[0]  # with NaNs about, the former alone is known
    surface = trimesh.Trimesh(scaled, faces[~repeated], process=False)
    faces_of_edge = np.bincount(surface.edges_unique_inverse)
    boundary = surface.edges_unique[faces_of_edge == 1]
    lengths = surface.edges_unique_length
    return MeshReport(
        n_vertices=len(vertices),
        n_faces=len(faces),
        n_components=_n_pieces(faces),
        n_boundary_edges=len(boundary),
        n_boundary_loops=_n_pieces(boundary),
        n_nonmanifold_edges=int(np.count_nonzero(faces_of_edge > 2)),
        n_degenerate_faces=int(np.count_nonzero(degenerate)),
        n_duplicate_faces=int(np.count_nonzero(~surface.unique_faces())),
        n_unreferenced_vertices=int(np.count_nonzero(~referenced(faces, len(vertices)))),
        is_watertight=surface.is_watertight,
        is_consistently_oriented=surface.is_winding_consistent,
        euler_characteristic=surface.euler_number,
        area=float(surface.area) * scale * scale,
        mean_edge_length=float(lengths.mean()) * scale if len(lengths) else 0.0,
        bounding_box_diagonal=float(np.linalg.norm(np.ptp(scaled, axis=0))) * scale,
        problem=problem,
    )


def check_arrays(vertices, faces):
    """Shapes, types and indices: vertices as (n, 3) float64 and faces as (m, 3) int64, both C-contiguous."""
    vertices = _triples(vertices, "vertices", "iuf", "real numbers")
    faces = _triples(faces, "faces", "iu", "integers")
    if not len(faces):
        raise MeshError(f"the mesh has {len(vertices)} vertices and no faces; a surface is needed")
    if faces.min() < 0 or faces.max() >= len(vertices):
        i, j = np.argwhere((faces < 0) | (faces >= len(vertices)))[0]
        raise MeshError(
            f"face {i} (counted from 0) refers to vertex {faces[i, j]}, but there are {len(vertices)} vertices"
        )
    with np.errstate(over="ignore"):  # a long double beyond the range becomes infinite, which is looked for
        return np.ascontiguousarray(vertices, np.float64), np.ascontiguousarray(faces, np.int64)


def _triples(values, name, kinds, wanted):
    try:
        array = np.asarray(values)
    except (ValueError, TypeError) as error:  # rows of different lengths, mostly
        raise MeshError(f"{name} are not a rectangular array of numbers: {shortened(error)}") from error
    if array.size and array.dtype.kind not in kinds:
        raise MeshError(f"{name} must be {wanted}, got an array of {array.dtype}")
    if array.size and (array.ndim != 2 or array.shape[1] != 3):
        raise MeshError(f"{name} must be an array of the shape (…, 3), got {array.shape}")
    return array


def shortened(error):
    return textwrap.shorten(repr(error), 200)


def referenced(faces, n_vertices):
    used = np.zeros(n_vertices, dtype=bool)
    used[faces] = True
    return used


def _n_pieces(simplices):
    """Into how many connected pieces faces (m, 3) or edges (m, 2) fall."""
    return len(np.unique(vertex_components(simplices.max(initial=0) + 1, simplices)[simplices]))


def _scaled(vertices):
    """The vertices divided by their largest coordinate, and this: squares of 1e200 would leave the range."""
    scale = float(np.abs(vertices).max()) or 1.0
    with np.errstate(invalid="ignore"):  # infinite by infinite
        return vertices / scale, scale


def _degenerate_faces(vertices, faces):
    """Which triangles are degenerate (see `DEGENERATE`), and which of these are collapsed.

    Collapsed: the shortest edge is at most `DEGENERATE` times the longest, so that two corners are one point.
    """
    from heatwalk.numerics.triangles import areas, squared_lengths

    scaled = _scaled(vertices)[0]
    squares = squared_lengths(scaled, faces)
    longest = squares.max(axis=0)
    collapsed = squares.min(axis=0) <= DEGENERATE**2 * longest
    return collapsed | (2 * areas(scaled, faces) <= DEGENERATE * longest), collapsed


def _refuse(wrong, why):
    """Raise where any vertex is `wrong`: (n,) bool array."""
    if wrong.any():
        first = ", ".join(map(str, np.flatnonzero(wrong)[:5])) + (", …" if wrong.sum() > 5 else "")
        raise MeshError(f"{wrong.sum():,} of {len(wrong):,} vertices {why}: {first}")
