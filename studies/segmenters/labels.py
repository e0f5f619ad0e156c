"""Labels as a method gives them, of vertices or of faces, become labels of vertices: there they are compared."""

import numpy as np
import trimesh

LABELS_OF = ("auto", "vertices", "faces")

# Two areas this close to one another, relative to the larger, are a tie: sums in another order differ by less.
_TIE = 1e-9


class LabelError(ValueError):
    """Labels that are not one integer a vertex or a face; the message says what they are."""


def at_vertices(labels, vertices, faces, labels_of="auto"):
    """Labels of the vertices, from those of the vertices or of the faces.

    A vertex gets the label that most of the area of its faces carries; the smallest of those that tie; -1 where it
    belongs to no face.

    Parameters
    ----------
    labels : (n,) or (m,) integers, 0 or more, or -1 for what belongs to no part
    vertices : (n, 3) float array
    faces : (m, 3) int array
    labels_of : {"auto", "vertices", "faces"}
        "auto": whichever there are as many of as labels

    Returns
    -------
    (n,) int64 array

    Raises
    ------
    LabelError
        for another number of labels, labels that are no integers or below -1, and "auto" on a mesh with as many
        vertices as faces
    """
    labels = np.asarray(labels)
    n_vertices, n_faces = len(vertices), len(faces)
    there = f"{n_vertices} vertices and {n_faces} faces"
    if labels.ndim != 1 or labels.dtype.kind not in "iu":
        raise LabelError(
            f"labels of shape {labels.shape} and type {labels.dtype} for {there}; "
            "needed: one integer a vertex or a face"
        )
    counts = {"vertices": n_vertices, "faces": n_faces}
    if labels_of != "auto":
        counts = {labels_of: counts[labels_of]}
    fitting = [kind for kind, count in counts.items() if count == len(labels)]
    if not fitting:
        raise LabelError(f"{len(labels)} labels for {there}; needed: {' or '.join(map(str, counts.values()))}")
    if len(fitting) > 1:
        raise LabelError(f"{there}: say which the labels belong to, with segmenter.labels_of=vertices or faces")
    if labels.size and labels.min() < -1:
        raise LabelError(f"the label {labels.min()}; needed: 0, 1, 2 … or -1 for what belongs to no part")
    labels = labels.astype(np.int64)
    return labels if fitting == ["vertices"] else _largest_share(labels, vertices, faces)


def _largest_share(face_labels, vertices, faces):
    """For each vertex the label that most of the area of its faces carries: (n,) int64."""
    names, ranks = np.unique(face_labels, return_inverse=True)
    # One number for each vertex and label that meet there, ascending by vertex, then by label.
    meetings, place = np.unique(faces.ravel() * len(names) + np.repeat(ranks, 3), return_inverse=True)
    shares = np.bincount(place, np.repeat(trimesh.triangles.area(vertices[faces]), 3))
    at, first = np.unique(meetings // len(names), return_index=True)
    largest = np.repeat(np.maximum.reduceat(shares, first), np.diff(first, append=len(meetings)))
    winners = np.flatnonzero(shares >= (1 - _TIE) * largest)
    winners = winners[np.unique(meetings[winners] // len(names), return_index=True)[1]]
    result = np.full(len(vertices), -1, dtype=np.int64)
    result[at] = names[meetings[winners] % len(names)]
    return result
