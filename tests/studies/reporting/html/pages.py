"""A page with everything that a page can have, of small surfaces, and with names that try to break out of it."""

import numpy as np
import trimesh

from studies.figures.charts import Axis, Chart, Panel, Series
from studies.reporting.html import (
    Cell,
    ChartBlock,
    Facts,
    Field,
    Heading,
    Mark,
    Page,
    Scene,
    Surface,
    TableBlock,
    ViewerBlock,
    Viewport,
    drawings,
    pack,
)

HOSTILE = '</script><img src=x onerror="window.broken=1">'
LEVELS = (0.0, 0.1, 0.3)
METHODS = ("walk", "cuts")
ROWS = [("walk", 3.5), ("cuts", 12.0), (HOSTILE, None), ("walk two", -1.0), ("zebra", 100.0), ("ant", 20.0)]


def scene(model, level, number, stretch):
    """A ball that is the same on both sides at level 0, and pulled apart at others."""
    ball = trimesh.creation.icosphere(2)
    vertices = np.asarray(ball.vertices) * [1.0, stretch, 0.7]
    original = Surface(vertices, np.asarray(ball.faces))
    moved = vertices.copy()
    moved[:, 0] *= 1 + level
    variant = Surface(moved, np.asarray(ball.faces))
    labels = (vertices[:, 0] > 0.3).astype(int)
    after = (vertices[:, 0] > 0.3 - level).astype(int)
    margin = {"margin": Field(np.linspace(0, 1, len(vertices)), 0, 1, "margin")}
    viewports = [
        viewport
        for row in METHODS
        for viewport in (
            Viewport(original, "original", row, "", labels, labels != after, margin),
            Viewport(variant, "variant", row, f"CP {100 * level:g} %", after, labels != after, margin),
        )
    ]
    return Scene(
        {"model": model, "repeat": 1, "level": level},
        viewports,
        f"{model}, {level:g}",
        100 * level,
        np.eye(3),
        f"id{number}",
    )


def whole_page():
    scenes = [
        scene(model, level, 3 * i + j, stretch)
        for i, (model, stretch) in enumerate((("ball", 1.0), (HOSTILE, 0.5)))
        for j, level in enumerate(LEVELS)
    ]
    curve = Series("mean", LEVELS, (0.0, 10.0, 30.0), (0.0, 9.0, 25.0), (0.0, 11.0, 35.0))
    chart = Chart("Curve", (Panel(Axis("level"), Axis("CP", from_zero=True), HOSTILE, (curve,)),))
    table = TableBlock(
        "Results",
        [Heading("name", HOSTILE), Heading("value", "A number.", True)],
        [
            [Cell(name, name), Cell("–" if value is None else f"{value:g}", "" if value is None else value)]
            for name, value in ROWS
        ],
        explained=True,
    )
    marks = {0: [Mark(0.3, 30.0, f"{HOSTILE}: 30", scene=5), Mark(0.1, 10.0, "plain")]}
    blocks = [
        Facts("", [("study", HOSTILE)], [f"python -m studies.run '{HOSTILE}'"]),
        table,
        ChartBlock("By level", drawings(chart, marks)),
        ViewerBlock("Surfaces"),
    ]
    return Page(HOSTILE, blocks, scenes=pack(scenes))
