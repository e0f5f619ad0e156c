"""The Princeton benchmark and TOSCA for the tests, where they are at hand."""

import gc
import importlib.util
import os
import shutil
import signal
import sys
import tempfile
import zipfile

import numpy as np
import pytest
import scipy.sparse as sp
import threadpoolctl
import trimesh

from heatwalk.numerics.solver import PositiveDefiniteSolver
from heatwalk.segmentation import segment
from studies.datasets.cache import FOLDER_VARIABLE
from tests.helpers.documents import ROOT
from tests.helpers.interpreter import COMPILED, Interpreter
from tests.helpers.meshes import DATA

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # A shell makes what it starts in the background ignore Ctrl-C, and children inherit that: tests of it would hang.
    signal.signal(signal.SIGINT, signal.default_int_handler)


gc.set_threshold(20_000, 10, 10)  # what is imported and collected is no garbage, and looking through it takes long


def pytest_configure(config):
    """Caches of meshes and of bytecode for this run alone, and one BLAS thread per process of pytest-xdist.

    The waiting threads of several processes would spin.
    """
    if not hasattr(config, "workerinput"):
        config.caches = os.environ[FOLDER_VARIABLE] = tempfile.mkdtemp(prefix="caches-")
        if sys.dont_write_bytecode and not os.path.exists(importlib.util.cache_from_source(np.__file__)):
            # Neither the installation nor Python has compiled the packages: each process would, for several seconds.
            os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # python -B sets none
            os.environ["PYTHONPYCACHEPREFIX"] = os.path.join(config.caches, "bytecode")
    if "PYTEST_XDIST_WORKER" in os.environ:
        for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
            os.environ.setdefault(variable, "1")  # of libraries that are loaded later, and of child processes
        threadpoolctl.threadpool_limits(1)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config, log):
    """Tests of a file run in one process, which makes what they share once; files start in the order of collection."""
    from xdist.scheduler import LoadFileScheduling

    if config.getvalue("dist") != "load":  # what ``-n`` alone means
        return None
    config.option.loadscopereorder = False
    return LoadFileScheduling(config, log)


def pytest_collection_modifyitems(items):
    """Files that take longest come early: at the end, short ones are left for whichever process has nothing to do."""
    items.sort(key=lambda item: _position(item.path.relative_to(ROOT / "tests").parts))


def _position(parts):
    """Where a file of tests comes, from the parts of its path."""
    if len(parts) == 2 and parts[0] == "studies":
        return 4  # commands, before the folders of the packages
    return {"heatwalk": 0, "perturb": 1, "test_recipes.py": 2, "test_docs.py": 3}.get(parts[0], 5)


def pytest_sessionstart(session):
    """If nothing is compiled yet, every other process of pytest-xdist compiles the solver, the others the search."""
    worker = os.environ.get("PYTEST_XDIST_WORKER")
    if worker is None:
        return
    if int(worker.removeprefix("gw")) % 2:
        PositiveDefiniteSolver(sp.diags_array([-1.0, 4.0, -1.0], offsets=[-1, 0, 1], shape=(2000, 2000)).tocsr())
    else:
        sphere = trimesh.creation.icosphere(2)  # its eigenvalues need no solver
        segment(sphere.vertices, sphere.faces)


def pytest_unconfigure(config):
    """The caches end with the run."""
    if hasattr(config, "caches"):
        shutil.rmtree(config.caches, ignore_errors=True)
    gc.freeze()  # or Python, before it ends, looks for garbage among all that was imported


@pytest.fixture(scope="session")
def interpreter():
    """Runs commands with this project's packages, as ``python`` does; see `tests.helpers.interpreter`."""
    interpreter = Interpreter(ROOT, COMPILED)
    yield interpreter
    interpreter.close()


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
        text = (psb_root / "data" / "off" / f"{model}.off").read_text()
        (n, m, _), numbers = np.split(np.fromstring(text.removeprefix("OFF"), sep=" "), [3])
        vertices, faces = np.split(numbers, [3 * int(n)])
        faces = faces.reshape(int(m), 4)[:, 1:].astype(np.int64)  # each is preceded by the number of its corners
        return trimesh.Trimesh(vertices.reshape(-1, 3), faces, process=False)

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
