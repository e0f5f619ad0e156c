import os
import shutil

import pandas as pd
import pytest

from studies.planning.trial import COLUMNS
from studies.storage import ROWS_FILE, TABLE_FILE, RowStore, find_reusable, read_reusable
from tests.studies.storage.example_rows import row


def write_table(store, trial_ids):
    path = store.path.with_name(TABLE_FILE)
    store.frame(trial_ids, COLUMNS).to_parquet(path)
    after = store.path.stat().st_mtime_ns + 10**9
    os.utime(path, ns=(after, after))


@pytest.mark.parametrize("kept", [ROWS_FILE, TABLE_FILE])
def test_successful_rows_are_found_in_other_folders_each_once(tmp_path, kept):
    for name in ("one", "two"):
        with RowStore(tmp_path / name) as store:
            store.add(row("a", level=0.25, error='"status": "ok"'), row("b", status="failed"), row(name, n_faces=7))
            write_table(store, ["a", "b", name])
        if kept != ROWS_FILE:
            store.path.unlink()
    shutil.copytree(tmp_path / "one", tmp_path / "one.before-20200101T000000")
    found = find_reusable(tmp_path, tmp_path / "mine", ["a", "b", "one", "two", "x"])
    assert found == {tmp_path / "one" / kept: {"a", "one"}, tmp_path / "two" / kept: {"two"}}
    rows = {row["trial_id"]: row for path, ids in found.items() for row in read_reusable(path, ids)}
    assert [rows[trial_id]["level"] for trial_id in ("a", "one", "two")] == [0.25, None, None]
    assert rows["two"]["n_faces"] == 7


def test_rows_of_an_earlier_plan_are_found_although_the_table_does_not_have_them(tmp_path):
    with RowStore(tmp_path / "other") as store:
        store.add(row("a"), row("b"))
        store.write_plan(["b"])
        write_table(store, ["b"])
    found = find_reusable(tmp_path, tmp_path / "mine", ["a", "b"])
    assert found == {store.path: {"a", "b"}}
    assert sorted(row["trial_id"] for row in read_reusable(store.path, {"a", "b"})) == ["a", "b"]


def test_the_rows_and_not_an_older_table_are_searched(tmp_path):
    with RowStore(tmp_path / "other") as store:
        store.write_plan(["a"])
        store.add(row("a", status="failed"))
        store.frame(["a"], COLUMNS).to_parquet(tmp_path / "other" / TABLE_FILE)
        os.utime(tmp_path / "other" / TABLE_FILE, ns=(0, 0))
        store.add(row("a"))
    assert find_reusable(tmp_path, tmp_path / "mine", ["a"]) == {store.path: {"a"}}


def test_a_folder_does_not_find_its_own_rows_but_its_own_table_if_there_are_none(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a"))
        write_table(store, ["a"])
    assert find_reusable(tmp_path, tmp_path, ["a"]) == {}
    store.path.unlink()
    assert find_reusable(tmp_path, tmp_path, ["a"]) == {tmp_path / TABLE_FILE: {"a"}}


@pytest.mark.parametrize("content", [b"PAR1", b"", b"some text" * 100, {"x": [1]}, {"trial_id": [1], "status": [2]}])
@pytest.mark.parametrize("has_rows", [False, True])
def test_a_table_of_something_else_is_no_source_of_rows(tmp_path, content, has_rows):
    (tmp_path / "other").mkdir()
    if has_rows:
        with RowStore(tmp_path / "other") as store:
            store.add(row("b"))
            store.write_plan(["b"])
    path = tmp_path / "other" / TABLE_FILE
    if isinstance(content, bytes):
        path.write_bytes(content)
    else:
        pd.DataFrame(content).to_parquet(path)
    expected = {tmp_path / "other" / ROWS_FILE: {"b"}} if has_rows else {}
    assert find_reusable(tmp_path, tmp_path / "mine", ["a", "b"]) == expected
