"""Text in figures: names in any script, of any length, in the place that there is for them."""

from __future__ import annotations

import unicodedata
from collections.abc import Iterable
from functools import lru_cache

import matplotlib
from anyascii import anyascii
from matplotlib import font_manager
from matplotlib.font_manager import FontProperties
from matplotlib.textpath import TextToPath

from studies.storage import encodable

FONT = "DejaVu Sans"  # is part of matplotlib
ELLIPSIS = "…"
POINTS_PER_INCH = 72
HINTING = 1.03  # letters are moved to whole pixels, which makes a text on a screen a little longer


def displayable(text: str) -> str:
    r"""A text of one or more lines whose characters an installed font has.

    Control characters become spaces. If no font on this machine has one of the characters, those beyond ``FONT`` are
    transliterated.

    Parameters
    ----------
    text : str

    Returns
    -------
    str

    Examples
    --------
    >>> displayable("Lauf\t3"), displayable("Küche"), displayable("кошка")
    ('Lauf 3', 'Küche', 'кошка')
    """
    spaced = "".join(_without_control(letter) for letter in encodable(text))
    if not _missing(spaced):
        return spaced
    # All of them, since a word in two scripts is harder to read than one in either.
    available = _characters_of(_path_of(FONT)) | {"\n"}
    return "".join(letter if letter in available else _latin(letter) for letter in spaced)


def families(texts: Iterable[str]) -> list[str]:
    """The fonts that texts need: ``FONT``, and installed ones for characters that it does not have.

    Parameters
    ----------
    texts : iterable of str

    Returns
    -------
    list of str
        names of fonts, each used for what the ones before it do not have

    Examples
    --------
    >>> families(["Ant 81", "кошка"])
    ['DejaVu Sans']
    """
    characters = frozenset("".join(texts)) - _characters_of(_path_of(FONT)) - {"\n"}
    needed = [FONT]
    while characters:
        found = _best_font(characters)
        if found is None:
            break
        name, covered = found
        needed.append(name)
        characters -= covered
    return needed


def width(text: str, size: float) -> float:
    """The width of the longest line of a text, in inches.

    Parameters
    ----------
    text : str
    size : float
        of the font, in points

    Examples
    --------
    >>> 0.2 < width("original", 7) < 0.6
    True
    """
    points = max(sum(map(_advance, line)) for line in text.split("\n"))
    return HINTING * points * size / POINTS_PER_INCH


def shorten(text: str, size: float, inches: float) -> str:
    """A line that fits: as much of its beginning and of its end as there is room for.

    Parameters
    ----------
    text : str
    size : float
        of the font, in points
    inches : float
        room

    Returns
    -------
    str
        the text itself if it fits

    Examples
    --------
    >>> shorten("original", 7, 2.0), shorten("a_very_long_name_of_a_scan_0017", 7, 0.8)
    ('original', 'a_very…_0017')
    """
    if width(text, size) <= inches:
        return text
    fewest, most = 0, len(text)
    while fewest < most:  # how many characters are kept
        kept = (fewest + most + 1) // 2
        if width(_shortened(text, kept), size) <= inches:
            fewest = kept
        else:
            most = kept - 1
    return _shortened(text, fewest)


def wrap(text: str, size: float, inches: float, most_lines: int = 3) -> str:
    """A text in lines that fit; a word that is longer than a line, and what is left after the last, are shortened.

    Parameters
    ----------
    text : str
    size : float
        of the font, in points
    inches : float
        length of a line
    most_lines : int

    Returns
    -------
    str
        lines separated by line breaks

    Examples
    --------
    >>> wrap("Spikes of up to four fifths of the bounding box", 9, 2.0)
    'Spikes of up to four fifths of\\nthe bounding box'
    """
    lines = _filled(text, size, inches, most_lines)
    for share in (0.5, 0.6, 0.7, 0.8, 0.9):  # lines of about the same length, so that no word is left alone
        narrower = _filled(text, size, share * inches, most_lines)
        if len(narrower) == len(lines) and all(width(line, size) <= inches for line in narrower):
            lines = narrower
            break
    return "\n".join(shorten(line, size, inches) for line in lines)


def _filled(text: str, size: float, inches: float, most_lines: int) -> list[str]:
    """The lines of a text, each filled with words before the next begins."""
    lines: list[str] = []
    words = text.split()
    while words and len(lines) < most_lines - 1:
        line = words.pop(0)
        while words and width(f"{line} {words[0]}", size) <= inches:
            line += f" {words.pop(0)}"
        lines.append(line)
    return [*lines, " ".join(words)] if words else lines


def _shortened(text: str, kept: int) -> str:
    end = kept // 2
    return text[: kept - end] + ELLIPSIS + (text[-end:] if end else "")


def _latin(letter: str) -> str:
    """A character in Latin letters; nothing for a mark that belongs to the character before it."""
    return anyascii(letter) or ("" if unicodedata.category(letter) in ("Mn", "Mc", "Me", "Cf") else "?")


def _without_control(letter: str) -> str:
    """The character, or a space for one that moves the cursor."""
    if letter == "\n" or unicodedata.category(letter) not in ("Cc", "Zl", "Zp"):
        return letter
    return " "


def _missing(text: str) -> frozenset[str]:
    """The characters of a text that no installed font has."""
    characters = frozenset(text) - _characters_of(_path_of(FONT)) - {"\n"}
    while characters and (found := _best_font(characters)) is not None:
        characters -= found[1]
    return characters


@lru_cache(maxsize=4096)
def _advance(letter: str) -> float:
    """The width of a character at a size of 1 point, without kerning."""
    font = FontProperties(family=families([letter]), size=100)
    return float(TextToPath().get_text_width_height_descent(letter, font, False)[0]) / 100


@lru_cache(maxsize=1024)
def _best_font(characters: frozenset[str]) -> tuple[str, frozenset[str]] | None:
    """The installed font that has most of some characters, and those that it has; None if there is none."""
    found = [
        (len(covered), font.name, covered)
        for font in font_manager.fontManager.ttflist
        if font.style == "normal" and font.weight in (400, "normal", "regular")
        if not font.fname.startswith(matplotlib.get_data_path())  # has no other letters, only symbols for formulas
        for covered in [characters & _characters_of(font.fname)]
        if covered
    ]
    if not found:
        return None
    _, name, covered = max(found, key=lambda each: (each[0], each[1]))
    return name, covered


def _path_of(name: str) -> str:
    return str(font_manager.findfont(FontProperties(family=[name])))


@lru_cache(maxsize=4096)
def _characters_of(path: str) -> frozenset[str]:
    """The characters that a font file has; none if it cannot be read."""
    try:
        return frozenset(map(chr, font_manager.get_font(path).get_charmap()))
    except (OSError, RuntimeError):
        return frozenset()
