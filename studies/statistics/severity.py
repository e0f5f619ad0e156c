"""How severe perturbations are for methods: sums over strengths, and corruption errors relative to a reference.

After ImageNet-C (Hendrycks and Dietterich 2019): the area under the curve over the strengths of a perturbation,
relative to that of a reference, and its mean over perturbations. A *cell* is one model under one perturbation at one
strength.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import pandas as pd

CELL = ("part", "level", "model")
"""The columns of the rows that make a cell."""

FEWEST_METHODS = 0.5  # share of the methods that must have a cell that counts


def cell_values(rows: pd.DataFrame, column: str, bound: float) -> pd.DataFrame:
    """The value of every method in every cell: the mean over repeats, in which a failed trial counts with the bound.

    Parameters
    ----------
    rows : DataFrame
        trials, with the columns segmenter, part, level, model, status and ``column``
    column : str
    bound : float
        the worst value that the measure can have, which a trial that failed, timed out or crashed counts with

    Returns
    -------
    DataFrame
        a row per method, a column per cell (part, level, model), in the order of the rows; NaN where nothing was run

    Examples
    --------
    >>> import pandas as pd
    >>> rows = pd.DataFrame({"segmenter": ["a", "a", "b"], "part": "holes", "level": [1.0, 2.0, 1.0], "model": "cow",
    ...                      "status": ["ok", "failed", "ok"], "value": [3.0, float("nan"), 5.0]})
    >>> cell_values(rows, "value", 200).to_numpy().tolist()
    [[3.0, 200.0], [5.0, nan]]
    """
    values = rows[column].astype("float64").where(rows["status"] == "ok", bound)
    keys = ["segmenter", *CELL]
    means = values.groupby([rows[key].astype(object) for key in keys], sort=False).mean()
    methods = list(dict.fromkeys(rows["segmenter"]))
    cells = list(dict.fromkeys(zip(*(rows[key].astype(object) for key in CELL), strict=True)))
    return means.unstack(list(CELL)).reindex(index=methods, columns=cells)


def common_cells(cells: pd.DataFrame) -> pd.DataFrame:
    """The cells that at least half of the methods have: what others have run besides is not compared.

    A method that was added with more models than a board has does not make all others incomplete.
    """
    return cells.loc[:, cells.notna().mean() >= FEWEST_METHODS]


def areas(cells: pd.DataFrame) -> NDArray[np.float64]:
    """Sums over strengths: (methods, parts, models), NaN where a method lacks a strength that others have.

    Parts and models are in the order in which they first occur; a part that has no cell of a model adds 0.
    """
    parts, models = (list(dict.fromkeys(cells.columns.get_level_values(level))) for level in (0, 2))
    sums = np.zeros((len(cells), len(parts), len(models)))
    of_part, of_model = (cells.columns.get_level_values(level) for level in (0, 2))
    for i, (part, model) in enumerate(zip(of_part, of_model, strict=True)):
        sums[:, parts.index(part), models.index(model)] += cells.iloc[:, i].to_numpy()
    return sums


def corruption_errors(cells: pd.DataFrame, reference: str) -> pd.DataFrame:
    """The sum of every method over the cells of every part, relative to that of the reference over the same cells.

    Parameters
    ----------
    cells : DataFrame
        from `cell_values`
    reference : str
        the method whose corruption errors are 1

    Returns
    -------
    DataFrame
        a row per method, a column per part; NaN where the sum of the reference is 0, or the two have no cell in common

    Examples
    --------
    >>> import pandas as pd
    >>> columns = pd.MultiIndex.from_tuples([("holes", 1.0, "cow"), ("holes", 2.0, "cow"), ("noise", 1.0, "cow")])
    >>> cells = pd.DataFrame([[1.0, 3.0, 0.0], [2.0, 4.0, 1.0]], index=["walk", "cuts"], columns=columns)
    >>> corruption_errors(cells, "walk").to_numpy().tolist()
    [[1.0, nan], [1.5, nan]]
    """
    of_part = cells.columns.get_level_values(0)
    parts = list(dict.fromkeys(of_part))
    values = cells.to_numpy()
    if reference not in cells.index:
        return _frame(np.full((len(cells), len(parts)), np.nan), cells, parts)
    standard = cells.loc[reference].to_numpy()
    both = ~np.isnan(values) & ~np.isnan(standard)
    indicator = (of_part.to_numpy()[:, None] == np.array(parts, dtype=object)).astype(float)
    sums = np.where(both, values, 0) @ indicator
    standards = np.where(both, standard, 0) @ indicator
    return _frame(np.divide(sums, standards, out=np.full(sums.shape, np.nan), where=standards > 0), cells, parts)


def part_means(cells: pd.DataFrame) -> pd.DataFrame:
    """The mean of every method over its cells of every part; NaN where it has none."""
    of_part = cells.columns.get_level_values(0)
    parts = list(dict.fromkeys(of_part))
    means = [cells.loc[:, of_part == part].mean(axis=1).to_numpy() for part in parts]
    return _frame(np.array(means).reshape(len(parts), len(cells)).T, cells, parts)


def _frame(values: NDArray[np.float64], cells: pd.DataFrame, parts: list[str]) -> pd.DataFrame:
    import pandas as pd

    return pd.DataFrame(values, index=cells.index, columns=parts)
