"""Published values, from a file in conf/paper, next to the computed ones in tables, and the claims they make."""

from __future__ import annotations

import dataclasses
import functools
import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from studies._own_packages import CONF
from studies.columns import AUTHORS, COMPUTED, Column, Published, Table
from studies.experiments.experiment import PUBLISHED
from studies.planning.errors import StudyError
from studies.reporting.claims import Claim
from studies.storage.text import parse_yaml

if TYPE_CHECKING:
    import pandas as pd

PERCENT = " %"


@functools.cache
def _read(name: str) -> Mapping[str, Any]:
    """What conf/paper/NAME.yaml contains, read once: a report needs it for each of its studies."""
    return parse_yaml(CONF.joinpath("paper", f"{name}.yaml").read_text("utf-8"))


class Publication:
    """What a publication prints about the studies here.

    Parameters
    ----------
    data : mapping
        as in conf/paper/heat_walk_2011.yaml, whose comments explain it
    is_own_method : bool
        whether the publication's method, with its settings, is among those of the study
    """

    def __init__(self, data: Mapping[str, Any], is_own_method: bool = True) -> None:
        self._data = data
        self._is_own_method = is_own_method

    @classmethod
    def load(cls, name: str) -> Publication:
        """The publication in conf/paper/NAME.yaml.

        Raises
        ------
        StudyError
            if there is no such file
        """
        folder = CONF / "paper"
        known = sorted(file.name.removesuffix(".yaml") for file in folder.iterdir() if file.name.endswith(".yaml"))
        if name not in known:
            raise StudyError(f"publication is {name!r}: it must be null or one of {', '.join(known)}")
        return cls(_read(name))

    def for_segmenters(self, options: Iterable[Mapping[str, Any]]) -> Publication:
        """The publication for a study of segmenters with these options.

        Its values are shown only if its own method with its own settings is among them.
        """
        method = self._data["segmenter"]
        is_own = any(all(one.get(key, value) == value for key, value in method.items()) for one in options)
        return Publication(self._data, is_own)

    @property
    def citation(self) -> str:
        """Authors, title and year, as Markdown."""
        return str(self._data["citation"])

    @property
    def datasets(self) -> tuple[str, ...]:
        """The datasets whose results are compared with the publication's claims."""
        return tuple(self._data["datasets"])

    @property
    def argument(self) -> Mapping[str, Any] | None:
        """What it argues against other methods: ``claim``, and ``against``, their names; None if it does not."""
        return self._data.get("argument")

    def section(self, study: str, rows: pd.DataFrame) -> str:
        """The section that a study is about, "" if the publication has none about what the rows are of."""
        return str(self._of_study(study, rows).get("section", ""))

    def shows(self, study: str, rows: pd.DataFrame) -> str:
        """The tables and figures that a study reproduces, "" if there are none."""
        return str(self._of_study(study, rows).get("shows", ""))

    def remark(self, study: str, rows: pd.DataFrame) -> str:
        """What explains results that are worse than the published ones."""
        return " ".join(str(self._of_study(study, rows).get("remark", "")).split())

    def is_about(self, rows: pd.DataFrame) -> bool:
        """Whether the rows, or some of them, are of the published method with the published settings."""
        if not self._is_own_method or "segmenter" not in rows:
            return self._is_own_method
        return any(self._is_method(str(name), group) for name, group in rows.groupby("segmenter"))

    def _is_method(self, name: str, rows: pd.DataFrame) -> bool:
        """Whether the rows of a method are of the published one, with the published settings."""
        if name.partition(" (")[0] != self._data["method"]:
            return False
        settings = {key: value for key, value in self._data["segmenter"].items() if not key.startswith("_")}
        stored = rows["segmenter_options"].dropna().unique() if "segmenter_options" in rows else ()
        options = [json.loads(each) for each in stored]
        return all(each.get(key, value) == value for each in options for key, value in settings.items())

    def _of_study(self, study: str, rows: pd.DataFrame) -> Mapping[str, Any]:
        """What is published about a study; nothing if the rows are of another perturbation or method."""
        entry = self._data["studies"].get(study, {})
        perturbations = set(rows["perturbation"].dropna().unique()) - {""}
        if not self.is_about(rows) or ("perturbations" in entry and not perturbations <= {*entry["perturbations"]}):
            return {}
        return entry

    def annotate(self, table: Table, rows: pd.DataFrame) -> Table:
        """The table with the published values: a column next to the computed values, or rows of methods.

        Parameters
        ----------
        table : Table
        rows : DataFrame
            the trials that the table was made from
        """
        if "source" in table.frame and "method" in table.frame:
            return self._with_methods(table)
        if not table.value or PUBLISHED not in table.columns:
            return table
        name = self._data["column"]
        frame = table.frame.copy()
        values = [self._value(record, rows) for record in table.records()]
        is_about = self.is_about(rows) and not (all(map(math.isnan, values)) and not self._has_studies_of(rows))
        position = list(frame.columns).index(table.published_before) if table.published_before else len(frame.columns)
        frame.insert(position, name, values)
        shown = next((column for column in table.columns if column.name == table.value), Column(name=table.value))
        published = dataclasses.replace(
            shown, name=name, heading=name, bounds=None, help=f"Value in {self._data['label']}.", shown=is_about
        )
        columns = tuple(published if column == PUBLISHED else column for column in table.columns)
        if not is_about:  # the column is stored, so that every table of a kind of experiment has the same ones
            return table.replace(frame=frame, columns=columns)
        notes = " ".join(filter(None, (table.notes, self._data["note"])))
        return table.replace(
            frame=frame, columns=columns, notes=notes, published=Published(name, str(self._data["label"]))
        )

    def _with_methods(self, table: Table) -> Table:
        """A table of methods with the published rows, of methods that are shipped below those computed."""
        import pandas as pd

        source, methods = self._data["column"], self._data["methods"]["rows"]
        published = pd.DataFrame([{"method": method, "source": source, **row} for method, row in methods.items()])
        spelled = {method.lower(): method for method in methods}
        names = table.frame["method"].where(
            table.frame["source"] != AUTHORS, table.frame["method"].map(lambda name: spelled.get(name.lower(), name))
        )
        frame = pd.concat([table.frame.assign(method=names), published], ignore_index=True)
        # The scores of a method's segmentations by its authors come before those that are published of it.
        computed = list(frame["method"][frame["source"] == COMPUTED])
        places = [
            _place_of(str(method), source, list(methods), self._data["methods"].get("shipped", {}), computed)
            for method, source in zip(frame["method"], frame["source"], strict=True)
        ]
        frame = frame.iloc[sorted(range(len(frame)), key=places.__getitem__)].reset_index(drop=True)
        notes = " ".join(filter(None, (table.notes, self._data["note"])))
        return table.replace(
            frame=frame[table.frame.columns], notes=notes, published=Published("source", str(self._data["label"]))
        )

    def claims(self, tables: Iterable[Table], rows: pd.DataFrame) -> list[Claim]:
        """The published claims about what annotated tables show, in the order of their rows."""
        return [claim for table in tables for claim in self._claims(table, rows)]

    def _claims(self, table: Table, rows: pd.DataFrame) -> Iterator[Claim]:
        if "source" in table.frame:
            yield from self._claims_about_methods(table, rows)
            return
        for record in table.records() if table.name == "table" else ():
            for entry in self._matching(record, rows):
                if not _all_equal(record, entry.get("only", {})):
                    continue
                words = {
                    key: value.replace("_", " ") if isinstance(value, str) else value for key, value in record.items()
                }
                yield Claim(
                    entry["claim"].format(**words),
                    _number(_lookup(entry, record)),
                    record[table.value or "mean"],
                    record["ci_low"],
                    record["ci_high"],
                    PERCENT,
                    entry.get("digits", 2),
                    entry.get("higher_is_better", False),
                )

    def _claims_about_methods(self, table: Table, rows: pd.DataFrame) -> Iterator[Claim]:
        methods = self._data["methods"]
        if not self.is_about(rows):
            return
        for record in table.records():
            published = methods["rows"].get(str(record["method"]).partition(" (")[0])
            if published is None or record["source"] == self._data["column"]:
                continue
            for metric, value in published.items():
                yield Claim(
                    methods["claim"].format(method=record["method"], metric=metric.replace("_", " ")),
                    _number(value),
                    record[metric],
                    record[f"{metric}_low"],
                    record[f"{metric}_high"],
                    digits=methods["digits"],
                )

    def _value(self, record: Mapping[str, Any], rows: pd.DataFrame) -> float:
        """The published value for a row of a table, NaN if there is none."""
        return next((_number(_lookup(entry, record)) for entry in self._matching(record, rows)), math.nan)

    def _has_studies_of(self, rows: pd.DataFrame) -> bool:
        """Whether the publication has the study of these trials."""
        return "study" not in rows or bool(rows["study"].isin(list(self._data["studies"])).any())

    def _matching(self, record: Mapping[str, Any], rows: pd.DataFrame) -> Iterator[Mapping[str, Any]]:
        """The entries about a row of a table."""
        if "segmenter" in record:
            if record["segmenter"].partition(" (")[0] != self._data["method"]:
                return
            rows = rows[rows["segmenter"] == record["segmenter"]] if "segmenter" in rows else rows
        if not self.is_about(rows):
            return
        for entry in self._data["values"]:
            if (
                entry["by"] in record
                and _all_equal(record, entry.get("where", {}))
                and _key(entry, record) is not None
                and _are_made_of(entry.get("rows", {}), record, rows)
            ):
                yield entry


