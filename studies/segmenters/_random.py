"""Random numbers for methods that draw some."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray


def random_generator(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> np.random.Generator:
    """A generator that the mesh alone determines: a method gives the same labels whenever it is called.

    Parameters
    ----------
    vertices : (n, 3) float array
        coordinates
    faces : (m, 3) int array
        vertices of each face

    Examples
    --------
    >>> corner = np.eye(3), np.array([[0, 1, 2]])
    >>> random_generator(*corner).random() == random_generator(*corner).random()
    True
    """
    content = np.asarray(vertices, np.float64).tobytes() + np.asarray(faces, np.int64).tobytes()
    return np.random.default_rng(list(hashlib.sha256(content).digest()))
