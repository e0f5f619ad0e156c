"""What a kind of study is: how it is planned, and what is shown of its rows."""

import math
from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar


@dataclass(frozen=True)
class Claim:
    """A figure of the paper beside ours.

    what : str
    paper : float, NaN where the paper gives pictures alone
    ours, low, high : float, our figure and its 95 % interval, NaN where there is none
    unit : str, put behind the figures
    digits : int
    higher_is_better : bool
    """

    what: str
    paper: float
    ours: float
    low: float
    high: float
    unit: str = ""
    digits: int = 2
    higher_is_better: bool = False

    @property
    def verdict(self):
        """Same where the paper's figure lies in our interval, to the digits that are shown."""
        if math.isnan(self.paper):
            return "–"
        low, high, paper = (round(value, self.digits) for value in (self.low, self.high, self.paper))
        if math.isnan(self.low) or low <= paper <= high:
            return "same" if not math.isnan(self.low) or round(self.ours, self.digits) == paper else "differs"
        return "better" if (high < paper) != self.higher_is_better else "worse"


class Experiment(ABC):
    """One kind of study. It holds no state: a configuration and rows go in, trials, tables and figures come out.

    columns : those that its rows have behind ``studies.planning.trial.COLUMNS``, with their types
    headings : key in ``display`` -> heading of that column in table.md
    notes : str, what the columns mean
    """

    columns: ClassVar[dict[str, str]] = {}
    headings: ClassVar[dict[str, str]]
    notes: ClassVar[str]

    @abstractmethod
    def plan(self, cfg, dataset, segmenter):
        """The trials, model by model: list of studies.planning.trial.Trial.

        cfg : DictConfig
        dataset : studies.datasets.Dataset
        segmenter : studies.segmenters.Segmenter
        """

    @abstractmethod
    def tables(self, rows, cfg):
        """What the rows come to: dict of file stem -> DataFrame; the first is ``table``, the study's own."""

    @abstractmethod
    def display(self, table):
        """``table`` as text: a list of dicts with the keys of ``headings``."""

    @abstractmethod
    def narrow(self, table):
        """The keys in ``display`` that fit on a terminal."""

    @abstractmethod
    def claims(self, tables, cfg):
        """The paper's figures beside ours: list of Claim."""

    def curves(self, rows, tables, cfg, title):
        """Figures made of the rows alone: dict of file stem -> matplotlib Figure."""
        return {}

    def surfaces(self, trials, rows, cfg, title, engine):
        """Pictures of surfaces, which are computed anew by the engine: yields (file stem, what it shows, make).

        ``make()`` gives the matplotlib Figure, or raises studies.execution.engine.TaskFailedError; it is called only
        where the file does not show that already.
        """
        return ()
