"""Where results go: the same study going on adds to its folder, and nothing else ever writes over it."""

import functools
import json
import shutil
import sys
import zipfile

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

import studies
from studies import status
from studies.execution.study import run_study
from studies.figures import drawing
from studies.planning.names import MAX_BYTES
from studies.planning.trial import TIMINGS
from studies.segmenters.segmenter import _method
from tests.helpers.meshes import bundled
from tests.studies.conftest import STUDY, configured_with
from tests.studies.test_survival import FOLDER


@pytest.fixture(scope="module", autouse=True)
def quick_charts():
    """Charts are written as text: these tests are about which of them are written, and where."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(drawing, "draw", lambda chart: chart)
        monkeypatch.setattr(drawing, "save", lambda chart, path, *content: path.write_text(f"{chart} {content}"))
        yield


@functools.cache
def animals():
    """Three meshes, and others of the same names in a folder of their own: file -> content."""
    found = {}
    for i, name in enumerate(("ant", "bee", "fly")):
        mesh = bundled("ant")
        mesh.vertices *= [1, 1, 1 + i]
        found[f"{name}.off"] = mesh.export(file_type="off")
        mesh.vertices *= [1, 2, 1]
        found[f"others/{name}.off"] = mesh.export(file_type="off")
    return found


def write_animals(folder):
    (folder / "others").mkdir()
    for name, content in animals().items():
        (folder / name).write_text(content)


@pytest.fixture
def herd(here):
    """Three files in the current folder, next to a folder with others of the same names."""
    write_animals(here)
    return here


def run_in_current_folder(*words, results="results"):
    """The results of a small study of the three files."""
    where = () if results is None else (f"results_dir={results}",)
    chosen = configured_with(*STUDY, "engine=serial", "dataset.glob=*.off", "repeats=2", *where, *words)
    return run_study(chosen, Console()).results


@pytest.fixture
def ran(herd):
    """A function: options -> the results of a small study of the three files."""
    return run_in_current_folder


@pytest.fixture(scope="module")
def usual(tmp_path_factory):
    """The results of the small study without options, run once."""
    folder = tmp_path_factory.mktemp("usual")
    write_animals(folder)
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.chdir(folder)
        run_in_current_folder()
    return folder / "results"


@pytest.fixture
def whole(herd, usual):
    """The three files, and the results of the small study without options."""
    shutil.copytree(usual, herd / "results")
    return herd


def files(folder, *, below=False):
    """The content of the files of a results folder that show something."""
    paths = folder.rglob("*") if below else folder.iterdir()
    return {path: path.read_bytes() for path in paths if path.is_file() and path.suffix not in (".jsonl", ".lock")}


def stored(folder):
    return pd.read_parquet(folder / "trials.parquet")


@pytest.mark.parametrize(
    ("words", "name"),
    [
        (["+segmenter.seconds=0.001"], "segmenter.seconds=0.001"),
        (["segmenter._target_=tests.helpers.segmenting.hostile"], "segmenter=hostile"),
        (["perturbation.unit=bounding_box_diagonal"], "perturbation.unit=bounding_box_diagonal"),
        (["perturbation.distribution=uniform", "levels=[0.1]"], "perturbation.distribution=uniform"),
        (["dataset.weld=exact"], "dataset.weld=exact"),
        (["dataset.glob=others/*.off"], "dataset.glob=others_"),
        (["dataset.glob=others/*.off", "levels=[0.1]", "repeats=1"], "dataset.glob=others_"),
        (["dataset.glob=others/ant.off"], "dataset.glob=others_ant.off"),
    ],
)  # fmt: skip
def test_another_method_perturbation_or_dataset_has_a_folder_of_its_own(ran, whole, words, name):
    folder = whole / "results" / FOLDER
    before = files(folder)
    other = ran(*words)
    assert other.folder.parent == folder.relative_to(whole)
    assert other.folder.name.startswith(name)
    assert before == files(folder)
    assert len(stored(other.folder)) == len(other.rows)
    again = ran(*words)
    assert again.folder == other.folder
    assert ran().folder == folder.relative_to(whole)
    assert before == files(folder)


def test_the_first_study_of_an_empty_folder_has_the_usual_place_whatever_its_options_are(ran):
    assert ran("+segmenter.seconds=0.001", "perturbation.distribution=uniform").folder.as_posix() == f"results/{FOLDER}"
    assert ran().folder.name == "segmenter.seconds=0,perturbation.distribution=gaussian"


@pytest.mark.parametrize(
    ("words", "name", "n"),
    [
        (["levels=[0.2]"], "levels=[0.2]", 6),
        (["repeats=1"], "repeats=1", 6),
        (["dataset.glob=b*.off"], "dataset.glob=b", 4),
        (["dataset.glob=fly.off", "levels=[0.1]", "repeats=1"], "dataset.glob=fly.off,levels=[0.1],repeats=1", 1),
    ],
)
def test_a_part_is_shown_on_its_own_and_the_whole_stays(ran, whole, capsys, words, name, n):
    folder = whole / "results" / FOLDER
    before = files(folder)
    capsys.readouterr()
    part = ran(*words)
    said = " ".join(capsys.readouterr().out.split())
    assert f"the other {12 - n} trials stay" in said
    assert f"{n} of them stored already" in said
    assert before == files(folder)
    assert part.folder.name.startswith(name)
    assert len(part.rows) == len(stored(part.folder)) == n
    assert set(part.rows["trial_id"]) < set(stored(folder)["trial_id"])
    assert ran().folder.name == "files"
    assert before == files(folder)


def test_a_part_says_of_how_many(ran, whole, capsys):
    capsys.readouterr()
    part = ran("dataset.glob='[ab]*.off'", "levels=[0.2]")
    assert "(2 of 3 models, 1 of 2 levels)" in " ".join(capsys.readouterr().out.split())
    assert part.title == "Normal noise on files: halves, 2 of 3 models"
    assert (part.folder / "table.md").read_text().startswith(f"# {part.title}\n")
    assert (part.folder / "normal_noise.png").exists()
    assert studies.load(part.folder).rows["model"].unique().tolist() == ["ant", "bee"]


def test_the_same_study_going_on_adds_to_its_folder(ran, herd):
    folder = herd / "results" / FOLDER
    ran("levels=[0.2]", "repeats=1", "dataset.glob=ant.off")
    for words, n in (
        (["levels=[0.2]", "repeats=2", "dataset.glob=ant.off"], 2),  # more repeats
        (["levels=[0.1,0.2]", "repeats=2", "dataset.glob=ant.off"], 4),  # more levels
        (["levels=[0.1,0.2]", "repeats=2"], 12),  # more models
        (["levels=[0.3]", "repeats=1"], 15),  # other levels
        (["levels=[0.2]", "repeats=1"], 15),  # fewer
        (["levels=[0.2]", "repeats=3", "dataset.glob=fly.off"], 16),  # more repeats of fewer models
    ):
        ran(*words)
        rows = stored(folder)
        assert len(rows) == n, words
        assert rows["trial_id"].is_unique
        assert studies.load(folder).tables["table"]["n"].sum() == n
    assert rows["level"].unique().tolist() == [0.1, 0.2, 0.3]
    whole = ran("levels=[0.1,0.2,0.3]", "repeats=3")
    assert whole.folder.name == "files"
    assert len(stored(folder)) == 27
    pd.testing.assert_frame_equal(
        whole.rows.drop(columns=list(TIMINGS)),
        ran("levels=[0.1,0.2,0.3]", "repeats=3", results="other").rows.drop(columns=list(TIMINGS)),
    )


def test_all_commands_that_made_the_rows_are_kept(ran, herd):
    ran("levels=[0.1]")
    ran("levels=[0.2]")
    whole = studies.load(herd / "results" / FOLDER)
    assert "'levels=[0.2]'" in whole.command
    assert ["'levels=[0.1]'" in command for command in whole.earlier_commands] == [True]
    ran("levels=[0.1,0.2]")
    assert studies.load(herd / "results" / FOLDER).earlier_commands == ()


def test_in_a_fresh_clone_a_part_keeps_the_rows_of_the_whole(ran, whole):
    folder = whole / "results" / FOLDER
    for name in ("trials.jsonl", "planned.txt"):
        (folder / name).unlink()
    shutil.rmtree(folder / "labels", ignore_errors=True)
    before = files(folder)
    assert len(ran("levels=[0.2]", "repeats=1").rows) == 3
    assert before == files(folder)
    assert len(ran("levels=[0.3]", "repeats=1").rows) == 3
    assert len(stored(folder)) == 15


def test_a_study_that_was_killed_is_no_smaller_for_a_part(ran, whole):
    folder = whole / "results" / FOLDER
    lines = (folder / "trials.jsonl").read_text().splitlines(keepends=True)
    (folder / "trials.jsonl").write_text("".join(lines[:5]))
    (folder / "trials.parquet").unlink()
    assert len(ran("dataset.glob=fly.off").rows) == 4
    assert len((folder / "planned.txt").read_text().splitlines()) == 12
    assert len(stored(folder)) == 9
    assert len(ran().rows) == 12


def test_an_edited_mesh_replaces_its_rows_where_all_run_again_and_a_part_leaves_the_whole(ran, whole, capsys):
    folder = whole / "results" / FOLDER
    mesh = bundled("ant")
    mesh.vertices *= [3, 1, 1]
    mesh.export(whole / "bee.off")
    before = files(folder)
    part = ran("levels=[0.1]")
    assert part.folder.parent == folder.relative_to(whole)
    assert "version=" in part.folder.name
    assert before == files(folder)
    capsys.readouterr()
    assert ran().folder == folder.relative_to(whole)
    assert "4 stored rows are of other meshes or code" in capsys.readouterr().out
    assert len(stored(folder)) == 12
    assert before != files(folder)


def test_another_version_of_the_method_never_mixes_with_the_rows_of_the_whole(ran, herd, configured, console):
    (herd / "versioned.py").write_text(
        "class Thirds:\n    algorithm_version = {}\n"
        "    def __call__(self, vertices, faces):\n"
        "        return (vertices[:, 0] > vertices[:, 0].mean()).astype(int)\n"
    )
    source = (herd / "versioned.py").read_text()
    folder = herd / "results" / FOLDER

    def with_version(version, *words):
        (herd / "versioned.py").write_text(source.format(version))
        sys.modules.pop("versioned", None)
        _method.cache_clear()
        return ran("segmenter._target_=versioned.Thirds", *words)

    with_version(1)
    before = files(folder)
    for words in (["levels=[0.1]"], ["levels=[0.7]"]):
        part = with_version(2, *words)
        assert "version=" in part.folder.name
        assert before == files(folder)
    assert with_version(2).folder == folder.relative_to(herd)
    assert json.loads((folder / "provenance.json").read_text())["segmenter_versions"] == {"Thirds": 2}
    assert len(stored(folder)) == 12


@pytest.mark.parametrize("length", [4, 90])
def test_the_name_of_a_folder_is_legal_everywhere(ran, whole, length):
    levels = ",".join(f"{0.1 + i / 1000:.3f}" for i in range(1, length))
    part = ran(f"levels=[{levels}]", "repeats=1", "dataset.glob=a?t.off")
    name = part.folder.name
    assert len(name.encode()) <= MAX_BYTES
    assert not set(name) & set('<>:"/\\|?*')
    assert len(part.rows) == length - 1


def test_a_dry_run_says_where_results_would_go_and_writes_nothing(ran, whole, capsys):
    before = files(whole, below=True)
    capsys.readouterr()
    ran("+segmenter.seconds=0.001", "dry_run=true")
    ran("levels=[0.1]", "dry_run=true")
    said = " ".join(capsys.readouterr().out.split())
    assert "has other results, which stay: these go to results/normal_noise/files/segmenter.seconds=0.001" in said
    assert "the other 6 trials stay" in said
    assert before == files(whole, below=True)


def test_made_and_commit_are_those_of_the_rows(ran, whole):
    path = whole / "results" / FOLDER / "provenance.json"
    then = json.loads(path.read_text()) | {"made": "2020-01-01T00:00:00+00:00", "commit": "0" * 40}
    path.write_text(json.dumps(then, indent=2) + "\n")
    before = path.read_bytes()
    for words in ([], ["gallery.models=1", "title=Noise"], ["levels=[0.1]"]):
        ran(*words)
        assert path.read_bytes() == before, words
    ran("repeats=3")
    now = json.loads(path.read_text())
    assert now["made"] > then["made"]
    assert now["commit"] != then["commit"]


def test_published_results_are_written_to_only_if_they_are_named(ran, whole, capsys):
    (whole / "results" / "PUBLISHED.md").write_text("These results are published.\n")
    before = files(whole / "results", below=True)
    capsys.readouterr()
    for words, n in ((["levels=[0.1]"], 6), (["+segmenter.seconds=0.001"], 12), ([], 12)):
        results = ran(*words, results=None)
        assert results.folder.parts[0] == "runs"
        assert len(results.rows) == n
    said = " ".join(capsys.readouterr().out.split())
    assert "results is published and stays as it is: results go to runs" in said
    assert "6 of them reused from results/normal_noise/files/trials.jsonl" in said
    assert before == files(whole / "results", below=True)
    assert status.main([]) == 0
    assert "segmenter.seconds=0.001" in capsys.readouterr().out
    shutil.move("runs", "elsewhere")
    assert status.main([]) == 0  # of the published results, as in a fresh clone
    assert "segmenter.seconds" not in capsys.readouterr().out
    assert ran("repeats=3").folder.parts[0] == "results"
    assert len(stored(whole / "results" / FOLDER)) == 18


def test_fresh_starts_over_in_the_folder_of_the_same_study_alone(ran, whole):
    before = files(whole / "results" / FOLDER)
    other = ran("+segmenter.seconds=0.001")
    ran("+segmenter.seconds=0.001", "fresh=true", "repeats=1")
    assert len(stored(other.folder)) == 6
    assert before == files(whole / "results" / FOLDER)


def test_another_archive_of_the_same_name_is_another_dataset(configured, tmp_path, psb_zip):
    other = tmp_path / "other" / psb_zip.name
    other.parent.mkdir()
    with zipfile.ZipFile(psb_zip) as archive, zipfile.ZipFile(other, "w") as copy:
        for name in archive.namelist():
            if name.endswith("/off/1.off") or "/seg/Benchmark/1/" in name or name.endswith("off/2.off"):
                data = archive.read(name)
                copy.writestr(name, data + b"\n" if name.endswith(".off") else data)
    words = ("+study=scaling", "levels=[2]", "repeats=1", "engine=serial", "gallery.models=0", "dataset=psb",
             "segmenter=custom", "segmenter._target_=tests.helpers.segmenting.halves", f"results_dir={tmp_path}",
             "dataset.models=[1,2]")  # fmt: skip
    first = run_study(configured(*words, f"dataset.root={psb_zip}"), Console(quiet=True)).results
    table = (first.folder / "trials.parquet").read_bytes()
    second = run_study(configured(*words, f"dataset.root={other}"), Console(quiet=True)).results
    assert second.folder.parent == first.folder
    assert second.folder.name.startswith("dataset-")
    assert (first.folder / "trials.parquet").read_bytes() == table
    assert np.isfinite(second.rows["change_percentage"]).all()
