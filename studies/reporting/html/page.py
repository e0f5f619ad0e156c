"""A page: what it consists of, as plain data, and the template that makes one self-contained HTML file of it."""

from __future__ import annotations

import base64
import io
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cache
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar

from studies.columns import Table, is_missing
from studies.reporting.html.packing import PackedScenes, palette, read_packed
from studies.reporting.html.svg import Drawing, Entry
from studies.storage import atomic_write, encodable

if TYPE_CHECKING:
    import jinja2

REPORT_FILE = "report.html"
INDEX_FILE = "index.html"

PICTURE_WIDTH = 1600  # pixels; wider pictures are made smaller
PICTURE_QUALITY = 80
PICTURE_EFFORT = 2  # of 6: larger by a little, in a quarter of the time
SCENES_START = '<script type="application/json" id="scenes">'
SCENES_END = "</script>"


@dataclass(frozen=True)
class Cell:
    """A cell of a table: what is shown, what it is sorted by, and where it leads."""

    text: str
    order: float | str
    link: str = ""
    scene: int = -1


@dataclass(frozen=True)
class Heading:
    """The heading of a column, with its explanation."""

    text: str
    help: str = ""
    number: bool = False


@dataclass(frozen=True)
class Block:
    """A part of a page, with a heading of its own unless it is empty."""

    heading: str = ""
    kind: ClassVar[str] = ""


@dataclass(frozen=True)
class Facts(Block):
    """Names and values; and commands, each of which can be copied."""

    facts: Sequence[tuple[str, str]] = ()
    commands: Sequence[str] = ()
    kind: ClassVar[str] = "facts"


@dataclass(frozen=True)
class Text(Block):
    """Paragraphs."""

    paragraphs: Sequence[str] = ()
    kind: ClassVar[str] = "text"


@dataclass(frozen=True)
class TableBlock(Block):
    """A table that can be sorted and filtered.

    Parameters
    ----------
    headings : sequence of Heading
    rows : sequence of sequences of Cell
    notes : str
        below the table
    explained : bool
        whether the explanations of the columns are listed below it
    """

    headings: Sequence[Heading] = ()
    rows: Sequence[Sequence[Cell]] = ()
    notes: str = ""
    explained: bool = False
    kind: ClassVar[str] = "table"

    @classmethod
    def of(cls, table: Table, heading: str = "") -> TableBlock:
        """A table of a study, with the text of its cells as everywhere else.

        Examples
        --------
        >>> import pandas as pd
        >>> from studies.columns import Column
        >>> block = TableBlock.of(Table("table", pd.DataFrame({"level": [10.0]}), [Column(name="level", format="g")]))
        >>> block.headings[0].text, block.rows[0][0]
        ('level', Cell(text='10', order=10.0, link='', scene=-1))
        """
        columns = table.visible()
        headings = [Heading(column.title, column.help, column.dtype != "string") for column in columns]
        rows = [
            [Cell(text, _order(record, column.name, text)) for column, text in zip(columns, cells, strict=True)]
            for record, cells in zip(table.records(), table.cells(), strict=True)
        ]
        return cls(heading, headings, rows, table.notes, True)


def _order(record: dict[str, Any], name: str, text: str) -> float | str:
    """What a cell is sorted by: its value, or the first number of its text."""
    value = record.get(name, text)
    if is_missing(value):
        return ""
    if isinstance(value, bool | str):
        try:
            return float(str(value).split()[0])
        except (ValueError, IndexError):
            return str(value)
    return float(value)


@dataclass(frozen=True)
class ChartBlock(Block):
    """Panels, and how to read them."""

    drawings: Sequence[Drawing] = ()
    notes: str = ""
    kind: ClassVar[str] = "chart"

    @property
    def common_legend(self) -> tuple[Entry, ...]:
        """The legend of all panels, if they have the same."""
        legends = {drawing.legend for drawing in self.drawings}
        return legends.pop() if len(legends) == 1 and len(self.drawings) > 1 else ()


@dataclass(frozen=True)
class PictureBlock(Block):
    """A picture in the page itself."""

    source: str = ""
    description: str = ""
    kind: ClassVar[str] = "picture"

    @classmethod
    def of(cls, path: Path, heading: str = "", width: int = PICTURE_WIDTH) -> PictureBlock:
        """A picture from a file, made smaller."""
        return cls(heading, picture_source(path, width), heading or path.stem.replace("_", " "))


@dataclass(frozen=True)
class ViewerBlock(Block):
    """The viewer of the page's scenes, or why there is none.

    Parameters
    ----------
    reason : str
        why there are no scenes
    fallback : PictureBlock, optional
        shown where a browser cannot draw scenes
    """

    reason: str = ""
    fallback: PictureBlock | None = None
    kind: ClassVar[str] = "viewer"


@dataclass(frozen=True)
class Card:
    """What leads to another page."""

    title: str
    link: str
    text: str = ""
    source: str = ""


@dataclass(frozen=True)
class CardsBlock(Block):
    """Cards that lead to other pages."""

    cards: Sequence[Card] = ()
    kind: ClassVar[str] = "cards"


@dataclass(frozen=True)
class Page:
    """A page that needs nothing but itself.

    Parameters
    ----------
    title : str
    blocks : sequence of Block
        one below the other
    lead : str
        below the title
    scenes : PackedScenes, optional
        of the viewer
    up : str
        address of the page that this one is a part of
    """

    title: str
    blocks: Sequence[Block] = ()
    lead: str = ""
    scenes: PackedScenes | None = None
    up: str = ""
    groups: Sequence[str] = field(default_factory=tuple)

    def html(self) -> str:
        """The page.

        Examples
        --------
        >>> "<h1>a &lt; b</h1>" in Page("a < b").html()
        True
        """
        return _environment().get_template("page.html.j2").render(
            page=self,
            scenes=dict(self.scenes.values) if self.scenes else None,
            palette=palette(),
            style=_static("page.css"),
            scripts=[_static(name) for name in ("page.js", *(["viewer.js"] if self.scenes else []))],
        )  # fmt: skip

    def write(self, path: Path) -> None:
        """Write the page to a file, which has the earlier page until this one is complete."""
        with atomic_write(path) as part:
            part.write_text(encodable(self.html()), "utf-8")


def stored_scenes(path: Path) -> PackedScenes | None:
    """The scenes of a page that was written earlier; None if it has none, or is not there."""
    try:
        text = path.read_text("utf-8")
    except (OSError, ValueError):
        return None
    _, found, rest = text.partition(SCENES_START)
    return read_packed(rest.partition(SCENES_END)[0]) if found else None


def picture_source(path: Path, width: int = PICTURE_WIDTH) -> str:
    """A picture as the address of its own data; "" if it cannot be read."""
    from PIL import Image

    try:
        with Image.open(path) as image:
            factor = max(image.width // width, 1)
            picture = (image.reduce(factor) if factor > 1 else image).convert("RGB")
    except (OSError, SyntaxError):  # Pillow raises SyntaxError for a broken PNG
        return ""
    if picture.width > width:
        picture = picture.resize((width, round(picture.height * width / picture.width)))
    stream = io.BytesIO()
    picture.save(stream, "WEBP", quality=PICTURE_QUALITY, method=PICTURE_EFFORT)
    return f"data:image/webp;base64,{base64.b64encode(stream.getvalue()).decode('ascii')}"


@cache
def _environment() -> jinja2.Environment:
    import jinja2

    return jinja2.Environment(
        loader=jinja2.PackageLoader("studies.reporting.html"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )


@cache
def _static(name: str) -> str:
    return resources.files("studies.reporting.html").joinpath("static", name).read_text("utf-8")
