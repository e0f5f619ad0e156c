"""Titles over tables and pictures, and of sections: what was studied, on what, with which methods."""

from collections.abc import Sequence

from studies.reporting.text import count_of

MOST_NAMED = 3  # methods that a title names


def full_title(title: str, dataset: str, segmenters: Sequence[str], subset: str = "") -> str:
    """The title of a study with its dataset, its methods, and how much of the dataset it is about.

    Parameters
    ----------
    title, dataset : str
    segmenters : sequence of str
        names of methods, with their options
    subset : str
        such as "1 of 3 models", "" for all

    Examples
    --------
    >>> full_title("Holes", "bundled", ["HeatWalk (time=2)"], "1 of 3 models")
    'Holes on bundled: HeatWalk (time=2), 1 of 3 models'
    >>> full_title("Holes", "psb", ["HeatWalk", "Slabs"]), full_title("Holes", "psb", ["a", "b", "c", "d"])
    ('Holes on psb: HeatWalk and Slabs', 'Holes on psb: 4 methods')
    """
    words = f"{title} on {dataset}" if dataset else title
    if segmenters:
        words += f": {_methods(segmenters)}"
    return f"{words}, {subset}" if subset else words


def _methods(names: Sequence[str]) -> str:
    if len(names) > MOST_NAMED:
        return f"{len(names)} methods"
    return " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))


def subset(number: int, total: int | None) -> str:
    """How many models of how many, "" if these are all, or it is not known.

    Examples
    --------
    >>> subset(1, 3), subset(3, 3), subset(1, None)
    ('1 of 3 models', '', '')
    """
    return f"{number:,} of {count_of(total, 'model')}" if total and number < total else ""
