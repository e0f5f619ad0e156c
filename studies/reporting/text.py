"""Tables as text: Markdown, HTML for notebooks, and the terminal."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable, Sequence
from html import escape
from typing import TYPE_CHECKING

from studies.columns import Table

if TYPE_CHECKING:
    from rich.console import Console

# Columns of a table on the terminal from which on less space separates them, to fit on 80 characters.
MANY_COLUMNS = 8


def count_of(number: int, noun: str, plural: str = "") -> str:
    """A number and what it counts.

    Examples
    --------
    >>> count_of(1, "trial"), count_of(1200, "trial"), count_of(2, "study", "studies")
    ('1 trial', '1,200 trials', '2 studies')
    """
    return f"{number:,} {noun if number == 1 else plural or f'{noun}s'}"


def in_words(stem: str) -> str:
    """The name of a file without its suffix, as it is written in a heading.

    Examples
    --------
    >>> in_words("heat_map"), in_words("figure12")
    ('Heat map', 'Figure 12')
    """
    return re.sub(r"(?<=[a-z])(?=\d)", " ", stem.replace("_", " ")).capitalize()


def options_of_variants(names: Iterable[str]) -> dict[str, str]:
    """What tells names of methods apart where most of them are variants of one: the options in their parentheses.

    Parameters
    ----------
    names : iterable of str
        such as ``"HeatWalkRobust (without merge)"``

    Returns
    -------
    dict of str to str
        options by name; only of the names that are variants of what more than half of the names are

    Examples
    --------
    >>> options_of_variants(["HeatWalk", "HeatWalkRobust", "HeatWalkRobust (without merge)"])
    {'HeatWalkRobust (without merge)': 'without merge'}
    >>> options_of_variants(["HeatWalk", "KMeans (n=4)", "Voronoi"])
    {}
    """
    parts = {name: name.removesuffix(")").partition(" (") for name in names}
    kinds = Counter(kind for kind, _, _ in parts.values())
    return {
        name: options for name, (kind, _, options) in parts.items() if options and kinds[kind] > max(1, len(parts) / 2)
    }


def plain_text(markdown: str) -> str:
    """Markdown of a single paragraph without its emphasis, and with the text of links alone.

    Examples
    --------
    >>> plain_text("*Same*: [the paper](paper.pdf)'s value; `levels`")
    "Same: the paper's value; levels"
    """
    text = re.sub(r"!?\[([^\]]*)\]\([^)]*\)", r"\1", markdown)
    return re.sub(r"[*`]", "", text)


def markdown_table(headings: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table.

    Examples
    --------
    >>> print(*markdown_table(["level", "CP %"], [["0.1", "2.00"]]), sep="\\n")
    | level | CP % |
    | --- | --- |
    | 0.1 | 2.00 |
    """
    lines = [headings, ["---"] * len(headings), *rows]
    return ["| " + " | ".join(cells) + " |" for cells in lines]


def markdown_page(title: str, *tables: Table) -> str:
    """A page of Markdown: a title, and every table with its notes and what its columns are.

    Tables after the first have a heading of their own. Those that show no columns are left out.
    """
    lines = [f"# {title}"]
    for i, table in enumerate(tables):
        if table.visible():
            heading = ["", f"## {table.title}"] if i else []
            notes = ["", table.notes] if table.notes else []
            lines += [*heading, "", *markdown_of(table), *notes, *_columns_of(table)]
    return "\n".join([*lines, ""])


def _columns_of(table: Table) -> list[str]:
    """A list of what the columns of a table are."""
    explained = [f"- {column.title}: {column.help}" for column in table.visible() if column.help]
    return ["", *explained] if explained else []


def markdown_of(table: Table) -> list[str]:
    """Lines of a table in Markdown."""
    return markdown_table([column.title for column in table.visible()], table.cells())


def html_of(title: str, table: Table) -> str:
    """A table as HTML, as notebooks show it; headings have the help of their column as tooltip."""
    heads = "".join(f'<th title="{escape(column.help)}">{escape(column.title)}</th>' for column in table.visible())
    rows = "".join("<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in cells) + "</tr>" for cells in table.cells())
    return f"<table><caption>{escape(title)}</caption><thead><tr>{heads}</tr></thead><tbody>{rows}</tbody></table>"


def print_table(title: str, table: Table, console: Console) -> None:
    """Print the columns of a table that fit on 80 characters; table.md has all of them.

    Headings wrap on a narrow terminal; a value is never cut.
    """
    from rich.table import Table as RichTable
    from rich.text import Text

    columns, rows = table.visible(compact=True), table.cells(compact=True)
    padding = (0, 1) if len(columns) < MANY_COLUMNS else (0, 1, 0, 0)
    # A table of few columns is narrower than its title, which wraps, although values do not.
    above = Text(title, "table.title", no_wrap=False)
    below = Text(f"{table.name}.md explains the columns", "table.caption", no_wrap=False)
    shown = RichTable(title=above, caption=below, padding=padding)
    widths = []
    for i, column in enumerate(columns):
        widths.append(max([*(len(cells[i]) for cells in rows), *map(len, column.title.split())]))
        shown.add_column(column.title, justify="right", min_width=widths[-1])
    for cells in rows:
        shown.add_row(*cells)
    narrowest = sum(widths) + len(widths) * (1 + sum(padding[1::2] or (1,)) + (len(padding) == 2)) + 1
    console.print(shown, width=max(console.width, narrowest), crop=False, no_wrap=True)
