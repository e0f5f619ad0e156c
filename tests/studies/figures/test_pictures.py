import numpy as np
import pytest

from studies.figures.drawing import save
from studies.figures.layout import lay_out
from studies.figures.pictures import Picture, Tile, is_drawn


@pytest.fixture
def drawn(tmp_path):
    """A file that shows "variant 1a"."""
    figure = lay_out([[Tile(np.zeros((60, 80, 3), np.uint8), "black")]])
    save(figure, tmp_path / "gallery.png", "variant 1a")
    return tmp_path / "gallery.png"


def test_a_picture_is_drawn_again_only_if_its_content_changes(drawn):
    assert is_drawn(drawn, "variant 1a")
    assert not is_drawn(drawn, "variant 1b")
    assert not is_drawn(drawn.with_name("other.png"), "variant 1a")


def test_a_picture_has_no_pdf_next_to_it(drawn):
    assert [path.name for path in drawn.parent.iterdir()] == ["gallery.png"]


@pytest.mark.parametrize("length", [0, 7, 40, 200])
def test_a_damaged_file_is_drawn_again(drawn, length):
    drawn.write_bytes(drawn.read_bytes()[:length])
    assert not is_drawn(drawn, "variant 1a")


def test_a_file_with_a_damaged_middle_is_drawn_again(drawn):
    data = bytearray(drawn.read_bytes())
    data[len(data) // 2] ^= 0xFF
    drawn.write_bytes(data)
    assert not is_drawn(drawn, "variant 1a")


def test_a_picture_without_all_of_its_parts_cannot_be_made():
    class Half(Picture):
        stem = "half"

        def tasks(self):
            return []

    with pytest.raises(TypeError, match="abstract"):
        Half()
