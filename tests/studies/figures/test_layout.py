import itertools

import numpy as np
import pytest

from studies.figures.layout import lay_out
from studies.figures.pictures import ColourBar, Row, Tile
from studies.figures.style import TWO_COLUMNS


def blank(height=60, width=80):
    return np.full((height, width, 3), 255, dtype=np.uint8)


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


def test_a_scale_bar_has_the_length_of_its_pixels_in_the_picture():
    picture = np.zeros((60, 80, 3), dtype=np.uint8)
    figure = lay_out([[Tile(picture, "one", ruler=40), Tile(picture, "two", ruler=10), Tile(picture, "three")]])
    figure.draw_without_rendering()
    long, short, none = figure.axes
    widths = [axes.lines[0].get_window_extent().width / axes.get_window_extent().width for axes in (long, short)]
    # But for the marks at the ends.
    assert widths[0] - widths[1] == pytest.approx(30 / 80, abs=0.01)
    assert not none.lines
    assert 0 <= long.lines[0].get_window_extent().y0 < long.get_window_extent().y0


@pytest.mark.parametrize("n_tiles", [1, 4, 7])
@pytest.mark.parametrize(
    "name",
    ["scan_of_the_left_half_of_the_statue_in_the_garden_2024-05-17_cleaned_v2_final_0017" * 2, "象の模型" * 40, "a\tb"],
)
@pytest.mark.filterwarnings("error")
def test_labels_and_captions_of_any_length_and_script_stay_inside_the_figure(n_tiles, name, tmp_path):
    from studies.figures.drawing import save

    tiles = [Tile(np.zeros((60, 80, 3), dtype=np.uint8), f"{name} {i}") for i in range(n_tiles)]
    figure = lay_out([Row(tiles, f"{name}, HeatWalk")], f"{name} on data", f"{name}; CP: Change Percentage")
    figure.draw_without_rendering()
    boxes = [text.get_window_extent() for text in figure.texts]
    for box in boxes:
        assert box.x0 >= 0
        assert box.y0 >= 0
        assert box.x1 <= figure.bbox.width
        assert box.y1 <= figure.bbox.height
    captions = boxes[-n_tiles:]
    assert all(left.x1 <= right.x0 + 1 for left, right in itertools.pairwise(captions))
    save(figure, tmp_path / "names.png", "names")


def test_a_label_is_above_the_captions_of_its_row_and_below_the_row_before():
    figure = lay_out([Row([Tile(blank(), "one")], "Ant 81"), Row([Tile(blank(), "two")], "Cow 3")], "Holes", "levels")
    figure.draw_without_rendering()
    bottoms = {text.get_text(): text.get_window_extent().y0 for text in figure.texts}
    assert sorted(bottoms, key=bottoms.get, reverse=True) == ["Holes", "levels", "Ant 81", "one", "Cow 3", "two"]
    assert bottoms["Cow 3"] < figure.axes[0].get_window_extent().y0


def test_a_row_without_captions_takes_no_room_for_them():
    with_caption, without = lay_out([[Tile(blank(), "one")]]), lay_out([[Tile(blank(), "")]])
    assert without.get_figheight() < with_caption.get_figheight()
