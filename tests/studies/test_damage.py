"""Names and errors that are not text, and folders that a study did not write: a line each, never the end."""

import json
import os
import shutil
import sys

import pandas as pd
import pytest
from rich.console import Console

import studies
from studies import merge, report, status
from studies.execution.study import run_study
from studies.planning.errors import StudyError
from studies.storage import RowStore, StoredRows
from tests.studies.conftest import STUDY, ant, configured_with, typed
from tests.studies.storage.example_rows import row
from tests.studies.test_survival import FOLDER

SURROGATE = chr(0xDCFC)


@pytest.fixture(scope="module")
def pristine(tmp_path_factory):
    """The folder of a study, run once."""
    folder = tmp_path_factory.mktemp("pristine")
    (folder / "ant.off").write_text(ant())
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        chosen = configured_with(*STUDY, "engine=serial", "results_dir=results", "repeats=1")
        assert run_study(chosen, Console()).complete
    return folder / "results" / FOLDER


@pytest.fixture
def two(pristine, here):
    """The folder of all results, with the same study in two places."""
    shutil.copytree(pristine, here / "results" / FOLDER)
    shutil.copytree(pristine, here / "results" / "zebra" / "files")
    return here / "results"


def not_yaml(folder):
    (folder / "config.yaml").write_text("a: [1\n b: }")


def config_of_bytes(folder):
    (folder / "config.yaml").write_bytes(b"\xff\xfe\x00")


def config_of_something_else(folder):
    (folder / "config.yaml").write_text("services: {web: {image: nginx}}\n")


def empty_config(folder):
    (folder / "config.yaml").write_text("")


def another_experiment(folder):
    path = folder / "config.yaml"
    path.write_text(path.read_text().replace("studies.experiments.Change", "studies.experiments.Alchemy"))


def provenance_cut(folder):
    (folder / "provenance.json").write_text('{"command": "py')


def provenance_list(folder):
    (folder / "provenance.json").write_text("[1, 2]")


def foreign_table(folder):
    (folder / "trials.jsonl").unlink()
    pd.DataFrame({"x": [1]}).to_parquet(folder / "trials.parquet")


def table_of_other_types(folder):
    (folder / "trials.jsonl").unlink()
    pd.DataFrame({"trial_id": [[1], [2]], "status": [["ok"], ["ok"]], "level": ["a", "b"]}).to_parquet(
        folder / "trials.parquet"
    )


def table_cut(folder):
    (folder / "trials.jsonl").unlink()
    path = folder / "trials.parquet"
    path.write_bytes(path.read_bytes()[:-100])


def table_empty(folder):
    (folder / "trials.jsonl").unlink()
    (folder / "trials.parquet").write_bytes(b"")


def rows_of_other_types(folder):
    with (folder / "trials.jsonl").open("a") as file:
        for trial_id in (folder / "planned.txt").read_text().splitlines():
            file.write(json.dumps({"trial_id": trial_id, "status": "ok", "level": "high", "repeat": {}}) + "\n")


CONFIGS = [not_yaml, config_of_bytes, config_of_something_else, empty_config, another_experiment]
TABLES = [foreign_table, table_of_other_types, table_cut, table_empty, rows_of_other_types]
ORIGINS = [provenance_cut, provenance_list]


@pytest.mark.parametrize("spoil", [*CONFIGS, *TABLES, *ORIGINS])
def test_report_and_load_name_the_folder_that_they_cannot_read(two, capsys, spoil):
    spoil(two / "zebra" / "files")
    capsys.readouterr()
    assert report.main([str(two)]) == 0
    said = capsys.readouterr()
    (line,) = [line for line in said.out.splitlines() if line.startswith("zebra/files: cannot be read: ")]
    assert len(line) > 45
    assert "Traceback" not in said.out + said.err
    assert "Normal noise (files)" in (two / "README.md").read_text()
    with pytest.raises(StudyError if spoil in CONFIGS + ORIGINS else ValueError, match=r"files|stored rows"):
        studies.load(two / "zebra" / "files")
    assert len(studies.load(two / FOLDER).rows) == 2


