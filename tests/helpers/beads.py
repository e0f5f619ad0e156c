"""Beads on a line, joined by necks: a closed surface whose parts are obvious."""

import numpy as np
import trimesh


def beads(lengths=(1.0, 1.6, 1.0), rings=12, sectors=24):
    """A surface of revolution with a bead per length, and for each face the number of its bead.

    Beads meet in necks of a fifth of a bead's radius, at rings of vertices: no face is part of two beads.
    """
    steps = [np.linspace(0, 1, round(rings * length) + 1) for length in lengths]
    starts = np.concatenate([[0.0], np.cumsum(lengths)[:-1]])
    x = np.concatenate([start + length * step[:-1] for start, length, step in zip(starts, lengths, steps, strict=True)])
    radius = np.concatenate([0.1 + 0.4 * np.sin(np.pi * step[:-1]) for step in steps])
    x, radius = x[1:], radius[1:]  # without the pole at the start
    # Uneven sectors, so that no two faces are mirror images of each other.
    angles = np.cumsum(1 + 0.2 * np.sin(np.arange(sectors)))
    angles *= 2 * np.pi / angles[-1]
    around = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    n = len(x)
    vertices = np.concatenate(
        [
            [[0.0, 0, 0]],
            np.column_stack([np.repeat(x, sectors), np.kron(radius[:, None], around)]),
            [[sum(lengths), 0, 0]],
        ]
    )
    index = 1 + np.arange(n * sectors).reshape(n, sectors)
    after = np.roll(index, -1, axis=1)
    a, b, c, d = index[:-1].ravel(), index[1:].ravel(), after[1:].ravel(), after[:-1].ravel()
    first, last = np.full(sectors, 0), np.full(sectors, len(vertices) - 1)
    faces = np.concatenate(
        [
            np.column_stack([first, index[0], after[0]]),
            np.column_stack([a, b, c]),
            np.column_stack([a, c, d]),
            np.column_stack([last, after[-1], index[-1]]),
        ]
    )
    centres = vertices[faces].mean(axis=1)
    mesh = trimesh.Trimesh(vertices, faces[:, ::-1], process=False)
    return mesh, np.searchsorted(np.cumsum(lengths)[:-1], centres[:, 0])
