"""What a method is: where it comes from, and what running it takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, kw_only=True)
class About:
    """A method's source, as leaderboards show it. A class of methods has one as its attribute ``about``.

    Parameters
    ----------
    title : str
        name of the method in the field, such as "Normalized cuts"
    source : str
        authors, title and year of the publication; "" for a method that has none
    bibtex : str
        BibTeX entry of the publication, "" if there is none
    seeded : bool
        whether the method draws random numbers, which `random_generator` seeds by the mesh
    licences : mapping of str to str
        packages that the method calls, other than the dependencies of this project, and their licences
    extra : str
        optional dependency of this project that has them, as in ``pip install 'heatwalk[EXTRA]'``
    baseline : bool
        whether it is a trivial method that others should be better than

    Examples
    --------
    >>> About(title="One segment", baseline=True).licences
    {}
    """

    title: str
    source: str = ""
    bibtex: str = ""
    seeded: bool = False
    licences: Mapping[str, str] = field(default_factory=dict)
    extra: str = ""
    baseline: bool = False
