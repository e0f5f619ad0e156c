"""The page of interactive plates: one for each figure of the publication, in a single viewer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

from studies.figures.method_scenes import POSITION, named
from studies.figures.scenes import Scene
from studies.reporting.html.packing import pack
from studies.reporting.html.page import Facts, Page, Text, ViewerBlock

PICKED = "plate"


@dataclass(frozen=True, eq=False)
class Plate:
    """What corresponds to one figure.

    Parameters
    ----------
    figure : int
        its number
    title : str
    look : str
        what to look at
    shown : str
        which meshes are shown
    scenes : sequence of Scene
        that which is shown first before the others, each at a `POSITION` of the slider
    """

    figure: int
    title: str
    look: str
    shown: str
    scenes: Sequence[Scene]

    @property
    def name(self) -> str:
        """By which it is picked."""
        return f"{self.figure}. {self.title}"


@dataclass(frozen=True)
class PlatesBlock(ViewerBlock):
    """The viewer with a card for each plate.

    Parameters
    ----------
    plates : sequence of Plate
    """

    plates: Sequence[Plate] = ()
    kind: ClassVar[str] = "plates"
    assets: ClassVar[str] = "plates"

    def first_scenes(self) -> list[int]:
        """The number of the first scene of each plate."""
        numbers, following = [], 0
        for plate in self.plates:
            numbers.append(following)
            following += len(plate.scenes)
        return numbers


def plates_page(
    plates: Sequence[Plate], title: str, lead: str, facts: Sequence[tuple[str, str]] = (), command: str = ""
) -> Page:
    """The page of some plates.

    Parameters
    ----------
    plates : sequence of Plate
        at least one
    title, lead : str
    facts : sequence of pairs of str
        names and values, about what is shown
    command : str
        that makes the page again
    """
    scenes = [scene for plate in plates for scene in named(plate.scenes, PICKED, plate.name)]
    return Page(
        title,
        [
            PlatesBlock(plates=plates),
            Text("How to read them", _EXPLANATIONS),
            Facts("How this page was made", facts, [command] if command else []),
        ],
        lead,
        scenes=pack(scenes, slider=POSITION),
    )


_EXPLANATIONS = (
    "Surfaces are segmented by the method as published, at time 1 unless a slider chooses another. A part keeps its "
    "colour along the slider and from side to side; the dissipator region is grey.",
    "CP, the Change Percentage, is twice the share of points that must change their segment to turn one segmentation "
    "into the other; “what changed” shows where they are.",
    "Heat is computed in the browser, from the eigenpairs of the mesh, for the vertex that is clicked (with the "
    "keyboard: Enter takes the vertex in the middle of the first surface that shows heat). Its colours go from 0 to "
    "the largest value shown on any side. Those of other functions go from the 1st to the 99th percentile.",
    "Meshes are reduced for display by choosing some of their vertices, so that what is shown at a vertex is exactly "
    "what was computed there on the whole mesh.",
)
