"""Tables for LaTeX, with the package booktabs."""

from __future__ import annotations

from collections.abc import Sequence

from anyascii import anyascii

from studies.columns import Column, Table

LINE_LENGTH = 90  # characters that fit on a line of a page of one column

# What a character is in LaTeX if it is not the character. Brackets and the asterisk would belong to the end of the line
# before them; "<", ">", "|" and quotation marks are others in the default encoding of fonts.
_SPECIAL = {
    "\\": r"\textbackslash{}", "&": r"\&", "%": r"\%", "$": r"\$", "#": r"\#", "_": r"\_", "{": r"\{", "}": r"\}",
    "~": r"\textasciitilde{}", "^": r"\textasciicircum{}", "<": r"\textless{}", ">": r"\textgreater{}",
    "|": r"\textbar{}", '"': r"\textquotesingle{}\textquotesingle{}", "`": r"\textasciigrave{}",
    "[": "{[}", "]": "{]}", "*": "{*}",
    "–": "--", "—": "---", "−": "$-$", "×": r"$\times$", "±": r"$\pm$", "·": r"$\cdot$", "≤": r"$\le$", "≥": r"$\ge$",
    "→": r"$\to$", "…": r"\ldots{}", "“": "``", "”": "''", "‘": "`", "’": "'",
}  # fmt: skip
_LAST_LATIN = "\u017f"  # up to which LaTeX knows all letters


def latex(table: Table, title: str) -> str:
    r"""A table for LaTeX: words to the left, numbers to the right, notes below.

    Numbers that need room are left out. A table that is wider than a line all the same is made as narrow as one.

    Parameters
    ----------
    table : Table
    title : str
        the caption

    Returns
    -------
    str
        an environment ``table``, whose first line names the packages that it needs

    Examples
    --------
    >>> import pandas as pd
    >>> share = Column(name="share", heading="failed %", format=".1f")
    >>> print(latex(Table("table", pd.DataFrame({"share": [0.5, 12]}), (share,)), "50 % of all"), end="")
    % needs \usepackage{booktabs}
    \begin{table}
    \centering
    \caption{50 \% of all}
    \begin{tabular}{r}
    \toprule
    failed \% \\
    \midrule
    0.5       \\
    12.0      \\
    \bottomrule
    \end{tabular}
    \end{table}
    """
    shown = table.shortened()
    columns = shown.visible()
    lines = [[column.title for column in columns], *shown.cells()]
    is_wide = sum(max(map(len, each)) + 2 for each in zip(*lines, strict=True)) > LINE_LENGTH
    rows = _aligned([[escaped(cell) for cell in cells] for cells in lines])
    return "\n".join(
        [
            rf"% needs \usepackage{{booktabs{',graphicx' if is_wide else ''}}}",
            r"\begin{table}",
            r"\centering",
            rf"\caption{{{escaped(title)}}}",
            *([r"\resizebox{\linewidth}{!}{%"] if is_wide else []),
            rf"\begin{{tabular}}{{{''.join(map(_alignment, columns))}}}",
            r"\toprule",
            rows[0],
            r"\midrule",
            *rows[1:],
            r"\bottomrule",
            rf"\end{{tabular}}{'}' if is_wide else ''}",
            *_notes(table.notes),
            r"\end{table}",
            "",
        ]
    )


def escaped(text: str) -> str:
    r"""Text as LaTeX shows it; what pdfLaTeX has no letter for is transliterated.

    Examples
    --------
    >>> print(escaped("95 % of my_method"), escaped("Å − 犬"))
    95 \% of my\_method Å $-$ Quan
    """
    return "".join(_escaped_letter(letter) for letter in " ".join(text.split()))


def _escaped_letter(letter: str) -> str:
    if letter in _SPECIAL:
        return _SPECIAL[letter]
    if letter.isprintable() and letter <= _LAST_LATIN:
        return letter
    return "".join(_SPECIAL.get(each, each) for each in anyascii(letter) if each.isprintable())


def _alignment(column: Column) -> str:
    return "l" if column.dtype == "string" else "r"


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table whose columns are below each other in the file, too."""
    widths = [max(map(len, cells)) for cells in zip(*rows, strict=True)]
    return [" & ".join(cell.ljust(width) for cell, width in zip(cells, widths, strict=True)) + r" \\" for cells in rows]


def _notes(notes: str) -> list[str]:
    """The notes, as wide as the text."""
    if not notes:
        return []
    return [r"\par\medskip", r"\begin{minipage}{\linewidth}", rf"\footnotesize {escaped(notes)}", r"\end{minipage}"]
