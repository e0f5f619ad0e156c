"""What a kind of study is: how it is planned, and what is made of its rows."""

from __future__ import annotations

import json
import time
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

from studies import planning
from studies.columns import Column, Table, dtypes
from studies.execution.peak_memory import peak_memory
from studies.planning.errors import StudyError
from studies.planning.names import check_name
from studies.planning.plan import Block, ListedBlock
from studies.planning.trial import Trial
from studies.planning.types import has_type
from studies.segmenters.segmenter import TOLD_OPTION

if TYPE_CHECKING:
    import numpy as np
    import pandas as pd

    from studies.datasets import Dataset
    from studies.figures.charts import Chart
    from studies.figures.pictures import Picture
    from studies.figures.scenes import ScenesToMake
    from studies.metrics.metric import TriangleMesh
    from studies.segmenters import Segmenter
    from studies.segmenters.segmenter import Labelled

    Labels = Callable[[str], Mapping[str, np.ndarray] | None]

SEGMENTER = Column(name="segmenter", dtype="string", help="Segmentation method.")
"""Column of tables with the segmenter, which is shown if there are several."""

MODELS = Column(name="n", dtype="int64", heading="models", format=".0f", help="Models without a failed trial.")
"""Column of tables that count models."""

TRIALS = Column(name="n", dtype="int64", heading="n", format=".0f", help="Trials that succeeded.")
"""Column of tables that count trials."""

FAILURES = Column(
    name="failures", dtype="int64", heading="failed", format=".0f", lower_is_better=True, help="Trials that failed."
)
"""Column of tables that count failed trials."""

PEAK_MEMORY = Column(
    name="peak_memory",
    heading="peak memory (MB)",
    format=".1f",
    unit="MB",
    lower_is_better=True,
    help="Median over trials of the peak memory of segmenting, above what the process used before.",
)
"""Column of tables of what methods cost."""

TOLD = Column(name="told", dtype="string", help="Whether the method is told how many segments to find.")
"""Column of tables of methods that says which are told the number, which others have to find."""

PUBLISHED = Column(name="published", help="Published value; `studies.reporting` puts the column of a publication here.")
"""Where a table shows published values; without it, a table shows none."""


