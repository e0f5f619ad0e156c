"""How the package finds its perturbations, and what importing it costs."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

import perturb

ROOT = Path(__file__).parents[2]

CORKSCREW = """
from dataclasses import dataclass
from typing import ClassVar

import perturb


@dataclass(frozen=True)
class Corkscrew(perturb.Perturbation):
    amount: float = 0.5
    unit: str = "radians_per_diagonal"

    name: ClassVar[str] = "corkscrew"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("radians_per_diagonal",)}

    def apply(self, mesh, parameters):
        return self.finish(mesh, *perturb.moved(mesh, 0 * mesh.vertices))
"""


def python(code, path):
    """What a new process prints that runs code with a folder first on its path."""
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(path), *sys.path])}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, cwd=path)
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture
def extended(tmp_path):
    """A folder with a copy of the package to which one file has been added."""
    package = tmp_path / "perturb"
    package.mkdir()
    for file in (ROOT / "perturb").glob("*.py"):
        (package / file.name).write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
    (package / "corkscrew.py").write_text(CORKSCREW)
    return tmp_path


@pytest.fixture
def shipped(tmp_path):
    """A folder with a copy of the package, without files that a user has added."""
    package = tmp_path / "perturb"
    package.mkdir()
    added = {perturb.get(name) for name in perturb.names() if perturb.get(name).__name__ not in perturb.__all__}
    for file in (ROOT / "perturb").glob("*.py"):
        if f"perturb.{file.stem}" not in {cls.__module__ for cls in added}:
            (package / file.name).write_text(file.read_text(encoding="utf-8"), encoding="utf-8")
    return tmp_path


def test_importing_loads_neither_trimesh_nor_scipy_nor_numba_nor_pymeshlab(shipped):
    heavy = ("trimesh", "scipy", "numba", "pymeshlab", "fast_simplification", "hydra")
    code = (
        f"import sys, perturb; perturb.names(); perturb.Tessellation(); print([m for m in {heavy} if m in sys.modules])"
    )
    assert python(code, shipped) == "[]\n"


@pytest.mark.parametrize("name", perturb.__all__)
def test_every_public_name_exists_and_is_listed(name):
    assert getattr(perturb, name) is not None
    assert name in dir(perturb)


def test_an_unknown_attribute_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'perturb' has no attribute 'Hole'"):
        perturb.Hole  # noqa: B018


def test_one_more_file_is_one_more_perturbation(extended):
    code = "import perturb; print(perturb.Corkscrew(0.1).name, 'Corkscrew' in dir(perturb), *perturb.names())"
    assert python(code, extended).split() == ["corkscrew", "True", *sorted([*perturb.names(), "corkscrew"])]


def test_hydra_finds_the_class_of_an_added_file(extended):
    code = "import hydra.utils; print(hydra.utils.instantiate({'_target_': 'perturb.Corkscrew', 'amount': 0.2}))"
    assert python(code, extended) == "Corkscrew(amount=0.2, unit='radians_per_diagonal')\n"


def test_an_added_file_can_derive_from_a_shipped_perturbation(extended):
    code = CORKSCREW.replace("perturb.Perturbation", "perturb.Scaling")
    (extended / "perturb" / "a_corkscrew.py").write_text(
        code.replace("Corkscrew", "ACorkscrew").replace("corkscrew", "a_corkscrew")
    )
    code = "import perturb; print(perturb.ACorkscrew.__mro__[1].__name__, 'a_corkscrew' in perturb.names())"
    assert python(code, extended) == "Scaling True\n"


def test_private_modules_and_the_conformance_suite_are_not_searched(extended):
    (extended / "perturb" / "_corkscrew.py").write_text(CORKSCREW.replace('"corkscrew"', '"hidden"'))
    code = (
        "import sys, perturb; print('hidden' in perturb.names(), 'perturb._proximity' in sys.modules, "
        "'perturb.testing' in sys.modules)"
    )
    assert python(code, extended) == "False False False\n"


def test_an_error_in_an_added_file_is_reported_with_its_path(extended):
    (extended / "perturb" / "corkscrew.py").write_text("import no_such_module\n")
    code = """
import traceback, perturb
try:
    perturb.names()
except ModuleNotFoundError:
    print(traceback.format_exc())
"""
    printed = python(code, extended)
    assert str(Path("perturb", "corkscrew.py")) in printed
    assert "No module named 'no_such_module'" in printed