def _place_of(
    method: str, source: str, published: Sequence[str], shipped: Mapping[str, str], computed: Sequence[str]
) -> tuple[int, int, int]:
    """Where a row of a table of methods goes: below what was computed of the method, or below all that was computed."""
    by = int(source != AUTHORS)
    if source == COMPUTED:
        return 0, computed.index(method), -1
    if shipped.get(method) in computed:
        return 0, computed.index(shipped[method]), by
    return (1, published.index(method), by) if method in published else (0, len(computed), 0)


def _lookup(entry: Mapping[str, Any], record: Mapping[str, Any]) -> Any:
    return entry["values"][_key(entry, record)]


def _key(entry: Mapping[str, Any], record: Mapping[str, Any]) -> Any:
    """The key of ``values`` that the row is about, None if there is none."""
    return next((key for key in entry["values"] if _equal(key, record[entry["by"]])), None)


def _all_equal(record: Mapping[str, Any], wanted: Mapping[str, Any]) -> bool:
    return all(name in record and _equal(value, record[name]) for name, value in wanted.items())


def _equal(a: Any, b: Any) -> bool:
    if isinstance(a, str) or isinstance(b, str):
        return bool(a == b)
    return math.isclose(a, b, rel_tol=1e-5, abs_tol=1e-8)


def _are_made_of(wanted: Mapping[str, Any], record: Mapping[str, Any], rows: pd.DataFrame) -> bool:
    """Whether all trials behind a row of a table have these values."""
    behind = rows[rows["part"] == record["part"]] if "part" in record else rows
    return all(bool((behind[name] == value).all()) for name, value in wanted.items())


def _number(value: float | None) -> float:
    return math.nan if value is None else float(value)
