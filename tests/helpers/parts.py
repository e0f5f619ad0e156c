"""Shapes with obvious parts."""

import numpy as np
import trimesh

# Four directions far apart, and not symmetric: the lengths differ too.
DIRECTIONS = np.array([[1.0, 0.1, 0.2], [-0.4, 0.9, -0.2], [-0.3, -0.8, 0.5], [-0.2, -0.1, -1.0]])
LENGTHS = np.array([2.0, 1.7, 1.5, 1.85])


def star(subdivisions=4):
    """A ball with four arms: vertices, faces, and for each vertex its arm, -1 on the ball and around it."""
    sphere = trimesh.creation.icosphere(subdivisions)
    outward = np.asarray(sphere.vertices)
    directions = DIRECTIONS / np.linalg.norm(DIRECTIONS, axis=1, keepdims=True)
    rise = np.exp(18 * (outward @ directions.T - 1)) * LENGTHS
    vertices = outward * (0.5 + rise.sum(axis=1))[:, None]
    arm = np.where(rise.max(axis=1) > 0.5, rise.argmax(axis=1), -1)
    return vertices, np.asarray(sphere.faces), arm


def chain(radii=(1.0, 0.8, 0.9), neck=0.25, around=24):
    """Balls joined in a row by necks: vertices, faces, and for each vertex its ball."""
    profile = []
    for i, radius in enumerate(radii):
        along = np.linspace(0, np.pi, 25)[1:-1]
        start = 2 * sum(radii[:i])
        ring = np.column_stack([start + radius * (1 - np.cos(along)), radius * np.sin(along)])
        ring[:, 1] = np.where((ring[:, 1] < neck) & ~_is_tip(ring[:, 0], radii), neck, ring[:, 1])
        profile.append(ring)
    ball = np.repeat(np.repeat(np.arange(len(radii)), 23), around)
    along, radius = np.concatenate(profile).T
    angle = 2 * np.pi * np.arange(around) / around
    rings = np.stack(
        [
            np.repeat(along[:, None], around, axis=1),
            radius[:, None] * np.cos(angle),
            radius[:, None] * np.sin(angle),
        ],
        axis=-1,
    )
    vertices = np.concatenate([rings.reshape(-1, 3), [[0, 0, 0], [2 * sum(radii), 0, 0]]])
    n_rings = len(along)
    index = np.arange(n_rings * around).reshape(n_rings, around)
    here, there = index[:-1], index[1:]
    sides = np.concatenate(
        [
            np.stack([here, np.roll(here, -1, 1), there], axis=-1).reshape(-1, 3),
            np.stack([np.roll(here, -1, 1), np.roll(there, -1, 1), there], axis=-1).reshape(-1, 3),
        ]
    )
    tips = [
        np.stack([np.full(around, len(vertices) - 2), np.roll(index[0], -1), index[0]], axis=1),
        np.stack([np.full(around, len(vertices) - 1), index[-1], np.roll(index[-1], -1)], axis=1),
    ]
    return vertices, np.concatenate([sides, *tips]), np.append(ball, [0, len(radii) - 1])


def agreement(labels, parts):
    """The share of what belongs to a part that has the label of most of that part, each label for one part at most."""
    from scipy.optimize import linear_sum_assignment

    labels, parts = labels[parts >= 0], parts[parts >= 0]
    table = np.zeros((parts.max() + 1, labels.max() + 1))
    np.add.at(table, (parts, labels), 1)
    return table[linear_sum_assignment(-table)].sum() / table.sum()


def _is_tip(along, radii):
    """Whether a place along the chain is in the first half of its first ball, or in the second half of its last."""
    return (along < radii[0]) | (along > 2 * sum(radii) - radii[-1])
