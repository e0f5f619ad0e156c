"""What a new user meets: help, other people's folders, first commands, first failures."""

import os
import subprocess
import sys
from pathlib import Path

import pandas as pd
import pytest

import studies
from studies._own_packages import CONF, _OwnPackages, prefer_own_packages
from studies.planning.help import help_text
from tests.studies.conftest import typed

pytestmark = pytest.mark.usefixtures("charts_as_text")

ROOT = Path(studies.__file__).parents[1]


def command(folder, *words):
    """What a command gives in a folder, with this project behind the folder on the path: CompletedProcess."""
    environment = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "100"}
    return subprocess.run(
        [sys.executable, *words], cwd=folder, env=environment, capture_output=True, text=True, timeout=120
    )


def names(group):
    return sorted(file.stem for file in (CONF / group).glob("*.yaml"))


# --- help


@pytest.mark.parametrize("group", ["study", "dataset", "segmenter", "perturbation", "engine"])
def test_help_says_in_one_line_what_each_name_is(group):
    lines = help_text([]).splitlines()
    start = lines.index(f"{group}=")
    listed = [line.split(maxsplit=1) for line in lines[start + 1 : start + 1 + len(names(group))]]
    assert [words[0] for words in listed] == names(group)
    assert all(len(words) == 2 and len(words[1]) > 20 for words in listed)


@pytest.mark.parametrize("study", names("study"))
def test_help_shows_what_the_options_of_a_study_are(study):
    text = help_text([f"+study={study}", "--help"])
    section = text.partition(f"Options of study={study}, as OPTION=VALUE:")[2].partition("Options of")[0]
    assert "title: " in section
    assert "defaults" not in section
    for line in section.splitlines():
        key = line.strip().partition(":")[0]
        assert key not in ("title", "axis", "levels") or "#" in line


def test_help_shows_the_options_of_the_choices_that_are_typed_or_made_by_the_study():
    text = help_text(["+study=table1", "segmenter=external", "-h"])
    for heading in ("dataset=psb", "segmenter=external", "engine=local"):
        assert f"Options of {heading}" in text
    assert "Options of perturbation" not in text
    assert "Options of perturbation=holes" in help_text(["+study=figure12"])


def test_every_general_option_is_explained():
    text = help_text([])
    for line in text.partition("Options, with their defaults:")[2].partition("Options of")[0].splitlines():
        assert not line.strip() or "#" in line or line.strip() in ("gallery:", "page:"), line


def test_help_says_how_to_compare_methods_and_where_the_number_of_segments_comes_from():
    text = help_text(["--help"])
    (several,) = [line for line in text.splitlines() if line.startswith("  segmenters: null")]
    assert "segmenters=[heat_walk,my_package.my_method]" in several
    assert "all: every one" in several
    (reference,) = [line for line in text.splitlines() if line.startswith("  reference_segmenter: null")]
    assert "number of segments on the original" in reference


def test_help_is_that_of_the_command_too(tmp_path):
    done = typed(tmp_path, "--help", "+study=scaling")
    assert (done.returncode, done.stdout) == (0, help_text(["--help", "+study=scaling", "engine=serial"]) + "\n")


def test_shell_completion_is_not_offered(tmp_path):
    assert "ompletion" not in help_text([])
    done = typed(tmp_path, "--shell-completion", "install=bash")
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1


# --- commands


def test_the_packages_are_commands_too(tmp_path, interpreter):
    done = command(tmp_path, "-m", "heatwalk", "--version")
    assert (done.returncode, done.stdout.split()[0]) == (0, "heatwalk")
    done = command(tmp_path, "-m", "studies", "--help")
    assert done.returncode == 0
    assert [line.split()[0] for line in done.stdout.splitlines()[2:]] == ["run", "status", "report", "serve", "merge"]
    done = interpreter.run(["-m", "studies", "status", "nowhere"], tmp_path)
    assert (done.returncode, done.stderr) == (2, "studies.status: error: no results of a study in nowhere\n")
    done = interpreter.run(["-m", "studies", "runn"], tmp_path)
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)


def hostile_folder(folder):
    """Fill a folder with modules of a user's own that have the names of this project's."""
    for path in ("conf/__init__.py", "conf/study/__init__.py", "perturb.py", "heatwalk/__init__.py"):
        file = folder / path
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("raise RuntimeError('not this one')")
    (folder / "conf" / "config.yaml").write_text("mine: true")
    (folder / "studies").mkdir()
    (folder / "studies" / "notes.txt").write_text("a folder that is no package")


@pytest.mark.parametrize("engine", ["serial", "local"])
def test_a_study_finds_its_own_packages_whatever_lies_in_the_current_folder(here, engine):
    hostile_folder(here)
    (here / "own.py").write_text("def halves(vertices, faces): return [int(x > 0) for x in vertices[:, 0]]")
    done = command(
        here, "-m", "studies.run", "+study=holes", "dataset=files", "dataset.glob=ant.off", "segmenter=custom",
        "segmenter._target_=own.halves", "gallery.models=0", "levels=[3]", "repeats=1", f"engine={engine}",
    )  # fmt: skip
    assert (done.returncode, done.stderr) == (0, "")
    assert pd.read_csv(here / "results" / "holes" / "files" / "table.csv")["n"].tolist() == [1]


