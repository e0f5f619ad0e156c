import pytest

from studies.figures import typography
from studies.figures.typography import ELLIPSIS, displayable, families, shorten, width, wrap


@pytest.mark.parametrize("text", ["Ant 81", "Küche", "скан", "مسح", "a\nb", "50 % < α"])
def test_what_the_font_of_matplotlib_has_is_shown_as_it_is(text):
    assert displayable(text) == text
    assert families([text]) == [typography.FONT]


@pytest.mark.parametrize("text", ["象の模型", "코끼리", "🐘 3", "\U00013000", "\ue000", "a\udcfcb"])
def test_what_no_font_has_is_transliterated(text, monkeypatch):
    monkeypatch.setattr(typography, "_best_font", lambda characters: None)
    shown = displayable(text)
    assert shown
    assert displayable(shown) == shown


def test_characters_that_move_the_cursor_are_spaces():
    assert displayable("a\tb\rc\u2028d") == "a b c d"


@pytest.mark.parametrize("text", ["Ant 81", "a_long_name_with_a_number_at_its_end_0017", "mmmmmmmmmmmmm", "illililil"])
@pytest.mark.parametrize("inches", [0.3, 0.8, 3.0])
def test_a_shortened_text_fits_and_keeps_its_beginning_and_end(text, inches):
    short = shorten(text, 7, inches)
    assert width(short, 7) <= inches
    if short != text:
        head, tail = short.split(ELLIPSIS)
        assert text.startswith(head)
        assert text.endswith(tail)
        assert 0 <= len(head) - len(tail) <= 1


@pytest.mark.parametrize("inches", [1.0, 2.0, 7.0])
def test_lines_fit_and_contain_the_words_in_order(inches):
    text = "Spikes of up to four fifths of the bounding box on the benchmark"
    lines = wrap(text, 9, inches, most_lines=9).split("\n")
    assert " ".join(lines) == text
    assert all(width(line, 9) <= inches for line in lines)


def test_no_more_lines_than_allowed():
    lines = wrap("word " * 50, 9, 1.0, most_lines=2).split("\n")
    assert len(lines) == 2
    assert ELLIPSIS in lines[1]
