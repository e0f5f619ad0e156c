"""Loops over the triangles of a mesh: areas, edge lengths, operator entries, connected components."""

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled

Vector = tuple[float, float, float]


@compiled
def areas(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Area of each face: (m,) float array."""
    area = np.empty(len(faces))
    for f in range(len(faces)):
        e = _opposite_edges(vertices, faces[f])
        area[f] = _area(e)
    return area


@compiled
def squared_edge_lengths(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """Squared lengths of the edges opposite the corners of each face: (3, m) float array."""
    squares = np.empty((3, len(faces)))
    for f in range(len(faces)):
        e = _opposite_edges(vertices, faces[f])
        for i in range(3):
            squares[i, f] = _dot(e[i], e[i])
    return squares


@compiled
def cotangent_weights(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], min_flatness: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Contribution of each face to the stiffness of its edges 01, 12, 20: (3, m) float array; its area: (m,).

    With e_i the edge opposite corner i: e_i · e_j / (4 area) = −½ cot of the angle between them. A face flatter than
    ``min_flatness`` (area over squared longest edge) is treated as if it were exactly this flat.
    """
    weights, area = np.empty((3, len(faces))), np.empty(len(faces))
    for f in range(len(faces)):
        e = _opposite_edges(vertices, faces[f])
        area[f] = _area(e)
        longest = max(_dot(e[0], e[0]), _dot(e[1], e[1]), _dot(e[2], e[2]))
        four_areas = 4 * max(area[f], min_flatness * longest)
        if four_areas == 0:  # three coincident corners: no edges, no area, no conduction
            four_areas = 1
        weights[0, f] = _dot(e[0], e[1]) / four_areas
        weights[1, f] = _dot(e[1], e[2]) / four_areas
        weights[2, f] = _dot(e[2], e[0]) / four_areas
    return weights, area


@compiled
def lumped_mass(faces: NDArray[np.int64], area: NDArray[np.float64], n_vertices: int) -> NDArray[np.float64]:
    """A third of the area of the faces around each vertex: (n_vertices,) float array."""
    mass = np.zeros(n_vertices)
    for corner in range(3):
        for f in range(len(faces)):
            mass[faces[f, corner]] += area[f] / 3
    return mass


@compiled
def connected_components(n_vertices: int, simplices: NDArray[np.int64]) -> NDArray[np.int64]:
    """Connected component of each vertex of (m, d) ``simplices``, numbered in the order of their smallest vertices."""
    # Union-find: the parent of a vertex is a smaller vertex of its component; a root is its own parent.
    parent = np.arange(n_vertices)
    for s in range(len(simplices)):
        root = find_root(parent, simplices[s, 0])
        for i in range(1, simplices.shape[1]):
            other = find_root(parent, simplices[s, i])
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
def find_root(parent: NDArray[np.int64], vertex: int) -> int:
    """Root of the tree of a vertex; shortens the path to it on the way."""
    while parent[vertex] != vertex:
        parent[vertex] = parent[parent[vertex]]
        vertex = parent[vertex]
    return vertex


@compiled
def _opposite_edges(vertices: NDArray[np.float64], face: NDArray[np.int64]) -> tuple[Vector, Vector, Vector]:
    """Edge vectors opposite the corners of a face."""
    a, b, c = vertices[face[0]], vertices[face[1]], vertices[face[2]]
    return (
        (c[0] - b[0], c[1] - b[1], c[2] - b[2]),
        (a[0] - c[0], a[1] - c[1], a[2] - c[2]),
        (b[0] - a[0], b[1] - a[1], b[2] - a[2]),
    )


@compiled
def _dot(u: Vector, v: Vector) -> float:
    """Inner product of two vectors."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]


@compiled
def _area(e: tuple[Vector, Vector, Vector]) -> float:
    """Area of a face with the edge vectors ``e``."""
    u, v = e[0], e[1]
    x, y, z = u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2], u[0] * v[1] - u[1] * v[0]
    return 0.5 * np.sqrt(x * x + y * y + z * z)
