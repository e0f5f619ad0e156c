"""What the methods of a leaderboard are: found by the names of their classes, which rows contain."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from studies.planning.targets import locate
from studies.reporting.text import options_of_variants
from studies.segmenters.about import About

if TYPE_CHECKING:
    import pandas as pd

TOLD = "told_n_segments"  # in the options of a row, of a method that is told how many segments to find
TOLD_MARK = "(k)"


@dataclass(frozen=True)
class Card:
    """What a method is.

    Parameters
    ----------
    name : str
        as in the column ``segmenter`` of the rows
    about : About
        what the method declares; of one that declares nothing, or that is not installed, its name alone
    told : bool
        whether it was told how many segments to find
    target, version : str
        dotted name of its class or function, and its version; "" where rows do not have them
    options : dict
        its options
    """

    name: str
    about: About
    told: bool = False
    target: str = ""
    version: str = ""
    options: dict[str, Any] = field(default_factory=dict)

    @property
    def baseline(self) -> bool:
        """Whether it is a trivial method, which has no rank."""
        return self.about.baseline

    @property
    def title(self) -> str:
        """Its name in words, with the options that its name in the rows has."""
        _, bracket, options = self.name.partition(" (")
        return f"{self.about.title}{bracket}{options}"

    @property
    def label(self) -> str:
        """The title, marked if the method was told how many segments to find."""
        return f"{self.title} {TOLD_MARK}" if self.told else self.title


def cards_of(rows: pd.DataFrame) -> dict[str, Card]:
    """The cards of the methods in rows, by the names that rows have.

    Parameters
    ----------
    rows : DataFrame
        with the column segmenter; optionally segmenter_options, target and version

    Examples
    --------
    >>> import pandas as pd
    >>> rows = pd.DataFrame({"segmenter": ["Voronoi"], "target": ["studies.segmenters.voronoi.Voronoi"],
    ...                      "segmenter_options": ['{"told_n_segments": 4}']})
    >>> card = cards_of(rows)["Voronoi"]
    >>> card.label, card.baseline, card.told
    ('Voronoi cells (k)', True, True)
    """
    found = {}
    for name, group in rows.groupby(rows["segmenter"].astype(object), sort=False):
        options = json.loads(_last(group, "segmenter_options") or "{}")
        target = _last(group, "target")
        told = TOLD in options
        plain = {key: value for key, value in options.items() if key != TOLD}
        found[str(name)] = Card(str(name), _about(target, str(name)), told, target, _last(group, "version"), plain)
    return found


def names_in_charts(cards: Mapping[str, Card], mark: bool = True) -> dict[str, str]:
    """What methods are called where there is little room: variants of what most of them are by their options alone.

    Parameters
    ----------
    cards : mapping of str to Card
    mark : bool
        whether methods that are told the number of segments are marked

    Examples
    --------
    >>> names = ("HeatWalk", "HeatWalkRobust", "HeatWalkRobust (without merge)")
    >>> cards = {name: Card(name, About(title=name.partition(" ")[0])) for name in names}
    >>> list(names_in_charts(cards).values())
    ['HeatWalk', 'HeatWalkRobust', 'without merge']
    """
    options = options_of_variants(card.name for card in cards.values())
    found = {}
    for name, card in cards.items():
        words = options.get(card.name, card.title)
        found[name] = f"{words} {TOLD_MARK}" if card.told and mark else words
    return found


def _last(rows: pd.DataFrame, column: str) -> str:
    """The last value of a column, "" if there is none."""
    values = list(rows[column].dropna()) if column in rows else []
    return str(values[-1]) if values else ""


def _about(target: str, name: str) -> About:
    """What the class of a method declares; its name alone where it declares nothing or is not installed."""
    plain = About(title=name.partition(" (")[0].replace("_", " "))
    if not target:
        return plain
    try:
        about = getattr(locate("segmenter", target, ValueError), "about", None)
    except Exception:  # whatever importing someone's module leads to
        return plain
    return about if isinstance(about, About) else plain
