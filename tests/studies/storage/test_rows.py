import json

import pandas as pd
import pytest

from studies.columns import Column, dtypes
from studies.planning.trial import COLUMNS
from studies.storage import PLAN_FILE, ROWS_FILE, TABLE_FILE, RowStore, StoredRows, planned_ids, read_rows, rows
from tests.studies.storage.example_rows import row

NAMES = [column.name for column in COLUMNS]


def test_rows_are_on_disk_before_the_store_is_closed(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a", seconds_segment=0.1 + 0.2))
        assert StoredRows(tmp_path).frame(["a"], COLUMNS)["seconds_segment"].tolist() == [0.1 + 0.2]


def test_a_later_row_replaces_an_earlier_one(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a", status="failed"))
        store.add(row("b"))
        store.add(row("a", status="ok"))
    assert StoredRows(tmp_path).status == {"a": "ok", "b": "ok"}
    assert StoredRows(tmp_path).frame(["a", "b"], COLUMNS)["status"].tolist() == ["ok", "ok"]


def test_a_row_cut_at_any_byte_loses_that_row_only_and_the_next_one_is_complete(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a"))
        store.add(row("b"))
    content = store.path.read_bytes()
    first = content.index(b"\n") + 1
    for cut in range(first, len(content) - 1, 37):
        store.path.write_bytes(content[:cut])
        with RowStore(tmp_path) as again:
            assert set(again.status) == {"a"}
            assert again.damaged == (cut > first)
            again.add(row("c"))
        assert set(StoredRows(tmp_path).status) == {"a", "c"}


@pytest.mark.parametrize(
    "line",
    [
        b"\xff\xfe\n", b"[]\n", b"{}\n", b"null\n", b"\n", b'{"trial_id": "a"}\n',
        b'{"trial_id": ["a"], "status": "ok"}\n',
        b'{"trial_id": "a", "status": {}}\n', b'"trial_id status"\n', b"1" * 5000 + b"\n", b"[" * 5000 + b"\n",
    ],
)  # fmt: skip
def test_a_line_that_is_not_a_row_is_counted_and_left_out(tmp_path, line):
    (tmp_path / ROWS_FILE).write_bytes(line)
    with RowStore(tmp_path) as store:
        assert (store.damaged, store.status) == (1, {})
        store.add(row("b"))
    assert StoredRows(tmp_path).status == {"b": "ok"}


def test_the_frame_has_the_columns_and_types_and_the_order_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(rows, "_BATCH_SIZE", 2)
    columns = (*COLUMNS, Column(name="n_steps", dtype="Int64"), Column(name="text", template="{n_steps}"))
    with RowStore(tmp_path) as store:
        store.add_all(row(name, n_steps=4) for name in "cabd")
        frame = store.frame(["a", "b", "x", "c"], columns)
    assert frame["trial_id"].tolist() == ["a", "b", "c"]
    assert frame["n_steps"].tolist() == [4, 4, 4]
    assert {name: str(dtype) for name, dtype in frame.dtypes.items()} == {
        name: str(pd.Series(dtype=dtype).dtype) for name, dtype in dtypes(columns).items()
    }


def test_an_empty_frame_has_the_columns_too(tmp_path):
    assert list(StoredRows(tmp_path).frame(["a"], COLUMNS).columns) == NAMES


def test_rows_are_plain_json_lines(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a", level=0.5))
    lines = [json.loads(line) for line in store.path.read_bytes().split(b"\n")[:-1]]
    assert [line["level"] for line in lines] == [0.5]


def test_seconds_are_the_mean_over_the_rows_that_have_them(tmp_path):
    assert StoredRows(tmp_path).seconds is None
    with RowStore(tmp_path) as store:
        store.add(row("a", seconds=1.0), row("b"), row("c", seconds=2.0))
        assert store.seconds == StoredRows(tmp_path).seconds == 1.5


def test_the_plan_is_stored_in_its_order(tmp_path):
    assert planned_ids(tmp_path) is None
    with RowStore(tmp_path) as store:
        store.write_plan(iter(["b", "a"]))
    assert planned_ids(tmp_path) == ["b", "a"]
    assert (tmp_path / PLAN_FILE).read_bytes() == b"b\na\n"


def test_rows_are_read_in_the_order_of_the_plan_before_and_after_the_table_is_written(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a", n_faces=1), row("b", n_faces=2), row("of an earlier plan"))
        store.write_plan(["b", "a", "not run yet"])
        before = read_rows(tmp_path, COLUMNS)
        before.to_parquet(tmp_path / TABLE_FILE)
    assert before["trial_id"].tolist() == ["b", "a"]
    pd.testing.assert_frame_equal(read_rows(tmp_path, COLUMNS), before)
    for name in (ROWS_FILE, PLAN_FILE):
        (tmp_path / name).unlink()
    pd.testing.assert_frame_equal(read_rows(tmp_path, COLUMNS), before)


def test_columns_that_the_table_does_not_have_are_missing_values(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a"))
        store.frame(["a"], COLUMNS).to_parquet(tmp_path / TABLE_FILE)
    store.path.unlink()
    frame = read_rows(tmp_path, (*COLUMNS, Column(name="new", dtype="Int64")))
    assert list(frame.columns) == [*NAMES, "new"]
    assert frame["new"].isna().tolist() == [True]
