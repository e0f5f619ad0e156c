"""README, CONTRIBUTING and docs/: their links, commands and snippets are those of the code."""

import itertools
import re
import shlex
import shutil
import sys
from importlib import import_module
from importlib.metadata import distribution
from pathlib import Path
from types import SimpleNamespace

import pandas as pd
import pytest
import yaml
from hydra import initialize_config_module
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

import conf
import heatwalk
from studies.planning.command_line import list_globbed_studies, quote_argument
from studies.planning.configuration import instantiate_experiment
from tests.helpers.composing import composition, files_read_once
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


@pytest.fixture(scope="module", autouse=True)
def read_configurations_once():
    """Composing a configuration takes most of the time of these tests."""
    with files_read_once():
        yield


@pytest.fixture
def workplace(tmp_path):
    """What the pages assume to be in the current folder: a mesh, and the results of the first study."""
    cow = distribution("pymeshlab").locate_file("pymeshlab/tests/sample_meshes/cow.obj")
    shutil.copy(cow, tmp_path / "cow.obj")
    shutil.copytree(ROOT / "results" / "shot_noise" / "bundled", tmp_path / "results" / "shot_noise" / "bundled")
    return tmp_path


@pytest.fixture
def run(workplace, interpreter):
    """A function: words of a command -> what it prints in the workplace."""

    def run_there(words):
        done = interpreter.run(words, workplace)
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
            cfg = composition(overrides)
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


def test_the_documented_class_is_told_the_number_of_segments_of_the_original(run, workplace):
    block, command = example("docs/segmenters.md", "my_methods.py")
    (workplace / "my_methods.py").write_text(block.text, encoding="utf-8")
    _, *words = shlex.split(command.splitlines()[1])
    run([*words, "dataset.models=[ant]", "levels=[0.1]", "repeats=1", "gallery.models=0"])
    rows = pd.read_parquet(workplace / "mine" / "shot_noise" / "bundled" / "trials.parquet")
    assert rows[["segmenter", "status", "n_segments_reference"]].values.tolist() == [["Sectors", "ok", 1]]
    table = (workplace / "mine" / "shot_noise" / "bundled" / "table.md").read_text(encoding="utf-8")
    assert "Told how many segments to find: Sectors." in table


def test_the_documented_script_for_a_network_is_a_program_that_segments(run, workplace):
    block, command = example("docs/neural.md", "segment_with_network.py")
    (workplace / "segment_with_network.py").write_text(block.text, encoding="utf-8")
    _, *words = [word.replace("=python ", f"='{sys.executable}' ") for word in shlex.split(command)]
    run([*words, "dataset.models=[ant]", "levels=[0.1]", "repeats=1", "gallery.models=0"])
    rows = pd.read_parquet(workplace / "mine" / "shot_noise" / "bundled" / "trials.parquet")
    assert rows[["status", "n_segments_reference", "change_percentage"]].values.tolist() == [["ok", 1, 0.0]]


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


@pytest.fixture
def gallery(monkeypatch):
    """The module that draws docs/gallery.md."""
    monkeypatch.syspath_prepend(ROOT / "docs")
    return import_module("gallery")


def test_the_gallery_shows_every_perturbation_of_today(gallery):
    again = "run python docs/gallery.py, or with the names of what is new"
    assert TEXT["docs/gallery.md"] == gallery.page(), again
    pictures = {path.stem: path.stat().st_size for path in gallery.PICTURES.glob("*.png")}
    assert sorted(pictures) == sorted(gallery.shown()), again
    assert max(pictures.values()) <= gallery.LARGEST


def test_every_perturbation_stands_for_something_in_practice(gallery):
    assert sorted(gallery.PRACTICE) == sorted(gallery.shown())


def test_every_shipped_method_is_in_the_table_of_methods(monkeypatch):
    monkeypatch.syspath_prepend(ROOT / "docs")
    hooks, methods = import_module("hooks"), import_module("methods")
    files = {path.stem for path in (Path(conf.__file__).parent / "segmenter").glob("*.yaml")}
    assert set(methods.methods()) == files - {"custom", "external"}
    config = SimpleNamespace(config_file_path=str(ROOT / "mkdocs.yml"))
    page = hooks.on_page_markdown(TEXT["docs/segmenters.md"], page=None, config=config, files=None)
    for name, method in methods.methods().items():
        assert method.about is not None, f"{name} needs an attribute `about`"
        (row,) = [line for line in page.splitlines() if line.startswith(f"| `{name}` |")]
        assert method.about.title in row
        assert method.about.source in row
        assert row.split(" | ")[3] == ("yes" if method.is_told else "no")


def test_versions_agree():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    assert str(citation["version"]) == heatwalk.__version__
    assert f"## [{heatwalk.__version__}]" in TEXT["CHANGELOG.md"]


def test_citation_names_the_paper_and_its_address():
    citation = yaml.safe_load((ROOT / "CITATION.cff").read_text(encoding="utf-8"))
    (paper,) = citation["references"]
    assert paper["title"] in TEXT["README.md"].replace("\n> ", " ")
    assert f"https://doi.org/{paper['doi']}" in TEXT["README.md"]
