"""Operations on meshes that perturbations are built from."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:  # SciPy and trimesh take most of a second to import, which `import perturb` need not wait for
    import trimesh
    from scipy.sparse import coo_array


FACES_AT_A_TIME = 1000
MAX_EXPONENT = 300  # squares of lengths between 2^-300 and 2^300 can be added without underflow and overflow


def _mean_edge_length(mesh: trimesh.Trimesh) -> float:
    length, exponent = _edge_lengths(mesh)
    start, end = mesh.edges_unique.T
    return float(np.ldexp(length[start != end].mean(), exponent))


def _bounding_box_diagonal(mesh: trimesh.Trimesh) -> float:
    exponent = size_exponent(mesh)
    return float(np.ldexp(np.linalg.norm(np.ldexp(mesh.extents, -exponent)), exponent))


def _edge_lengths(mesh: trimesh.Trimesh) -> tuple[np.ndarray, int]:
    """(k,) the lengths of ``mesh.edges_unique`` as multiples of a power of two; the exponent of the latter."""
    exponent = size_exponent(mesh)
    if exponent == 0:
        return mesh.edges_unique_length, 0
    start, end = np.ldexp(np.asarray(mesh.vertices), -exponent)[mesh.edges_unique.T]
    return np.linalg.norm(end - start, axis=1), exponent


def size_exponent(mesh: trimesh.Trimesh) -> int:
    """Return 0 for a mesh the squared lengths of which are ordinary numbers, else the exponent of its size."""
    exponent = int(np.frexp(mesh.extents.max())[1])
    return exponent if abs(exponent) > MAX_EXPONENT else 0


LENGTHS: Mapping[str, Callable[[trimesh.Trimesh], float]] = {
    "mean_edge_length": _mean_edge_length,
    "bounding_box_diagonal": _bounding_box_diagonal,
}
"""Units of relative lengths: name of the unit → function that returns its length on a mesh, in the mesh's own unit."""


def as_trimesh(vertices: ArrayLike, faces: ArrayLike) -> trimesh.Trimesh:
    """Build a mesh from copies of its arrays, exactly as they are.

    Nothing is merged, removed or reordered (``process=False``), so indices into the arrays remain valid for the mesh.

    Parameters
    ----------
    vertices : (n, 3) array of real numbers
    faces : (m, 3) array of integers
        Indices of vertices, each in 0 … n-1.

    Returns
    -------
    trimesh.Trimesh
        With float64 vertices and int64 faces. It shares no memory with the arguments.

    Examples
    --------
    >>> import perturb
    >>> mesh = perturb.as_trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 1, 0]], [[0, 1, 2], [0, 3, 1]])
    >>> len(mesh.vertices), len(mesh.faces)
    (4, 2)
    """
    import trimesh

    return trimesh.Trimesh(np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int64), process=False)


def moved(mesh: trimesh.Trimesh, displacement: ArrayLike) -> tuple[trimesh.Trimesh, np.ndarray]:
    """Displace the vertices of a mesh.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Left unchanged.
    displacement : (n, 3) float array
        Added to the vertices, in the mesh's own unit.

    Returns
    -------
    mesh : trimesh.Trimesh
        The displaced mesh, with the same faces.
    counterpart : (n,) int array
        The counterpart of each vertex, which is the vertex itself: 0 … n-1.

    Examples
    --------
    >>> import perturb
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> lifted, counterpart = perturb.moved(box, [[0, 0, 2]] * 8)
    >>> lifted.bounds.tolist()
    [[-0.5, -0.5, 1.5], [0.5, 0.5, 2.5]]
    >>> counterpart.tolist()
    [0, 1, 2, 3, 4, 5, 6, 7]
    """
    vertices = np.asarray(mesh.vertices) + displacement
    return as_trimesh(vertices, mesh.faces), np.arange(len(vertices))


def without_faces(mesh: trimesh.Trimesh, dropped: np.ndarray) -> tuple[trimesh.Trimesh, np.ndarray]:
    """Remove faces from a mesh, and the vertices that thereby lose their last face.

    Parameters
    ----------
    mesh : trimesh.Trimesh
        Left unchanged.
    dropped : (m,) bool array
        True for each face to remove.

    Returns
    -------
    mesh : trimesh.Trimesh
        The remaining vertices and faces, in their previous order.
    counterpart : (n,) int array
        The index of each vertex in the new mesh, -1 if it was removed.

    Notes
    -----
    A vertex that already had no face is kept: removing it would clean the mesh, not perturb it.

    Examples
    --------
    >>> import perturb
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> rest, counterpart = perturb.without_faces(box, (box.faces == 0).any(axis=1))
    >>> len(rest.vertices), counterpart.tolist()
    (7, [-1, 0, 1, 2, 3, 4, 5, 6])
    """
    faces = np.asarray(mesh.faces)
    removed = np.zeros(len(mesh.vertices), dtype=bool)
    removed[faces[dropped]] = True
    removed[faces[~dropped]] = False
    counterpart = np.where(removed, -1, np.cumsum(~removed) - 1)
    return as_trimesh(np.asarray(mesh.vertices)[~removed], counterpart[faces[~dropped]]), counterpart


