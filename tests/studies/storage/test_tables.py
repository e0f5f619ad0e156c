import os
import signal
import subprocess
import sys

import numpy as np
import pandas as pd
import pyarrow.parquet
import pytest

from studies.planning.trial_ids import TrialIds
from studies.storage import RowStore, read_table, rows, tables
from studies.storage.folders import move_to_backup, result_folders
from studies.storage.reuse import find_reusable, read_reusable
from studies.storage.statuses import Statuses
from tests.studies.storage.example_rows import row

ROWS = pd.DataFrame(
    {"trial_id": [f"{i:024x}" for i in range(10)], "status": "ok", "model": list("aaaabbbbcc"), "x": 0.5}
)


@pytest.fixture
def small_parts(monkeypatch):
    monkeypatch.setattr(tables, "MOST_ROWS", 4)
    monkeypatch.setattr(tables, "ROWS_PER_PART", 3)


def test_a_table_of_few_rows_is_one_file_and_of_many_a_folder_with_the_same_rows(tmp_path, small_parts):
    path = tmp_path / "trials.parquet"
    for frame in (ROWS[:4], ROWS, ROWS[:3], ROWS[2:]):
        tables.write_table(path, frame)
        assert path.is_dir() == (len(frame) > 4)
        pd.testing.assert_frame_equal(pd.read_parquet(path), frame.reset_index(drop=True))
    assert [each.name for each in tmp_path.iterdir()] == ["trials.parquet"]
    assert len(tables.table_files(path)) == 3


def test_rows_in_any_order_are_written_in_that_of_the_plan_and_later_ones_replace_earlier_ones(tmp_path, small_parts):
    order = np.random.default_rng(0).permutation(10)
    outdated = ROWS.iloc[[4, 7]].assign(status="failed")
    batches = [(outdated, np.array([4, 7])), *((ROWS.iloc[part], part) for part in np.split(order, [3, 4]))]
    tables.write_in_order(tmp_path / "trials.parquet", iter(batches))
    pd.testing.assert_frame_equal(pd.read_parquet(tmp_path / "trials.parquet"), ROWS)
    assert [each.name for each in (tmp_path / "trials.parquet").iterdir() if each.suffix != ".parquet"] == []


def test_pyarrow_reads_the_same_rows_of_a_folder(tmp_path, small_parts):
    path = tmp_path / "trials.parquet"
    tables.write_table(path, ROWS)
    assert pyarrow.parquet.read_table(path).to_pylist() == ROWS.to_dict("records")


def test_polars_reads_the_same_rows_of_a_folder(tmp_path, small_parts):
    polars = pytest.importorskip("polars", reason="polars is not installed")
    path = tmp_path / "trials.parquet"
    tables.write_table(path, ROWS)
    assert polars.scan_parquet(path).collect().to_dicts() == ROWS.to_dict("records")


def test_duckdb_reads_the_same_rows_of_a_folder(tmp_path, small_parts):
    duckdb = pytest.importorskip("duckdb", reason="duckdb is not installed")
    path = tmp_path / "trials.parquet"
    tables.write_table(path, ROWS)
    assert duckdb.read_parquet(f"{path}/*.parquet").df().to_dict("records") == ROWS.to_dict("records")


def test_a_folder_counts_as_the_table_of_its_results(tmp_path, small_parts):
    folder = tmp_path / "study"
    folder.mkdir()
    path = folder / "trials.parquet"
    tables.write_table(path, ROWS)
    assert result_folders(tmp_path) == [folder]
    assert rows.count_table_rows(path) == 10
    assert rows.read_table_columns(path, ["x", "absent", "model"]) == {"x": [0.5] * 10, "model": list("aaaabbbbcc")}
    wanted = ROWS["trial_id"].tolist()[2:8]
    assert find_reusable(tmp_path, tmp_path / "other", [*wanted, "f" * 24]) == {path: set(wanted)}
    assert [each["trial_id"] for each in read_reusable(path, wanted)] == wanted
    moved = move_to_backup(folder)
    assert [each.name for each in moved.iterdir()] == ["trials.parquet"]
    assert not list(folder.iterdir())


def test_columns_that_are_left_out_are_missing_values(tmp_path, small_parts):
    from studies.columns import Column

    tables.write_table(tmp_path / "trials.parquet", ROWS)
    columns = [Column(name=name, dtype="string") for name in ("trial_id", "status", "model")]
    frame = read_table(tmp_path / "trials.parquet", columns, without=["model"])
    assert frame["model"].isna().all()
    assert frame["status"].tolist() == ["ok"] * 10


