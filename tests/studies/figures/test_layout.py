import numpy as np

from studies.figures.layout import lay_out, shrink
from studies.figures.pictures import ColourBar, Tile
from studies.figures.style import TWO_COLUMNS


def test_the_pictures_of_a_row_are_cropped_alike_and_keep_all_their_ink():
    picture, other = np.full((60, 80, 3), 255, dtype=np.uint8), np.full((60, 80, 3), 255, dtype=np.uint8)
    picture[10:20, 30:40] = 0
    other[40:50, 60:70] = 0
    figure = lay_out([[Tile(picture, "one"), Tile(other, "two")]], "heading")
    shown = [axes.get_images()[0].get_array() for axes in figure.axes]
    assert [image.shape for image in shown] == [(40, 40, 3), (40, 40, 3)]
    assert [int((image == 0).all(axis=2).sum()) for image in shown] == [100, 100]
    assert figure.get_figwidth() <= TWO_COLUMNS


def test_a_white_picture_is_laid_out_whole():
    figure = lay_out([[Tile(np.full((60, 80, 3), 255, dtype=np.uint8), "nothing")]])
    assert figure.axes[0].get_images()[0].get_array().shape == (60, 80, 3)


def test_a_colour_bar_is_below_its_picture_and_inside_the_figure():
    picture = np.zeros((60, 80, 3), dtype=np.uint8)
    figure = lay_out([[Tile(picture, "one"), Tile(picture, "two", ColourBar(0.0, 2.0, "heat"))]])
    figure.draw_without_rendering()
    plain, barred = figure.axes[:2]
    assert not plain.child_axes
    (bar,) = barred.child_axes
    assert [text.get_text() for text in bar.get_xticklabels()] == ["0", "heat", "2"]
    assert 0 <= bar.get_tightbbox().y0 < bar.get_tightbbox().y1 <= barred.get_window_extent().y0


def test_a_picture_drawn_in_proportion_keeps_a_dot_of_the_smallest_scale():
    shrunk = shrink(np.zeros((90, 120, 3), np.uint8), 1e-6)
    assert shrunk.shape == (90, 120, 3)
    assert (shrunk < 255).any(axis=2).sum() == 1
