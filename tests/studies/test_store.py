import json

import pandas as pd

from studies.store import Store
from studies.trial import COLUMNS


def row(trial_id, **values):
    return dict.fromkeys(COLUMNS) | {"trial_id": trial_id, "status": "ok", "repeat": 0, "seed": 1} | values


def test_rows_are_on_disk_before_the_store_is_closed(tmp_path):
    store = Store(tmp_path)
    store.add(row("a", change_percentage=0.1 + 0.2))
    assert Store(tmp_path).rows["a"]["change_percentage"] == 0.1 + 0.2


def test_a_later_row_replaces_an_earlier_one(tmp_path):
    with Store(tmp_path) as store:
        store.add(row("a", status="failed"))
        store.add(row("a", status="ok"))
    assert Store(tmp_path).frame(["a"])["status"].tolist() == ["ok"]


def test_a_row_cut_at_any_byte_loses_that_row_only_and_the_next_one_is_whole(tmp_path):
    with Store(tmp_path) as store:
        store.add(row("a"))
        store.add(row("b"))
    content = store.path.read_bytes()
    first = content.index(b"\n") + 1
    for cut in range(first, len(content) - 1, 37):
        store.path.write_bytes(content[:cut])
        with Store(tmp_path) as again:
            assert set(again.rows) == {"a"}
            assert again.damaged == (cut > first)
            again.add(row("c"))
        assert set(Store(tmp_path).rows) == {"a", "c"}


def test_the_frame_has_the_columns_and_types_and_the_order_asked_for(tmp_path):
    with Store(tmp_path) as store:
        for name in "cab":
            store.add(row(name))
        frame = store.frame(["a", "b", "x", "c"])
    assert frame["trial_id"].tolist() == ["a", "b", "c"]
    assert {name: str(kind) for name, kind in frame.dtypes.items()} == {
        name: str(pd.Series(dtype=kind).dtype) for name, kind in COLUMNS.items()
    }


def test_an_empty_frame_has_the_columns_too(tmp_path):
    assert list(Store(tmp_path).frame(["a"]).columns) == list(COLUMNS)


def test_rows_are_plain_json_lines(tmp_path):
    with Store(tmp_path) as store:
        store.add(row("a", level=0.5))
    lines = [json.loads(line) for line in store.path.read_text().splitlines()]
    assert [line["level"] for line in lines] == [0.5]
