"""Seconds and memory of segmentation against the number of vertices, and against what stands in its place today.

    python -m tests.benchmarks.scaling [--largest 1000000] [--output results/performance]

Every measurement is a process of its own with one BLAS thread; seconds are CPU seconds, the fewest of two to five
processes: memory that a virtual machine has given back to its host takes seconds a gigabyte to get again. Of each pair
of commands that make a ratio, both run in this one run, one after the other.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SIZES = (1_000, 5_000, 25_000, 100_000, 400_000, 1_000_000)
LARGEST_DENSE = 25_000  # n x n arrays: 5 GB each
SAMPLED_ROWS = 20_000  # of the blocked product, where all rows would take hours
STAGES = ("operator", "spectrum", "walk", "dissipators")


def ours(vertices, faces):
    """Mesh to labels, by stage."""
    import heatwalk

    warm_up()
    start = time.process_time()
    seg = heatwalk.segment(vertices, faces)
    total = time.process_time() - start
    shares = {stage: seg.seconds[stage] / sum(seg.seconds.values()) for stage in STAGES}
    return {
        "seconds": total,
        **{stage: total * share for stage, share in shares.items()},
        "pairs": int(seg.spectrum.eigenvalues.shape[1]),
        "regions": len(seg.exemplars),
    }


def scipy_eigsh(vertices, faces):
    """SciPy's own generalised shift-and-invert, 30 pairs, nothing tuned."""
    return {"seconds": timed(lambda: _eigsh(*_operator(vertices, faces)))}


def todays_code(vertices, faces):
    """What a user would write: the operator, eigsh, and the walk by blocks of kernel rows in NumPy."""
    return {"seconds": timed(lambda: _blocked_walk(_factor(*_eigsh(*_operator(vertices, faces)))))}


def blocked_product(vertices, faces):
    """The largest inner product of every row by blocked matrix products; of a sample of the rows where n is large."""
    import numpy as np

    factor = np.random.default_rng(0).standard_normal((len(vertices), 15))
    rows = min(len(factor), SAMPLED_ROWS)
    return {"seconds": timed(lambda: _largest_products(factor, rows)) * len(factor) / rows, "sampled_rows": rows}


def dense(vertices, faces):
    """The paper as printed, with n x n arrays, vectorised over rows; the eigenpairs by eigsh."""
    return {"seconds": timed(lambda: _dense_paper(_factor(*_eigsh(*_operator(vertices, faces)))))}


def import_heatwalk(vertices, faces):
    """Wall seconds of ``import heatwalk`` in a new process, the median of seven."""

    def once():
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", "import heatwalk"], check=True)
        with_it = time.perf_counter() - start
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", "pass"], check=True)
        return with_it - (time.perf_counter() - start)

    return {"seconds": sorted(once() for _ in range(7))[3]}


def timed(function):
    warm_up()
    start = time.process_time()
    function()
    return time.process_time() - start


def warm_up():
    """Load, and compile if need be, everything before the clock starts."""
    import numpy as np

    import heatwalk

    i, j = np.divmod(np.arange(60 * 60), 60)
    corner = np.flatnonzero((i < 59) & (j < 59))
    faces = np.vstack(
        [np.column_stack([corner, corner + 60, corner + 61]), np.column_stack([corner, corner + 61, corner + 1])]
    )
    heatwalk.segment(np.column_stack([i, j, np.sin(i / 9) * j / 3]), faces)


def _operator(vertices, faces):
    from heatwalk.laplacian import stiffness_and_mass, unit_area

    return stiffness_and_mass(unit_area(vertices, faces), faces)


def _eigsh(stiffness, mass):
    import scipy.sparse as sp
    from scipy.sparse.linalg import eigsh

    return eigsh(stiffness, 30, sp.diags_array(mass).tocsc(), sigma=-0.01)


def _factor(eigenvalues, eigenvectors):
    import numpy as np

    return eigenvectors * np.exp(-np.maximum(eigenvalues, 0) / 12)  # e^{-λt/2} at the paper's time 1, t = 1/6


