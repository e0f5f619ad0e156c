"""The difference of every method from one of them, of the same models and draws."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from studies.columns import Column
from studies.planning.errors import StudyError

if TYPE_CHECKING:
    import pandas as pd

    from studies.segmenters import Segmenter

LOW, HIGH = "{}_low", "{}_high"


def check_paired_with(name: str | None, segmenters: Sequence[Segmenter]) -> None:
    """Check that the method that others are compared with is one of several.

    Raises
    ------
    StudyError
        if it is not
    """
    names = [segmenter.name for segmenter in segmenters]
    if name is None or (name in names and len(names) > 1):
        return
    choice = f"choose one of {', '.join(names)}" if len(names) > 1 else "and the study has only one: segmenters=[a,b]"
    raise StudyError(f"paired_with is {name!r}: it must be the name of one of several methods; {choice}")


def rows_of(rows: pd.DataFrame, name: str | None) -> pd.DataFrame | None:
    """The rows of the method that the others are compared with; None if there is none."""
    return None if name is None else rows[rows["segmenter"] == name]


def matched(rows: pd.DataFrame, others: pd.DataFrame, column: str, keys: Sequence[str]) -> pd.DataFrame:
    """The differences of rows from those of another method with the same keys, where both have a value.

    Parameters
    ----------
    rows : DataFrame
        of trials, by one method or several; those by the other method are left out
    others : DataFrame
        of trials by the other method
    column : str
    keys : sequence of str
        columns that tell the rows of a method apart

    Returns
    -------
    DataFrame
        segmenter, the keys, and ``column`` with the difference

    Examples
    --------
    >>> import pandas as pd
    >>> walk = pd.DataFrame({"segmenter": "walk", "model": ["ant", "cow"], "value": [3.0, 5.0]})
    >>> peer = pd.DataFrame({"segmenter": "peer", "model": ["cow", "dog"], "value": [4.0, 9.0]})
    >>> matched(pd.concat([walk, peer]), peer, "value", ["model"]).to_dict("records")
    [{'segmenter': 'walk', 'model': 'cow', 'value': 1.0}]
    """
    mine = rows.loc[~rows["segmenter"].isin(others["segmenter"].unique()), ["segmenter", *keys, column]]
    pairs = mine.merge(others[[*keys, column]], on=list(keys), suffixes=("", "_of_other"))
    pairs[column] = pairs[column].astype(float) - pairs.pop(f"{column}_of_other").astype(float)
    return pairs.dropna(subset=[column])


def difference(value: float, interval: tuple[float, float], name: str = "difference") -> dict[str, float]:
    """The values of a `difference_column`."""
    return {name: value, LOW.format(name): interval[0], HIGH.format(name): interval[1]}


def difference_column(
    other: str | None, of: str, *, name: str = "difference", heading: str = "", format: str, lower_is_better: bool
) -> Column:
    """The column of differences from the method ``other``; tables without differences do not show it.

    Parameters
    ----------
    other : str or None
    of : str
        what the differences are of, as its heading says it
    name, heading, format, lower_is_better
        of the column
    """
    return Column(
        name=name,
        heading=heading,
        format=format,
        lower_is_better=lower_is_better,
        bounds=(LOW.format(name), HIGH.format(name)),
        help=f"{of} minus that of {other}, with the 95 % interval of the difference: of the same models and draws.",
    )
