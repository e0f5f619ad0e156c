"""The results of a study: its rows, and what they amount to."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies import storage
from studies.columns import Table
from studies.datasets import make_dataset
from studies.experiments.experiment import row_columns
from studies.planning.errors import StudyError
from studies.planning.titles import full_title, subset
from studies.reporting.claims import Claim
from studies.reporting.publication import Publication
from studies.reporting.text import html_of
from studies.segmenters import make_segmenter
from studies.storage.records import CONFIG_FILE, PROVENANCE_FILE, read_config, read_provenance

if TYPE_CHECKING:
    import pandas as pd

    from studies.experiments import Experiment


@dataclass(frozen=True)
class Results:
    """The stored results of a study.

    Parameters
    ----------
    folder : Path
        where they are stored
    name : str
        name of the study
    base_title : str
        its title, without dataset and methods
    experiment : Experiment
        the kind of study
    rows : DataFrame
        one row per trial
    publication : Publication or None
        whose values are shown next to the computed ones
    command : str
        the command that makes the results again
    earlier_commands : tuple of str
        those that made other parts of the rows
    record : mapping
        the configuration, as in config.yaml
    swept : mapping of str to str
        the options that the sweep varied of which this study was a job
    n_models_of : int or None
        how many models the dataset has without the options that select some; None if that is not known

    Examples
    --------
    >>> import studies
    >>> results = studies.load("results/shot_noise/bundled")  # doctest: +SKIP
    >>> results.tables["table"][["level", "mean"]]  # doctest: +SKIP
    """

    folder: Path
    name: str
    base_title: str
    experiment: Experiment
    rows: pd.DataFrame
    publication: Publication | None = None
    command: str = ""
    earlier_commands: tuple[str, ...] = ()
    record: Mapping[str, Any] = field(default_factory=dict)
    swept: Mapping[str, str] = field(default_factory=dict)
    n_models_of: int | None = None

    @classmethod
    def load(cls, folder: str | Path) -> Results:
        """Read the results in a folder such as results/shot_noise/bundled.

        Raises
        ------
        StudyError
            if the folder does not contain results, or those of an earlier version
        """
        folder = Path(folder)
        if not (folder / CONFIG_FILE).exists():
            raise StudyError(f"{folder} has no {CONFIG_FILE}: it does not contain the results of a study")
        if not (folder / storage.TABLE_FILE).exists() and not (folder / storage.ROWS_FILE).exists():
            raise StudyError(f"{folder} has neither {storage.TABLE_FILE} nor {storage.ROWS_FILE}: no rows are stored")
        return cls.of_record(folder, read_config(folder))

    @classmethod
    def of_record(cls, folder: Path, record: Mapping[str, Any], rows: pd.DataFrame | None = None) -> Results:
        """Results from a stored configuration; the rows are read from the folder by default."""
        experiment = _experiment(folder, record)
        if rows is None:
            rows = storage.read_rows(folder, row_columns(experiment))
        origin = read_provenance(folder) if (folder / PROVENANCE_FILE).exists() else {}
        return cls(
            folder=folder,
            name=record["study"]["name"],
            base_title=str(record["title"]),
            experiment=experiment,
            rows=_with_options(rows, record),
            publication=publication_of(record),
            command=str(origin.get("command", "")),
            earlier_commands=tuple(map(str, origin.get("earlier_commands", ()))),
            record=record,
            swept=origin.get("swept", {}),
            n_models_of=origin.get("n_models_of") or _total(record),
        )

    @property
    def dataset(self) -> str:
        """Name of the dataset."""
        return str(self.rows["dataset"].iloc[0]) if len(self.rows) else ""

    @cached_property
    def methods(self) -> list[str]:
        """Names of the methods, without the people of a benchmark."""
        named = self.rows.loc[self.rows["segmenter_options"].notna(), "segmenter"]
        return list(dict.fromkeys((named if len(named) else self.rows["segmenter"]).dropna().astype(str)))

    @cached_property
    def models(self) -> list[str]:
        """Names of the models."""
        columns = [name for name in ("model", "other") if name in self.rows]
        return list(dict.fromkeys(str(name) for column in columns for name in self.rows[column].dropna()))

    @property
    def subset(self) -> str:
        """How many models of how many, "" for all of the dataset."""
        return subset(len(self.models), self.n_models_of)

    @cached_property
    def extent(self) -> str:
        """How large it is, if its title says that instead of naming the methods."""
        return self.experiment.extent(self.rows) if len(self.rows) else ""

    @property
    def title(self) -> str:
        """The title with dataset, methods, and how much of the dataset it is about."""
        if self.extent:
            return f"{full_title(self.base_title, self.dataset, [])}: {self.extent}"
        return full_title(self.base_title, self.dataset, self.methods, self.subset)

    @cached_property
    def report_tables(self) -> dict[str, Table]:
        """The tables by name, with published values if there are any; the study's main one is the first."""
        tables = self.experiment.tables(self.rows)
        if self.publication:
            tables = [self.publication.annotate(table, self.rows) for table in tables]
        return {table.name: table for table in tables}

    @property
    def tables(self) -> dict[str, pd.DataFrame]:
        """The tables as DataFrames, by name."""
        return {name: table.frame for name, table in self.report_tables.items()}

    @property
    def main_table(self) -> Table:
        """The study's main table."""
        return next(iter(self.report_tables.values()))

    @property
    def failures(self) -> int:
        """How many trials failed."""
        return int((self.rows["status"] != "ok").sum())

    def claims(self) -> list[Claim]:
        """What the publication claims about the results."""
        return self.publication.claims(self.report_tables.values(), self.rows) if self.publication else []

    def _repr_html_(self) -> str:
        return html_of(self.title, self.main_table)