def edge_graph(mesh: trimesh.Trimesh) -> coo_array:
    """Return the edges of a mesh as a weighted graph, for the algorithms of `scipy.sparse.csgraph`.

    Parameters
    ----------
    mesh : trimesh.Trimesh

    Returns
    -------
    (n, n) scipy.sparse.coo_array
        Symmetric; the length of each edge, in the mesh's own unit, at both of its positions.

    Notes
    -----
    Distances along the edges are at least as long as those along the surface.

    Examples
    --------
    >>> import perturb
    >>> import trimesh
    >>> from scipy.sparse.csgraph import dijkstra
    >>> box = trimesh.creation.box(extents=[1, 2, 4])
    >>> float(dijkstra(perturb.edge_graph(box), indices=0)[1])
    4.0
    """
    from scipy.sparse import coo_array

    n_vertices = len(mesh.vertices)
    start, end = mesh.edges_unique.T
    length, exponent = _edge_lengths(mesh)
    length = np.tile(np.ldexp(length, exponent), 2)
    return coo_array((length, (np.r_[start, end], np.r_[end, start])), shape=(n_vertices, n_vertices))


def vertex_normals(mesh: trimesh.Trimesh) -> np.ndarray:
    """Compute vertex normals weighted by the angles of the corners.

    Parameters
    ----------
    mesh : trimesh.Trimesh

    Returns
    -------
    (n, 3) float array
        Unit vectors; zero for a vertex without a normal: one without faces, or with only degenerate ones.

    Notes
    -----
    Unlike weights by area, weights by angle do not depend on how the surface is divided into triangles.

    A face that occurs several times, in either winding, counts once. Where neighbouring faces are wound differently,
    they are treated as if the minority of a patch were reversed. At a vertex where the normals cancel even so, for
    example in a fin without thickness, they are all taken to be on the side of the face with the largest angle. Whether
    a triangle is degenerate is decided relative to its own edges, so that the size of the mesh does not matter.

    References
    ----------
    Thürmer and Wüthrich 1998, doi:10.1080/10867651.1998.10487487

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> box = trimesh.creation.box()
    >>> bool(np.allclose(perturb.vertex_normals(box), np.sign(box.vertices) / np.sqrt(3)))
    True
    """
    from perturb._normals import compute_vertex_normals

    return compute_vertex_normals(np.asarray(mesh.vertices), np.asarray(mesh.faces))


def random_direction(rng: np.random.Generator) -> np.ndarray:
    """Draw a direction in space, all directions being equally likely.

    Parameters
    ----------
    rng : numpy.random.Generator

    Returns
    -------
    (3,) float array
        A unit vector.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> direction = perturb.random_direction(np.random.default_rng(0))
    >>> round(float(np.linalg.norm(direction)), 12)
    1.0
    """
    direction = rng.standard_normal(3)
    return direction / np.linalg.norm(direction)


def n_components(mesh: trimesh.Trimesh) -> int:
    """Count the connected components of a mesh: parts that share no vertex. Vertices without faces are not counted."""
    from heatwalk.laplacian import vertex_components

    faces = np.asarray(mesh.faces)
    return int(np.count_nonzero(np.bincount(vertex_components(len(mesh.vertices), faces)[faces[:, 0]])))


def reason_unusable(mesh: trimesh.Trimesh) -> str | None:
    """Return why a mesh can be neither perturbed nor segmented, as the end of a sentence; None if it can be."""
    counts = f"{len(mesh.vertices)} vertices, {len(mesh.faces)} faces"
    if len(mesh.faces) == 0:
        return f"has no face ({counts})"
    if len(mesh.vertices) < 4:
        return f"has fewer than 4 vertices ({counts})"
    if not np.isfinite(mesh.vertices).all():
        return f"has coordinates that are not finite ({counts})"
    if _all_degenerate(np.asarray(mesh.vertices), np.asarray(mesh.faces)):
        return f"has only degenerate triangles ({counts})"
    return None


def _all_degenerate(vertices: np.ndarray, faces: np.ndarray) -> bool:
    """Return whether no triangle has an area above rounding."""
    from perturb._normals import is_degenerate

    # On most meshes a proper triangle is among the first: the others need not be computed.
    return all(
        is_degenerate(vertices, faces[i : i + FACES_AT_A_TIME]).all() for i in range(0, len(faces), FACES_AT_A_TIME)
    )
