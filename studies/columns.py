"""Columns are declared once: rows, tables and every way of showing them read the same declaration.

A `Column` belongs to the metric or the experiment that computes its values. Parquet and CSV use its name and dtype,
Markdown, LaTeX, HTML, the terminal and notebooks its heading, format and help.
"""

from __future__ import annotations

import math
import string
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import pandas as pd

MISSING = "–"  # what is shown for a value that is missing

# Values of the column ``source`` in a table of methods; a publication has a word of its own.
COMPUTED = "computed"  # segmented and scored here
AUTHORS = "authors"  # scored here, from the segmentations by a method's authors that come with the dataset


@dataclass(frozen=True, kw_only=True)
class Column:
    """A column of the rows or of a table.

    Parameters
    ----------
    name : str
        name in parquet, CSV and DataFrames
    dtype : str
        pandas dtype of the stored values, one that can hold missing values
    heading : str
        heading where the column is shown; by default the name with spaces
    format : str
        format specification of a shown value, such as ".2f". One of integers, such as "d" or ",d", shows a value that
        is not whole with one decimal.
    unit : str
        unit of the values, "" where they have none
    lower_is_better : bool or None
        None where neither is
    help : str
        what the values are, in one sentence
    template : str
        shown text made of several stored columns, such as "{ci_low:.2f} – {ci_high:.2f}"; the column itself is then
        not stored
    bounds : tuple of two str, optional
        names of the stored columns with the interval of the value, shown in parentheses behind it
    compact : bool
        whether it is shown where room is scarce: on a terminal of 80 characters
    shown : bool
        False for a column that is stored and not shown, such as the bounds of an interval

    Examples
    --------
    >>> error = Column(name="rand_index_error", heading="Rand error", format=".4f", lower_is_better=True)
    >>> error.text({"rand_index_error": 0.12345})
    '0.1235'
    >>> interval = Column(name="interval", template="{low:.1f} – {high:.1f}")
    >>> interval.text({"low": 1.0, "high": 2.0}), interval.text({"low": float("nan"), "high": 2.0})
    ('1.0 – 2.0', '–')
    """

    name: str
    dtype: str = "float64"
    heading: str = ""
    format: str = ""
    unit: str = ""
    lower_is_better: bool | None = None
    help: str = ""
    template: str = ""
    bounds: tuple[str, str] | None = None
    compact: bool = True
    shown: bool = True

    @property
    def title(self) -> str:
        """The heading, or the name with spaces."""
        return self.heading or self.name.replace("_", " ")

    @property
    def stored(self) -> bool:
        """Whether the column has values of its own in a DataFrame."""
        return not self.template

    def text(self, row: Mapping[str, Any], *, compact: bool = False) -> str:
        """The value in ``row`` as text, `MISSING` where it is missing.

        Parameters
        ----------
        row : mapping
            values by the names of stored columns
        compact : bool
            leave out the interval behind a value

        Raises
        ------
        ValueError
            If the format cannot show the value.
        """
        names = _names_in(self.template) if self.template else [self.name]
        if is_missing(row.get(names[0])):
            return MISSING
        try:
            if self.template:
                shown = self.template.format(**{name: row[name] for name in names})
            else:
                shown = _formatted(row[self.name], self.format)
        except ValueError as error:
            values = ", ".join(repr(row[name]) for name in names)
            raise ValueError(
                f"column {self.name!r}: its format {self.template or self.format!r} cannot show {values}: {error}"
            ) from error
        if self.dtype == "string" and not self.template:
            shown = shown.replace("_", " ")
        if compact or self.bounds is None or is_missing(row.get(self.bounds[0])):
            return shown
        low, high = (_formatted(row[bound], self.format) for bound in self.bounds)
        return f"{shown} ({low} – {high})"


@dataclass(frozen=True)
class Published:
    """The column of a table that holds values published elsewhere, next to those computed here.

    Parameters
    ----------
    column : str
        name of the column
    label : str
        whose values they are, for legends
    """

    column: str
    label: str


