"""LaTeX tables are read again, and say what the CSV files beside them say."""

import re
import shutil
import subprocess
from pathlib import Path

import pandas as pd
import pytest

from studies.columns import Column, Table
from studies.reporting.latex import escaped, latex
from studies.reporting.results import Results

RESULTS = Path(__file__).parents[3] / "results"
FOLDERS = ("shot_noise/bundled", "table1/psb")

SIGNS = '\\&%$#_{}~^<>|"`[]*–—−×≤≥→…“”‘’ [x] *y* a--b 犬 Ω é ł\t\n\n\x00\u200b'


def letters_of(text):
    """What LaTeX shows for a text that `escaped` has made: the other way round, by the meaning of commands."""
    commands = {
        r"\textbackslash{}": "\\", r"\textasciitilde{}": "~", r"\textasciicircum{}": "^", r"\textless{}": "<",
        r"\textgreater{}": ">", r"\textbar{}": "|", r"\textquotesingle{}\textquotesingle{}": '"', "{[}": "[",
        "{]}": "]", "{*}": "*", "$-$": "−", r"$\times$": "×", r"$\le$": "≤", r"\ldots{}": "…", r"\&": "&", r"\%": "%",
        r"\_": "_", r"\#": "#", r"\$": "$", r"\{": "{", r"\}": "}", "--": "–", "``": "“",
    }  # fmt: skip
    pattern = "|".join(map(re.escape, sorted(commands, key=len, reverse=True)))
    return re.sub(pattern, lambda found: commands[found[0]], text)


def read(text):
    """The cells of a table in LaTeX, as text; its headings first."""
    inside = re.search(r"\\begin\{tabular\}\{([lr]+)\}\n(.*)\\end\{tabular\}", text, re.DOTALL)
    lines = [line for line in inside[2].splitlines() if not re.fullmatch(r"\\(top|mid|bottom)rule", line)]
    rows = [
        [letters_of(cell.strip()) for cell in re.split(r"(?<!\\)&", line.removesuffix(r"\\"))]
        for line in lines
        if line.endswith(r" \\")
    ]
    assert len(rows) == len(lines)
    assert {len(row) for row in rows} == {len(inside[1])}
    return inside[1], rows


def assert_balanced(text):
    """Every group, environment and formula ends, and no special character is left."""
    plain = re.sub(r"\\[&%$#_{}\\]", "", text)
    depth = 0
    for letter in plain:
        depth += {"{": 1, "}": -1}.get(letter, 0)
        assert depth >= 0
    assert depth == 0
    open_ones = []
    for command, name in re.findall(r"\\(begin|end)\{(\w+)\}", plain):
        if command == "begin":
            open_ones.append(name)
        else:
            assert open_ones.pop() == name
    assert open_ones == []
    assert plain.count("$") % 2 == 0
    assert "%" not in re.sub(r"\{%$", "", plain.partition("\n")[2], flags=re.MULTILINE)
    for line in text.splitlines():
        assert line.count("&") == line.count(r"\&") or line.endswith(r" \\")


@pytest.fixture(scope="module", params=FOLDERS)
def stored(request):
    return Results.load(RESULTS / request.param)


def test_a_table_says_what_its_csv_file_says_to_the_digits_that_are_shown(stored):
    frame = pd.read_csv(stored.folder / "table.csv")
    table = stored.main_table
    alignment, (headings, *rows) = read(latex(table, stored.title))
    columns = table.shortened().visible()
    assert headings == [column.title for column in columns]
    assert alignment == "".join("l" if column.dtype == "string" else "r" for column in columns)
    checked = 0
    for i, column in enumerate(columns):
        for value, row in zip(frame[column.name] if column.stored else [], rows, strict=column.stored):
            if pd.isna(value):
                assert row[i] == "–"
            elif isinstance(value, str):
                assert row[i] == value.replace("_", " ")
            else:
                shown = row[i].partition(" ")[0]
                decimals = len(shown.partition(".")[2])
                assert float(shown) == pytest.approx(value, abs=0.51 * 10**-decimals), (column.name, row)
            checked += 1
    assert checked >= len(frame) * 3


def test_values_of_the_paper_are_beside_those_computed():
    results = Results.load(RESULTS / "shot_noise" / "bundled")
    _, (headings, *rows) = read(latex(results.main_table, results.title))
    published = pd.read_csv(results.folder / "table.csv")["paper"]
    assert [float(row[headings.index("paper")]) for row in rows] == published.tolist()


def test_every_table_of_a_study_is_balanced_and_notes_are_below_it(stored):
    for table in stored.report_tables.values():
        text = latex(table, stored.title)
        assert_balanced(text)
        assert text.index(r"\bottomrule") < text.index(escaped(table.notes)) if table.notes else True


def hostile(text):
    columns = (Column(name="model", dtype="string", heading=text), Column(name="mean", format=".1f"))
    frame = pd.DataFrame({"model": [text, "[1] first", "*", "plain"], "mean": [1.0, 2.0, None, 3.0]})
    return Table("table", frame, columns, notes=text)


def test_names_with_signs_of_latex_are_shown_as_they_are():
    text = latex(hostile(r"50 % & \more_{x}^2 ~ #1 $5 <a|b> [c] *"), r"\end{table} %")
    assert_balanced(text)
    assert read(text)[1][1][0] == r"50 % & \more {x}^2 ~ #1 $5 <a|b> [c] *"
    assert [row[0] for row in read(text)[1][2:]] == ["[1] first", "*", "plain"]
    assert r"\caption{\textbackslash{}end\{table\} \%}" in text


def test_no_line_of_a_table_begins_with_what_would_belong_to_the_line_before():
    _, _, body = latex(hostile("*[x]"), "title").partition(r"\toprule")
    assert not re.search(r"\\\\\s*[*\[]", body)


def test_every_character_is_one_that_latex_knows():
    assert all(letter == "\\" or (letter.isprintable() and letter <= "\u017f") for letter in escaped(SIGNS + "\ud800"))
    assert_balanced(latex(hostile(SIGNS), SIGNS))
    assert escaped("Größe 犬 Ω é ł") == "Größe Quan O é ł"


def test_a_wide_table_is_made_as_narrow_as_the_text():
    narrow, wide = latex(hostile("x"), "title"), latex(hostile("x" * 100), "title")
    assert r"\resizebox" not in narrow
    assert r"\resizebox{\linewidth}{!}{%" in wide
    assert wide.startswith(r"% needs \usepackage{booktabs,graphicx}")
    assert_balanced(wide)


@pytest.mark.skipif(shutil.which("pdflatex") is None, reason="pdflatex is not installed")
def test_latex_compiles_tables_with_every_sign(tmp_path):
    results = Results.load(RESULTS / "shot_noise" / "bundled")
    tables = [latex(table, results.title) for table in (*results.report_tables.values(), hostile(SIGNS))]
    document = [r"\documentclass{article}", r"\usepackage{booktabs,graphicx}", r"\begin{document}", *tables]
    (tmp_path / "all.tex").write_text("\n".join([*document, r"\end{document}"]), "utf-8")
    subprocess.run(["pdflatex", "-halt-on-error", "all.tex"], cwd=tmp_path, check=True, capture_output=True)
