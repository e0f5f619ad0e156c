"""What several threads save on one mesh: elapsed and CPU seconds of `heatwalk.segment` by the number of threads.

    python -m tests.benchmarks.threads [--largest 1000000] [--threads 1 2] [--repeats 5] [--output results/performance]

Every process measures all numbers of threads in turn on one surface, after a first call of each, and takes the fastest
of so many calls; no variable of BLAS or OpenMP is set. On a machine that does other things, ratios are too large: its
load is written with them. Peak memory is that of a process of its own with the largest number of threads.
"""

import argparse
import hashlib
import json
import os
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.benchmarks.scaling import STAGES, peak_memory

SIZES = (10_000, 35_000, 100_000, 1_000_000)
VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")

# (vertices, elapsed seconds with two threads over those with one, at most)
TARGETS = ((100_000, 0.62), (1_000_000, 0.58))
MOST_GROWTH = 14  # of the seconds from 100,000 to a million vertices
MOST_MEMORY = 1.3  # GB at a million


def measure(file, threads, repeats):
    """Seconds of each number of threads on the surface in a file: a list of dicts."""
    import numpy as np

    import heatwalk
    from tests.helpers.surfaces import surface

    with np.load(file) as arrays:
        vertices, faces = arrays["vertices"], arrays["faces"]
    small = surface(40_000)
    fastest = {}
    for number in threads:
        heatwalk.segment(*small, threads=number)
    for _ in range(repeats):
        for number in threads:
            cpu, elapsed = time.process_time(), time.perf_counter()
            seg = heatwalk.segment(vertices, faces, threads=number)
            elapsed, cpu = time.perf_counter() - elapsed, time.process_time() - cpu
            row = {
                "vertices": len(vertices),
                "threads": number,
                "elapsed": elapsed,
                "cpu": cpu,
                "labels": hashlib.sha256(seg.labels.tobytes()).hexdigest()[:16],
                **{stage: seg.seconds[stage] for stage in STAGES},
            }
            fastest[number] = min(row, fastest.get(number, row), key=lambda each: each["elapsed"])
            del seg
    return [{**row, "peak_bytes": peak_memory()} for row in fastest.values()]


def in_a_process(file, threads, repeats):
    """`measure` in a new process without variables that limit threads."""
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES}
    command = [sys.executable, "-m", "tests.benchmarks.threads", "--measure", str(file), "--repeats", str(repeats)]
    command += ["--threads", *map(str, threads)]
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def stored_surface(size, folder):
    """A file with a surface: making it takes memory that is not to be measured."""
    import numpy as np

    from tests.helpers.surfaces import surface

    vertices, faces = surface(size)
    file = folder / f"{size}.npz"
    np.savez(file, vertices=vertices, faces=faces)
    return file


def targets(rows, peaks):
    """Measures, targets, values and whether they are met."""
    elapsed = {(row["size"], row["threads"]): row["elapsed"] for row in rows}
    found = []
    for size, most in TARGETS:
        if {(size, 1), (size, 2)} <= elapsed.keys():
            found.append((f"two threads over one at {size:,}", most, elapsed[size, 2] / elapsed[size, 1]))
    if {(1_000_000, 1), (100_000, 1)} <= elapsed.keys():
        growth = elapsed[1_000_000, 1] / elapsed[100_000, 1]
        found.append(("one thread, time at 1,000,000 over time at 100,000", MOST_GROWTH, growth))
    if 1_000_000 in peaks:
        found.append(("peak memory at 1,000,000, GB", MOST_MEMORY, peaks[1_000_000] / 1e9))
    return [(name, f"≤ {most:g}", f"{value:.3g}", "met" if value <= most else "missed") for name, most, value in found]


def table(rows, peaks, load):
    """The results as lines of Markdown."""
    one = {row["size"]: row["elapsed"] for row in rows if row["threads"] == 1}
    lines = [
        "# Threads",
        "",
        "Made by `python -m tests.benchmarks.threads`. Elapsed and CPU seconds of `heatwalk.segment`, and elapsed "
        f"seconds of its steps. Load average before: {load:.1f} on {os.cpu_count()} processors.",
        "",
        "| measure | target | reached | |",
        "| --- | --- | --- | --- |",
        *("| " + " | ".join(cells) + " |" for cells in targets(rows, peaks)),
        "",
        f"| vertices | threads | elapsed | over one | CPU | {' | '.join(STAGES)} | labels |",
        "|" + " --- |" * (6 + len(STAGES)),
    ]
    for row in rows:
        ratio = f"{row['elapsed'] / one[row['size']]:.2f}" if row["size"] in one else ""
        stages = " | ".join(f"{row[stage]:.3f}" for stage in STAGES)
        lines.append(
            f"| {row['vertices']:,} | {row['threads']} | {row['elapsed']:.3f} | {ratio} | {row['cpu']:.3f} | {stages} "
            f"| {row['labels']} |"
        )
    return lines


def main():
    """Measure all sizes, and write the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="number of vertices of the largest surface")
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2], help="numbers of threads to compare")
    parser.add_argument("--repeats", type=int, default=5)
    parser.add_argument("--output", type=Path, default=Path("results/performance"))
    parser.add_argument("--measure", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        print(json.dumps(measure(arguments.measure, arguments.threads, arguments.repeats)))
        return
    load, rows, peaks = os.getloadavg()[0], [], {}
    for size in (size for size in SIZES if size <= arguments.largest):
        with TemporaryDirectory() as folder:
            file = stored_surface(size, Path(folder))
            found = in_a_process(file, arguments.threads, arguments.repeats if size < SIZES[-1] else 2)
            peaks[size] = in_a_process(file, arguments.threads[-1:], 1)[0]["peak_bytes"]
        rows += [{"size": size, **row} for row in found]
        print(*(f"{size:>9,} {row['threads']} {row['elapsed']:.3f} s" for row in found), sep="\n", flush=True)
    (arguments.output / "threads.md").write_text("\n".join(table(rows, peaks, load)) + "\n")


if __name__ == "__main__":
    main()