@dataclass(frozen=True, kw_only=True)
class Experiment(ABC):
    """One kind of study, with its options as fields.

    A subclass is a frozen dataclass. Its options come from the node ``experiment`` of the configuration, and it knows
    nothing else about the configuration, the command line or any publication.

    Attributes
    ----------
    columns : tuple of Column
        what its rows have in addition to `studies.planning.trial.COLUMNS`
    notes : str
        what its tables show, in a few sentences
    version : int, str or None
        of an experiment of your own, on which the ids of its trials depend: raise it when its trials compute other
        values, so that they run again. None: they depend on a digest of the code of the package, or of the module,
        that defines it, and run again after every change of the code.
    gathers : bool
        whether its tables are always about every row of the results folder: those of other methods, models or
        perturbations than were asked for stay, and count if they are of the same variants (the column ``draw``)
    selecting : tuple of str
        options of such a study that choose which trials there are, in addition to those of every study
    presenting : tuple of str
        options of such a study that only choose what is made of its rows
    picture : str
        file stem of the picture that stands for a study where there is room for one
    has_scenes : bool
        whether its page has a viewer of surfaces: see `scenes`
    """

    columns: ClassVar[tuple[Column, ...]] = ()
    notes: ClassVar[str] = ""
    version: ClassVar[int | str | None] = None
    gathers: ClassVar[bool] = False
    selecting: ClassVar[tuple[str, ...]] = ()
    presenting: ClassVar[tuple[str, ...]] = ()
    picture: ClassVar[str] = "gallery"
    has_scenes: ClassVar[bool] = False

    @abstractmethod
    def plan(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> list[Trial]:
        """The trials of a study, model by model.

        Trials with the same ``group_key`` must be consecutive. Seeds must not depend on the segmenter: methods are
        compared under the same draws.

        Parameters
        ----------
        study : str
            name of the study
        dataset : Dataset
        segmenters : sequence of Segmenter
            at least one

        Raises
        ------
        StudyError
            for options that define no trial
        """

    def blocks(self, study: str, dataset: Dataset, segmenters: Sequence[Segmenter]) -> Iterable[Block]:
        """The trials of `plan`, so that those of a large study need not all be in memory: their ids are enough."""
        trials = self.plan(study, dataset, segmenters)
        return [ListedBlock(trials)] if trials else []

    @abstractmethod
    def tables(self, rows: pd.DataFrame) -> list[Table]:
        """What the rows amount to. The first table has the name "table" and is the study's main one.

        Parameters
        ----------
        rows : DataFrame
            all rows of the study, failed ones too, in the order of the plan
        """

    def charts(self, study: str, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, Chart]:
        """Charts made of tables and rows alone, by file stem."""
        return {}

    def extent(self, rows: pd.DataFrame) -> str:
        """How large the study is, as its title says it; "" for a title that names the methods."""
        return ""

    def findings(self, rows: pd.DataFrame, argument: Mapping[str, Any] | None = None) -> str:
        """What the rows amount to, in a few sentences for the page of all results; "" if the table says it all.

        Parameters
        ----------
        rows : DataFrame
        argument : mapping, optional
            what a publication argues: see `studies.reporting.publication.Publication.argument`
        """
        return ""

    def files(self, tables: Mapping[str, Table], rows: pd.DataFrame, title: str) -> dict[str, str]:
        """Further files made of tables and rows alone: their texts by file name."""
        return {}

    def pictures(
        self, study: str, trials: Sequence[Trial], rows: pd.DataFrame, title: str, labels: Labels
    ) -> Iterable[Picture]:
        """Pictures of surfaces, which workers compute.

        Parameters
        ----------
        study : str
        trials : sequence of Trial
            the plan
        rows : DataFrame
            the rows of the plan that are stored
        title : str
        labels : callable
            trial_id -> the arrays that ``measure`` returned with the row; None where they were not kept
        """
        return ()

    def scenes(self, trials: Sequence[Trial], rows: pd.DataFrame, labels: Labels) -> ScenesToMake | None:
        """What the viewer of the study's page shows; None for a page without one.

        Parameters
        ----------
        trials, rows, labels
            as for `pictures`
        """
        return None

    def unwanted_pictures(self) -> Sequence[str]:
        """File stems of pictures that the options exclude: those of an earlier run are deleted."""
        return ()


def row_columns(experiment: type[Experiment] | Experiment) -> tuple[Column, ...]:
    """Every column of the rows of an experiment."""
    return (*planning.trial.COLUMNS, *experiment.columns)


def by_segmenter(rows: pd.DataFrame) -> list[str]:
    """The columns that tables of these rows are grouped by first: the segmenter, if there are several."""
    return ["segmenter"] if rows["segmenter"].nunique() > 1 else []


def measured(segmenter: Segmenter, mesh: TriangleMesh) -> tuple[np.ndarray, float, float | None]:
    """The labels of a mesh's vertices, the seconds that segmenting took, and its peak memory in MB."""
    labelled, seconds, megabytes = measured_result(segmenter, mesh)
    return labelled.labels, seconds, megabytes


def measured_result(segmenter: Segmenter, mesh: TriangleMesh) -> tuple[Labelled, float, float | None]:
    """As `measured`, with what else the method tells about the labels."""
    start = time.perf_counter()
    with peak_memory() as memory:
        labelled = segmenter.labelled(mesh.vertices, mesh.faces)
    return labelled, time.perf_counter() - start, memory.megabytes


def told_methods(rows: pd.DataFrame) -> list[str]:
    """Names of the methods of some rows that are told how many segments to find."""
    if "segmenter_options" not in rows:
        return []
    methods = rows[["segmenter", "segmenter_options"]].dropna().drop_duplicates()
    told = methods["segmenter_options"].map(lambda options: TOLD_OPTION in json.loads(options)).astype(bool)
    return list(dict.fromkeys(methods.loc[told, "segmenter"].astype(str)))


def note_on_told(methods: Sequence[str]) -> str:
    """A sentence that names the methods that are told how many segments to find; "" if there are none."""
    return f"Told how many segments to find: {', '.join(methods)}." if methods else ""


def frame_of(records: Iterable[Mapping[str, Any]], columns: Sequence[str] = ()) -> pd.DataFrame:
    """A DataFrame of records; with the given columns if there are none."""
    import pandas as pd

    records = list(records)
    return pd.DataFrame(records) if records else pd.DataFrame(columns=list(columns))


def require_whole_number(name: str, value: Any) -> int:
    """``value`` of the option ``name``, which must be a whole number of at least 1."""
    if isinstance(value, bool) or not (isinstance(value, int) and value >= 1):
        raise StudyError(f"{name} is {value!r}: it must be a whole number of at least 1")
    return value


def check_plates(plates: Any) -> None:
    """Check the options of pictures, by file stem: what they have in common.

    Raises
    ------
    StudyError
        If one is not a mapping, could not be the name of a file, or its ``models`` are not a list of names.
    """
    if not isinstance(plates, Mapping):
        raise StudyError(f"plates is {plates!r}: it must be a mapping of pictures {{name: {{models: [a,b]}}}}")
    for stem, plate in plates.items():
        check_name("plates", stem)
        if not isinstance(plate, Mapping):
            raise StudyError(f"plates.{stem} is {plate!r}: it must be a mapping of options")
        models = plate.get("models")
        if not (models == "each_category" or has_type(models, Sequence[int | str] | None)):
            raise StudyError(f"plates.{stem}.models is {models!r}: it must be a list [a,b]")


__all__ = ["Experiment", "by_segmenter", "check_plates", "dtypes", "frame_of", "require_whole_number", "row_columns"]
