"""Meshes with holes, handles and spikes, and what is known of them."""

from collections import deque
from itertools import pairwise

import numpy as np
import trimesh

from perturb import as_trimesh


def arrays(mesh):
    """Vertices and faces as the package takes them."""
    return np.array(mesh.vertices, dtype=np.float64), np.array(mesh.faces, dtype=np.int64)


def blob(subdivisions=4):
    """A closed surface of genus 0 without symmetry."""
    mesh = trimesh.creation.icosphere(subdivisions)
    x, y, z = mesh.vertices.T
    return as_trimesh(np.column_stack([2 * x + 0.3 * y**2, y * (1 + 0.3 * x), z * (0.8 + 0.2 * x * y)]), mesh.faces)


def patch_around(mesh, vertex, n_sides):
    """Faces around a vertex, next to each other, whose outline has so many edges."""
    chosen = [int(np.flatnonzero((mesh.faces == vertex).any(axis=1))[0])]
    if n_sides == 3:
        return chosen
    seen, queue = set(chosen), deque(chosen)
    neighbours = {}
    for a, b in mesh.face_adjacency.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    while queue:
        for other in sorted(neighbours[queue.popleft()]):
            outline = rim(mesh.faces[[*chosen, other]])
            if other not in seen and outline is not None and len(outline) == len(chosen) + 3:
                seen.add(other)
                chosen.append(other)
                queue.append(other)
                if len(outline) == n_sides:
                    return chosen
    raise AssertionError("no such patch")


def rim(faces):
    """The outline of some faces, in their direction; None if it is not a simple loop."""
    sides = {(a, b) for face in faces.tolist() for a, b in zip(face, [*face[1:], face[0]], strict=True)}
    following = {a: b for a, b in sides if (b, a) not in sides}
    if len(following) != sum((b, a) not in sides for a, b in sides):
        return None
    loop = [min(following)]
    while following[loop[-1]] != loop[0]:
        loop.append(following[loop[-1]])
        if len(loop) > len(following):
            return None
    return loop if len(loop) == len(following) else None


def with_tube(mesh, start, end, n_sides, rings=0):
    """A tube of so many sides between two vertices, with narrower rings of vertices of its own."""
    a, b = patch_around(mesh, start, n_sides), patch_around(mesh, end, n_sides)
    first, last = rim(mesh.faces[a]), rim(mesh.faces[b])[::-1]
    vertices, faces = arrays(mesh)
    turn = min(range(n_sides), key=lambda k: np.sum((vertices[first] - vertices[np.roll(last, k)]) ** 2))
    last = np.roll(last, turn)
    layers = [np.array(first)]
    for share in np.arange(1, rings + 1) / (rings + 1):
        layers.append(len(vertices) + np.arange(n_sides))
        ring = (1 - share) * vertices[first] + share * vertices[last]
        vertices = np.concatenate([vertices, ring.mean(axis=0) + 0.7 * (ring - ring.mean(axis=0))])
    layers.append(last)
    tube = []
    for low, high in pairwise(layers):
        tube += [np.column_stack([low, np.roll(low, -1), np.roll(high, -1)])]
        tube += [np.column_stack([low, np.roll(high, -1), high])]
    return as_trimesh(vertices, np.concatenate([np.delete(faces, a + b, axis=0), *tube]))


def is_nearly(mesh, vertices, faces, within=0.01):
    """Whether two surfaces have the same area and volume within a share."""
    other = as_trimesh(vertices, faces)
    return abs(other.area / mesh.area - 1) < within and abs(abs(other.volume / mesh.volume) - 1) < within
