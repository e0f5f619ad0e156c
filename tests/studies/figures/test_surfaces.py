import colorsys
import functools

import numpy as np
import pytest

import perturb
from heatwalk.io import label_colours
from studies.figures import surfaces
from studies.figures.surfaces import surface
from studies.figures.views import view_along
from tests.studies.figures.samples import ink


def extent(image):
    rows, columns = np.flatnonzero(ink(image).any(axis=1)), np.flatnonzero(ink(image).any(axis=0))
    return np.ptp(rows) / image.shape[0], np.ptp(columns) / image.shape[1]


def has_hue(image, colour):
    """Whether some pixels have a colour's hue and saturation, however brightly lit."""
    hue, saturation, _ = colorsys.rgb_to_hsv(*(colour / 255))
    pixels = np.unique(image.reshape(-1, 3)[::7], axis=0)
    seen = np.array([colorsys.rgb_to_hsv(*pixel) for pixel in pixels / 255])
    return ((np.abs(seen[:, 0] - hue) < 0.01) & (np.abs(seen[:, 1] - saturation) < 0.02)).sum() > 10


@pytest.mark.parametrize("size", [(720, 600), (300, 500), (600, 200)])
def test_the_shape_fills_the_picture_in_one_direction_and_leaves_its_border_white(cow, view, size):
    image = surface(cow.mesh, view, labels=cow.labels, size=size)
    assert image.shape == (size[1], size[0], 3)
    border = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert (border == 255).all()
    assert max(extent(image)) == pytest.approx(1 - 2 * surfaces.MARGIN, abs=0.02)


def test_it_is_drawn_again_with_the_same_bytes(cow, view):
    draw = functools.partial(surface, cow.mesh, view, labels=cow.labels, opacity=0.5, edges=True)
    assert np.array_equal(draw(), draw())


def test_a_model_in_another_unit_and_place_is_drawn_the_same_to_rounding(cow, view):
    moved = perturb.as_trimesh(1e-3 * cow.mesh.vertices + [5.0, -7.0, 2.0], cow.mesh.faces)
    other = surface(moved, view_along(np.asarray(moved.vertices), view.axes), labels=cow.labels)
    differ = np.abs(surface(cow.mesh, view, labels=cow.labels).astype(int) - other) > 8
    assert differ.any(axis=2).mean() < 0.002


def test_every_segment_that_is_in_sight_has_its_own_colour_and_the_background_is_grey(cow, view):
    image = surface(cow.mesh, view, labels=cow.labels)
    # The foremost vertex of a segment whose normal faces the camera is in sight if it is the foremost of all.
    depth = np.asarray(cow.mesh.vertices) @ view.axes[2]
    foremost = cow.labels[depth.argmax()]
    assert has_hue(image, label_colours(np.array([foremost]))[0, :3])
    largest = np.bincount(cow.labels[cow.labels >= 0]).argmax()
    assert has_hue(image, label_colours(np.array([largest]))[0, :3])
    grey = surface(cow.mesh, view, labels=np.full(len(cow.labels), -1))
    assert (np.ptp(grey, axis=2) == 0).all()
    assert np.array_equal(grey, surface(cow.mesh, view))


def test_a_mark_and_a_contour_are_drawn_where_they_belong(cow, view):
    depth = np.asarray(cow.mesh.vertices) @ view.axes[2]
    point = int(depth.argmax())
    height = np.asarray(cow.mesh.vertices) @ view.axes[1]
    level = np.median(height)
    plain = surface(cow.mesh, view)
    marked = surface(cow.mesh, view, points=[point], contour=(height, level))
    unit = max(view.extent / surfaces.TILE) / (1 - 2 * surfaces.MARGIN)
    right, up = (np.asarray(cow.mesh.vertices)[point] - view.centre) @ view.axes[:2].T / unit
    column, row = round(surfaces.TILE[0] / 2 + right), round(surfaces.TILE[1] / 2 - up)
    red = marked[row, column].astype(int)
    assert red[0] > 100 > 4 * red[1:].max() / 2
    line = np.flatnonzero((marked.max(axis=2) == 0).sum(axis=1) > 50)
    assert np.abs(line - (surfaces.TILE[1] / 2 - (level - view.centre @ view.axes[1]) / unit)).max() < 8
    assert not (plain.max(axis=2) == 0).any()


def test_one_of_labels_colours_and_field_is_shown(cow, view):
    with pytest.raises(ValueError, match="exclude each other"):
        surface(cow.mesh, view, labels=cow.labels, field=np.zeros(len(cow.labels)))


def test_black_faces_may_be_none_or_all(cow, view):
    none = np.zeros(len(cow.mesh.faces), dtype=bool)
    without = surface(cow.mesh, view, labels=cow.labels)
    assert np.array_equal(surface(cow.mesh, view, labels=cow.labels, solid=none), without)
    black = surface(cow.mesh, view, labels=cow.labels, solid=~none)
    assert (black[ink(without)] == 0).mean() > 0.9  # all but the outline, which is smoothed
    assert np.ptp(black, axis=2).max() == 0  # no segment has its colour
