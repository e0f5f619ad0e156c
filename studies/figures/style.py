"""One style for every figure: sizes, fonts and colours that are readable in grey and by colour-blind readers.

This module contains plain values. `studies.figures.drawing` applies them with matplotlib; another renderer, such as an
HTML report, can use the same colours.
"""

from typing import NamedTuple

ONE_COLUMN, TWO_COLUMNS = 3.4, 7.0  # width of a figure, in inches
DPI = 300

# Sizes of text, in points.
TITLE, SUBTITLE, LABEL, SMALL = 9, 7.5, 8, 7
SUBTITLE_COLOUR = "#555555"

# Settings of matplotlib, on top of its defaults.
RC: dict[str, object] = {
    "font.size": LABEL,
    "axes.titlesize": LABEL,
    "axes.labelsize": LABEL,
    "xtick.labelsize": SMALL,
    "ytick.labelsize": SMALL,
    "legend.fontsize": SMALL,
    "legend.title_fontsize": SMALL,
    "text.parse_math": False,  # a name may contain dollar signs
    "axes.linewidth": 0.6,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "xtick.major.width": 0.6,
    "ytick.major.width": 0.6,
    "hatch.linewidth": 0.6,
    "grid.linewidth": 0.5,
    "grid.alpha": 0.3,
    "pdf.fonttype": 42,  # embeds TrueType fonts, which journals require and which keep the text searchable
}

FIELD_COLOURS = "viridis"  # colour map of functions and heat maps; perceptually uniform, also in grey
SPAN_COLOURS = "Oranges"  # colour map of shaded intervals
PUBLISHED_COLOUR = "#c8501e"
PUBLISHED_MARKERS = "sDP"  # of one source of published values, of a second and of a third
MISSING_COLOUR = "#d9d9d9"  # heat map cells without a value


class GroupStyle(NamedTuple):
    """Appearance of one segmenter's values: colours differ, and so do markers, lines and hatches."""

    colour: str
    marker: str
    line: str | tuple[int, tuple[int, ...]]  # a line style of matplotlib
    hatch: str


# The first is the blue of a study with one segmenter. The others are from the palette of Okabe and Ito (2008), without
# its vermilion, which is close to the colour of published values, and without its yellow, which is faint on white.
_GROUPS = (
    GroupStyle("#1f5fa8", "o", "-", ""),
    GroupStyle("#e69f00", "^", (0, (6, 1)), "////"),
    GroupStyle("#009e73", "D", (0, (4, 1, 1, 1)), "...."),
    GroupStyle("#000000", "v", (0, (2, 1)), "xxxx"),
    GroupStyle("#cc79a7", "P", (0, (8, 1, 1, 1, 1, 1)), "\\\\\\\\"),
    GroupStyle("#56b4e9", "X", (0, (1, 1)), "++++"),
)
_MARKERS = "o^DvPX*"


def group_style(group: int) -> GroupStyle:
    """Appearance of the segmenter with this number.

    Parameters
    ----------
    group : int
        number of the segmenter within the study, from 0

    Returns
    -------
    GroupStyle
        From the seventh segmenter on, colours repeat with other markers.

    Examples
    --------
    >>> group_style(0).colour
    '#1f5fa8'
    >>> group_style(6).colour == group_style(0).colour, group_style(6).marker == group_style(0).marker
    (True, False)
    """
    return _GROUPS[group % len(_GROUPS)]._replace(marker=_MARKERS[group % len(_MARKERS)])
