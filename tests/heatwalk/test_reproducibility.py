"""The same labels on every processor: with other BLAS kernels, threads, and paths of the solver."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from tests.helpers.meshes import bundled

TIMES = (0.13, 0.6, 1.0, 2.7, 12.0)
ENVIRONMENTS = [
    {"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "1"},
    {"OPENBLAS_CORETYPE": "Prescott", "OPENBLAS_NUM_THREADS": "1"},
    {"OPENBLAS_CORETYPE": "Zen", "OPENBLAS_NUM_THREADS": "1"},
]
THREADS = [{"OPENBLAS_CORETYPE": "Haswell", "OPENBLAS_NUM_THREADS": "2"}]
PROGRAM = """
import hashlib, sys
import heatwalk
times = [float(time) for time in sys.argv[1].split(",")]
for path in sys.argv[2:]:
    mesh = heatwalk.read_mesh(path)
    together = [seg.labels for seg in heatwalk.segment_at_times(mesh.vertices, mesh.faces, times)]
    alone = [heatwalk.segment(mesh.vertices, mesh.faces, time).labels for time in times]
    for labels in (together, alone):
        print(path, *(hashlib.sha256(each.tobytes()).hexdigest()[:16] for each in labels))
"""


def labels_in(environment, paths):
    """Digests of the labels of each mesh at each time: {path: (from one spectrum, from a spectrum per time)}."""
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM, ",".join(map(str, TIMES)), *map(str, paths)],
        env=os.environ | environment | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True,
        text=True,
        check=True,
    )
    digests = {}
    for line in done.stdout.splitlines():
        path, *labels = line.split(" ")
        digests.setdefault(path, []).append(labels)
    return digests


def assert_equal_labels(paths, environments):
    first = labels_in(environments[0], paths)
    for together, alone in first.values():
        assert together == alone
    for environment in environments[1:]:
        assert labels_in(environment, paths) == first, environment


def test_labels_of_shipped_meshes_do_not_depend_on_the_blas_kernel(tmp_path):
    paths = []
    for name in ("cow", "bone"):
        paths.append(Path(tmp_path, f"{name}.off"))
        bundled(name).export(paths[-1])
    assert_equal_labels(paths, ENVIRONMENTS)


@pytest.mark.slow
def test_labels_of_the_benchmark_depend_on_neither_blas_kernel_nor_threads(psb_root):
    models = sorted((psb_root / "data" / "off").glob("*.off"), key=lambda path: int(path.stem))
    assert_equal_labels(models[::9], [*ENVIRONMENTS, *THREADS])
