"""Coordinates that do not depend on where a mesh is and how large it is."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def unit_size(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """The vertices, moved and scaled so that the longest side of the bounding box of the faces is from -0.5 to 0.5.

    Parameters
    ----------
    vertices : (n, 3) float array
        coordinates of any finite magnitude
    faces : (m, 3) int array
        vertices of each face

    Returns
    -------
    (n, 3) float array
        vertices without a face are at the origin

    Raises
    ------
    ValueError
        If there are no faces, or a coordinate of one is NaN or infinite.

    Examples
    --------
    >>> unit_size(np.array([[2.0, 0, 0], [6, 0, 0], [6, 2, 0]]), np.array([[0, 1, 2]])) + 0.0
    array([[-0.5 , -0.25,  0.  ],
           [ 0.5 , -0.25,  0.  ],
           [ 0.5 ,  0.25,  0.  ]])
    """
    vertices, used = np.asarray(vertices, np.float64), np.unique(faces)
    if not len(used):
        raise ValueError("the mesh has no faces")
    points = vertices[used]
    bad = used[~np.isfinite(points).all(axis=1)]
    if len(bad):
        raise ValueError(f"vertex {bad[0]} has NaN or infinite coordinates")
    result = np.zeros_like(vertices)
    largest = np.abs(points).max()
    # Divided in two steps: the difference of two coordinates of 1e308 would overflow, as would 1 / 1e-310.
    points = points / largest if largest > 0 else points
    low, high = points.min(axis=0), points.max(axis=0)
    extent = (high - low).max()
    result[used] = (points - (low + high) / 2) / (extent if extent > 0 else 1.0)
    return result
