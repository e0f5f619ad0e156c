"""The page of one mesh: its segments over time, beside those of a variant, or by the robust variant of the method."""

from __future__ import annotations

from collections.abc import Sequence

from studies.figures.charts import Axis, Chart, Panel, Series
from studies.figures.scenes import Scene
from studies.figures.time_scenes import (
    BEFORE,
    FROM_REGION,
    MOST_DIVERGENCES,
    VERY_MANY_VERTICES,
    Side,
    scenes_by_time,
)
from studies.reporting.html.packing import pack
from studies.reporting.html.page import Block, Cell, ChartBlock, Facts, Heading, Page, TableBlock, Text, ViewerBlock
from studies.reporting.html.svg import drawings

SLIDER = "time"


def mesh_page(
    title: str,
    times: Sequence[float],
    sides: Sequence[Side],
    facts: Sequence[tuple[str, str]] = (),
    command: str = "",
    first: int = BEFORE,
) -> Page:
    """The page of one mesh.

    Parameters
    ----------
    title : str
    times : sequence of float
        ascending
    sides : sequence of Side
        from `studies.figures.time_scenes.sides_of`
    facts : sequence of pairs of str
        names and values, about what is shown
    command : str
        that makes the page again
    first : int
        number of the time that is shown first
    """
    scenes = scenes_by_time(times, sides, first)
    return Page(
        title,
        [
            ViewerBlock(),
            Text("", _explanations(times, sides)),
            *(_over_time(times, scenes, sides) if len(times) > 1 else []),
            Facts("How this page was made", facts, [command] if command else []),
        ],
        scenes=pack(scenes, slider=SLIDER),
    )


def _explanations(times: Sequence[float], sides: Sequence[Side]) -> list[str]:
    """How to read the viewer."""
    where = [*(["over time"] if len(times) > 1 else []), *(["on both sides"] if len(sides) > 1 else [])]
    colour = f"A part keeps its colour {' and '.join(where)}; the" if where else "Each part has a colour; the"
    lines = [
        f"{colour} dissipator region is grey. The time is how long heat flows, in the unit of the paper, in which its "
        "experiments use 1.",
    ]
    if len(times) == 1:
        lines.append(
            f"Of meshes with more than {VERY_MANY_VERTICES:,} vertices one time is shown, which --time chooses, and no "
            "margin."
        )
    if any(side.compared for side in sides):
        lines.append(
            "CP, the Change Percentage, is twice the share of points that must change their segment to turn one "
            "segmentation into the other; “what changed” shows where they are."
        )
    lines.append(
        "“colours” shows a function instead of the segments. The ends of its scale are the 5th and the 95th percentile "
        "of the first surface (of the margin 0 and the 95th); values beyond have the colour of the end. A vertex is in "
        "the dissipator region where the dissipator test is above 0 (red): its heat is then nearer to the uniform "
        "density than to the mean one of its region."
    )
    if not any(FROM_REGION in side.at_times[0].fields for side in sides):
        lines.append(
            f"The two divergences that the test compares are shown of meshes with up to {MOST_DIVERGENCES:,} vertices."
        )
    return lines


def _over_time(times: Sequence[float], scenes: Sequence[Scene], sides: Sequence[Side]) -> list[Block]:
    """The number of segments at each time, as a chart and as a table."""
    return [ChartBlock("Segments by time", drawings(_chart(times, sides))), _table(scenes, sides)]


def _name(side: Side) -> str:
    return f"{side.title}, {side.row}" if side.row else side.title


def _chart(times: Sequence[float], sides: Sequence[Side]) -> Chart:
    """The number of segments over time."""
    series = tuple(
        Series(_name(side), tuple(times), tuple(each.n_segments for each in side.at_times), group=i)
        for i, side in enumerate(sides)
    )
    return Chart("", (Panel(Axis("time", logarithmic=True), Axis("segments", from_zero=True), series=series),))


def _table(scenes: Sequence[Scene], sides: Sequence[Side]) -> TableBlock:
    """What each viewport says, by time; a click shows it."""
    headings = [
        Heading("time", "Show this time in the viewer.", number=True),
        *(Heading(_name(side)) for side in sides),
    ]
    ascending = sorted(range(len(scenes)), key=lambda i: float(scenes[i].at[SLIDER]))
    rows = [
        [
            Cell(f"{scenes[i].at[SLIDER]:g}", float(scenes[i].at[SLIDER]), scene=i),
            *(Cell(each.note, float(each.note.split()[0])) for each in scenes[i].viewports),
        ]
        for i in ascending
    ]
    return TableBlock("At each time", headings, rows)
