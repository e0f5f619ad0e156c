"""Surfaces whose parts are known."""

import numpy as np


def beads(radii, neck=0.05, around=16, along=12):
    """Vertices and faces of beads of these radii in a row, joined by necks: a closed surface of revolution."""
    profile, position = [], 0.0
    for radius in radii:
        angle = np.linspace(0, np.pi, along)
        profile += [(position + radius * (1 - np.cos(a)), max(radius * np.sin(a), neck * radius)) for a in angle]
        position += 2 * radius + 0.5 * neck
    (first, _), (last, _) = profile[0], profile[-1]
    turn = 2 * np.pi * np.arange(around) / around
    rings = [np.column_stack([np.full(around, x), 1.1 * r * np.cos(turn), r * np.sin(turn)]) for x, r in profile]
    vertices = np.vstack([*rings, [[first - 0.05, 0, 0], [last + 0.05, 0, 0]]])
    i, j = np.divmod(np.arange(around * (len(rings) - 1)), around)
    a, b = i * around + j, i * around + (j + 1) % around
    sides = np.vstack([np.column_stack([a, b, a + around]), np.column_stack([b, b + around, a + around])])
    k, end = np.arange(around), around * (len(rings) - 1)
    caps = [
        np.column_stack([(k + 1) % around, k, np.full(around, len(vertices) - 2)]),
        np.column_stack([end + k, end + (k + 1) % around, np.full(around, len(vertices) - 1)]),
    ]
    return vertices, np.vstack([sides, *caps])
