"""Seconds and peak memory of every shipped method on one mesh of about 10,000 vertices.

    python -m tests.benchmarks.segmenters [--size 10000] [--methods kmeans spectral] [--output results/performance]

Each method has a new process, which makes labels of arrays twice, with one thread. The first time includes the loading
of packages and, if they are not in the cache, the compilation of inner loops. Memory is that which segmenting needed at
most, above what the process used before. The mesh is the hand of the synthetic shapes; methods that are told the number
of segments are told that of its parts.
"""

import argparse
import json
import os
import subprocess
import sys
import time
from pathlib import Path

import psutil

SIZE = 10_000  # vertices
MODEL = "hand"
LIMIT = 30  # seconds that a method may take
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def methods():
    """The shipped methods by name."""
    from docs.methods import methods

    return methods()


def measure(name, size):
    """Elapsed and CPU seconds, peak memory and number of segments, measured in a separate process."""
    environment = os.environ | dict.fromkeys(THREADS, "1")
    command = [sys.executable, "-m", "tests.benchmarks.segmenters", "--measure", name, "--size", str(size)]
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def _measure_here(name, size):
    import numpy as np

    from studies.execution.peak_memory import peak_memory

    model = _model(size)
    mesh, method = model.load(), methods()[name].for_model(model)
    with peak_memory() as memory:
        start, cpu = time.perf_counter(), time.process_time()
        labels = method(mesh.vertices, mesh.faces)
        elapsed, cpu = time.perf_counter() - start, time.process_time() - cpu
    again = time.process_time()
    method(mesh.vertices, mesh.faces)
    again = time.process_time() - again
    print(
        json.dumps(
            {
                "vertices": len(mesh.vertices),
                "faces": len(mesh.faces),
                "elapsed": elapsed,
                "first": cpu,
                "seconds": again,
                "peak_megabytes": memory.megabytes,
                "segments": len(np.unique(labels)),
            }
        )
    )


def _model(size):
    from studies.datasets.synthetic import Synthetic

    (model,) = Synthetic(models=[MODEL], resolution=size).models()
    return model


def table(results):
    """Markdown with one row per method, the slowest last."""
    (vertices,) = {row["vertices"] for row in results.values()}
    (faces,) = {row["faces"] for row in results.values()}
    lines = [
        "# Methods",
        "",
        f"Made by `python -m tests.benchmarks.segmenters`: the synthetic {MODEL} with {vertices:,} vertices and "
        f"{faces:,} faces, in a new process for each method, from arrays to labels, with one thread. The first call "
        "includes the loading of packages. Memory is that which the first call needed at most, above what the process "
        f"used before. Load average over the last 15 minutes: {psutil.getloadavg()[2]:.1f} on {os.cpu_count()} "
        "processors; the more there is to do besides, the longer are elapsed seconds.",
        "",
        "| method | CPU seconds | first call, CPU | first call, elapsed | peak memory (MB) | segments |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for name, row in sorted(results.items(), key=lambda item: item[1]["seconds"]):
        lines.append(
            f"| `{name}` | {row['seconds']:.2f} | {row['first']:.2f} | {row['elapsed']:.2f} "
            f"| {row['peak_megabytes']:.0f} | {row['segments']} |"
        )
    slow = sorted(name for name, row in results.items() if row["elapsed"] > LIMIT)
    return "\n".join([*lines, "", f"First call longer than {LIMIT} s: {', '.join(slow) or 'none'}."]) + "\n"


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--size", type=int, default=SIZE, help="number of vertices")
    parser.add_argument("--methods", nargs="+", help="names in conf/segmenter; by default all")
    parser.add_argument("--output", type=Path, default=Path("results/performance"))
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        _measure_here(arguments.measure, arguments.size)
    else:
        results = {}
        for method_name in arguments.methods or methods():
            results[method_name] = measure(method_name, arguments.size)
            print(f"{method_name:<26}", json.dumps(results[method_name]), flush=True)
        written = table(results)
        arguments.output.mkdir(parents=True, exist_ok=True)
        (arguments.output / "segmenters.md").write_text(written, encoding="utf-8")
        print(written, end="")
