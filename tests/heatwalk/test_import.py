import subprocess
import sys

import pytest

import heatwalk
import heatwalk.io
from tests.helpers.mesh_files import TETRAHEDRON, off_bytes


def loaded(code, *arguments):
    """Which of the packages that take long to import a new process loads."""
    code += (
        "\nimport sys; print([m for m in ('numpy', 'scipy.sparse', 'numba', 'trimesh', 'pandas') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code, *arguments], capture_output=True, text=True, check=True)
    return done.stdout.splitlines()[-1]


@pytest.mark.parametrize("module", ["heatwalk", "heatwalk.io", "heatwalk.cli"])
def test_importing_loads_nothing_large(module):
    assert loaded(f"import {module}") == "[]"


@pytest.mark.parametrize("arguments", [["--help"], ["segment", "--help"], ["--version"]])
def test_help_and_version_load_nothing_large(arguments):
    code = "import sys\nfrom heatwalk.cli import main\ntry: main(sys.argv[1:])\nexcept SystemExit: pass"
    assert loaded(code, *arguments) == "[]"


@pytest.mark.parametrize(
    ("command", "packages"), [("segment", "['numpy', 'scipy.sparse', 'numba']"), ("inspect", "['numpy', 'numba']")]
)
def test_commands_on_triangles_in_text_files_load_no_more_than_they_use(command, packages, tmp_path):
    path = tmp_path / "tetrahedron.off"
    path.write_bytes(off_bytes(*TETRAHEDRON))
    options = ["--output", str(tmp_path / "out.ply")] if command == "segment" else []
    code = "import sys\nfrom heatwalk.cli import main\nassert main(sys.argv[1:]) == 0"
    assert loaded(code, command, str(path), *options) == packages


@pytest.mark.parametrize("name", heatwalk.__all__)
def test_every_public_name_exists_and_is_listed(name):
    assert getattr(heatwalk, name) is not None
    assert name in dir(heatwalk)


def test_an_unknown_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'segmnet'"):
        heatwalk.segmnet  # noqa: B018


@pytest.mark.parametrize("name", heatwalk.io.__all__)
def test_every_name_of_the_file_formats_exists_and_is_listed(name):
    assert callable(getattr(heatwalk.io, name))
    assert name in dir(heatwalk.io)


def test_an_unknown_file_format_name_is_an_attribute_error():
    with pytest.raises(AttributeError, match="no attribute 'read_stp'"):
        heatwalk.io.read_stp  # noqa: B018
