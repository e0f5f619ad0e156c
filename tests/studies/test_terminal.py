"""Terminals that lack characters, readers that leave early, notebooks' settings, and folders that cannot be written."""

import io
import os
import subprocess
import sys

import pytest

from studies.terminal import _forgiving
from tests.helpers.terminal import Terminal
from tests.studies.conftest import STUDY, typed_command

STUDY_SERIAL = (*STUDY, "repeats=1", "engine=serial")


def command(folder, words, **environment):
    """A command in a folder of its own, with variables of its own."""
    settings = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "COLUMNS": "80"} | environment
    return subprocess.run([sys.executable, "-m", *words], cwd=folder, env=settings, capture_output=True, timeout=300)


@pytest.fixture(scope="module")
def python():
    """An interpreter that has not imported matplotlib, which reads the environment then."""
    with Terminal(has_charts=False) as interpreter:
        yield interpreter


@pytest.fixture(params=["ascii", "cp1252", "latin-1:strict", None])
def run(request, here):
    """A function: words -> what a command prints on a terminal that lacks characters, as bytes.

    The encoding is asked for by ``PYTHONIOENCODING``; without one, an interpreter is started where there is ASCII only.
    """
    encoding = request.param
    if encoding is None:
        with Terminal(LC_ALL="C", PYTHONUTF8="0", PYTHONCOERCECLOCALE="0") as python:
            yield lambda *words: python.run(here, words)
        return

    def in_bytes(module, *words):
        done = typed_command(here, module, *words, encoding=encoding)
        done.stdout, done.stderr = (text.encode(encoding.partition(":")[0]) for text in (done.stdout, done.stderr))
        return done

    yield in_bytes


def test_a_terminal_that_lacks_characters_shows_others(here, run):
    (here / "ant.off").rename(here / "Ämter 蟻.off")
    words = [word for word in STUDY_SERIAL if not word.startswith("dataset.glob")]
    done = run("studies.run", *words, "dataset.glob=*.off", "title=Größe ±σ 蟻")
    assert done.returncode == 0, done.stderr
    assert b"Gr" in done.stdout
    for words in (["studies.status"], ["studies.report"], ["studies.run", "--help"]):
        done = run(*words)
        assert done.returncode == 0, done.stderr
        assert not done.stderr
    failing = run("studies.run", *STUDY_SERIAL, "dataset.glob=蟻 ö.off")
    assert failing.returncode == 2
    assert failing.stderr.count(b"\n") == 1


@pytest.mark.parametrize("words", [["studies.status", "."], ["studies.report", "."], ["studies.run", "--help"]])
def test_a_reader_that_leaves_early_is_no_error(study, here, words, python):
    assert study("repeats=1", results=".")
    is_short = words[0] == "studies.status"
    done = command_without_reader(words) if is_short else python.run(here, words, unread=[1])
    assert done.stderr == b""
    assert done.returncode == 0
    if words[0] == "studies.report":
        assert (here / "README.md").exists()


def command_without_reader(words):
    """A command of an interpreter that writes at once, to a pipe that nobody reads any more."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join(sys.path), "PYTHONUNBUFFERED": "1"}
    reading, writing = os.pipe()
    os.close(reading)
    try:
        return subprocess.run(
            [sys.executable, "-m", *words], env=environment, stdout=writing, stderr=subprocess.PIPE, timeout=300
        )
    finally:
        os.close(writing)


def test_a_study_goes_on_when_nobody_reads_its_output_any_more(here, python):
    assert python.run(here, ["studies.run", *STUDY_SERIAL], unread=(1, 2)).returncode == 0
    assert (here / "results" / "normal_noise" / "files" / "table.csv").exists()


BACKENDS = ["module://matplotlib_inline.backend_inline", "module://no_such_module", "TkNone"]


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_plotting_backend_of_a_notebook_does_not_matter(here, backend, python):
    words = [word for word in STUDY_SERIAL if not word.startswith("gallery")]
    done = python.run(here, ["studies.run", *words, "gallery.models=1"], MPLBACKEND=backend)
    assert done.returncode == 0, done.stderr
    folder = here / "results" / "normal_noise" / "files"
    assert (folder / "normal_noise.png").exists()
    assert (folder / "gallery.png").exists()


@pytest.mark.parametrize("backend", BACKENDS)
def test_the_plotting_backend_of_a_notebook_does_not_matter_to_a_report(study, here, backend, python):
    assert study("repeats=1")
    assert python.run(here, ["studies.report"], MPLBACKEND=backend).returncode == 0
    assert (here / "results" / "README.md").exists()


def test_where_compiled_code_is_cached_does_not_matter(here):
    (here / "file").touch()
    words = [word for word in STUDY_SERIAL if not word.startswith("segmenter")]
    done = command(here, ["studies.run", *words, "levels=[0.1]"], NUMBA_CACHE_DIR=str(here / "file" / "cache"))
    assert done.returncode == 0, done.stderr + done.stdout


def test_mistakes_of_every_command_end_with_2(here):
    for words in (
        ["studies.status", "--what"],
        ["studies.report", "a", "b"],
        ["studies.merge"],
        ["studies.run", "--x"],
    ):
        done = typed_command(here, *words)
        assert done.returncode == 2, words
        assert "Traceback" not in done.stderr


def test_a_stream_that_is_no_file_stays_as_it_is():
    for stream in (io.StringIO(), None):
        assert _forgiving(stream) is stream
