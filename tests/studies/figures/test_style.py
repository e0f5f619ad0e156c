from itertools import combinations

import numpy as np
import pytest
from matplotlib.colors import to_rgb

from studies.figures.style import PUBLISHED_COLOUR, group_style

# Linear RGB as seen with no cones of a kind: Machado, Oliveira, Fernandes 2009, doi:10.1109/TVCG.2009.113, severity 1.
VISION = {
    "normal": np.eye(3),
    "protanopia": [[0.152286, 1.052583, -0.204868], [0.114503, 0.786281, 0.099216], [-0.003882, -0.048116, 1.051998]],
    "deuteranopia": [[0.367322, 0.860646, -0.227968], [0.280085, 0.672501, 0.047413], [-0.011820, 0.042940, 0.968881]],
    "tritanopia": [[1.255528, -0.076749, -0.178779], [-0.078411, 0.930809, 0.147602], [0.004733, 0.691367, 0.303900]],
}
TO_XYZ = [[0.4124564, 0.3575761, 0.1804375], [0.2126729, 0.7151522, 0.0721750], [0.0193339, 0.1191920, 0.9503041]]
WHITE = [0.95047, 1.0, 1.08883]


def lab(colour, vision):
    """CIE L*a*b* of a colour as seen with a kind of vision."""
    encoded = np.array(to_rgb(colour))
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    x, y, z = np.cbrt(np.array(TO_XYZ) @ np.clip(np.array(VISION[vision]) @ linear, 0, 1) / WHITE)
    return np.array([116 * y - 16, 500 * (x - y), 200 * (y - z)])


@pytest.mark.parametrize("vision", VISION)
def test_colours_of_segmenters_and_of_published_values_stay_apart_for_colour_blind_readers(vision):
    colours = [PUBLISHED_COLOUR, *(group_style(group).colour for group in range(6))]
    for one, other in combinations(colours, 2):
        assert np.linalg.norm(lab(one, vision) - lab(other, vision)) > 15, (one, other)


def test_six_segmenters_differ_without_colour():
    styles = [group_style(group) for group in range(6)]
    for appearance in ("marker", "line", "hatch"):
        assert len({getattr(style, appearance) for style in styles}) == 6
    assert all(style.marker != "s" for style in styles)  # the marker of published values


def test_more_segmenters_than_colours_still_differ():
    assert len({group_style(group) for group in range(42)}) == 42
