"""Pages of HTML that need nothing but themselves: data first, a template second.

A `Page` is a title and blocks, one below the other. The viewer of a page shows scenes, each a few surfaces side by
side; see `studies.figures.scenes`.

Examples
--------
>>> import trimesh
>>> from studies.reporting.html import Page, Scene, Surface, ViewerBlock, Viewport, pack
>>> ball = trimesh.creation.icosphere(2)
>>> upper = (ball.vertices[:, 2] > 0).astype(int)
>>> viewport = Viewport(Surface(ball.vertices, ball.faces), "halves", labels=upper)
>>> page = Page("A ball", [ViewerBlock("Surfaces")], scenes=pack([Scene({"model": "ball", "level": 0}, [viewport])]))
>>> page.html().count("<canvas")
1
"""

from studies.figures.scenes import Field, Heat, Reduced, Scene, Surface, Viewport, reduce_mesh
from studies.reporting.html.packing import PackedScenes, pack, unpack
from studies.reporting.html.page import (
    INDEX_FILE,
    REPORT_FILE,
    Block,
    Card,
    CardsBlock,
    Cell,
    ChartBlock,
    Facts,
    Heading,
    Page,
    PictureBlock,
    TableBlock,
    Text,
    ViewerBlock,
    stored_scenes,
)
from studies.reporting.html.svg import Drawing, Mark, drawings

__all__ = [
    "INDEX_FILE",
    "REPORT_FILE",
    "Block",
    "Card",
    "CardsBlock",
    "Cell",
    "ChartBlock",
    "Drawing",
    "Facts",
    "Field",
    "Heading",
    "Heat",
    "Mark",
    "PackedScenes",
    "Page",
    "PictureBlock",
    "Reduced",
    "Scene",
    "Surface",
    "TableBlock",
    "Text",
    "ViewerBlock",
    "Viewport",
    "drawings",
    "pack",
    "reduce_mesh",
    "stored_scenes",
    "unpack",
]