def _largest_products(factor, rows, block=1024):
    return [(factor[i : min(i + block, rows)] @ factor.T).argmax(axis=1) for i in range(0, rows, block)]


def _blocked_walk(factor, block=1024):
    import numpy as np

    remaining, potential = np.arange(len(factor)), np.einsum("ij,ij->i", factor, factor)
    root = remaining
    while True:
        chosen, updated = np.empty(len(remaining), dtype=int), np.empty(len(remaining))
        for i in range(0, len(remaining), block):
            capacity = np.minimum(factor[remaining[i : i + block]] @ factor[remaining].T, potential[remaining])
            chosen[i : i + block] = capacity.argmax(axis=1)
            updated[i : i + block] = capacity.max(axis=1)
        potential[remaining] = updated
        following = np.arange(len(factor))
        following[remaining] = remaining[chosen]
        root = following[root]
        left = np.unique(remaining[chosen])
        if len(left) == len(remaining):
            return root
        remaining = left


def _dense_paper(factor):
    import numpy as np

    kernel = factor @ factor.T
    potential, remaining = np.diag(kernel).copy(), np.arange(len(kernel))
    root = remaining
    while True:
        capacity = np.minimum(kernel[np.ix_(remaining, remaining)], potential[remaining])
        following = np.arange(len(kernel))
        following[remaining] = remaining[capacity.argmax(axis=1)]
        potential[remaining] = capacity.max(axis=1)
        del capacity
        root = following[root]
        left = np.unique(following[remaining])
        if len(left) == len(remaining):
            break
        remaining = left
    np.maximum(kernel, 1e-300, out=kernel)
    density = kernel / kernel.sum(axis=1, keepdims=True)
    labels = root.copy()
    for exemplar in remaining:
        members = root == exemplar
        mean = kernel[members].sum(axis=0)
        mean /= mean.sum()
        p = density[members]
        from_cluster = (p * np.log(p / mean)).sum(axis=1)
        from_uniform = (p * np.log(p * len(kernel))).sum(axis=1)
        labels[np.flatnonzero(members)[from_cluster > from_uniform]] = -1
    return labels


MEASUREMENTS = {
    function.__name__: function
    for function in (ours, scipy_eigsh, todays_code, blocked_product, dense, import_heatwalk)
}


def measure(name, surface_file):
    """One measurement, the quickest of a few processes of its own: its figures, and the process's peak memory in bytes.

    Five where they take half a minute at most, else at least two.
    """
    environment = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, "-m", "tests.benchmarks.scaling", "--measure", name, "--surface", str(surface_file)]
    runs, start = [], time.perf_counter()
    while len(runs) < 2 or (len(runs) < 5 and time.perf_counter() - start < 30):
        run = subprocess.run(command, env=environment, check=True, capture_output=True, text=True)
        runs.append(json.loads(run.stdout))
    return min(runs, key=lambda figures: figures["seconds"])


def _measure_here(name, surface_file):
    import numpy as np

    with np.load(surface_file) as surface:
        vertices, faces = surface["vertices"], surface["faces"]
    figures = MEASUREMENTS[name](vertices, faces)
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    print(json.dumps({"n": len(vertices), "peak_bytes": peak, **figures}))


def throughput(folder, seconds=60):
    """Meshes segmented a second by two processes over one: benchmark-sized surfaces, each process its own loop."""
    code = (
        "import sys, time, threadpoolctl, numpy as np, heatwalk\n"
        "threadpoolctl.threadpool_limits(1)\n"
        "loaded = [np.load(f) for f in sys.argv[2:]]\n"
        "meshes = [(s['vertices'], s['faces']) for s in loaded]\n"
        "heatwalk.segment(*meshes[0])\n"
        "print('ready', flush=True); sys.stdin.readline()\n"
        "done, start = 0, time.perf_counter()\n"
        "while time.perf_counter() - start < float(sys.argv[1]):\n"
        "    heatwalk.segment(*meshes[done % len(meshes)]); done += 1\n"
        "print(done / (time.perf_counter() - start))\n"
    )
    files = [str(file) for file in sorted(folder.glob("*.npz")) if int(file.stem) in (5_000, 25_000)]

    def rate(processes):
        running = [
            subprocess.Popen(
                [sys.executable, "-c", code, str(seconds / 2), *files],
                stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
            )
            for _ in range(processes)
        ]  # fmt: skip
        for process in running:
            process.stdout.readline()
        for process in running:
            process.stdin.write("\n")
            process.stdin.flush()
        return sum(float(process.communicate()[0]) for process in running)

    one, two = rate(1), rate(2)
    return {"one": one, "two": two}


