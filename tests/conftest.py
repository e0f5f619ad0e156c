"""The Princeton benchmark for the tests, where it is at hand."""

import os
import zipfile

import pytest
import trimesh

from tests.meshes import DATA


@pytest.fixture(scope="session")
def psb_zip():
    path = DATA / "psb-dev.zip"
    if not path.exists():
        pytest.skip(f"the benchmark is not at hand: no {path}")
    return path


@pytest.fixture(scope="session")
def psb_root(psb_zip, tmp_path_factory):
    """The benchmark unpacked, once for all test processes."""
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    target = shared / "psb"
    if not target.exists():
        unpacking = shared / f"psb-{os.getpid()}"
        zipfile.ZipFile(psb_zip).extractall(unpacking)
        try:
            unpacking.rename(target)
        except OSError:
            if not target.exists():  # else another process was quicker
                raise
    return target / "MeshsegBenchmark-1.0"


@pytest.fixture(scope="session")
def psb_mesh(psb_root):
    """A function: benchmark model id -> trimesh.Trimesh."""

    def load(model):
        return trimesh.load(psb_root / "data" / "off" / f"{model}.off", process=False)

    return load
