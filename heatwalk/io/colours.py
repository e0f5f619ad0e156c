"""Colours of segment labels."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Twenty colours that are easy to tell apart and distinct from the grey of the dissipator region, the most dissimilar
# ones first. After S. Trubetskoy, "List of 20 Simple, Distinct Colors", 2017, without its grey, black, white and beige;
# the last two are additions.
_PALETTE = np.array(
    [
        [230, 25, 75], [0, 130, 200], [255, 225, 25], [60, 180, 75], [245, 130, 48],
        [145, 30, 180], [70, 240, 240], [240, 50, 230], [170, 110, 40], [0, 128, 128],
        [210, 245, 60], [0, 0, 128], [250, 190, 212], [128, 128, 0], [220, 190, 255],
        [128, 0, 0], [170, 255, 195], [255, 215, 180], [100, 60, 220], [255, 110, 110],
    ],
    dtype=np.uint8,
)  # fmt: skip
_DISSIPATOR_GREY = np.array([175, 175, 175], dtype=np.uint8)


def label_colours(labels: ArrayLike, dissipator: int | None = None) -> NDArray[np.uint8]:
    """Colour of each label. Equal labels get the same colour, whichever other labels occur.

    Parameters
    ----------
    labels : (n,) int array, 0 or more
    dissipator : int, optional
        the label of the dissipator region, shown in grey

    Returns
    -------
    (n, 4) uint8 array
        red, green, blue and alpha

    Notes
    -----
    Labels 0 to 19 have clearly distinct colours, labels 20 to 59 darker shades of them; then the colours repeat.

    Examples
    --------
    >>> from heatwalk.io import label_colours
    >>> label_colours([0, 20, 1], dissipator=1)
    array([[230,  25,  75, 255],
           [161,  18,  52, 255],
           [175, 175, 175, 255]], dtype=uint8)
    """
    labels = np.asarray(labels)
    shade = np.array([1.0, 0.7, 0.45])[labels // len(_PALETTE) % 3]
    colours = np.rint(_PALETTE[labels % len(_PALETTE)] * shade[:, None]).astype(np.uint8)
    if dissipator is not None:
        colours[labels == dissipator] = _DISSIPATOR_GREY
    return np.column_stack([colours, np.full(len(labels), 255, dtype=np.uint8)])
