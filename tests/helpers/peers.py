"""Meshes and questions for the tests of the methods that the Heat Walk is compared with."""

import warnings

import numpy as np

from perturb.testing import odd_meshes

NECK = 0.2


def bulbs(radii, n_around=24, step=0.09):
    """Round bodies in a row along x, joined by necks, as one closed surface of revolution.

    Returns
    -------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    labels : (m,) int array
        the body that each face belongs to, -1 for a neck
    """
    radii = np.asarray(radii, dtype=float)
    centres = np.cumsum(np.concatenate([[0.0], radii[:-1] + radii[1:] + 0.3]))
    ends = centres[0] - radii[0], centres[-1] + radii[-1]
    # Rings at equal steps along the profile, which is steep at the ends.
    fine = np.linspace(*ends, 20001)
    profile = _profile(fine, centres, radii)
    length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(fine), np.diff(profile)))])
    x = np.interp(np.linspace(0, length[-1], round(length[-1] / step) + 1)[1:-1], length, fine)
    angle = 2 * np.pi * np.arange(n_around) / n_around
    radius = _profile(x, centres, radii)
    rings = np.stack(
        [np.repeat(x[:, None], n_around, axis=1), radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)],
        axis=-1,
    )
    index = 1 + np.arange(len(x) * n_around).reshape(len(x), n_around)
    a, b = index[:-1], index[1:]
    c, d = np.roll(b, -1, axis=1), np.roll(a, -1, axis=1)
    last = len(x) * n_around + 1
    fans = [
        np.stack([np.zeros_like(a[0]), index[0], np.roll(index[0], -1)], axis=-1),
        np.stack([np.full_like(a[0], last), np.roll(index[-1], -1), index[-1]], axis=-1),
    ]
    sides = [np.stack([a, b, c], axis=-1).reshape(-1, 3), np.stack([a, c, d], axis=-1).reshape(-1, 3)]
    vertices = np.concatenate([[[ends[0], 0, 0]], rings.reshape(-1, 3), [[ends[1], 0, 0]]])
    faces = np.concatenate([*sides, *fans])[:, [0, 2, 1]]
    centre = vertices[faces].mean(axis=1)
    inside = np.hypot(centre[:, :1] - centres, np.linalg.norm(centre[:, 1:], axis=1)[:, None]) < radii * 1.02
    off_neck = np.abs(centre[:, :1] - centres) < 0.9 * radii
    found = inside & off_neck | (np.abs(centre[:, :1] - centres) < radii) & (np.array([centre[:, 0] < centres[0]]).T)
    return vertices, faces, np.where(found.any(axis=1), found.argmax(axis=1), -1)


def _profile(x, centres, radii):
    """The radius of the surface at each x."""
    balls = np.sqrt(np.maximum(radii**2 - (x[:, None] - centres) ** 2, 0)).max(axis=1)
    between = (x > centres[0]) & (x < centres[-1])
    return np.where(between, np.maximum(balls, NECK), balls)


def same_partition(a, b):
    """Whether two labellings are equal but for the names of the labels."""
    a, b = np.asarray(a), np.asarray(b)
    n_pairs = len(np.unique(np.column_stack([a, b]), axis=0))
    return n_pairs == len(np.unique(a)) == len(np.unique(b))


def turned(vertices, seed=0):
    """The vertices in another place, direction and size."""
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    rotation *= np.linalg.det(rotation)
    return 7.3 * vertices @ rotation.T + rng.normal(size=3)


def labels_or_reasons(method, names=None):
    """Labels of each mesh of `perturb.testing.odd_meshes`, checked; or the ValueError's message, one line."""
    results = {}
    for name, mesh in odd_meshes().items():
        if names is not None and name not in names:
            continue
        vertices, faces = np.array(mesh.vertices), np.array(mesh.faces)
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("error")
                labels = method(vertices, faces)
        except ValueError as error:
            results[name] = str(error)
            assert "\n" not in results[name]
            continue
        assert labels.shape == (len({"faces": faces, "vertices": vertices}[method.labels_of]),), name
        assert labels.dtype == np.int64, name
        assert labels.min() >= -1, name
        results[name] = labels
    return results