@dataclass(frozen=True)
class Table:
    """A table of a study: stored values, and how they are shown.

    Parameters
    ----------
    name : str
        stem of the files that hold it
    frame : pandas.DataFrame
        the values, in the order of the CSV file
    columns : sequence of Column
        what is shown of them, in this order. Columns whose values are not in ``frame`` are left out.
    notes : str
        sentences that explain the table, in addition to the help of its columns
    value : str
        name of the column that published values are compared with, "" where there are none
    published_before : str
        name of the column that published values come before in ``frame``, "" for the end
    published : Published, optional
        set by `studies.reporting` if published values are shown next to the computed ones
    """

    name: str
    frame: pd.DataFrame
    columns: Sequence[Column] = field(default=())
    notes: str = ""
    value: str = ""
    published_before: str = ""
    published: Published | None = None

    @property
    def title(self) -> str:
        """The name with spaces, as a heading."""
        return self.name.replace("_", " ").capitalize()

    def visible(self, *, compact: bool = False) -> list[Column]:
        """The columns that are shown: those of which there are values, and fewer where room is scarce."""
        return [
            column for column in self.columns if column.shown and (column.compact or not compact) and self._has(column)
        ]

    def cells(self, *, compact: bool = False) -> list[list[str]]:
        """The table as text, a list of cells for each row, in the order of `visible`."""
        columns = self.visible(compact=compact)
        return [[column.text(row, compact=compact) for column in columns] for row in self.records()]

    def shortened(self) -> Table:
        """The table without the numbers that need room; words stay."""
        return self.replace(columns=[each for each in self.columns if each.compact or each.dtype == "string"])

    def records(self) -> list[dict[str, Any]]:
        """The rows of the frame as dicts."""
        return self.frame.to_dict("records")  # type: ignore[return-value]  # names of columns are str

    def replace(self, **changes: Any) -> Table:
        """A copy with other values of the given fields."""
        return replace(self, **changes)

    def _has(self, column: Column) -> bool:
        names = [column.name] if column.stored else _names_in(column.template)
        return all(name in self.frame.columns for name in names)


def dtypes(columns: Sequence[Column]) -> dict[str, str]:
    """Name and dtype of the stored ones among ``columns``, in their order."""
    return {column.name: column.dtype for column in columns if column.stored}


def of_means(column: Column) -> Column:
    """A column of means of the values of another: with decimals even if those are whole, and not with all of them.

    Examples
    --------
    >>> counts = Column(name="splits", dtype="Int64", format="d")
    >>> counts.text({"splits": 3}), of_means(counts).text({"splits": 3.0})
    ('3', '3.0')
    """
    is_whole = _is_of_integers(column.format) or (column.dtype.lower().startswith("int") and not column.format)
    specification = _with_one_decimal(column.format) if is_whole else column.format or ".4g"
    return replace(column, dtype="float64", format=specification)


def _formatted(value: Any, specification: str) -> str:
    """A value by a format specification; one of integers shows other numbers with one decimal."""
    if _is_of_integers(specification) and isinstance(value, Real) and not isinstance(value, Integral):
        if not float(value).is_integer():
            return format(value, _with_one_decimal(specification))
        value = int(float(value))
    return format(value, specification)


def _is_of_integers(specification: str) -> bool:
    return specification.endswith("d")


def _with_one_decimal(specification: str) -> str:
    return f"{specification.removesuffix('d')}.1f"


def _names_in(template: str) -> list[str]:
    """The names that a template refers to."""
    return [name for _, name, _, _ in string.Formatter().parse(template) if name]


def is_missing(value: Any) -> bool:
    """Whether a value of a DataFrame is missing: None, NaN or pandas' NA."""
    if value is None or type(value).__name__ == "NAType":
        return True
    return isinstance(value, float) and math.isnan(value)
