"""CPU seconds and memory of each perturbation, and the ratio of its seconds to those of segmenting the same mesh.

    python -m tests.benchmarks.perturbations [--sizes 5000 25000 400000] [--output results/performance]

Each measurement is a separate process with one thread; everything is loaded and compiled before the clock starts, and
the mesh has nothing cached. A ratio above 1 means that perturbing takes longer than segmenting.
"""

import argparse
import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil

import heatwalk
import perturb
from tests.helpers.surfaces import surface

SIZES = (5_000, 25_000, 400_000)
WARM_UP = 5_000
LARGEST_REPEATED = 25_000  # meshes up to this size are measured three times, and the median is reported
SEGMENTING = "segmenting"
PERTURBATIONS = {
    "normal_noise": perturb.NormalNoise(),
    "shot_noise": perturb.ShotNoise(),
    "holes": perturb.Holes(),
    "holes, one_rings": perturb.Holes(unit="one_rings"),
    "short_circuits": perturb.ShortCircuits(),
    "short_circuits, strip": perturb.ShortCircuits(bridge="strip"),
    "decimation": perturb.Decimation(),
    "decimation, pymeshlab": perturb.Decimation(backend="pymeshlab"),
    "scaling": perturb.Scaling(),
    "missing_parts": perturb.MissingParts(),
    "missing_parts, plane": perturb.MissingParts(shape="plane"),
    "tessellation, isotropic": perturb.Tessellation(),
    "tessellation, anisotropic": perturb.Tessellation(method="anisotropic"),
    "tessellation, irregular": perturb.Tessellation(method="irregular"),
    "tessellation, subdivision": perturb.Tessellation(4, method="subdivision"),
}
_LISTED = {perturbation.name for perturbation in PERTURBATIONS.values()}
PERTURBATIONS |= {name: perturb.get(name)() for name in perturb.names() if name not in _LISTED}


def measure(name, surface_file):
    """Median CPU seconds and peak memory in bytes, measured in a separate process."""
    environment = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, "-m", "tests.benchmarks.perturbations", "--measure", name, "--surface", surface_file]
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def _measure_here(name, surface_file):
    with np.load(surface_file) as loaded:
        vertices, faces = loaded["vertices"], loaded["faces"]
    _run(name, *surface(WARM_UP))
    repetitions = 3 if len(vertices) <= 1.1 * LARGEST_REPEATED else 1
    seconds = [_run(name, vertices, faces) for _ in range(repetitions)]
    print(json.dumps({"seconds": statistics.median(seconds), "peak_bytes": _peak_memory()}))


def _run(name, vertices, faces):
    mesh = perturb.as_trimesh(vertices, faces)
    start = time.process_time()
    if name == SEGMENTING:
        heatwalk.segment(vertices, faces)
    else:
        PERTURBATIONS[name](mesh, np.random.default_rng(0))
    return time.process_time() - start


def _peak_memory():
    """Peak memory of this process in bytes."""
    if sys.platform == "win32":
        return psutil.Process().memory_info().peak_wset
    import resource

    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit


def run(sizes):
    """Measure everything: dict (name, size) -> its results."""
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        for size in sizes:
            file = str(Path(folder) / f"{size}.npz")
            vertices, faces = surface(size)
            np.savez(file, vertices=vertices, faces=faces)
            for name in (SEGMENTING, *PERTURBATIONS):
                results[name, size] = measure(name, file)
                print(f"{size:>9,} {name:<26}", json.dumps(results[name, size]), flush=True)
    return results


def table(results, sizes):
    """Markdown with one row per perturbation and, per size, its seconds, their ratio to segmenting, and the memory."""
    lines = [
        "# Perturbations",
        "",
        "Made by `python -m tests.benchmarks.perturbations`. For each number of vertices: CPU seconds with one thread, "
        "in parentheses their ratio to those of segmenting the same mesh, and the peak memory of the process. Load "
        f"average over the last 15 minutes, to which this benchmark contributes 1: {psutil.getloadavg()[2]:.1f} on "
        f"{os.cpu_count()} processors.",
        "",
        "| perturbation | " + " | ".join(f"{size:,}" for size in sizes) + " |",
        "| --- |" + " --- |" * len(sizes),
    ]
    for name in (SEGMENTING, *PERTURBATIONS):
        cells = []
        for size in sizes:
            seconds, peak = results[name, size]["seconds"], results[name, size]["peak_bytes"]
            ratio = seconds / results[SEGMENTING, size]["seconds"]
            cells.append(f"{seconds:.2f} ({ratio:.2f}), {peak / 1e9:.2f} GB")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES, help="numbers of vertices")
    parser.add_argument("--output", type=Path, default=Path("results/performance"))
    parser.add_argument("--measure", choices=(SEGMENTING, *PERTURBATIONS), help=argparse.SUPPRESS)
    parser.add_argument("--surface", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        _measure_here(arguments.measure, arguments.surface)
    else:
        written = table(run(arguments.sizes), arguments.sizes)
        arguments.output.mkdir(parents=True, exist_ok=True)
        (arguments.output / "perturbations.md").write_text(written, encoding="utf-8")
        print(written, end="")