def run(largest, folder):
    """Every measurement up to ``largest`` vertices: dict (measurement, size) -> figures, written as it grows."""
    import numpy as np

    from tests.helpers.surfaces import surface

    folder.mkdir(parents=True, exist_ok=True)
    figures = {}
    with tempfile.TemporaryDirectory() as surfaces:
        for size in (size for size in SIZES if size <= largest):
            file = Path(surfaces) / f"{size}.npz"
            vertices, faces = surface(size)
            np.savez(file, vertices=vertices, faces=faces)
            wanted = ["ours", "scipy_eigsh"]
            wanted += ["blocked_product"] if size <= 100_000 else []
            wanted += ["todays_code"] if size in (25_000, 100_000) else []
            wanted += ["dense"] if size <= LARGEST_DENSE else []
            for name in wanted:
                figures[name, size] = measure(name, file)
                print(f"{size:>9,} {name:<16}", json.dumps(figures[name, size]), flush=True)
        figures["import_heatwalk", 0] = measure("import_heatwalk", file)
        figures["throughput", 0] = throughput(Path(surfaces))
        figures["load", 0] = {"average": os.getloadavg()[2], "processors": os.cpu_count()}
    return figures


def targets(figures):
    """What is measured, the target, and what it came to: list of (measure, target, value, whether it is met)."""

    def of(name, size, key="seconds"):
        return figures.get((name, size), {}).get(key, float("nan"))

    rows = []

    def at_most(measure, target, value):
        rows.append((measure, f"≤ {target:g}", value, value <= target))

    def at_least(measure, target, value):
        rows.append((measure, f"≥ {target:g}", value, value >= target))

    for size, most in ((25_000, 0.15), (100_000, 0.15), (400_000, 0.15), (1_000_000, 0.25)):
        at_most(f"walk over eigensolve at {size:,}", most, of("ours", size, "walk") / of("ours", size, "spectrum"))
    for size, least in ((25_000, 50), (100_000, 150)):
        at_least(
            f"blocked matrix product over our walk at {size:,}",
            least,
            of("blocked_product", size) / of("ours", size, "walk"),
        )
    for size, most in ((25_000, 1.25), (100_000, 1.25), (400_000, 1.25), (1_000_000, 1.35)):
        at_most(
            f"mesh to labels over the eigensolve at {size:,}", most, of("ours", size) / of("ours", size, "spectrum")
        )
    for size, most in ((100_000, 0.45), (400_000, 0.40), (1_000_000, 0.33)):
        at_most(
            f"mesh to labels over SciPy's eigsh alone at {size:,}", most, of("ours", size) / of("scipy_eigsh", size)
        )
    for size, least in ((25_000, 8), (100_000, 15)):
        at_least(f"today's code over ours at {size:,}", least, of("todays_code", size) / of("ours", size))
    at_least("the paper written densely over ours at 25,000: time", 80, of("dense", 25_000) / of("ours", 25_000))
    peak = of("dense", 25_000, "peak_bytes") / of("ours", 25_000, "peak_bytes")
    at_least("the paper written densely over ours at 25,000: memory", 20, peak)
    at_most("time at 1,000,000 over time at 100,000", 14, of("ours", 1_000_000) / of("ours", 100_000))
    at_most("peak memory at 1,000,000, GB", 2.5, of("ours", 1_000_000, "peak_bytes") / 1e9)
    at_least("meshes a second, 2 processes over 1", 1.8, of("throughput", 0, "two") / of("throughput", 0, "one"))
    at_most("import heatwalk, seconds", 0.5, of("import_heatwalk", 0))
    return [row for row in rows if row[2] == row[2]]


