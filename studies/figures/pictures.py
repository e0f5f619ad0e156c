"""Pictures of surfaces that a study draws: what they are made of, and whether a file already shows them.

A `Picture` divides the work: its tasks run in worker processes, because rendering off screen can take a process down;
`Picture.figure` lays the results out in the process of the study. Drawing one takes three calls::

    results = map_ordered(engine, picture.function, picture.tasks())
    figure = picture.figure(results)
    save(figure, folder / f"{picture.stem}.png", content=picture.content)
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure

DRAWING_VERSION = 2  # raise it when a change alters pictures: they are then drawn again


class Picture(ABC):
    """A figure of rendered surfaces, drawn again only if its content changes.

    Attributes
    ----------
    stem : str
        name of the file, without suffix
    """

    stem: str

    @property
    @abstractmethod
    def content(self) -> str:
        """Fingerprint of what the figure shows, stored in its file."""

    @abstractmethod
    def tasks(self) -> list[Any]:
        """Arguments of `function`, one for each task; they can be pickled."""

    @staticmethod
    @abstractmethod
    def function(task: Any) -> Any:
        """What a worker computes and renders for a task."""

    @abstractmethod
    def figure(self, results: Sequence[Any]) -> Figure:
        """The figure made of the results of all tasks, in their order."""


@dataclass(frozen=True, eq=False)
class ColourBar:
    """The colour bar of a function on a surface.

    Parameters
    ----------
    low, high : float
        values at its ends
    unit : str
        what the values are, shown in the middle
    """

    low: float
    high: float
    unit: str


@dataclass(frozen=True, eq=False)
class Tile:
    """A rendered surface and its caption.

    Parameters
    ----------
    picture : (height, width, 3) uint8 array
    caption : str
        text above it, of one or more lines
    bar : ColourBar, optional
        shown below it
    ruler : float
        length in pixels of the scale bar that is shown below it; 0 for none
    """

    picture: np.ndarray
    caption: str
    bar: ColourBar | None = None
    ruler: float = 0.0


@dataclass(frozen=True, eq=False)
class Row:
    """Tiles side by side.

    Parameters
    ----------
    tiles : sequence of Tile
        pictures of the same size
    label : str
        above them, at the left: what they have in common, such as the model
    """

    tiles: Sequence[Tile]
    label: str = ""


def label_of(model: Any) -> str:
    """What a model is called in a picture: its name, and its category too if the name is only a number.

    Parameters
    ----------
    model : Model

    Examples
    --------
    >>> from types import SimpleNamespace as Model
    >>> label_of(Model(name="81", category="Ant")), label_of(Model(name="cat0", category="cat"))
    ('Ant 81', 'cat0')
    """
    category = getattr(model, "category", "")
    return f"{category} {model.name}" if category and model.name.isdecimal() else model.name


def stamp(content: str) -> str:
    """What the file of a picture says that it shows: the content, and which version of the drawing code drew it.

    Examples
    --------
    >>> stamp("variant 1a2b")
    'drawing 2: variant 1a2b'
    """
    return f"drawing {DRAWING_VERSION}: {content}"


def is_drawn(path: Path, content: str) -> bool:
    """Whether a PNG file shows a certain content.

    Parameters
    ----------
    path : Path
        file written by `studies.figures.drawing.save`
    content : str
        fingerprint of what it has to show

    Returns
    -------
    bool
        False as well if there is no such file, or if it is damaged

    Examples
    --------
    >>> is_drawn(Path("no-such-file.png"), "variant 1a2b")
    False
    """
    from PIL import Image

    try:
        with Image.open(path) as image:
            image.load()
            return image.info.get("Shows") == stamp(content)
    except (OSError, SyntaxError):  # Pillow raises SyntaxError for a broken PNG
        return False
