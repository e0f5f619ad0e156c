"""Lays rendered surfaces out in rows, each below its caption, on the width of two columns of a paper."""

from collections.abc import Iterator, Sequence

import matplotlib
import numpy as np
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure

from studies.figures.drawing import add_heading, styled
from studies.figures.pictures import ColourBar, Row, Tile
from studies.figures.style import FIELD_COLOURS, LABEL, SMALL, TWO_COLUMNS
from studies.figures.typography import displayable, families, shorten, width

# In inches.
WIDEST_TILE = 2.4
NARROWEST = 3.4  # figure, so that its title has room
GAP = 0.04  # between tiles
CAPTION_LINE = 0.14
LABEL_LINE = 0.17  # of a row
BAR_SPACE = 0.32  # below a picture with a colour bar
RULER_SPACE = 0.1  # below a picture with a scale bar


@styled
def lay_out(rows: Sequence[Row | Sequence[Tile]], title: str = "", subtitle: str = "") -> Figure:
    """Lay out tiles in rows.

    The pictures of a row are cropped alike, so that pictures of the same frame keep it.

    Parameters
    ----------
    rows : sequence of Row
        or of sequences of tiles, which are rows without a label; the pictures of a row have the same size
    title, subtitle : str
        text above all of them, see `studies.figures.drawing.add_heading`

    Returns
    -------
    matplotlib.figure.Figure
        at most 7 inches wide, with one Axes for each picture, row by row

    Examples
    --------
    >>> picture = np.full((60, 80, 3), 255, dtype=np.uint8)
    >>> picture[20:40, 20:60] = 0
    >>> figure = lay_out([Row([Tile(picture, "first"), Tile(picture, "second")], "Ant 81")], "Two tiles")
    >>> [text.get_text() for text in figure.texts]
    ['Two tiles', 'Ant 81', 'first', 'second']
    """
    labelled = [row if isinstance(row, Row) else Row(row) for row in rows]
    with matplotlib.rc_context({"font.family": families(map(displayable, [title, subtitle, *_texts(labelled)]))}):
        return _lay_out(labelled, title, subtitle)


def _lay_out(rows: Sequence[Row], title: str, subtitle: str) -> Figure:
    longest = max(len(row.tiles) for row in rows)
    cell = min(TWO_COLUMNS / longest, WIDEST_TILE)
    across = max(cell * longest, NARROWEST)
    pictures = [_cropped([tile.picture for tile in row.tiles]) for row in rows]
    heights = [min((cell - GAP) * row[0].shape[0] / row[0].shape[1], 1.4 * cell) for row in pictures]
    captions = [_space_above(row) for row in rows]
    labels = [LABEL_LINE if row.label else 0.0 for row in rows]
    below = [_space_below(row) for row in rows]
    total = sum(heights) + sum(captions) + sum(labels) + sum(below) + GAP

    figure = Figure(figsize=(across, total))
    whole = total + add_heading(figure, title, subtitle)
    left = (across - cell * longest) / 2
    top = total
    for row, cropped, height, caption, label, under in zip(
        rows, pictures, heights, captions, labels, below, strict=True
    ):
        if row.label:
            text = shorten(displayable(row.label), 1.15 * LABEL, across - 2 * GAP)  # bold letters are wider
            figure.text(GAP / across, (top - 0.05) / whole, text, va="top", fontsize=LABEL, fontweight="bold")
        bottom = top - label - caption - height
        for i, (tile, picture) in enumerate(zip(row.tiles, cropped, strict=True)):
            start = left + i * cell
            axes = figure.add_axes(((start + GAP / 2) / across, bottom / whole, (cell - GAP) / across, height / whole))
            axes.set_axis_off()
            axes.imshow(picture, interpolation="antialiased")
            # Captions of narrow tiles are smaller rather than cut off, unless they are very long.
            lines = [displayable(line) for line in tile.caption.split("\n")]
            size = SMALL if max(width(line, SMALL) for line in lines) <= cell else SMALL - 1
            figure.text(
                (start + cell / 2) / across, (bottom + height + 0.03) / whole,
                "\n".join(shorten(line, size, cell) for line in lines), ha="center", va="bottom", fontsize=size,
            )  # fmt: skip
            if tile.bar is not None:
                _draw_colour_bar(axes, tile.bar, height)
            if tile.ruler:
                inch = min((cell - GAP) / picture.shape[1], height / picture.shape[0])  # of a pixel
                _draw_ruler(axes, tile.ruler * inch / (cell - GAP), height)
        top = bottom - under
    return figure


def _texts(rows: Sequence[Row]) -> Iterator[str]:
    for row in rows:
        yield row.label
        for tile in row.tiles:
            yield tile.caption
            yield tile.bar.unit if tile.bar else ""


def _space_above(row: Row) -> float:
    lines = max(1 + tile.caption.count("\n") if tile.caption else 0 for tile in row.tiles)
    return CAPTION_LINE * lines + GAP


def _space_below(row: Row) -> float:
    if any(tile.bar is not None for tile in row.tiles):
        return BAR_SPACE
    return RULER_SPACE if any(tile.ruler for tile in row.tiles) else 0.0


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
    drawn.ax.tick_params(length=2, pad=1, labelsize=SMALL)
    drawn.outline.set_linewidth(0.4)


def _draw_ruler(axes: Axes, length: float, height: float) -> None:
    """A scale bar below a picture of this height in inches; its length is a share of the picture's width."""
    middle, y = 0.5, -0.05 / height
    axes.plot(
        [middle - length / 2, middle + length / 2], [y, y], color="black", lw=1.2, marker="|", ms=4,
        transform=axes.transAxes, clip_on=False, scalex=False, scaley=False,
    )  # fmt: skip
