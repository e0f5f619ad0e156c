import json
import os
import re
import subprocess
import sys

import pandas as pd
import pytest

from studies import status
from studies.storage import TABLE_FILE, RowStore, StoredRows, lock_holder, summarize
from tests.studies.conftest import typed_command
from tests.studies.storage.example_rows import row
from tests.studies.test_survival import FOLDER


def lines_of(out):
    """Study -> the other cells of its line."""
    lines = [[cell.strip() for cell in line.strip("│").split("│")] for line in out.splitlines() if "│" in line]
    return {line[0]: line[1:] for line in lines}


def printed(capsys, results="results"):
    assert status.main([str(results)]) == 0
    return capsys.readouterr().out


def test_it_shows_what_is_stored_and_what_runs(study, here, capsys):
    (here / "broken").touch()
    study("repeats=2", "levels=[0.1]")
    (here / "broken").unlink()
    study("repeats=2")
    capsys.readouterr()
    assert lines_of(printed(capsys))[FOLDER][:5] == ["4", "2", "2", "0", "0"]
    folder = here / "results" / FOLDER
    with RowStore(folder) as store:
        store.write_plan([*StoredRows(folder).status, "one more"])
        line = lines_of(printed(capsys))[FOLDER]
        assert line[0] == "5"
        assert line[-1] == f"running: {lock_holder(folder)}"
    assert lines_of(printed(capsys))[FOLDER][-1] == "1 to go"


def test_the_table_gives_the_same_numbers_as_the_rows(study, here):
    study("repeats=2")
    folder = here / "results" / FOLDER
    of_table = summarize(folder)
    assert of_table.statuses == {"ok": 4}
    assert of_table.seconds == pytest.approx(
        pd.read_parquet(folder / TABLE_FILE)[["seconds_perturb", "seconds_segment"]].sum(axis=None), rel=1e-12
    )
    (folder / TABLE_FILE).unlink()
    of_rows = summarize(folder)
    assert of_rows.statuses == of_table.statuses
    assert of_rows.seconds == pytest.approx(of_table.seconds, rel=1e-12)
    assert of_rows.n_planned == of_table.n_planned == 4


def test_rows_of_an_earlier_plan_do_not_count(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a"), row("b"), row("b", status="failed"), row("c", status="timeout"))
        store.write_plan(["b", "c", "d"])
    summary = summarize(tmp_path)
    assert summary.statuses == {"failed": 1, "timeout": 1}
    assert (summary.n_planned, summary.n_missing) == (3, 1)


@pytest.fixture(scope="module")
def large(tmp_path_factory):
    """The folder of a study of a million trials, most of which are to come."""
    folder = tmp_path_factory.mktemp("large")
    ids = [f"{i:x}" for i in range(1_234)]
    with RowStore(folder / "a study with a long name" / "and a dataset with one") as store:
        store.add_all(row(i, seconds_segment=1_000_000.4, status="ok" if i != "0" else "crashed") for i in ids)
        store.write_plan([*ids, *(f"planned {i}" for i in range(1_000_000))])
    return folder


@pytest.mark.parametrize("columns", ["20", "40", "80", "300"])
def test_no_number_is_cut_however_narrow_the_terminal_is(large, columns):
    done = typed_command(large, "studies.status", str(large), columns=columns)
    assert done.returncode == 0, done.stderr
    line = lines_of(done.stdout)["a study with a long name/and a dataset with one"]
    assert line[:6] == ["1,001,234", "1,233", "0", "0", "1", "1,234,000,494"]
    assert re.fullmatch(r"\d{4}-\d\d-\d\d \d\d:\d\d", line[6])
    assert line[7] == "1,000,000 to go"
    assert "…" not in done.stdout


def foreign(folder):
    pd.DataFrame({"x": [1]}).to_parquet(folder / TABLE_FILE)


def cut(folder):
    (folder / TABLE_FILE).write_bytes(b"PAR1")


def plan_is_binary(folder):
    with RowStore(folder) as store:
        store.add(row("a"))
    (folder / "planned.txt").write_bytes(b"\xff\xfe\x00")


@pytest.mark.parametrize("spoil", [foreign, cut, plan_is_binary])
def test_a_folder_that_cannot_be_read_is_a_line_and_not_the_end_of_the_others(tmp_path, capsys, spoil):
    for name in ("a", "z"):
        with RowStore(tmp_path / name / "files") as store:
            store.add(row("1"))
    (tmp_path / "m" / "files").mkdir(parents=True)
    spoil(tmp_path / "m" / "files")
    out = printed(capsys, tmp_path)
    assert lines_of(out).keys() >= {"a/files", "z/files"}
    (line,) = [line for line in out.splitlines() if line.startswith("m/files")]
    assert line.startswith("m/files: cannot be read: ")


def test_damaged_lines_are_left_out(tmp_path, capsys):
    with RowStore(tmp_path / "a") as store:
        store.add(row("1"), row("2", seconds_segment="soon"))
    with store.path.open("ab") as file:
        file.write(json.dumps({"trial_id": 3}).encode() + b"\n\xff\n{")
    assert lines_of(printed(capsys, tmp_path))["a"][:2] == ["2", "2"]


def test_no_results_are_an_error(tmp_path, capsys):
    assert status.main([str(tmp_path)]) == 2
    assert capsys.readouterr().err == f"studies.status: error: no results of a study in {tmp_path}\n"


def test_it_loads_nothing_that_it_does_not_need():
    code = (
        "import sys, studies.status, pyarrow.parquet, filelock, rich.console, rich.table\n"
        "before = set(sys.modules); studies.status.main(['results'])\n"
        "print({name.partition('.')[0] for name in sys.modules} & {'pandas', 'scipy', 'trimesh', 'hydra', 'omegaconf',"
        " 'matplotlib', 'numba', 'heatwalk', 'perturb', 'psutil'}, file=sys.stderr)"
    )
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=True)
    assert done.stderr.splitlines()[-1] == "set()"
