"""Meshes as they are found in the wild, on which perturbations are tried."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import trimesh

from perturb.meshes import as_trimesh

Arrays = tuple[np.ndarray, np.ndarray]

MAP_COORDINATES = np.array([477_000.0, 5_429_000.0, 250.0])
TETRAHEDRON = np.concatenate([np.zeros((1, 3)), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])


def odd_meshes() -> dict[str, trimesh.Trimesh]:
    """Make meshes that are valid as arrays, but are not closed, consistently wound surfaces at an ordinary scale.

    Returns
    -------
    dict of str to trimesh.Trimesh
        By what is odd about them. All are small variants of an ellipsoid, except for "fin", "two sheets" and
        "Möbius strip".

    Notes
    -----
    Not every perturbation can be applied to each of them, but one that cannot must raise PerturbationError.

    Examples
    --------
    >>> import perturb.testing
    >>> two_sided = perturb.testing.odd_meshes()["two-sided"]
    >>> bool((two_sided.faces[len(two_sided.faces) // 2 :] == two_sided.faces[: len(two_sided.faces) // 2, ::-1]).all())
    True
    """
    vertices, faces = ellipsoid()
    meshes = {label: change(vertices.copy(), faces.copy()) for label, change in _CHANGES.items()}
    meshes["fin"] = sheets(gap=0.0)
    meshes["two sheets"] = sheets(gap=0.08)
    meshes["Möbius strip"] = moebius_strip()
    return {label: as_trimesh(*arrays) for label, arrays in meshes.items()}


def ellipsoid() -> Arrays:
    """An ellipsoid with 642 vertices."""
    sphere = trimesh.creation.icosphere()
    return np.asarray(sphere.vertices) * [1.0, 0.7, 0.4], np.asarray(sphere.faces)


def sheets(gap: float, n: int = 24) -> Arrays:
    """Two unit squares of n x n vertices, above each other and wound oppositely; with a gap of 0, one of two sides.

    In the latter case the sides share their vertices, but divide each cell along different diagonals.
    """
    u, v = np.meshgrid(np.linspace(0, 1, n), np.linspace(0, 1, n), indexing="ij")
    below = np.stack([u.ravel(), v.ravel(), np.zeros(n * n)], axis=1)
    index = np.arange(n * n).reshape(n, n)
    a, b, c, d = (part.ravel() for part in (index[:-1, :-1], index[1:, :-1], index[1:, 1:], index[:-1, 1:]))
    one = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    other = np.concatenate([np.stack([a, d, b], axis=1), np.stack([b, d, c], axis=1)])
    if gap == 0:
        return below, np.concatenate([one, other])
    return np.concatenate([below, below + np.array([0, 0, gap])]), np.concatenate([one, other + n * n])


def moebius_strip(n: int = 60, width: int = 5) -> Arrays:
    """A strip of n x width vertices with a half twist, wound alike except along one line across."""
    angle, across = np.meshgrid(2 * np.pi * np.arange(n) / n, np.linspace(-0.3, 0.3, width), indexing="ij")
    radius = 1 + across * np.cos(angle / 2)
    vertices = np.stack([radius * np.cos(angle), radius * np.sin(angle), across * np.sin(angle / 2)], axis=-1)
    index = np.arange(n * width).reshape(n, width)
    following = np.concatenate([index[1:], index[:1, ::-1]])
    a, b, c, d = (part.ravel() for part in (index[:, :-1], following[:, :-1], following[:, 1:], index[:, 1:]))
    return vertices.reshape(-1, 3), np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def _two_sided(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return vertices, np.concatenate([faces, faces[:, ::-1]])


def _two_sided_and_mixed(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    both = np.concatenate([faces, faces[:, ::-1]])
    return vertices, both[np.random.default_rng(0).permutation(len(both))]


def _half_two_sided(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return vertices, np.concatenate([faces, faces[_centroids(vertices, faces)[:, 0] > 0][:, ::-1]])


def _half_flipped(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return vertices, np.where(_centroids(vertices, faces)[:, :1] > 0.1, faces[:, ::-1], faces)


def _a_third_flipped(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return vertices, np.where(np.random.default_rng(0).random((len(faces), 1)) < 1 / 3, faces[:, ::-1], faces)


def _duplicate_faces(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return vertices, np.concatenate([faces, np.roll(faces[::2], 1, axis=1), faces[::5]])


def _soup(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return vertices[faces].reshape(-1, 3), np.arange(faces.size).reshape(-1, 3)


def _split_along_a_seam(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    right = _centroids(vertices, faces)[:, :1] > 0
    used, split = np.unique(faces + len(vertices) * right, return_inverse=True)
    return np.concatenate([vertices, vertices])[used], split.reshape(-1, 3)


def _with_specks(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    places = np.random.default_rng(0).uniform(-1, 1, (20, 3))
    return _together((vertices, faces), *[(place + 1e-4 * TETRAHEDRON[0], TETRAHEDRON[1]) for place in places])


def _with_a_far_speck(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return _together((vertices, faces), (0.1 * TETRAHEDRON[0] + [1e9, 0, 0], TETRAHEDRON[1]))


def _with_a_far_spike(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    vertices[0] *= 1e9
    return vertices, faces


def _at_map_coordinates(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return vertices + MAP_COORDINATES, faces


def _at_map_coordinates_with_a_speck_at_the_origin(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return _together((vertices + MAP_COORDINATES, faces), TETRAHEDRON)


def _scaled(factor: float) -> Callable[[np.ndarray, np.ndarray], Arrays]:
    return lambda vertices, faces: (factor * vertices, faces)


def _repeated_corners(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return vertices, np.concatenate([[[0, 0, 1], [2, 3, 2], [4, 4, 4]], faces])


def _needles(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    """Three faces without area, each between an edge and a new vertex at one of its ends, which coincides with it."""
    a, b, _ = faces[[10, 200, 400]].T
    new = len(vertices) + np.arange(3)
    return np.concatenate([vertices, vertices[a]]), np.concatenate([faces, np.stack([a, b, new], axis=1)])


def _mostly_degenerate_vertices(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    """A tenth of the vertices have only faces without area."""
    a, b, _ = faces[:: len(faces) // 64].T
    new = len(vertices) + np.arange(len(a))
    return np.concatenate([vertices, vertices[a]]), np.concatenate([faces, np.stack([a, b, new], axis=1)])


def _unreferenced_vertices(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return np.concatenate([1.5 * vertices[::3], vertices]), faces + len(vertices[::3])


def _open(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    used, renumbered = np.unique(faces[_centroids(vertices, faces)[:, 0] < 0.6], return_inverse=True)
    return vertices[used], renumbered.reshape(-1, 3)


def _several_components(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    return _together(*[(vertices + np.array([0, 0, 0.9 * i]), faces) for i in range(4)])


def _edges_of_three_faces(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    """A wing on three edges."""
    a, b, _ = faces[[10, 200, 400]].T
    new = len(vertices) + np.arange(3)
    return np.concatenate([vertices, 1.3 * vertices[a]]), np.concatenate([faces, np.stack([b, a, new], axis=1)])


def _bow_ties(vertices: np.ndarray, faces: np.ndarray) -> Arrays:
    """Two ellipsoids that share the vertex where they touch, and a double cone."""
    end = int(vertices[:, 0].argmax())
    other = vertices * [-1, 1, 1] + 2 * vertices[end] * [1, 0, 0]
    joined = len(vertices) + np.arange(len(vertices)) - (np.arange(len(vertices)) > end)
    joined[end] = end
    pair = np.concatenate([vertices, np.delete(other, end, axis=0)]), np.concatenate([faces, joined[faces[:, ::-1]]])
    angle = 2 * np.pi * np.arange(12) / 12
    rim = 0.2 * np.stack([np.cos(angle), np.sin(angle), np.ones(12)], axis=1)
    cone = np.concatenate([np.zeros((1, 3)), rim, rim * [1, 1, -1]]) + np.array([0, 2, 0])
    upper = np.stack([np.zeros(12, dtype=int), 1 + np.arange(12), 1 + np.roll(np.arange(12), -1)], axis=1)
    return _together(pair, (cone, np.concatenate([upper, (upper + 12 * (upper > 0))[:, ::-1]])))


def _centroids(vertices: np.ndarray, faces: np.ndarray) -> np.ndarray:
    return vertices[faces].mean(axis=1)


def _together(*meshes: Arrays) -> Arrays:
    """One mesh of several."""
    first = np.cumsum([0, *[len(vertices) for vertices, _ in meshes]])
    return (
        np.concatenate([vertices for vertices, _ in meshes]),
        np.concatenate([faces + start for (_, faces), start in zip(meshes, first, strict=False)]),
    )


_CHANGES: dict[str, Callable[[np.ndarray, np.ndarray], Arrays]] = {
    "two-sided": _two_sided,
    "two-sided and mixed": _two_sided_and_mixed,
    "half two-sided": _half_two_sided,
    "half flipped": _half_flipped,
    "a third flipped": _a_third_flipped,
    "duplicate faces": _duplicate_faces,
    "soup": _soup,
    "split along a seam": _split_along_a_seam,
    "specks": _with_specks,
    "far speck": _with_a_far_speck,
    "far spike": _with_a_far_spike,
    "map coordinates": _at_map_coordinates,
    "map coordinates and a speck at the origin": _at_map_coordinates_with_a_speck_at_the_origin,
    "size 1e-6": _scaled(1e-6),
    "size 1e6": _scaled(1e6),
    "size 1e-200": _scaled(1e-200),
    "size 1e200": _scaled(1e200),
    "repeated corners": _repeated_corners,
    "needles": _needles,
    "many degenerate vertices": _mostly_degenerate_vertices,
    "unreferenced vertices": _unreferenced_vertices,
    "open": _open,
    "several components": _several_components,
    "edges of three faces": _edges_of_three_faces,
    "bow-ties": _bow_ties,
}
