"""Colours of segments on surfaces: a face's colour, and the same colour for the same part of two segmentations."""

import numpy as np

import heatwalk
from heatwalk.io import label_colours
from studies.metrics import match_labels

BACKGROUND = -1  # the label of the dissipator region, which is grey


def face_colours(labels: np.ndarray | None, faces: np.ndarray) -> np.ndarray:
    """The colour of each face.

    Parameters
    ----------
    labels : (n,) int array, optional
        segment of each vertex, ``BACKGROUND`` for the background; without labels, every face is grey
    faces : (m, 3) int array

    Returns
    -------
    (m, 3) uint8 array
        the colours of ``heatwalk.io.label_colours``

    Examples
    --------
    >>> face_colours(np.array([0, 0, -1, -1]), np.array([[0, 1, 2], [1, 2, 3]])).tolist()
    [[230, 25, 75], [175, 175, 175]]
    """
    if labels is None:
        labels = np.full(faces.max() + 1, BACKGROUND)
    of_faces = heatwalk.faces_from_vertices(labels, faces)
    grey = max(of_faces.max(), 0) + 1
    return label_colours(np.where(of_faces == BACKGROUND, grey, of_faces), grey)[:, :3]


def match_colours(reference: np.ndarray, compared: np.ndarray, labels: np.ndarray) -> np.ndarray:
    """Renumber a segmentation so that a part has the number, and so the colour, that it has in a reference.

    The background remains the background and is not matched. Parts without a counterpart are numbered on from the
    largest label of the reference.

    Parameters
    ----------
    reference, compared : (p,) int arrays
        labels of the same p points in the reference and in the segmentation to renumber
    labels : (n,) int array
        labels of all n points of the segmentation to renumber

    Returns
    -------
    (n,) int array

    Examples
    --------
    >>> reference, compared = np.array([0, 0, 1, -1]), np.array([5, 5, 3, -1])
    >>> match_colours(reference, compared, compared).tolist()
    [0, 0, 1, -1]
    """
    both = (reference >= 0) & (compared >= 0)
    renumbered = np.full(len(labels), BACKGROUND)
    parts = np.unique(labels[labels >= 0])
    first_new = max(reference.max(initial=BACKGROUND), BACKGROUND) + 1 + len(parts)
    number_of = dict(zip(parts.tolist(), range(first_new, first_new + len(parts)), strict=True))
    if both.any():
        matched = match_labels(reference[both], compared[both])
        number_of |= dict(zip(compared[both].tolist(), matched.tolist(), strict=True))
    for part, number in number_of.items():
        renumbered[labels == part] = number
    return renumbered
