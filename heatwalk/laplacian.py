"""Stiffness and lumped mass of a triangle mesh: the operator in which the paper measures time."""

import numpy as np
import scipy.sparse as sp

# A triangle flatter than this (area over squared longest edge) is treated as if it were this flat. Its
# stiffness stays positive semi-definite and finite: it ties its corners together instead of breaking the solver.
# The flattest triangle of the Princeton benchmark has 1.8e-4.
FLATTEST_TRIANGLE = 1e-5

# Least mass of a vertex, relative to the mean: vertices between zero-area triangles have none of their own.
LEAST_MASS = 1e-10


def unit_area(vertices, faces):
    """Vertices moved to the origin and scaled so that the mesh has area 1.

    Parameters
    ----------
    vertices : (n, 3) float array, any length unit
    faces : (m, 3) int array

    Returns
    -------
    (n, 3) float array
    """
    from heatwalk.numerics.triangles import areas  # here, so that importing the package does not wait for numba

    low, high = (np.array([end(coordinate) for coordinate in vertices.T]) for end in (np.min, np.max))
    # By the bounding box first: squares of coordinates near 1e-200 or 1e200 would leave the floating-point range.
    extent = (high - low).max()
    scaled = vertices / extent
    scaled -= 0.5 * (low / extent + high / extent)
    scaled /= np.sqrt(areas(scaled, faces).sum())
    return scaled


def stiffness_and_mass(vertices, faces):
    """Cotangent stiffness matrix and barycentric lumped mass.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array

    Returns
    -------
    stiffness : (n, n) scipy.sparse.csc_array, symmetric positive semi-definite, zero row sums
        ``(stiffness @ f)[i] = ½ Σ_j (cot α_ij + cot β_ij) (f_i − f_j)``
    mass : (n,) float array, positive; a third of the area of the triangles around each vertex

    Notes
    -----
    The entry of a triangle with corners i, j and opposite edge vectors e_i, e_j is e_i·e_j / (4 area): a Gram
    matrix, hence positive semi-definite whatever the triangle's angles. Boundaries get no special treatment
    (natural, insulated); at a non-manifold edge the terms of all its triangles add up.

    The operator of Desbrun, Meyer, Schröder, Barr, "Implicit fairing of irregular meshes using diffusion and
    curvature flow", 1999 (doi:10.1145/311535.311576), which the paper uses, divides by the whole area around a
    vertex and by 4 instead of 2: it is ``diag(1 / mass) @ stiffness / 6``.
    """
    from heatwalk.numerics.triangles import couplings, thirds_of_corners

    n = len(vertices)
    coupling, area = couplings(vertices, faces, FLATTEST_TRIANGLE)
    corners = faces.T.astype(np.int32)  # half the size of int64, in the products and in the result
    i, j = corners, corners[[1, 2, 0]]
    coupling[i == j] = 0  # a face with a repeated corner couples a vertex to itself, which is no coupling
    # The triangles of an edge add up above the diagonal, so that what is below is a copy: half the memory.
    edges = np.minimum(i, j).ravel(), np.maximum(i, j).ravel()
    above = sp.coo_array((coupling.ravel(), edges), shape=(n, n)).tocsr()
    off_diagonal = above + above.T.tocsr()
    stiffness = off_diagonal - sp.diags_array(off_diagonal.sum(axis=1))
    mass = thirds_of_corners(faces, area, n)
    return stiffness.T, np.maximum(mass, LEAST_MASS * mass.mean())


def vertex_components(n_vertices, simplices):
    """Connected component of each vertex: (n,) int array, numbered by each component's smallest vertex.

    simplices : (m, 3) faces or (m, 2) edges
    """
    from heatwalk.numerics.triangles import connected

    return connected(n_vertices, np.ascontiguousarray(simplices, np.int64))
