"""README, CONTRIBUTING and docs/: their links, commands and snippets are those of the code."""

import itertools
import os
import re
import shlex
import shutil
import subprocess
import sys
from importlib.metadata import distribution
from pathlib import Path

import pandas as pd
import pytest
import yaml
from hydra import compose, initialize_config_module
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

import conf
import heatwalk
from studies.planning.command_line import list_globbed_studies, quote_argument
from studies.planning.configuration import instantiate_experiment
from tests.helpers.documents import PAGES, ROOT, Block, blocks, commands

TEXT = {page.relative_to(ROOT).as_posix(): page.read_text(encoding="utf-8") for page in PAGES}
COMMANDS = sorted(
    {command for name, text in TEXT.items() if name != "CONTRIBUTING.md" for command in commands(text)}
)  # those of CONTRIBUTING.md need the files of its recipes: tests/test_recipes.py
SNIPPETS = [
    pytest.param(block.text, id=f"{name}-{number}")
    for name, text in TEXT.items()
    for number, block in enumerate(blocks(text))
    if block.language == "python" and not block.title
]
PAPER = yaml.safe_load((Path(conf.__file__).parent / "paper" / "heat_walk_2011.yaml").read_text(encoding="utf-8"))


@pytest.fixture
def workplace(tmp_path):
    """What the pages assume to be in the current folder: a mesh, and the results of the first study."""
    cow = distribution("pymeshlab").locate_file("pymeshlab/tests/sample_meshes/cow.obj")
    shutil.copy(cow, tmp_path / "cow.obj")
    shutil.copytree(ROOT / "results" / "shot_noise" / "bundled", tmp_path / "results" / "shot_noise" / "bundled")
    return tmp_path


@pytest.fixture
def run(workplace):
    """A function: words of a command -> what it prints in the workplace."""

    def run_there(words):
        done = subprocess.run(
            [sys.executable, *words], cwd=workplace, env=os.environ | {"PYTHONPATH": str(ROOT)},
            capture_output=True, text=True, encoding="utf-8",
        )  # fmt: skip
        assert done.returncode == 0, done.stdout + done.stderr
        return done.stdout

    return run_there


def jobs(words):
    """The options of each job of a command: one, or several for a sweep."""
    words = list_globbed_studies([quote_argument(word) for word in words if word not in ("-m", "--multirun")])
    overrides = OverridesParser.create().parse_overrides(words)
    return itertools.product(*map(choices, overrides))


def choices(override):
    if not override.is_sweep_override():
        return [override.input_line]
    key = override.input_line.partition("=")[0]
    return [f"{key}={value}" for value in override.sweep_string_iterator()]


def example(page, title) -> Block:
    """The block of a page that has a file name, and the command below it."""
    found = blocks(TEXT[page])
    position = next(number for number, block in enumerate(found) if block.title == title)
    return found[position], found[position + 1].text.strip()


@pytest.mark.parametrize("command", COMMANDS)
def test_a_documented_command_composes(command):
    words = [word for word in shlex.split(command)[3:] if word != "--help"]
    for overrides in jobs(words):
        with initialize_config_module("conf", version_base="1.3"):
            cfg = compose("config", list(overrides))
        if words:
            instantiate_experiment(OmegaConf.to_container(cfg, resolve=True))


@pytest.mark.parametrize("code", SNIPPETS)
def test_a_documented_snippet_runs_where_the_page_is_read(code, run):
    run(["-c", code])


def test_the_documented_function_is_a_segmenter(run, workplace):
    block, command = example("docs/segmenters.md", "my_package.py")
    (workplace / "my_package.py").write_text(block.text, encoding="utf-8")
    _, *words = shlex.split(command)
    run([*words, "dataset.models=[cow]", "levels=[0.1]", "repeats=1", "gallery.models=0"])
    rows = pd.read_parquet(workplace / "mine" / "shot_noise" / "bundled" / "trials.parquet")
    assert rows[["segmenter", "status", "n_segments_reference"]].values.tolist() == [["my_method (k=5)", "ok", 5]]


@pytest.mark.parametrize("page", TEXT)
def test_links_between_pages_lead_to_files_and_headings(page):
    for target in re.findall(r"\]\(([^)\s]+)\)", TEXT[page]):
        if "://" in target:
            continue
        path, _, anchor = target.partition("#")
        linked = (ROOT / page).parent / path if path else ROOT / page
        in_site = page == "docs/index.md" and (ROOT / path).exists()  # a picture that docs/hooks.py adds
        assert linked.exists() or in_site, target
        if anchor:
            named = "CONTRIBUTING.md" if linked.name == "contributing.md" else linked.relative_to(ROOT).as_posix()
            assert anchor in anchors(TEXT[named]), target


def anchors(text):
    headings = re.findall(r"^#+ (.+)$", text, re.MULTILINE)
    return {re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-") for heading in headings}


def test_every_study_of_the_paper_is_on_its_page():
    named = {word for command in commands(TEXT["docs/paper.md"]) for word in re.findall(r"\+study=([\w,]+)", command)}
    assert {study for names in named for study in names.split(",")} | set(
        re.findall(r"`(\w+)`", TEXT["docs/paper.md"])
    ) >= set(PAPER["studies"])


def test_versions_agree():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert str(citation["version"]) == heatwalk.__version__
    assert f"## [{heatwalk.__version__}]" in TEXT["CHANGELOG.md"]


def test_citation_names_the_paper_and_its_address():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    (paper,) = citation["references"]
    assert paper["title"] in TEXT["README.md"].replace("\n> ", " ")
    assert f"https://doi.org/{paper['doi']}" in TEXT["README.md"]