def write(figures, folder):
    """The table of targets, the table of stages, and the log-log plot."""
    from matplotlib.figure import Figure  # not in the processes whose memory is measured

    sizes = sorted(size for name, size in figures if name == "ours")
    lines = [
        "# Performance",
        "",
        "Made by `python -m tests.benchmarks.scaling`. CPU seconds, one thread, the fewest of two to five processes. "
        "Load average of the "
        f"last quarter of an hour, of which 1 is this benchmark's own: {figures['load', 0]['average']:.1f} on "
        f"{figures['load', 0]['processors']} processors.",
        "",
    ]
    lines += ["| measure | target | reached | |", "| --- | --- | --- | --- |"]
    lines += [f"| {m} | {t} | {v:.3g} | {'met' if met else 'missed'} |" for m, t, v, met in targets(figures)]
    lines += [
        "",
        "| vertices | pairs | " + " | ".join(STAGES) + " | total | peak GB | SciPy's eigsh |",
        "|" + " --- |" * 9,
    ]
    for size in sizes:
        row = figures["ours", size]
        stages = " | ".join(f"{row[stage]:.3f}" for stage in STAGES)
        lines.append(
            f"| {row['n']:,} | {row['pairs']} | {stages} | {row['seconds']:.2f} | {row['peak_bytes'] / 1e9:.2f} "
            f"| {figures['scipy_eigsh', size]['seconds']:.2f} |"
        )
    (folder / "performance.md").write_text("\n".join(lines) + "\n")
    (folder / "performance.json").write_text(
        json.dumps([{"measurement": name, "size": size, **row} for (name, size), row in figures.items()], indent=1)
        + "\n"
    )

    figure = Figure(figsize=(9, 4), dpi=150, layout="constrained")
    seconds, memory = figure.subplots(1, 2)
    for stage in STAGES:
        seconds.loglog(sizes, [figures["ours", size][stage] for size in sizes], marker=".", lw=1, label=stage)
    seconds.loglog(sizes, [figures["ours", size]["seconds"] for size in sizes], "k-o", label="mesh to labels")
    others = {"scipy_eigsh": "SciPy's eigsh alone", "todays_code": "today's code", "dense": "the paper, n x n"}
    for colour, (name, label) in enumerate(others.items(), start=len(STAGES)):
        at = sorted(size for other, size in figures if other == name)
        style = {"marker": "s", "ms": 4, "ls": "--", "color": f"C{colour}", "label": label}
        seconds.loglog(at, [figures[name, size]["seconds"] for size in at], **style)
        memory.loglog(at, [figures[name, size]["peak_bytes"] / 1e9 for size in at], **style)
    memory.loglog(sizes, [figures["ours", size]["peak_bytes"] / 1e9 for size in sizes], "k-o", label="mesh to labels")
    seconds.set(xlabel="vertices", ylabel="CPU seconds, one thread")
    seconds.set_ylim(top=20 * seconds.get_ylim()[1])  # the legend stands above the steepest line
    memory.set(xlabel="vertices", ylabel="peak memory of the process, GB")
    for axes in (seconds, memory):
        axes.grid(alpha=0.25)
        axes.legend(fontsize=7, frameon=False)
    figure.savefig(folder / "performance.png")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="vertices of the largest surface")
    parser.add_argument("--output", type=Path, default=Path("results/performance"))
    parser.add_argument("--measure", choices=MEASUREMENTS, help=argparse.SUPPRESS)
    parser.add_argument("--surface", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        _measure_here(arguments.measure, arguments.surface)
    else:
        figures = run(arguments.largest, arguments.output)
        write(figures, arguments.output)
        for measure_name, target, value, met in targets(figures):
            print(f"{'met   ' if met else 'MISSED'} {value:>9.3g} {target:>8}  {measure_name}")