KILLED = """
import os, signal, sys
import pandas as pd
from pathlib import Path
from studies.storage import tables
tables.ROWS_PER_PART, tables.MOST_ROWS = 3, 4
path = Path(sys.argv[1])
rows = pd.read_parquet(path).assign(x=7.0)
moment = sys.argv[2]
def kill(*_, **__):
    os.kill(os.getpid(), signal.SIGKILL)
if moment == "between two parts":
    original = tables._part
    tables._part = lambda folder, number: kill() if number == 1 else original(folder, number)
else:
    original = tables._put_aside
    tables._put_aside = lambda path: (original(path), kill())
tables.write_table(path, rows)
"""


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs a signal that no process can catch")
@pytest.mark.parametrize("moment", ["between two parts", "after the old table was put aside"])
def test_a_kill_while_a_folder_is_written_leaves_the_old_table_or_none_and_the_next_one_is_whole(
    tmp_path, small_parts, moment
):
    path = tmp_path / "trials.parquet"
    with RowStore(tmp_path) as store:
        store.add(*(row(f"{i:024x}") for i in range(10)))
    tables.write_table(path, ROWS)
    killed = subprocess.run([sys.executable, "-c", KILLED, str(path), moment], env=os.environ, check=False)
    assert killed.returncode == -signal.SIGKILL
    if moment == "between two parts":
        pd.testing.assert_frame_equal(pd.read_parquet(path), ROWS)
    else:
        assert not path.exists()
    with RowStore(tmp_path) as store:
        assert list(store.status) == ROWS["trial_id"].tolist()
    tables.write_table(path, ROWS)
    pd.testing.assert_frame_equal(pd.read_parquet(path), ROWS)
    assert not [each for each in tmp_path.iterdir() if each.name.endswith((".part", ".old"))]


def test_statuses_are_those_of_a_dict_whether_packed_or_not(monkeypatch):
    monkeypatch.setattr("studies.storage.statuses.PACKED_FROM", 7)
    rng, statuses, expected = np.random.default_rng(0), Statuses(), {}
    for _ in range(30):
        ids = [f"{i:024x}" for i in rng.integers(0, 60, rng.integers(1, 9))]
        states = rng.choice(["ok", "failed", "timeout"], len(ids)).tolist()
        if rng.random() < 0.5:
            statuses.add(TrialIds(ids), states)
        else:
            for trial_id, state in zip(ids, states, strict=True):
                statuses[trial_id] = state
        expected.update(zip(ids, states, strict=True))
        assert list(statuses.items()) == list(expected.items())
        assert len(statuses) == len(expected)
        asked = [f"{i:024x}" for i in range(70)]
        codes = statuses.of(TrialIds(asked))
        assert (codes == 0).tolist() == [expected.get(each) == "ok" for each in asked]
        assert (codes < 0).tolist() == [each not in expected for each in asked]


@pytest.mark.parametrize(
    "damage",
    [
        b"", b"\xff\xfe\n", b"[]\n", b"\n", b'{"trial_id": "a"}\n', b'{"trial_id": ["a"], "status": "ok"}\n',
        b'{"tri\n',
        b'{"trial_id": "n", "status": "ok", "level": NaN}\n', b'{"trial_id": "s", "status": "ok", "seconds": "x"}\n',
        b'{"trial_id": "u", "status": "ok", "error": "\\ud83d"}\n',
        b'{"trial_id": "v", "status": "ok", "error": "\\uDC00", "seconds": 3}\n',
        b'{"trial_id": "last", "status": "ok"}',
    ],
)  # fmt: skip
def test_a_large_file_is_read_as_a_small_one_is(tmp_path, monkeypatch, damage):
    with RowStore(tmp_path) as store:
        store.add(*(row(f"{i % 40:024x}", status="ok" if i % 3 else "failed", seconds=i / 7) for i in range(60)))
    lines = store.path.read_bytes().splitlines(keepends=True)
    store.path.write_bytes(b"".join([*lines[:30], damage, *lines[30:]] if damage.endswith(b"\n") else [*lines, damage]))
    small = rows.StoredRows(tmp_path)
    monkeypatch.setattr(rows, "_LARGE", 0)
    monkeypatch.setattr(rows, "_BLOCK", 6_000)
    large = rows.StoredRows(tmp_path)
    assert list(large.status.items()) == list(small.status.items())
    assert (large.damaged, large.seconds) == (small.damaged, pytest.approx(small.seconds))


def test_a_large_file_is_read_without_pandas_which_takes_longer_to_import(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(*(row(f"{i:024x}", seconds=1.0) for i in range(9)))
    code = (
        "import sys; from studies.storage import rows; rows._LARGE = 0; "
        f"print(len(rows.StoredRows({str(tmp_path)!r}).status), 'pyarrow' in sys.modules, 'pandas' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], env=os.environ, check=True, capture_output=True, text=True)
    assert done.stdout == "9 True False\n"
