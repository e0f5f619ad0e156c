"""A depth buffer: which faces are first along the rays of a regular grid."""

from __future__ import annotations

import math

import numpy as np

from heatwalk.numerics.compilation import compiled

TOLERANCE = 1e-9  # relative; faces whose depths differ by less lie on each other
SLACK = 1e-3  # relative; a face between the rays is not hidden by neighbours that slope towards it

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
    ax, ay, bx, by, cx, cy = pixels[a, 0], pixels[a, 1], pixels[b, 0], pixels[b, 1], pixels[c, 0], pixels[c, 1]
    doubled_area = (bx - ax) * (cy - ay) - (cx - ax) * (by - ay)
    found = 0
    if doubled_area == 0.0:
        return found
    left, right = max(math.ceil(min(ax, bx, cx) - 0.5), 0), min(max(ax, bx, cx) - 0.5, nearest.shape[1] - 1.0)
    low, high = max(math.ceil(min(ay, by, cy) - 0.5), 0), min(max(ay, by, cy) - 0.5, nearest.shape[0] - 1.0)
    row = low
    while row <= high:
        column = left
        while column <= right:
            x, y = column + 0.5, row + 0.5
            at_b = ((x - ax) * (cy - ay) - (cx - ax) * (y - ay)) / doubled_area
            at_c = ((bx - ax) * (y - ay) - (x - ax) * (by - ay)) / doubled_area
            at_a = 1.0 - at_b - at_c
            if at_a >= 0.0 and at_b >= 0.0 and at_c >= 0.0:
                here = at_a * nearness[a] + at_b * nearness[b] + at_c * nearness[c]
                found = 1
                if task == DRAW:
                    nearest[row, column] = max(nearest[row, column], here)
                elif here >= nearest[row, column] * (1.0 - TOLERANCE):
                    return 2
            column += 1
        row += 1
    return found


@compiled
def _is_in_front(pixels: np.ndarray, nearness: np.ndarray, face: np.ndarray, nearest: np.ndarray) -> bool:
    """Return whether nothing is in front of the centre of a face that no ray meets."""
    x, y, here = 0.0, 0.0, 0.0
    for v in face:
        x += pixels[v, 0] / 3.0
        y += pixels[v, 1] / 3.0
        here += nearness[v] / 3.0
    row = min(max(math.floor(y), 0), nearest.shape[0] - 1)
    column = min(max(math.floor(x), 0), nearest.shape[1] - 1)
    return here >= nearest[row, column] * (1.0 - SLACK)