@pytest.mark.parametrize("spoil", TABLES[:-1])
def test_status_names_the_folder_that_it_cannot_read(two, capsys, spoil):
    spoil(two / "zebra" / "files")
    capsys.readouterr()
    assert status.main([str(two)]) == 0
    said = capsys.readouterr().out
    assert FOLDER in said
    assert ("zebra/files: cannot be read: " in said) is (spoil is not table_of_other_types) or "zebra" in said


@pytest.mark.parametrize("spoil", [*CONFIGS, *TABLES, *ORIGINS])
def test_merge_refuses_a_folder_that_it_cannot_read_in_one_line(two, capsys, spoil):
    spoil(two / "zebra" / "files")
    before = {path: path.read_bytes() for path in (two / FOLDER).rglob("*") if path.is_file()}
    capsys.readouterr()
    assert merge.main([str(two / FOLDER), str(two / "zebra" / "files")]) == 2
    said = capsys.readouterr().err
    assert said.startswith("studies.merge: error: ")
    assert said.count("\n") == 1
    assert before == {path: path.read_bytes() for path in (two / FOLDER).rglob("*") if path.is_file()}


def test_a_study_runs_beside_folders_that_cannot_be_read(two, study):
    for i, spoil in enumerate([*CONFIGS, *TABLES]):
        shutil.copytree(two / "zebra" / "files", two / f"odd{i}" / "files")
        spoil(two / f"odd{i}" / "files")
    assert study("repeats=2")


def test_load_says_that_there_are_no_rows(two):
    for name in ("trials.jsonl", "trials.parquet"):
        (two / "zebra" / "files" / name).unlink()
    with pytest.raises(StudyError, match=r"zebra/files has neither trials\.parquet nor trials\.jsonl"):
        studies.load(two / "zebra" / "files")


def test_text_that_no_file_can_hold_is_stored_with_backslashes(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a", error=f"K{SURROGATE}che", model="Küche"))
    (stored,) = StoredRows(tmp_path)
    assert (stored["error"], stored["model"]) == ("K\\udcfcche", "Küche")


def test_rows_that_an_earlier_version_poisoned_can_be_read(tmp_path):
    with RowStore(tmp_path) as store:
        store.add(row("a"))
    with store.path.open("a") as file:
        file.write(json.dumps(row("b", status="failed", error=f"{SURROGATE}")) + "\n")
    assert [each["error"] for each in StoredRows(tmp_path)] == [None, "\\udcfc"]


@pytest.mark.skipif(sys.platform != "linux", reason="file names of other systems are always text")
def test_a_study_of_a_file_whose_name_is_not_text_stays_readable(here, capsys):
    os.rename(b"ant.off", b"K\xfcche.off")
    words = [word for word in STUDY if not word.startswith("dataset.glob")]
    done = typed(here, *words, "dataset.glob=*.off", "repeats=1", "gallery.models=1", f"title=Pe{SURROGATE}")
    assert done.returncode == 0, done.stderr
    assert (here / "results" / FOLDER / "gallery.png").exists()
    rows = pd.read_parquet(here / "results" / FOLDER / "trials.parquet")
    assert set(rows["model"]) == {"K\\udcfcche"}
    assert status.main(["results"]) == 0
    assert report.main(["results"]) == 0
    assert "K\\udcfcche" in json.loads((here / "results" / FOLDER / "provenance.json").read_text())["meshes_sha256"]
    again = typed(here, *words, "dataset.glob=*.off", "repeats=1")
    assert "2 of them stored already" in again.stdout


def halves_or_not_text(vertices, faces):
    raise ValueError(f"no mesh K{SURROGATE}che")


def test_an_error_whose_text_is_not_text_is_a_row(study):
    assert not study("repeats=1", f"segmenter._target_={__name__}.halves_or_not_text")
    rows = pd.read_parquet(f"results/{FOLDER}/trials.parquet")
    assert set(rows["error"]) == {"ValueError: no mesh K\\udcfcche"}
    assert report.main(["results"]) == 0
