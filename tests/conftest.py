"""The Princeton benchmark and TOSCA for the tests, where they are at hand."""

import os
import shutil
import signal
import tempfile
import zipfile

import pytest
import threadpoolctl
import trimesh

from studies.datasets.cache import FOLDER_VARIABLE
from tests.helpers.meshes import DATA

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell makes what it starts in the background ignore Ctrl-C, and children inherit that: tests of it would hang.
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_configure(config):
    """A cache of computed meshes for this run alone, and one BLAS thread per process of pytest-xdist.

    The waiting threads of several processes would spin.
    """
    if not hasattr(config, "workerinput"):
        config.mesh_cache = os.environ[FOLDER_VARIABLE] = tempfile.mkdtemp(prefix="meshes-")
    if "PYTEST_XDIST_WORKER" in os.environ:
        for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            os.environ.setdefault(variable, "1")  # of libraries that are loaded later, and of child processes
        threadpoolctl.threadpool_limits(1)


def pytest_unconfigure(config):
    """The cache ends with the run."""
    if hasattr(config, "mesh_cache"):
        shutil.rmtree(config.mesh_cache, ignore_errors=True)


@pytest.fixture(scope="session")
def psb_zip():
    path = DATA / "psb-dev.zip"
    if not path.exists():
        pytest.skip(f"the benchmark is not at hand: no {path}")
    return path


@pytest.fixture(scope="session")
def psb_root(psb_zip, tmp_path_factory):
    """The benchmark unpacked, once for all test processes."""
    return unpacked(psb_zip, tmp_path_factory) / "MeshsegBenchmark-1.0"


@pytest.fixture(scope="session")
def psb_mesh(psb_root):
    """A function: benchmark model id -> trimesh.Trimesh."""

    def load(model):
        return trimesh.load(psb_root / "data" / "off" / f"{model}.off", process=False)

    return load


@pytest.fixture(scope="session")
def tosca_zip():
    path = DATA / "tosca-dev.zip"
    if not path.exists():
        pytest.skip(f"TOSCA is not at hand: no {path}")
    return path


@pytest.fixture(scope="session")
def tosca_root(tosca_zip, tmp_path_factory):
    """The folder of TOSCA's poses at 5,000 vertices, unpacked, once for all test processes."""
    return unpacked(tosca_zip, tmp_path_factory) / "TOSCA_Isometric" / "vtx_5k"


def unpacked(archive, tmp_path_factory):
    shared = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        shared = shared.parent
    target = shared / archive.stem
    if not target.exists():
        unpacking = shared / f"{archive.stem}-{os.getpid()}"
        zipfile.ZipFile(archive).extractall(unpacking)
        try:
            unpacking.rename(target)
        except OSError:
            if not target.exists():  # else another process was quicker
                raise
    return target
