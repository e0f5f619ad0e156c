import io

import pandas as pd
import pytest
from rich.console import Console

from studies.columns import Column, Table
from studies.reporting.text import count_of, html_of, markdown_page, print_table

TABLE = Table(
    "table",
    pd.DataFrame({"level": [0.1, 1234567.5], "mean": [1.0, 12345678.25], "n": [3, 1000000]}),
    (
        Column(name="level", format=",.1f", help="How <much>."),
        Column(name="mean", heading="mean of many models", format=",.2f"),
        Column(name="n", dtype="int64", format=",d"),
    ),
    notes="What it means.",
)


@pytest.mark.parametrize("width", [20, 40, 80, 200])
def test_no_value_is_cut_however_narrow_the_terminal(width):
    written = io.StringIO()
    print_table("Holes on psb", TABLE, Console(file=written, width=width))
    for value in ("1,234,567.5", "12,345,678.25", "1,000,000", "0.1", "1.00"):
        assert value in written.getvalue()
    assert "…" not in written.getvalue()


def test_a_page_has_a_title_the_table_its_notes_and_what_its_columns_are():
    assert markdown_page("Holes on psb", TABLE).splitlines() == [
        "# Holes on psb", "", "| level | mean of many models | n |", "| --- | --- | --- |", "| 0.1 | 1.00 | 3 |",
        "| 1,234,567.5 | 12,345,678.25 | 1,000,000 |", "", "What it means.",
        "", "- level: How <much>.",
    ]  # fmt: skip


def test_a_page_has_a_section_for_each_further_table_that_shows_columns():
    column = Column(name="share", help="Share of the whole.")
    further = Table("by_category", pd.DataFrame({"share": [0.5]}), (column,))
    stored_only = Table("raw", pd.DataFrame({"share": [0.5]}))
    page = markdown_page("Holes on psb", TABLE, further, stored_only)
    assert page.startswith(markdown_page("Holes on psb", TABLE))
    assert page.removeprefix(markdown_page("Holes on psb", TABLE)).splitlines() == [
        "", "## By category", "", "| share |", "| --- |", "| 0.5 |", "", "- share: Share of the whole.",
    ]  # fmt: skip


def test_a_number_is_followed_by_the_singular_or_the_plural():
    assert [count_of(n, "trial") for n in (0, 1, 2, 12345)] == ["0 trials", "1 trial", "2 trials", "12,345 trials"]
    assert count_of(1, "study", "studies") == "1 study"


def test_a_notebook_shows_the_table_with_help_on_its_headings():
    html = html_of("A < B", TABLE)
    assert '<th title="How &lt;much&gt;.">level</th>' in html
    assert "<caption>A &lt; B</caption>" in html
    assert html.count("<td>") == 6


def test_a_title_with_brackets_is_printed_whole_though_its_table_is_narrow():
    table = Table("table", pd.DataFrame({"n": [1]}), (Column(name="n", dtype="int64"),))
    title = "segmenters=[heat_walk,cells] and a [/c] on bundled: 1 of 3 models"
    written = io.StringIO()
    print_table(title, table, Console(file=written, width=80, markup=False))
    words = " ".join(line.strip() for line in written.getvalue().splitlines() if "│" not in line)
    assert title.replace(" ", "") in words.replace(" ", "")
