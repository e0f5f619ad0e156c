"""Loops over the triangles of a mesh: sizes, couplings, connected components."""

import numpy as np

from heatwalk.numerics.compilation import compiled


@compiled
def areas(vertices, faces):
    """Area of each face: (m,) float array."""
    area = np.empty(len(faces))
    for f in range(len(faces)):
        e = _opposite_edges(vertices, faces[f])
        area[f] = _area(e)
    return area


@compiled
def squared_lengths(vertices, faces):
    """Squared lengths of the edges opposite the corners of each face: (3, m) float array."""
    squares = np.empty((3, len(faces)))
    for f in range(len(faces)):
        e = _opposite_edges(vertices, faces[f])
        for i in range(3):
            squares[i, f] = _dot(e[i], e[i])
    return squares


@compiled
def couplings(vertices, faces, flattest):
    """What each face adds to the stiffness of its edges 01, 12, 20: (3, m) float array; and its area: (m,) float array.

    With e_i the edge opposite corner i: e_i · e_j / (4 area), of a face flatter than ``flattest`` (area over squared
    longest edge) as if it were this flat.
    """
    coupling, area = np.empty((3, len(faces))), np.empty(len(faces))
    for f in range(len(faces)):
        e = _opposite_edges(vertices, faces[f])
        area[f] = _area(e)
        longest = max(_dot(e[0], e[0]), _dot(e[1], e[1]), _dot(e[2], e[2]))
        quarter = 4 * max(area[f], flattest * longest)
        if quarter == 0:  # three coincident corners: no edges and no area, it conducts nothing
            quarter = 1
        coupling[0, f] = _dot(e[0], e[1]) / quarter
        coupling[1, f] = _dot(e[1], e[2]) / quarter
        coupling[2, f] = _dot(e[2], e[0]) / quarter
    return coupling, area


@compiled
def thirds_of_corners(faces, values, n_vertices):
    """For each vertex the sum over its faces of a third of their values: (n,) float array."""
    total = np.zeros(n_vertices)
    for corner in range(3):
        for f in range(len(faces)):
            total[faces[f, corner]] += values[f] / 3
    return total


@compiled
def connected(n_vertices, simplices):
    """Connected component of each vertex of (m, d) ``simplices``, numbered by each component's smallest vertex."""
    # Union-find: a vertex's parent is a smaller vertex of its component, a root its own.
    parent = np.arange(n_vertices)
    for s in range(len(simplices)):
        root = _root(parent, simplices[s, 0])
        for i in range(1, simplices.shape[1]):
            other = _root(parent, simplices[s, i])
            parent[max(root, other)] = min(root, other)
            root = min(root, other)
    component = np.empty(n_vertices, dtype=np.int64)
    n_components = 0
    for vertex in range(n_vertices):
        if parent[vertex] == vertex:
            component[vertex] = n_components
            n_components += 1
        else:
            component[vertex] = component[parent[vertex]]
    return component


@compiled
def _root(parent, vertex):
    while parent[vertex] != vertex:
        parent[vertex] = parent[parent[vertex]]
        vertex = parent[vertex]
    return vertex


@compiled
def _opposite_edges(vertices, face):
    a, b, c = vertices[face[0]], vertices[face[1]], vertices[face[2]]
    return (
        (c[0] - b[0], c[1] - b[1], c[2] - b[2]),
        (a[0] - c[0], a[1] - c[1], a[2] - c[2]),
        (b[0] - a[0], b[1] - a[1], b[2] - a[2]),
    )


@compiled
def _dot(u, v):
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@compiled
def _area(e):
    u, v = e[0], e[1]
    x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    return 0.5 * np.sqrt(x * x + y * y + z * z)
