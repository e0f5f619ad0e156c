"""CPU seconds and memory of each perturbation, and its share of the seconds of segmenting the same mesh.

    python -m tests.benchmarks.perturbations [--sizes 5000 25000 400000] [--output results/performance]

Every measurement is a process of its own with one thread, everything loaded and compiled before the clock starts; the
mesh has nothing cached. A share above 1 is a perturbation slower than segmenting.
"""

import argparse
import json
import os
import resource
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import trimesh

import heatwalk
import perturb
from tests.helpers.surfaces import surface

SIZES = (5_000, 25_000, 400_000)
WARM_UP = 5_000
LARGEST_REPEATED = 25_000  # three times, of which the median counts
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


def measure(name, surface_file):
    """Median CPU seconds, and peak memory in bytes, in a process of its own."""
    environment = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, "-m", "tests.benchmarks.perturbations", "--measure", name, "--surface", surface_file]
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def _measure_here(name, surface_file):
    with np.load(surface_file) as loaded:
        vertices, faces = loaded["vertices"], loaded["faces"]
    _run(name, *surface(WARM_UP))
    seconds = []
    for _ in range(3 if len(vertices) <= 1.1 * LARGEST_REPEATED else 1):
        seconds.append(_run(name, vertices, faces))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(json.dumps({"seconds": statistics.median(seconds), "peak_bytes": peak}))


def _run(name, vertices, faces):
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    start = time.process_time()
    if name == SEGMENTING:
        heatwalk.segment(vertices, faces)
    else:
        PERTURBATIONS[name](mesh, np.random.default_rng(0))
    return time.process_time() - start


def run(sizes):
    """Every measurement: dict (name, size) -> its figures."""
    figures = {}
    with tempfile.TemporaryDirectory() as folder:
        for size in sizes:
            file = str(Path(folder) / f"{size}.npz")
            vertices, faces = surface(size)
            np.savez(file, vertices=vertices, faces=faces)
            for name in (SEGMENTING, *PERTURBATIONS):
                figures[name, size] = measure(name, file)
                print(f"{size:>9,} {name:<26}", json.dumps(figures[name, size]), flush=True)
    return figures


def table(figures, sizes):
    """Markdown: a row a perturbation; at each size its seconds, in brackets its share of segmenting, and the memory."""
    lines = [
        "# Perturbations",
        "",
        "Made by `python -m tests.benchmarks.perturbations`. At each number of vertices: CPU seconds with one thread, "
        "in brackets over those of segmenting the same mesh, and the peak memory of the process. Load average of the "
        f"last quarter of an hour, of which 1 is this benchmark's own: {os.getloadavg()[2]:.1f} on {os.cpu_count()} "
        "processors.",
        "",
        "| perturbation | " + " | ".join(f"{size:,}" for size in sizes) + " |",
        "| --- |" + " --- |" * len(sizes),
    ]
    for name in (SEGMENTING, *PERTURBATIONS):
        cells = []
        for size in sizes:
            seconds, peak = figures[name, size]["seconds"], figures[name, size]["peak_bytes"]
            share = seconds / figures[SEGMENTING, size]["seconds"]
            cells.append(f"{seconds:.2f} ({share:.2f}), {peak / 1e9:.2f} GB")
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES, help="vertices of the surfaces")
    parser.add_argument("--output", type=Path, default=Path("results/performance"))
    parser.add_argument("--measure", choices=(SEGMENTING, *PERTURBATIONS), help=argparse.SUPPRESS)
    parser.add_argument("--surface", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        _measure_here(arguments.measure, arguments.surface)
    else:
        written = table(run(arguments.sizes), arguments.sizes)
        arguments.output.mkdir(parents=True, exist_ok=True)
        (arguments.output / "perturbations.md").write_text(written)
        print(written, end="")
