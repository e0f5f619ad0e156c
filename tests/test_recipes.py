"""The recipes of CONTRIBUTING.md, followed literally in a fresh copy of the repository."""

import shlex
import shutil
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

from tests.helpers.documents import ROOT, blocks, section
from tests.helpers.interpreter import COMPILED, Interpreter

CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")


def git(folder, *words):
    identity = ("-c", "user.name=tests", "-c", "user.email=tests@localhost", "-c", "commit.gpgsign=false")
    return subprocess.run(["git", *identity, *words], cwd=folder, check=True, capture_output=True, text=True).stdout


@pytest.fixture(scope="module")
def fresh_copy(tmp_path_factory):
    """A copy of the repository as git has it, without results, and with what numba has compiled already."""
    copy = tmp_path_factory.mktemp("recipes") / "repository"
    files = [Path(name) for name in git(ROOT, "ls-files", "--cached", "--others", "--exclude-standard").splitlines()]
    compiled = [path.relative_to(ROOT) for path in ROOT.glob("heatwalk/**/__pycache__/*.nb?")]
    for path in [*files, *compiled]:
        if path.parts[0] != "results" and (ROOT / path).is_file():
            (copy / path).parent.mkdir(parents=True, exist_ok=True)
            shutil.copy2(ROOT / path, copy / path)
    git(copy, "init", "--quiet")
    git(copy, "add", "--all")
    git(copy, "commit", "--quiet", "--message=A fresh copy")
    return copy


@pytest.fixture(scope="module")
def interpreter(fresh_copy):
    """Runs the commands of recipes; of the copy it has imported what no recipe changes."""
    interpreter = Interpreter(fresh_copy, COMPILED)
    yield interpreter
    interpreter.close()


@pytest.fixture
def repository(fresh_copy):
    """The copy as it was committed; what numba compiles stays for the next test."""
    yield fresh_copy
    git(fresh_copy, "reset", "--hard", "--quiet")
    git(fresh_copy, "clean", "-d", "--force", "--quiet")
    shutil.rmtree(fresh_copy / "mine", ignore_errors=True)


@pytest.fixture
def follow(repository, interpreter):
    """A function: heading of a recipe, folder -> writes its files and runs its commands there; what each prints."""

    def run(heading, folder=repository):
        recipe = blocks(section(CONTRIBUTING, heading))
        files = [block for block in recipe if block.title]
        for block in files:
            path = folder / block.title
            assert not path.exists()
            path.parent.mkdir(exist_ok=True, parents=True)
            path.write_text(block.text, encoding="utf-8")
        lint(repository, folder, [block.title for block in files if block.language == "python"])
        printed = [
            run_command(line, interpreter, folder)
            for block in recipe if block.language == "sh"
            for line in block.text.splitlines()
        ]  # fmt: skip
        if folder == repository:
            assert changed(repository) == {block.title for block in files}
        else:
            assert changed(repository) == set()
            assert {path.name for path in folder.iterdir()} - {"__pycache__", "mine"} == {
                Path(block.title).parts[0] for block in files
            }
        return printed

    return run


def lint(repository, folder, names):
    """The project's own rules for the files of a recipe."""
    for words in (["check"], ["format", "--check"]):
        words = ["ruff", *words, "--no-cache", "--config", repository / "pyproject.toml", *names]
        done = subprocess.run([sys.executable, "-m", *words], cwd=folder, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr


def run_command(line, interpreter, folder):
    program, *words = shlex.split(line)
    assert program == "python"
    done = interpreter.run(words, folder, {"COLUMNS": "120"})
    assert done.returncode == 0, f"{line}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def changed(repository):
    """Paths that git reports as changed, added or removed."""
    return {line[3:] for line in git(repository, "status", "--porcelain", "--untracked-files=all").splitlines()}


def rows_of(folder):
    rows = pd.read_parquet(folder / "trials.parquet")
    assert (rows["status"] == "ok").all(), rows["error"].tolist()
    return rows


def test_a_perturbation_takes_one_file_and_one_yaml(repository, follow):
    printed, _ = follow("### A perturbation")
    folder = repository / "mine" / "twist" / "bundled"
    rows = rows_of(folder)
    assert rows["level"].tolist() == [15, 45, 90]
    assert set(rows["perturbation"]) == {"twist"}
    assert set(rows["unit"]) == {"degrees"}
    assert {path.name for path in folder.glob("*.png")} == {"twist.png", "gallery.png"}
    assert pd.read_csv(folder / "table.csv")["mean"].tolist() == pytest.approx(
        rows["change_percentage"].tolist(), rel=1e-5
    )
    assert "Twist" in printed


def test_a_segmenter_takes_one_file_and_one_yaml(repository, follow):
    follow("### A segmenter")
    alone = rows_of(repository / "mine" / "slabs" / "shot_noise" / "bundled")
    assert set(alone["segmenter"]) == {"Slabs (count=5)"}
    assert set(alone["n_segments_reference"]) == {5}
    both = repository / "mine" / "both" / "shot_noise" / "bundled"
    by_segmenter = {str(name): rows for name, rows in rows_of(both).groupby("segmenter")}
    assert set(by_segmenter) == {"HeatWalk", "Slabs"}
    assert by_segmenter["HeatWalk"]["seed"].tolist() == by_segmenter["Slabs"]["seed"].tolist()
    assert pd.read_csv(both / "table.csv")["segmenter"].value_counts().to_dict() == {"HeatWalk": 5, "Slabs": 5}


def test_a_metric_takes_one_file(repository, follow):
    printed, _ = follow("### A metric")
    assert "intact %" in printed
    folder = repository / "mine" / "shot_noise" / "bundled"
    rows = rows_of(folder)
    assert rows["intact_segments"].between(0, 100).all()
    assert ((rows["intact_segments"] == 100) == (rows["change_percentage"] == 0)).all()
    table = pd.read_csv(folder / "table.csv")
    assert table["intact_segments"].tolist() == pytest.approx(rows["intact_segments"].tolist(), rel=1e-5)
    assert "| intact % |" in (folder / "table.md").read_text(encoding="utf-8")


def test_a_dataset_takes_one_file_in_a_folder_of_the_user(repository, tmp_path, follow):
    own = tmp_path / "own"
    own.mkdir()
    follow("### A dataset", own)
    assert set(rows_of(own / "mine" / "holes" / "my_shapes")["model"]) == {"capsule-6"}
    rows = rows_of(own / "mine" / "shot_noise" / "my_shapes")
    assert set(rows["model"]) == {"capsule-3", "capsule-5", "capsule-8"}
    assert set(rows["category"]) == {"capsule"}


def test_a_kind_of_experiment_takes_one_folder(repository, tmp_path, follow):
    own = tmp_path / "own"
    own.mkdir()
    printed, again, _ = follow("### A kind of experiment", own)
    assert "Reordering on bundled: HeatWalk, 6 trials" in printed
    assert "6 of them stored already" in again
    folder = own / "mine" / "reordering" / "bundled"
    rows = rows_of(folder)
    assert rows.groupby("model")["seed"].nunique().to_dict() == {"ant": 2, "bunny": 2, "cow": 2}
    assert (rows["n_segments"] == rows["n_segments_reference"]).all()
    assert pd.read_csv(folder / "table.csv")["largest"].tolist() == pytest.approx([0, 0, 0], abs=0.1)
    assert "largest CP %" in printed
