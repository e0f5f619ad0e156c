"""Labels of vertices, where segmentations are compared, from the labels that a method assigns to vertices or faces."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from heatwalk.meshes import face_areas

LABELS_OF = ("auto", "vertices", "faces")
CONVERSION = ", as np.array(labels, dtype=int) makes them"

# Two areas are a tie if they differ by less than this, relative to the larger: the order of summation changes them by
# less.
_TIE = 1e-9


class LabelError(ValueError):
    """Labels that are not one integer per vertex or face; the message describes them."""


def labels_at_vertices(
    labels: ArrayLike, vertices: NDArray[np.float64], faces: NDArray[np.int64], labels_of: str = "auto"
) -> NDArray[np.int64]:
    """Labels of the vertices, from labels of the vertices or of the faces.

    A vertex gets the label that most of the area of its faces has, the smallest label in a tie, and -1 if it belongs to
    no face.

    Parameters
    ----------
    labels : (n,) or (m,) int array
        0 or more, or -1 for what belongs to no part
    vertices : (n, 3) float array
        coordinates
    faces : (m, 3) int array
        vertices of each face
    labels_of : {"auto", "vertices", "faces"}
        what the labels belong to; "auto": whichever their number matches

    Returns
    -------
    (n,) int64 array

    Raises
    ------
    LabelError
        If the number of labels matches neither, if labels are not integers or are below -1, and for "auto" on a mesh
        with as many vertices as faces.

    Examples
    --------
    >>> square = np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]])
    >>> faces = np.array([[0, 1, 2], [0, 2, 3]])
    >>> labels_at_vertices([8, 2], square, faces)
    array([2, 8, 2, 2])
    """
    labels = np.asarray(labels)
    n_vertices, n_faces = len(vertices), len(faces)
    mesh = f"{n_vertices} vertices and {n_faces} faces"
    if labels.ndim != 1 or labels.dtype.kind not in "iu":
        is_convertible = labels.ndim == 1 and labels.dtype.kind in "bf"
        raise LabelError(
            f"labels of shape {labels.shape} and type {labels.dtype} for {mesh}; "
            f"needed: one integer per vertex or per face{CONVERSION if is_convertible else ''}"
        )
    counts = {"vertices": n_vertices, "faces": n_faces}
    if labels_of != "auto":
        counts = {labels_of: counts[labels_of]}
    matching = [kind for kind, count in counts.items() if count == len(labels)]
    if not matching:
        raise LabelError(f"{len(labels)} labels for {mesh}; needed: {' or '.join(map(str, counts.values()))}")
    if len(matching) > 1:
        raise LabelError(f"{mesh}: specify what the labels belong to, with segmenter.labels_of=vertices or faces")
    if labels.size and labels.min() < -1:
        raise LabelError(f"the label {labels.min()}; needed: 0, 1, 2 … or -1 for what belongs to no part")
    labels = labels.astype(np.int64)
    return labels if matching == ["vertices"] else _labels_by_area(labels, vertices, faces)


def _labels_by_area(
    face_labels: NDArray[np.int64], vertices: NDArray[np.float64], faces: NDArray[np.int64]
) -> NDArray[np.int64]:
    """For each vertex the label that most of the area of its faces has: (n,)."""
    names, ranks = np.unique(face_labels, return_inverse=True)
    # One number per pair of a vertex and a label of its faces, ascending by vertex, then by label.
    pairs, pair_of_corner = np.unique(faces.ravel() * len(names) + np.repeat(ranks, 3), return_inverse=True)
    pair_areas = np.bincount(pair_of_corner, np.repeat(face_areas(vertices, faces), 3))
    used_vertices, first = np.unique(pairs // len(names), return_index=True)
    largest = np.repeat(np.maximum.reduceat(pair_areas, first), np.diff(first, append=len(pairs)))
    winners = np.flatnonzero(pair_areas >= (1 - _TIE) * largest)
    winners = winners[np.unique(pairs[winners] // len(names), return_index=True)[1]]  # in a tie the smallest label
    result = np.full(len(vertices), -1, dtype=np.int64)
    result[used_vertices] = names[pairs[winners] % len(names)]
    return result
