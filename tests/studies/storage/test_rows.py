import json
import shutil

import pandas as pd
import pytest
from studies.storage.store import Rows, Store

from studies.planning.trial import COLUMNS
from studies.storage import store


def row(trial_id, **values):
    return dict.fromkeys(COLUMNS) | {"trial_id": trial_id, "status": "ok", "repeat": 0, "seed": 1} | values


def test_rows_are_on_disk_before_the_store_is_closed(tmp_path):
    with Store(tmp_path) as held:
        held.add(row("a", change_percentage=0.1 + 0.2))
        assert Rows(tmp_path).frame(["a"])["change_percentage"].tolist() == [0.1 + 0.2]


def test_a_later_row_replaces_an_earlier_one(tmp_path):
    with Store(tmp_path) as held:
        held.add(row("a", status="failed"))
        held.add(row("b"))
        held.add(row("a", status="ok"))
    assert Rows(tmp_path).status == {"a": "ok", "b": "ok"}
    assert Rows(tmp_path).frame(["a", "b"])["status"].tolist() == ["ok", "ok"]


def test_a_row_cut_at_any_byte_loses_that_row_only_and_the_next_one_is_whole(tmp_path):
    with Store(tmp_path) as held:
        held.add(row("a"))
        held.add(row("b"))
    content = held.path.read_bytes()
    first = content.index(b"\n") + 1
    for cut in range(first, len(content) - 1, 37):
        held.path.write_bytes(content[:cut])
        with Store(tmp_path) as again:
            assert set(again.status) == {"a"}
            assert again.damaged == (cut > first)
            again.add(row("c"))
        assert set(Rows(tmp_path).status) == {"a", "c"}


@pytest.mark.parametrize("line", [b"\xff\xfe\n", b"[]\n", b"{}\n", b"null\n", b"\n", b'{"trial_id": "a"}\n'])
def test_a_line_that_is_no_row_is_counted_and_left_out(tmp_path, line):
    (tmp_path / "trials.jsonl").write_bytes(line)
    with Store(tmp_path) as held:
        assert (held.damaged, held.status) == (1, {})
        held.add(row("b"))
    assert Rows(tmp_path).status == {"b": "ok"}


def test_the_frame_has_the_columns_and_types_and_the_order_asked_for(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "_BATCH", 2)
    with Store(tmp_path) as held:
        held.add_all(row(name) for name in "cabd")
        frame = held.frame(["a", "b", "x", "c"])
    assert frame["trial_id"].tolist() == ["a", "b", "c"]
    assert {name: str(kind) for name, kind in frame.dtypes.items()} == {
        name: str(pd.Series(dtype=kind).dtype) for name, kind in COLUMNS.items()
    }


def test_an_empty_frame_has_the_columns_too(tmp_path):
    assert list(Rows(tmp_path).frame(["a"]).columns) == list(COLUMNS)


def test_rows_are_plain_json_lines(tmp_path):
    with Store(tmp_path) as held:
        held.add(row("a", level=0.5))
    lines = [json.loads(line) for line in held.path.read_text().splitlines()]
    assert [line["level"] for line in lines] == [0.5]


def test_what_was_there_is_moved_aside_and_not_what_other_studies_have_below(tmp_path):
    folder = tmp_path / "psb"
    for path in (folder, folder / "segmenter.time=2"):
        with Store(path) as held:
            held.add(row("a"))
    with Store(folder, fresh=True) as held:
        assert held.status == {}
    assert Rows(held.aside).status == Rows(folder / "segmenter.time=2").status == {"a": "ok"}
    assert held.aside.parent == tmp_path
    assert store.folders(tmp_path) == [folder, folder / "segmenter.time=2"]


def test_a_new_folder_has_nothing_to_move_aside(tmp_path):
    with Store(tmp_path / "new", fresh=True) as held:
        assert held.aside is None
    assert [path.name for path in tmp_path.iterdir()] == ["new"]


@pytest.mark.parametrize("kept", [store.ROWS, store.TABLE])
def test_rows_that_gave_a_figure_are_found_in_other_folders_each_once(tmp_path, kept):
    for name in ("one", "two"):
        with Store(tmp_path / name) as held:
            held.add(row("a", level=0.25, error='"status": "ok"'), row("b", status="failed"), row(name, n_faces=7))
            held.frame(["a", "b", name]).to_parquet(tmp_path / name / store.TABLE)
        if kept != store.ROWS:
            held.path.unlink()
    shutil.copytree(tmp_path / "one", tmp_path / "one.before-20200101T000000")
    found = store.elsewhere(tmp_path, tmp_path / "mine", ["a", "b", "one", "two", "x"])
    assert found == {tmp_path / "one" / kept: {"a", "one"}, tmp_path / "two" / kept: {"two"}}
    rows = {row["trial_id"]: row for path, ids in found.items() for row in store.fetch(path, ids)}
    assert [rows[trial_id]["level"] for trial_id in ("a", "one", "two")] == [0.25, None, None]
    assert rows["two"]["n_faces"] == 7


def test_a_folder_does_not_find_its_own_rows_but_its_own_table_where_there_are_none(tmp_path):
    with Store(tmp_path) as held:
        held.add(row("a"))
        held.frame(["a"]).to_parquet(tmp_path / store.TABLE)
    assert store.elsewhere(tmp_path, tmp_path, ["a"]) == {}
    held.path.unlink()
    assert store.elsewhere(tmp_path, tmp_path, ["a"]) == {tmp_path / store.TABLE: {"a"}}


def test_a_table_of_something_else_is_no_source_of_rows(tmp_path):
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
    pd.DataFrame({"x": [1]}).to_parquet(tmp_path / "a" / store.TABLE)
    (tmp_path / "b" / store.TABLE).write_bytes(b"PAR1")
    assert store.elsewhere(tmp_path, tmp_path / "mine", ["a"]) == {}


def test_a_file_is_replaced_when_it_is_whole_or_not_at_all(tmp_path):
    path = tmp_path / "table.csv"
    path.write_text("old")
    with pytest.raises(UnicodeEncodeError), store.replacing(path) as part:
        part.write_text("half \ud800")
    assert path.read_text() == "old"
    with store.replacing(path) as part:
        part.write_text("new")
        assert path.read_text() == "old"
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]
