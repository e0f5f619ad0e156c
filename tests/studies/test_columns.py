import numpy as np
import pandas as pd

from studies.columns import Column, Table, dtypes


def test_a_value_is_shown_by_its_format_and_a_missing_one_by_a_dash():
    column = Column(name="x", format=".1f")
    assert [column.text({"x": value}) for value in (1.26, np.nan, None, pd.NA)] == ["1.3", "–", "–", "–"]


def test_an_interval_follows_the_value_where_there_is_room_and_an_interval():
    column = Column(name="x", format=".1f", bounds=("low", "high"))
    assert column.text({"x": 2.0, "low": 1.0, "high": 3.0}) == "2.0 (1.0 – 3.0)"
    assert column.text({"x": 2.0, "low": 1.0, "high": 3.0}, compact=True) == "2.0"
    assert column.text({"x": 2.0, "low": np.nan, "high": np.nan}) == "2.0"


def test_names_are_shown_with_spaces():
    assert Column(name="unit", dtype="string").text({"unit": "mean_edge_length"}) == "mean edge length"


def test_a_table_shows_the_columns_it_has_values_of():
    frame = pd.DataFrame({"a": [1], "low": [2.0], "high": [3.0], "hidden": [4]})
    columns = (
        Column(name="a", dtype="int64"),
        Column(name="absent"),
        Column(name="interval", template="{low:.0f}–{high:.0f}", compact=False),
        Column(name="of_absent", template="{absent}"),
        Column(name="hidden", dtype="int64", shown=False),
    )
    table = Table("table", frame, columns)
    assert [column.name for column in table.visible()] == ["a", "interval"]
    assert [column.name for column in table.visible(compact=True)] == ["a"]
    assert table.cells() == [["1", "2–3"]]
    assert dtypes(columns) == {"a": "int64", "absent": "float64", "hidden": "int64"}
