"""What `heatwalk.segment_robust` does beyond the Heat Walk as published."""

import math
from dataclasses import dataclass, field, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray

from heatwalk.robust.averaging import times_around
from heatwalk.robust.repair import Repair

# A range of times wider than this has nothing to do with the one given.
MAX_OCTAVES = 8


@dataclass(frozen=True)
class Options:
    """The parts of the robust variant: switches, and their parameters.

    Parameters
    ----------
    repair : Repair
        what is repaired before anything is measured; labels remain those of the vertices as they are
    average : bool
        walk with the mean of the heat kernels at times around the given one instead of with the kernel at that time
    octaves : float, >= 0
        from the first to the last of these times, of which there are two per octave, and one more
    choose_time : bool
        look for the time at which the number of regions is most stable
    octaves_before, octaves_after : float, >= 0
        how far before and after the given time to look
    merge : bool
        join two regions if the capacity between them is nearly that within the one of lower peak
    persistence : float in (0, 1]
        this share of it
    join_small : bool
        join small regions to a neighbour
    min_area : float in [0, 1)
        those of less than this share of the area
    refine : bool
        move the borders of limbs to the cheapest cuts, short ones along concave creases
    hierarchy : bool
        cut limbs into parts at their waists
    max_curvature : float, above 0
        concave curvature at which a cut costs half as much as on a flat surface, on a mesh of area 1
    prominence : float, above 1
        how many times as expensive as at a waist a cut has to be on both sides of it
    min_part : float in [0, 1)
        least area of a part that a waist cuts off, as a share of the area

    Raises
    ------
    ValueError
        if a parameter is out of its range

    Examples
    --------
    >>> Options(persistence=1.5)
    Traceback (most recent call last):
    ValueError: persistence is 1.5: it must be above 0 and at most 1
    """

    repair: Repair = field(default_factory=Repair)
    average: bool = True
    octaves: float = 2.0
    choose_time: bool = True
    octaves_before: float = 1.5
    octaves_after: float = 3.0
    merge: bool = True
    persistence: float = 0.9
    join_small: bool = True
    min_area: float = 0.01
    refine: bool = False
    hierarchy: bool = False
    max_curvature: float = 2.0
    prominence: float = 1.3
    min_part: float = 0.01

    def __post_init__(self) -> None:
        for option in fields(self):
            value = getattr(self, option.name)
            if isinstance(option.default, bool) and not isinstance(value, bool):
                raise ValueError(f"{option.name} is {value!r}: it must be true or false")
        for name in ("octaves", "octaves_before", "octaves_after"):
            if not 0 <= getattr(self, name) <= MAX_OCTAVES:
                raise ValueError(f"{name} is {getattr(self, name)!r}: it must be from 0 to {MAX_OCTAVES}")
        if not 0 < self.persistence <= 1:
            raise ValueError(f"persistence is {self.persistence!r}: it must be above 0 and at most 1")
        for name in ("min_area", "min_part"):
            if not 0 <= getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)!r}: it must be at least 0 and below 1")
        for name, least in (("max_curvature", 0), ("prominence", 1)):
            if not least < getattr(self, name) < math.inf:
                raise ValueError(f"{name} is {getattr(self, name)!r}: it must be above {least} and finite")

    def averaged(self, time: float) -> NDArray[np.float64]:
        """The times over which the kernel at one time is averaged, ascending."""
        return times_around(time, self.octaves if self.average else 0.0)

    @property
    def joining(self) -> dict[str, float]:
        """The parameters of `heatwalk.robust.merging.merge_regions`."""
        return {
            "persistence": self.persistence if self.merge else math.inf,
            "min_area": self.min_area if self.join_small else 0.0,
        }

    @property
    def cutting(self) -> dict[str, Any]:
        """The parameters of `heatwalk.robust.parts.find_parts`."""
        return {
            "refine": self.refine,
            "hierarchy": self.hierarchy,
            "prominence": self.prominence,
            "min_area": self.min_part,
        }
