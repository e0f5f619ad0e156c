"""A published statement next to the value that was computed for it."""

from __future__ import annotations

import math
from dataclasses import dataclass

from studies.columns import MISSING


@dataclass(frozen=True)
class Claim:
    """A published value next to the computed one.

    Parameters
    ----------
    text : str
    published : float
        NaN if the publication makes the claim in words or pictures only
    computed, low, high : float
        the computed value and its 95 % interval, NaN if there is none
    unit : str
        put behind the values
    digits : int
        decimals that are shown and compared
    higher_is_better : bool

    Examples
    --------
    >>> Claim("Holes", 2.39, 1.45, 1.04, 1.94).verdict
    'better'
    """

    text: str
    published: float
    computed: float
    low: float
    high: float
    unit: str = ""
    digits: int = 2
    higher_is_better: bool = False

    @property
    def verdict(self) -> str:
        """Same if the published value is in the computed interval, to the digits that are shown; better or worse."""
        if math.isnan(self.published):
            return MISSING
        low, high, published = (round(value, self.digits) for value in (self.low, self.high, self.published))
        if math.isnan(self.low):
            return "same" if round(self.computed, self.digits) == published else "differs"
        if low <= published <= high:
            return "same"
        return "better" if (high < published) != self.higher_is_better else "worse"

    def cells(self) -> list[str]:
        """Text, published value, computed value, interval and verdict, as shown."""
        published = MISSING if math.isnan(self.published) else self._shown(self.published) + self.unit
        interval = MISSING if math.isnan(self.low) else f"{self._shown(self.low)} – {self._shown(self.high)}"
        verdict = f"**{self.verdict}**" if self.verdict == "worse" else self.verdict
        return [self.text, published, self._shown(self.computed) + self.unit, interval, verdict]

    def _shown(self, value: float) -> str:
        return MISSING if math.isnan(value) else f"{value:.{self.digits}f}"
