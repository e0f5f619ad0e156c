"""A depth buffer: which faces are first along the rays of a regular grid."""

from __future__ import annotations

import math

import numpy as np

from heatwalk.numerics.compilation import compiled

TOLERANCE = 1e-9  # relative; faces whose depths differ by less lie on each other
SLACK = 1e-4  # relative; the plane of a face between the rays is not hidden by that of a neighbour

DRAW, MARK = 0, 1  # what is done with the rays that meet a face


@compiled
def mark_visible(
    pixels: np.ndarray, nearness: np.ndarray, faces: np.ndarray, candidates: np.ndarray, nearest: np.ndarray,
    seen: np.ndarray,
) -> None:  # fmt: skip
    """Mark those of the candidate faces (m,) bool that are visible in `seen` (m,) bool.

    The rays are at the centres of pixels. `pixels` (n, 2) are the vertices in the image, and `nearness` (n,) is 1 over
    their depth, which is linear in the image; `nearest` (rows, columns) is overwritten with the largest along each ray.
    """
    nearest[:] = 0.0
    for f in range(len(faces)):
        _scan(pixels, nearness, faces[f], nearest, DRAW)
    for f in range(len(faces)):
        if candidates[f]:
            found = _scan(pixels, nearness, faces[f], nearest, MARK)
            if found == 2 or (found == 0 and _is_in_front(pixels, nearness, faces[f], nearest)):
                seen[f] = True


@compiled
def _scan(pixels: np.ndarray, nearness: np.ndarray, face: np.ndarray, nearest: np.ndarray, task: int) -> int:
    """Return 0 if no ray meets a face, 1 if some do; if `task` is MARK, 2 if it is first along one of them."""
    a, b, c = face[0], face[1], face[2]
    left, right = _range(pixels[a, 0], pixels[b, 0], pixels[c, 0], nearest.shape[1])
    low, high = _range(pixels[a, 1], pixels[b, 1], pixels[c, 1], nearest.shape[0])
    found = 0
    for row in range(low, high):
        for column in range(left, right):
            at_b, at_c, doubled_area = _coordinates(pixels, a, b, c, column + 0.5, row + 0.5)
            at_a = 1.0 - at_b - at_c
            if doubled_area != 0.0 and at_a >= 0.0 and at_b >= 0.0 and at_c >= 0.0:
                here = at_a * nearness[a] + at_b * nearness[b] + at_c * nearness[c]
                found = 1
                if task == DRAW:
                    nearest[row, column] = max(nearest[row, column], here)
                elif here >= nearest[row, column] * (1.0 - TOLERANCE):
                    return 2
    return found


@compiled
def _is_in_front(pixels: np.ndarray, nearness: np.ndarray, face: np.ndarray, nearest: np.ndarray) -> bool:
    """Return whether the plane of a face that no ray meets is first along the ray nearest to its centre."""
    a, b, c = face[0], face[1], face[2]
    column = math.floor((pixels[a, 0] + pixels[b, 0] + pixels[c, 0]) / 3.0)
    row = math.floor((pixels[a, 1] + pixels[b, 1] + pixels[c, 1]) / 3.0)
    column = min(max(column, 0), nearest.shape[1] - 1)
    row = min(max(row, 0), nearest.shape[0] - 1)
    at_b, at_c, doubled_area = _coordinates(pixels, a, b, c, column + 0.5, row + 0.5)
    if doubled_area == 0.0:
        return False
    here = (1.0 - at_b - at_c) * nearness[a] + at_b * nearness[b] + at_c * nearness[c]
    return here >= nearest[row, column] * (1.0 - SLACK)


@compiled
def _coordinates(pixels: np.ndarray, a: int, b: int, c: int, x: float, y: float) -> tuple[float, float, float]:
    """Return the barycentric coordinates of a point of the image with b and c, and twice the area of the triangle."""
    ax, ay = pixels[a, 0], pixels[a, 1]
    bx, by, cx, cy = pixels[b, 0] - ax, pixels[b, 1] - ay, pixels[c, 0] - ax, pixels[c, 1] - ay
    doubled_area = bx * cy - cx * by
    if doubled_area == 0.0:
        return 0.0, 0.0, 0.0
    x, y = x - ax, y - ay
    return (x * cy - cx * y) / doubled_area, (bx * y - x * by) / doubled_area, doubled_area


@compiled
def _range(a: float, b: float, c: float, length: int) -> tuple[int, int]:
    """Return the first pixel, of a row of `length`, whose centre is between the least and the largest, and the end."""
    return max(math.ceil(min(a, b, c) - 0.5), 0), min(math.floor(max(a, b, c) - 0.5), length - 1) + 1
