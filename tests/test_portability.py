"""The project runs on Linux, macOS and Windows: nothing in it exists on one of them alone."""

import ast
from pathlib import Path

import pandas as pd
import pytest

from tests.helpers import as_on_windows
from tests.helpers.as_on_windows import MODULES, NAMES, PACKAGES
from tests.helpers.meshes import bundled

PROJECT = Path(__file__).parents[1]
SOURCES = [path for package in PACKAGES for path in sorted((PROJECT / package).rglob("*.py"))]


def unportable(tree):
    """What a module uses that Windows does not have, as text."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name.partition(".")[0] in MODULES)
        elif isinstance(node, ast.ImportFrom) and node.module:
            names = {alias.name for alias in node.names}
            if node.module.partition(".")[0] in MODULES:
                yield node.module
            yield from (f"{node.module}.{name}" for name in sorted(names & NAMES.get(node.module, set())))
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            if node.attr in NAMES.get(node.value.id, set()):
                yield f"{node.value.id}.{node.attr}"
        elif isinstance(node, ast.Constant) and str(node.value).startswith(("/proc/", "/dev/", "/tmp/", "/sys/")):
            yield node.value


# The kernel of Linux keeps the peak of memory; elsewhere it is sampled.
ELSEWHERE_OTHERWISE = {
    "studies/execution/fork_server.py": [
        "signal.SIG_BLOCK", "signal.SIG_SETMASK", "signal.pthread_sigmask", "signal.pthread_sigmask",
    ],
    "studies/execution/peak_memory.py": ["/proc/self/clear_refs", "/proc/self/status"],
    "studies/execution/preload.py": ["signal.SIG_UNBLOCK", "signal.pthread_sigmask"],
}  # fmt: skip


@pytest.mark.parametrize(
    ("code", "found"),
    [
        ("import os\nos.fork()", ["os.fork"]),
        ("from signal import SIGKILL, SIGTERM", ["signal.SIGKILL"]),
        ("import fcntl", ["fcntl"]),
        ("from resource import getrusage", ["resource"]),
        ("open('/proc/self/status')", ["/proc/self/status"]),
        ("import os\nos.replace('a', 'b')", []),
    ],
)
def test_the_search_finds_what_it_looks_for(code, found):
    assert list(unportable(ast.parse(code))) == found


def test_no_module_uses_what_windows_does_not_have():
    assert len(SOURCES) > 50
    found = {
        path.relative_to(PROJECT).as_posix(): names
        for path in SOURCES
        if (names := sorted(unportable(ast.parse(path.read_text("utf-8")))))
    }
    assert found == ELSEWHERE_OTHERWISE


@pytest.mark.parametrize("engine", ["engine=serial", "engine.workers=2"])
def test_a_study_runs_without_the_names_that_windows_does_not_have(engine, tmp_path, interpreter):
    bundled("ant").export(tmp_path / "ant.off")
    words = (
        "+study=normal_noise", "dataset=files", "dataset.glob=ant.off", "segmenter=custom",
        "segmenter._target_=tests.helpers.segmenting.halves", "gallery.models=0", "levels=[0.1]", "repeats=4",
    )  # fmt: skip
    done = interpreter.run([as_on_windows.__file__, *words, engine], tmp_path)
    assert done.returncode == 0, done.stderr
    assert "workers are started by: spawn" in done.stdout
    assert "the project sees os.fork: False" in done.stdout
    rows = pd.read_parquet(tmp_path / "results" / "normal_noise" / "files" / "trials.parquet")
    assert rows["status"].tolist() == ["ok"] * 4