def test_the_heatwalk_command_finds_its_own_package_whatever_lies_in_the_current_folder(here):
    hostile_folder(here)
    # A script's own folder is first on the path, not the current one.
    script = here / "bin" / "heatwalk"
    script.parent.mkdir()
    script.write_text("import sys\nfrom heatwalk.cli import main\nsys.exit(main())\n")
    done = command(here, str(script), "inspect", "ant.off")
    assert (done.returncode, done.stderr) == (0, "")


def test_a_package_of_the_same_name_that_is_imported_already_is_named(tmp_path):
    (tmp_path / "perturb.py").write_text("")
    done = command(tmp_path, "-c", "import perturb, studies")
    assert done.returncode == 1
    last = done.stderr.splitlines()[-1]
    assert last.startswith("ImportError: studies needs its own package perturb, but ")
    assert str(Path("perturb.py")) in last


def test_packages_of_other_names_are_found_as_before():
    before = len(sys.meta_path)
    prefer_own_packages()
    assert len(sys.meta_path) == before
    (own,) = [finder for finder in sys.meta_path if isinstance(finder, _OwnPackages)]  # vtk puts one before it
    assert own.find_spec("json") is None
    assert own.find_spec("perturb.holes", ["elsewhere"]) is None


def test_a_dry_run_of_a_sweep_writes_nothing(here):
    done = typed(
        here, "-m", "+study=holes,scaling", "dataset=files", "dataset.glob=ant.off", "dry_run=true", "results_dir=out"
    )
    assert done.returncode == 0
    assert done.stdout.count("nothing was run or written") == 2
    assert [path.name for path in here.iterdir()] == ["ant.off"]


# --- failures and small numbers


def always_fail(vertices, faces):
    raise LookupError("no parts found")


FAILING = ("segmenter._target_=tests.studies.test_first_use.always_fail",)


def test_the_summary_of_failures_names_model_and_level(study, capsys):
    assert not study(*FAILING, "repeats=2")
    out = " ".join(capsys.readouterr().out.split())
    assert "4 of 4 trials failed" in out
    assert "4 × LookupError: no parts found (ant, normal_noise 0.1; ant, normal_noise 0.2)" in out


def test_a_single_trial_is_one_trial(study, capsys):
    study(*FAILING, "repeats=1", "levels=[0.3]")
    out = capsys.readouterr().out
    assert ", 1 trial\n" in out
    assert "1 of 1 trial failed" in out


@pytest.mark.parametrize("engine", ["serial", "local"])
def test_the_traceback_of_a_failure_is_kept_beside_its_row(here, configured, engine):
    from rich.console import Console

    from studies.execution.study import run_study
    from tests.studies.conftest import STUDY

    chosen = configured(*STUDY, *FAILING, f"engine={engine}", "repeats=1", "results_dir=results")
    with open("printed.txt", "w") as printed:
        run_study(chosen, Console(file=printed))
    rows = pd.read_parquet(chosen.folder / "trials.parquet")
    assert rows["status"].tolist() == ["failed"] * 2
    for text in rows["traceback"]:
        assert text.startswith("Traceback (most recent call last):")
        assert "in always_fail" in text
        assert text.endswith("LookupError: no parts found")
    assert ("in always_fail" in Path("printed.txt").read_text()) == (engine == "serial")


def test_the_traceback_of_a_deep_recursion_is_short():
    from studies.execution.interruption import TRACEBACK_LINES, traceback_of

    def down(n):
        return down(n - 1) + len("x" * n) if n else [][0]

    try:
        down(400)
    except IndexError as error:
        lines = traceback_of(error).splitlines()
    assert len(lines) <= TRACEBACK_LINES + 1
    assert lines[-1] == "IndexError: list index out of range"


def test_results_that_were_stored_without_tracebacks_can_be_read(study, here):
    study("repeats=1")
    folder = here / "results" / "normal_noise" / "files"
    path = folder / "trials.parquet"
    pd.read_parquet(path).drop(columns="traceback").to_parquet(path, index=False)
    (folder / "trials.jsonl").unlink()
    rows = studies.load(folder).rows
    assert len(rows) == 2
    assert rows["traceback"].isna().all()


def test_without_a_gallery_no_old_gallery_is_left(study, here):
    study("repeats=1")
    folder = here / "results" / "normal_noise" / "files"
    (folder / "gallery.png").write_bytes(b"of an earlier run")
    study("repeats=1", "gallery.models=0")
    assert not (folder / "gallery.png").exists()


def test_a_dry_run_says_how_to_estimate_the_time(study, capsys):
    assert study("dry_run=true")
    out = " ".join(capsys.readouterr().out.split())
    assert "start the study, stop it by Ctrl-C after a few trials, and dry_run=true estimates the rest" in out


@pytest.mark.parametrize("dataset", ["psb", "tosca"])
def test_data_that_are_missing_are_described_in_several_lines(here, dataset):
    done = typed(here, "+study=holes", f"dataset={dataset}", "dataset.root=nowhere")
    lines = done.stderr.splitlines()
    assert done.returncode == 2
    assert lines[0] == f"studies.run: error: {here / 'nowhere'} does not exist."
    assert len(lines) >= 4
    assert f"{dataset.upper()}_ROOT" in lines[-1]
