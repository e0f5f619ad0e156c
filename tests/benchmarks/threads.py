"""What several threads save on one mesh: elapsed and CPU seconds of `heatwalk.segment` by the number of threads.

    python -m tests.benchmarks.threads [--largest 1000000] [--threads 1 2] [--repeats 5] [--output results/performance]

Every process measures all numbers of threads in turn on one surface, after a first call of each, and takes the fastest
of so many calls; no variable of BLAS or OpenMP is set. On a machine that does other things, ratios are too large: its
load is written with them. Peak memory is that of a process of its own with the largest number of threads.

Processors share caches and the way to memory. What two of them can save at most is measured by two processes that
segment the same surface at the same time, with one thread each: they share no work, and wait for nothing but memory.

A virtual machine must ask its host for memory that it has not used lately, which takes seconds per GB. How time grows
is therefore also measured in a process whose C library (glibc) keeps what was freed, in a later call, which finds it.
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
KEEP_MEMORY = {"MALLOC_MMAP_THRESHOLD_": str(2**33), "MALLOC_TRIM_THRESHOLD_": str(2**34)}
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
    fastest, calls = {}, {number: [] for number in threads}
    for number in threads:
        heatwalk.segment(*small, threads=number)
    for _ in range(repeats):
        for number in threads:
            cpu, elapsed = time.process_time(), time.perf_counter()
            seg = heatwalk.segment(vertices, faces, threads=number)
            elapsed, cpu = time.perf_counter() - elapsed, time.process_time() - cpu
            calls[number].append(elapsed)
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
    return [{**row, "calls": calls[number], "peak_bytes": peak_memory()} for number, row in fastest.items()]


def in_processes(file, threads, repeats, processes=1, variables=None):
    """`measure` in so many new processes at the same time, without variables that limit threads: a list for each."""
    environment = {name: value for name, value in os.environ.items() if name not in VARIABLES} | (variables or {})
    command = [sys.executable, "-m", "tests.benchmarks.threads", "--measure", str(file), "--repeats", str(repeats)]
    command += ["--threads", *map(str, threads)]
    started = [subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(processes)]
    printed = [process.communicate()[0] for process in started]
    return [json.loads(each) for each in printed]


def stored_surface(size, folder):
    """A file with a surface: making it takes memory that is not to be measured."""
    import numpy as np

    from tests.helpers.surfaces import surface

    vertices, faces = surface(size)
    file = folder / f"{size}.npz"
    np.savez(file, vertices=vertices, faces=faces)
    return file


def targets(rows, peaks, at_once, kept):
    """Measures, targets, values, whether they are met, and what two processes at once show to be possible."""
    elapsed = {(row["size"], row["threads"]): row["elapsed"] for row in rows}
    found = []
    for size, most in TARGETS:
        if {(size, 1), (size, 2)} <= elapsed.keys():
            possible = f"{at_once[size] / 2 / elapsed[size, 1]:.3g}" if size in at_once else ""
            found.append((f"two threads over one at {size:,}", most, elapsed[size, 2] / elapsed[size, 1], possible))
    if {(1_000_000, 1), (100_000, 1)} <= elapsed.keys():
        growth = elapsed[1_000_000, 1] / elapsed[100_000, 1]
        found.append(("one thread, time at 1,000,000 over time at 100,000", MOST_GROWTH, growth, ""))
        growth = kept[1_000_000] / kept[100_000]
        found.append(("the same, of calls that find their memory in the process", MOST_GROWTH, growth, ""))
    if 1_000_000 in peaks:
        found.append(("peak memory at 1,000,000, GB", MOST_MEMORY, peaks[1_000_000] / 1e9, ""))
    return [
        (name, f"≤ {most:g}", f"{value:.3g}", "met" if value <= most else "missed", possible)
        for name, most, value, possible in found
    ]


def table(rows, peaks, at_once, kept, load):
    """The results as lines of Markdown."""
    one = {row["size"]: row["elapsed"] for row in rows if row["threads"] == 1}
    lines = [
        "# Threads",
        "",
        "Made by `python -m tests.benchmarks.threads`. Elapsed and CPU seconds of `heatwalk.segment`, and elapsed "
        f"seconds of its steps. Load average before: {load:.1f} on {os.cpu_count()} processors.",
        "",
        "| measure | target | reached | | at best here |",
        "| --- | --- | --- | --- | --- |",
        *("| " + " | ".join(cells) + " |" for cells in targets(rows, peaks, at_once, kept)),
        "",
        "At best here: half of the elapsed time of two processes that segment the same surface at the same time with "
        "one thread each, over that of one alone. They share no work, and wait for nothing but the memory that both "
        "processors use. Calls that find their memory in the process: "
        + "; ".join(f"{size:,} vertices {seconds:.2f} s" for size, seconds in kept.items())
        + ".",
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
    load, rows, peaks, at_once, kept = os.getloadavg()[0], [], {}, {}, {}
    for size in (size for size in SIZES if size <= arguments.largest):
        with TemporaryDirectory() as folder:
            file = stored_surface(size, Path(folder))
            repeats = arguments.repeats if size < SIZES[-1] else 2
            (found,) = in_processes(file, arguments.threads, repeats)
            peaks[size] = in_processes(file, arguments.threads[-1:], 1)[0][0]["peak_bytes"]
            # The last call of a process may be after the other one has ended.
            pair = in_processes(file, [1], repeats + 1, processes=2)
            at_once[size] = sum(min(each[0]["calls"][:-1]) for each in pair) / 2
            kept[size] = in_processes(file, [1], 3, variables=KEEP_MEMORY)[0][0]["elapsed"]
        rows += [{"size": size, **row} for row in found]
        print(*(f"{size:>9,} {row['threads']} {row['elapsed']:.3f} s" for row in found), sep="\n", flush=True)
    (arguments.output / "threads.md").write_text("\n".join(table(rows, peaks, at_once, kept, load)) + "\n")


if __name__ == "__main__":
    main()
