"""Lays rendered surfaces out in rows, each below its caption, on the width of two columns of a paper."""

import textwrap
from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from PIL import Image

from studies.figures.drawing import styled
from studies.figures.pictures import ColourBar, Tile
from studies.figures.style import FIELD_COLOURS, TWO_COLUMNS

# In inches.
WIDEST_TILE = 2.4
GAP = 0.04  # between tiles
CAPTION_LINE = 0.14
HEADING_LINE = 0.16
BAR_SPACE = 0.32  # below a picture with a colour bar

LETTERS_PER_INCH = 15  # of a heading


@styled
def lay_out(lines: Sequence[Sequence[Tile]], heading: str = "") -> Figure:
    """Lay out tiles in rows.

    The pictures of a row are cropped alike, so that pictures of the same frame keep it.

    Parameters
    ----------
    lines : sequence of sequences of Tile
        the rows; the pictures of a row have the same size
    heading : str
        text above all of them, wrapped to the width

    Returns
    -------
    matplotlib.figure.Figure
        at most 7 inches wide, with one Axes for each picture, row by row

    Examples
    --------
    >>> picture = np.full((60, 80, 3), 255, dtype=np.uint8)
    >>> picture[20:40, 20:60] = 0
    >>> figure = lay_out([[Tile(picture, "first"), Tile(picture, "second")]], "Two tiles")
    >>> [text.get_text() for text in figure.texts]
    ['Two tiles', 'first', 'second']
    """
    pictures = [_cropped([tile.picture for tile in line]) for line in lines]
    longest = max(map(len, lines))
    cell = min(TWO_COLUMNS / longest, WIDEST_TILE)
    width = cell * longest
    heights = [min((cell - GAP) * row[0].shape[0] / row[0].shape[1], 1.4 * cell) for row in pictures]
    captions = [CAPTION_LINE * (1 + max(tile.caption.count("\n") for tile in line)) + GAP for line in lines]
    below = BAR_SPACE if any(tile.bar is not None for line in lines for tile in line) else 0.0
    heading = "\n".join(textwrap.wrap(heading, max(int(LETTERS_PER_INCH * width), 30)))
    head = 0.1 + HEADING_LINE * (1 + heading.count("\n")) if heading else 0.0
    total = head + sum(heights) + sum(captions) + below * len(lines)

    figure = Figure(figsize=(width, total))
    if heading:
        figure.text(0.5, 1 - 0.07 / total, heading, ha="center", va="top", fontsize=9)
    top = total - head
    for line, row, height, above in zip(lines, pictures, heights, captions, strict=True):
        bottom = top - above - height
        for i, (tile, picture) in enumerate(zip(line, row, strict=True)):
            place = ((i * cell + GAP / 2) / width, bottom / total, (cell - GAP) / width, height / total)
            axes = figure.add_axes(place)
            axes.set_axis_off()
            axes.imshow(picture, interpolation="antialiased")
            middle = (i + 0.5) * cell / width
            figure.text(middle, (bottom + height + 0.03) / total, tile.caption, ha="center", va="bottom", fontsize=7)
            if tile.bar is not None:
                _draw_colour_bar(axes, tile.bar, height)
        top = bottom - below
    return figure


def shrink(picture: np.ndarray, share: float) -> np.ndarray:
    """A picture at a share of its size, in the middle of the bottom of a white one of its former size.

    Parameters
    ----------
    picture : (height, width, 3) uint8 array
    share : float
        0 to 1; at least one pixel remains

    Returns
    -------
    (height, width, 3) uint8 array

    Examples
    --------
    >>> small = shrink(np.zeros((90, 120, 3), np.uint8), 1 / 3)
    >>> small[:60].min(), small[60:, 40:80].max()
    (np.uint8(255), np.uint8(0))
    """
    height, width, _ = picture.shape
    size = (max(1, round(width * share)), max(1, round(height * share)))
    small = Image.fromarray(picture).resize(size, Image.Resampling.LANCZOS)
    sheet = Image.new("RGB", (width, height), "white")
    sheet.paste(small, ((width - small.width) // 2, height - small.height))
    return np.asarray(sheet)


def _cropped(pictures: list[np.ndarray]) -> list[np.ndarray]:
    """Pictures of one size, without the white rows and columns that all of them have at their borders."""
    ink = np.any([(picture < 255).any(axis=2) for picture in pictures], axis=0)
    if not ink.any():
        return pictures
    rows, columns = np.flatnonzero(ink.any(axis=1)), np.flatnonzero(ink.any(axis=0))
    return [picture[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1] for picture in pictures]


def _draw_colour_bar(axes: Axes, bar: ColourBar, height: float) -> None:
    """A colour bar below a picture of this height in inches."""
    place = axes.inset_axes((0.15, -0.12 / height, 0.7, 0.07 / height))
    colours = ScalarMappable(Normalize(bar.low, bar.high), FIELD_COLOURS)
    drawn = axes.figure.colorbar(colours, cax=place, orientation="horizontal")
    drawn.set_ticks([bar.low, (bar.low + bar.high) / 2, bar.high])
    drawn.ax.set_xticklabels([f"{bar.low if bar.low > bar.high / 1000 else 0:.2g}", bar.unit, f"{bar.high:.2g}"])
    drawn.ax.tick_params(length=2, pad=1, labelsize=7)
    drawn.outline.set_linewidth(0.4)
