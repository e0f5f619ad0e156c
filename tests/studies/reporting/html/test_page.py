import json
import re
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest
from PIL import Image

from studies.columns import Column, Table
from studies.reporting.html import Page, PictureBlock, TableBlock, ViewerBlock, stored_scenes
from tests.studies.reporting.html.pages import HOSTILE, ROWS, whole_page


class Reader(HTMLParser):
    """The elements of a page, and its text."""

    def __init__(self, html):
        super().__init__()
        self.elements, self.texts, self.attributes = [], [], []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        self.elements.append(tag)
        self.attributes += attributes

    def handle_data(self, data):
        self.texts.append(data)


@pytest.fixture(scope="module")
def html():
    return whole_page().html()


def test_names_are_text_wherever_they_are(html):
    read = Reader(html)
    assert read.elements.count("img") == 1  # the one on which the viewer is printed
    assert read.elements.count("script") == 4
    assert not [name for name, _ in read.attributes if name.startswith("on")]
    assert HOSTILE in read.texts


def test_the_scenes_are_in_the_page_exactly(html):
    [text] = re.findall(r'<script type="application/json" id="scenes">(.*?)</script>', html)
    assert json.loads(text) == whole_page().scenes.values


def test_a_page_refers_to_nothing_else(html):
    addresses = [value for name, value in Reader(html).attributes if name in ("src", "href")]
    assert all(address.startswith("data:") for address in addresses)
    assert "@import" not in html
    assert "url(" not in html
    assert not re.findall(r"https?://(?!www\.w3\.org)", html)


def test_a_page_without_scenes_has_no_viewer_and_says_why():
    html = Page("t", [ViewerBlock("Surfaces", "The models are elsewhere.")]).html()
    assert "The models are elsewhere." in html
    assert "<canvas" not in html
    assert "webgl2" not in html


def test_the_scenes_of_a_written_page_are_read_again(tmp_path):
    whole_page().write(tmp_path / "report.html")
    assert stored_scenes(tmp_path / "report.html") == whole_page().scenes
    (tmp_path / "report.html").write_text((tmp_path / "report.html").read_text()[:-5000].replace('"version"', '"v"'))
    assert stored_scenes(tmp_path / "report.html") is None
    Page("t").write(tmp_path / "report.html")
    assert stored_scenes(tmp_path / "report.html") is None
    assert stored_scenes(tmp_path / "none.html") is None


def test_a_table_has_the_text_of_its_cells_and_is_sorted_by_their_values():
    frame = pd.DataFrame({"what": ["a_b", "c"], "mean": [1.25, np.nan], "low": [1.0, 2.0], "high": [2.0, 3.0]})
    columns = [
        Column(name="what", dtype="string", help="Help."),
        Column(name="mean", format=".1f"),
        Column(name="interval", template="{low:.0f} – {high:.0f}"),
    ]
    block = TableBlock.of(Table("table", frame, columns, "Notes."))
    assert [[cell.text for cell in row] for row in block.rows] == [["a b", "1.2", "1 – 2"], ["c", "–", "2 – 3"]]
    assert [[cell.order for cell in row] for row in block.rows] == [["a_b", 1.25, 1.0], ["c", "", 2.0]]
    assert [(heading.text, heading.help, heading.number) for heading in block.headings] == [
        ("what", "Help.", False), ("mean", "", True), ("interval", "", True),
    ]  # fmt: skip


def test_every_row_of_a_table_is_in_the_page(html):
    assert html.count("<tr>") == 1 + len(ROWS)


def test_a_picture_is_in_the_page_and_not_wider_than_asked_for(tmp_path):
    import base64
    import io

    Image.fromarray(np.full((300, 900, 3), 200, np.uint8)).save(tmp_path / "a.png")
    block = PictureBlock.of(tmp_path / "a.png", "A picture", 300)
    head, _, data = block.source.partition(",")
    with Image.open(io.BytesIO(base64.b64decode(data))) as image:
        assert (head, image.size) == ("data:image/webp;base64", (300, 100))
        assert np.abs(np.asarray(image.convert("RGB")).astype(int) - 200).max() < 8


def test_a_damaged_picture_is_said_to_be_one(tmp_path):
    (tmp_path / "a.png").write_bytes(b"no picture")
    assert "cannot be read" in Page("t", [PictureBlock.of(tmp_path / "a.png")]).html()
