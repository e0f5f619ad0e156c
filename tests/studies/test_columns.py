import numpy as np
import pandas as pd
import pytest

from studies.columns import Column, Table, dtypes, of_means


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


@pytest.mark.parametrize(
    ("specification", "value", "shown"),
    [
        ("d", 3, "3"), ("d", np.int64(3), "3"), ("d", 3.0, "3"), ("d", 2.25, "2.2"), (",d", 1234.5, "1,234.5"),
        ("d", np.float32(0.5), "0.5"), ("d", float("inf"), "inf"), (".2f", 3, "3.00"),
    ],
)  # fmt: skip
def test_a_format_of_integers_shows_other_numbers_with_one_decimal(specification, value, shown):
    assert Column(name="x", format=specification).text({"x": value}) == shown


@pytest.mark.parametrize(
    ("options", "value", "shown"),
    [
        ({"dtype": "Int64", "format": "d"}, 3.0, "3.0"),
        ({"dtype": "Int64", "format": ",d"}, 12345.67, "12,345.7"),
        ({"dtype": "Int64"}, 4 / 3, "1.3"),
        ({"dtype": "Int64", "format": ".3f"}, 4 / 3, "1.333"),
        ({}, 4 / 3, "1.333"),
        ({"format": ".1f"}, 4 / 3, "1.3"),
    ],
)
def test_means_of_a_column_have_decimals_even_if_its_values_are_whole(options, value, shown):
    assert of_means(Column(name="x", **options)).text({"x": value}) == shown


def test_a_format_that_cannot_show_a_value_is_an_error_that_names_the_column():
    with pytest.raises(ValueError, match=r"column 'splits': its format '\.2q' cannot show 1\.5"):
        Column(name="splits", format=".2q").text({"splits": 1.5})
    with pytest.raises(ValueError, match=r"column 'range': its format '\{low:d\}' cannot show 1\.5"):
        Column(name="range", template="{low:d}").text({"low": 1.5})
