"""Stiffness and lumped mass of a triangle mesh: the discrete Laplace–Beltrami operator."""

from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import scipy.sparse as sp

# Triangles flatter than this (area over squared longest edge) are treated as if they were exactly this flat, so that
# their stiffness stays finite and positive semi-definite: it ties their corners together instead of breaking the
# solver. The flattest triangle of the Princeton benchmark has 1.8e-4.
MIN_FLATNESS = 1e-5

# Least mass of a vertex relative to the mean: vertices between zero-area triangles have no mass of their own.
MIN_RELATIVE_MASS = 1e-10


def unit_area(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Centre a mesh at the origin and scale it to area 1.

    Parameters
    ----------
    vertices : (n, 3) float array, in any unit
    faces : (m, 3) int array

    Returns
    -------
    (n, 3) float array

    Examples
    --------
    >>> unit_area(np.array([[5.0, 0, 0], [7, 0, 0], [5, 4, 0]]), np.array([[0, 1, 2]]))
    array([[-0.5, -1. ,  0. ],
           [ 0.5, -1. ,  0. ],
           [-0.5,  1. ,  0. ]])
    """
    from heatwalk.numerics.triangles import areas  # imports numba

    low, high = (np.array([end(coordinate) for coordinate in vertices.T]) for end in (np.min, np.max))
    # First by the bounding box: squares of coordinates near 1e-200 or 1e200 would underflow or overflow.
    extent = (high - low).max()
    scaled = vertices / extent
    scaled -= 0.5 * (low / extent + high / extent)
    scaled /= np.sqrt(areas(scaled, faces).sum())
    return scaled


def stiffness_and_mass(
    vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> "tuple[sp.csc_array, NDArray[np.float64]]":
    """Cotangent stiffness matrix and barycentric lumped mass.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array

    Returns
    -------
    stiffness : (n, n) scipy.sparse.csc_array
        symmetric positive semi-definite with zero row sums:
        ``(stiffness @ f)[i] = ½ Σ_j (cot α_ij + cot β_ij) (f_i − f_j)``
    mass : (n,) float array, positive
        a third of the area of the triangles around each vertex

    Notes
    -----
    A triangle with edge vectors e_i and e_j opposite its corners i and j contributes e_i·e_j / (4 area): a Gram
    matrix, hence positive semi-definite for any angles. Boundaries get no special treatment (natural boundary
    condition, insulated); at a non-manifold edge the contributions of all its triangles add up.

    The paper uses the operator of Desbrun et al., which divides by the whole area around a vertex, and by 4 instead
    of 2: it is ``diag(1 / mass) @ stiffness / 6``.

    References
    ----------
    M. Desbrun, M. Meyer, P. Schröder, A. Barr, "Implicit fairing of irregular meshes using diffusion and curvature
    flow", 1999, doi:10.1145/311535.311576

    Examples
    --------
    >>> stiffness, mass = stiffness_and_mass(np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), np.array([[0, 1, 2]]))
    >>> stiffness.toarray()
    array([[ 1. , -0.5, -0.5],
           [-0.5,  0.5,  0. ],
           [-0.5,  0. ,  0.5]])
    >>> mass
    array([0.16666667, 0.16666667, 0.16666667])
    """
    import scipy.sparse as sp

    from heatwalk.numerics.triangles import cotangent_weights, lumped_mass

    n = len(vertices)
    weights, area = cotangent_weights(vertices, faces, MIN_FLATNESS)
    corners: NDArray[Any] = faces.T.astype(np.int32)  # half the size of int64, in the products and in the result
    i, j = corners, corners[[1, 2, 0]]
    weights[i == j] = 0  # a face with a repeated corner has no edge there
    # Sum the triangles of each edge above the diagonal and copy the sums below it: half the memory.
    edges = np.minimum(i, j).ravel(), np.maximum(i, j).ravel()
    above = sp.coo_array((weights.ravel(), edges), shape=(n, n)).tocsr()
    off_diagonal = above + above.T.tocsr()
    stiffness = off_diagonal - sp.diags_array(off_diagonal.sum(axis=1))
    mass = lumped_mass(faces, area, n)
    return stiffness.T, np.maximum(mass, MIN_RELATIVE_MASS * mass.mean())


def vertex_components(n_vertices: int, simplices: NDArray[np.integer]) -> NDArray[np.int64]:
    """Connected component of each vertex.

    Parameters
    ----------
    n_vertices : int
    simplices : (m, 3) int array of faces, or (m, 2) int array of edges

    Returns
    -------
    (n_vertices,) int array
        components are numbered 0, 1, 2 … in the order of their smallest vertices

    Examples
    --------
    >>> vertex_components(5, np.array([[0, 2], [1, 4]]))
    array([0, 1, 0, 2, 1])
    """
    from heatwalk.numerics.triangles import connected_components

    return connected_components(n_vertices, np.ascontiguousarray(simplices, np.int64))