def publication_of(record: Mapping[str, Any]) -> Publication | None:
    """The publication whose values are shown in the study of a stored configuration, if there is one."""
    name = record.get("publication")
    return Publication.load(name).for_segmenters(_segmenters(record)) if name else None


def _segmenters(record: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """The options of the segmenters of a stored configuration, as far as it contains them."""
    single, several = record["segmenter"], record.get("segmenters")
    if several is None:
        return [single]
    walk = {"_target_": "studies.segmenters.HeatWalk"}
    named = {"heat_walk": single if single.get("_target_") == walk["_target_"] else walk}
    return [one if isinstance(one, Mapping) else named.get(one, {"_target_": one}) for one in several]


def _experiment(folder: Path, record: Mapping[str, Any]) -> Experiment:
    from studies.planning.configuration import instantiate_experiment

    try:
        return instantiate_experiment(record)
    except Exception as error:
        raise StudyError(
            f"{folder}: {CONFIG_FILE} does not describe an experiment of this version "
            f"({' '.join(str(error).split())}); "
            "run its study again, which reuses the stored rows, or move the folder away"
        ) from error


def _total(record: Mapping[str, Any]) -> int | None:
    """How many models the dataset of a stored configuration has; None if that cannot be told here."""
    try:
        return make_dataset(record["dataset"]).total()
    except ValueError:  # data that are elsewhere, or a class that is not there any more
        return None


def _with_options(rows: pd.DataFrame, record: Mapping[str, Any]) -> pd.DataFrame:
    """Rows in which each has the options of its method: those of earlier versions have its name alone."""
    lacks = rows["segmenter_options"].isna()
    if not lacks.any() or record.get("segmenters"):
        return rows
    try:
        segmenter = make_segmenter(record["segmenter"])
    except (KeyError, ValueError):
        return rows
    lacks &= rows["segmenter"].isin([segmenter.name, segmenter.name.partition(" (")[0]])
    rows = rows.copy()
    rows.loc[lacks, "segmenter"] = segmenter.name
    rows.loc[lacks, "segmenter_options"] = json.dumps(segmenter.options, sort_keys=True)
    return rows
