"""Time and memory of segmentation as functions of the number of vertices, compared with the alternatives.

    python -m tests.benchmarks.scaling [--largest 1000000] [--output results/performance] [--solvers | --redraw]

Every measurement runs in its own process with one BLAS thread. Seconds are CPU seconds, the minimum of two to five
processes: a virtual machine that has returned memory to its host needs seconds per gigabyte to get it back. Both
commands of each ratio are measured in the same run, one after the other. The sparse solvers are also measured with the
default number of threads, in elapsed seconds.

Before it starts, it prints how much memory each measurement takes, and measurements that need more than is free are
left out: the method as printed in the paper, with n x n arrays, takes 15 GB at 25,000 vertices.
"""

import argparse
import json
import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

SIZES = (1_000, 5_000, 25_000, 100_000, 400_000, 1_000_000)
LARGEST_DENSE = 25_000  # n x n arrays: 5 GB each
SAMPLED_ROWS = 20_000  # of the blocked product, if all rows would take hours
BASE_BYTES = 250_000_000  # of a process that has loaded everything
BYTES_PER_VERTEX = {"ours": 2_500, "scipy_eigsh": 5_000, "blocked_product": 10_000, "plain_numpy": 30_000}
BYTES_PER_VERTEX_OF_SOLVERS = 5_000
STAGES = ("operator", "spectrum", "walk", "dissipators")

SOLVER_SIZES = (25_000, 100_000, 400_000, 1_000_000)
N_SOLVES = 41  # of two columns each: what the eigensolver needs for 21 pairs
SOLVER_LIMIT = 300  # seconds per process


def ours(vertices, faces):
    """Mesh to labels, with the seconds of each stage."""
    import heatwalk

    warm_up()
    start = time.process_time()
    seg = heatwalk.segment(vertices, faces)
    total = time.process_time() - start
    shares = {stage: seg.seconds[stage] / sum(seg.seconds[stage] for stage in STAGES) for stage in STAGES}
    return {
        "seconds": total,
        **{stage: total * share for stage, share in shares.items()},
        "pairs": int(seg.spectrum.eigenvalues.shape[1]),
        "regions": len(seg.exemplars),
    }


def scipy_eigsh(vertices, faces):
    """Generalised shift-and-invert of SciPy with default options, 30 pairs."""
    return {"seconds": timed(lambda: _eigsh(*_operator(vertices, faces)))}


def plain_numpy(vertices, faces):
    """What a user would write: the operator, eigsh, and the walk in NumPy by blocks of kernel rows."""
    return {"seconds": timed(lambda: _blocked_walk(_factor(*_eigsh(*_operator(vertices, faces)))))}


def blocked_product(vertices, faces):
    """The largest inner product of every row by blocked matrix products; of a sample of the rows if n is large."""
    import numpy as np

    factor = np.random.default_rng(0).standard_normal((len(vertices), 15))
    rows = min(len(factor), SAMPLED_ROWS)
    return {"seconds": timed(lambda: _largest_products(factor, rows)) * len(factor) / rows, "sampled_rows": rows}


def dense(vertices, faces):
    """The method as printed in the paper, with n x n arrays, vectorised over rows; the eigenpairs by eigsh."""
    return {"seconds": timed(lambda: _dense_paper(_factor(*_eigsh(*_operator(vertices, faces)))))}


def import_heatwalk(vertices, faces):
    """Elapsed seconds of ``import heatwalk`` in a new process, the median of seven."""

    def once():
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", "import heatwalk"], check=True)
        with_import = time.perf_counter() - start
        start = time.perf_counter()
        subprocess.run([sys.executable, "-c", "pass"], check=True)
        return with_import - (time.perf_counter() - start)

    return {"seconds": sorted(once() for _ in range(7))[3]}


def timed(function):
    warm_up()
    start = time.process_time()
    function()
    return time.process_time() - start


def warm_up():
    """Load everything, and compile it if necessary, before the clock starts."""
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


def solver_heatwalk(matrix, blocks):
    """The solver of this package."""
    from heatwalk.numerics.solver import PositiveDefiniteSolver

    solver = yield PositiveDefiniteSolver(matrix)
    for block in blocks:
        solver.solve(block)
    yield solver.n_entries


def solver_cholmod(matrix, blocks):
    """CHOLMOD by cholespy: simplicial, nested dissection by METIS."""
    import numpy as np
    from cholespy import CholeskySolverD, MatrixType

    indptr, indices = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
    solver = yield CholeskySolverD(matrix.shape[0], indptr, indices, matrix.data, MatrixType.CSR)
    for block in blocks:
        solver.solve(block, np.empty_like(block))
    yield None  # not available


def solver_superlu(matrix, blocks):
    """SuperLU by SciPy, with the options for a symmetric positive definite matrix."""
    from scipy.sparse.linalg import splu

    solver = yield splu(
        matrix.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True}
    )
    for block in blocks:
        solver.solve(block)
    yield solver.nnz


def measure_solver(solver, matrix):
    """Seconds to order and factorise a matrix and to solve with it; each CPU and elapsed."""
    import numpy as np
    import scipy.sparse as sp

    block = np.random.default_rng(0).standard_normal((matrix.shape[0], 2))
    small = sp.diags_array([-1.0, 3.0, -1.0], offsets=[-1, 0, 1], shape=(1000, 1000)).tocsr()
    warm = solver(small, [block[:1000]])
    warm.send(next(warm))

    marks = [(time.process_time(), time.perf_counter())]
    run = solver(matrix, [block] * N_SOLVES)
    factorised = next(run)
    marks.append((time.process_time(), time.perf_counter()))
    n_entries = run.send(factorised)
    marks.append((time.process_time(), time.perf_counter()))
    (factor_cpu, factor_elapsed), (solve_cpu, solve_elapsed) = np.diff(marks, axis=0).tolist()
    return {
        "seconds": factor_cpu + solve_cpu,
        "factor": factor_cpu,
        "solve": solve_cpu,
        "elapsed": factor_elapsed + solve_elapsed,
        "entries": n_entries,
    }


def shifted_matrix(vertices, faces):
    """The matrix that the eigensolver factorises: M^{-1/2} L M^{-1/2} - σ I, as scipy.sparse.csr_array."""
    import scipy.sparse as sp

    from heatwalk.numerics.sparse import scale_symmetric
    from heatwalk.spectrum import SHIFT

    stiffness, mass = _operator(vertices, faces)
    return (scale_symmetric(stiffness, mass**-0.5) - SHIFT * sp.eye_array(len(mass))).tocsr()


SOLVERS = {
    "solver_heatwalk": ("this package", solver_heatwalk),
    "solver_cholmod": ("CHOLMOD (cholespy)", solver_cholmod),
    "solver_superlu": ("SuperLU (SciPy)", solver_superlu),
}

MEASUREMENTS = {
    function.__name__: function
    for function in (ours, scipy_eigsh, plain_numpy, blocked_product, dense, import_heatwalk)
}


def measure(name, input_file, threads=1, limit=None, key="seconds"):
    """The fastest of several processes: its results, and its peak memory in bytes. None if one exceeds the limit.

    Five processes if they take half a minute at most, otherwise at least two, or one of more than a minute.
    """
    environment = dict(os.environ)
    if threads is not None:
        names = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS")
        environment |= dict.fromkeys(names, str(threads))
    command = [sys.executable, "-m", "tests.benchmarks.scaling", "--measure", name, "--input", str(input_file)]
    runs, start = [], time.perf_counter()
    while len(runs) < 5 and (not runs or time.perf_counter() - start < (60 if len(runs) < 2 else 30)):
        try:
            run = subprocess.run(command, env=environment, check=True, capture_output=True, text=True, timeout=limit)
        except subprocess.TimeoutExpired:
            return None
        runs.append(json.loads(run.stdout))
    return min(runs, key=lambda result: result[key])


def _measure_here(name, input_file):
    import numpy as np
    import scipy.sparse as sp

    if name in SOLVERS:
        matrix = sp.load_npz(input_file)
        result = {"n": matrix.shape[0], **measure_solver(SOLVERS[name][1], matrix)}
    else:
        with np.load(input_file) as surface:
            vertices, faces = surface["vertices"], surface["faces"]
        result = {"n": len(vertices), **MEASUREMENTS[name](vertices, faces)}
    print(json.dumps({"peak_bytes": peak_memory(), **result}))


def peak_memory():
    """Peak memory of this process in bytes."""
    status = Path("/proc/self/status")
    if status.exists():  # Linux, where the peak by getrusage includes that of the parent process
        return int(re.search(r"VmHWM:\s*(\d+) kB", status.read_text())[1]) * 1024
    if sys.platform == "win32":
        import psutil

        return psutil.Process().memory_info().peak_wset
    import resource

    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss  # macOS: bytes


def throughput(folder, seconds=60):
    """Meshes segmented per second by one and by two processes: surfaces of the size of benchmark models."""
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
    files = [str(file) for file in (folder / "5000.npz", folder / "25000.npz") if file.exists()]

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


def required_memory(name, size):
    """Bytes that a measurement takes on a surface of so many vertices, rounded up from what it took."""
    if name == "dense":
        return BASE_BYTES + 3 * 8 * size**2  # three arrays of size n x n at the same time
    return BASE_BYTES + BYTES_PER_VERTEX.get(name, BYTES_PER_VERTEX_OF_SOLVERS) * size


def free_memory():
    """Bytes that this process may still take: what the system has left, or the container it runs in."""
    import psutil

    free = psutil.virtual_memory().available
    limit, used = (Path("/sys/fs/cgroup") / name for name in ("memory.max", "memory.current"))
    if limit.exists() and used.exists() and (most := limit.read_text().strip()).isdigit():
        free = min(free, int(most) - int(used.read_text()))
    return free


def planned(largest):
    """The measurements up to ``largest`` vertices, by size."""
    plan = {}
    for size in (size for size in SIZES if size <= largest):
        plan[size] = ["ours", "scipy_eigsh"]
        plan[size] += ["blocked_product"] if size <= 100_000 else []
        plan[size] += ["plain_numpy"] if size in (25_000, 100_000) else []
        plan[size] += ["dense"] if size <= LARGEST_DENSE else []
        plan[size] += [*SOLVERS] if size in SOLVER_SIZES else []
    return plan


def only_solvers(plan):
    """The measurements of the sparse solvers in a plan."""
    return {size: solvers for size, names in plan.items() if (solvers := [name for name in names if name in SOLVERS])}


def affordable(plan, free):
    """The measurements of a plan that ``free`` bytes are enough for; prints what they take, and what is left out.

    Raises
    ------
    SystemExit
        with one line, if there is not even enough memory for this package on the smallest surface
    """
    needs = {(name, size): required_memory(name, size) for size, names in plan.items() for name in names}
    (largest_name, largest_size), most = max(needs.items(), key=lambda item: item[1])
    print(
        f"takes up to {most / 1e9:.1f} GB of memory ({largest_name} at {largest_size:,} vertices); "
        f"{free / 1e9:.1f} GB are free"
    )
    for (name, size), need in needs.items():
        if need > free:
            print(f"{size:>9,} {name:<24} left out: takes {need / 1e9:.1f} GB, and {free / 1e9:.1f} GB are free")
    kept = {size: [name for name in names if needs[name, size] <= free] for size, names in plan.items()}
    kept = {size: names for size, names in kept.items() if {"ours", "scipy_eigsh"} <= {*names} or names == [*SOLVERS]}
    if not kept:
        raise SystemExit(f"scaling: error: {free / 1e9:.1f} GB of memory are free, too little for any measurement")
    return kept


def run(plan):
    """The measurements of a plan: dict (measurement, size) -> results, printed as they are made."""
    import numpy as np

    from tests.helpers.surfaces import surface

    results = {}

    def record(name, size, result):
        results[name, size] = result
        print(f"{size:>9,} {name:<24}", json.dumps(result) if result else "did not finish", flush=True)

    with tempfile.TemporaryDirectory() as folder:
        for size, names in plan.items():
            file = Path(folder) / f"{size}.npz"
            vertices, faces = surface(size)
            np.savez(file, vertices=vertices, faces=faces)
            for name in (name for name in names if name not in SOLVERS):
                record(name, size, measure(name, file))
            solvers = [name for name in names if name in SOLVERS]
            if solvers:
                for name, result in measure_solvers(solvers, vertices, faces, Path(folder)):
                    record(name, size, result)
        if any("ours" in names for names in plan.values()):
            record("import_heatwalk", 0, measure("import_heatwalk", file))
            record("throughput", 0, throughput(Path(folder)))
            record("load", 0, {"average": os.getloadavg()[2], "processors": os.cpu_count()})
    return results


def measure_solvers(solvers, vertices, faces, folder):
    """Yield (measurement, results) of sparse solvers on one surface, with one thread and with the default number."""
    import scipy.sparse as sp

    file = folder / "matrix.npz"
    sp.save_npz(file, shifted_matrix(vertices, faces), compressed=False)
    for name in solvers:
        yield name, measure(name, file, limit=SOLVER_LIMIT)
        yield f"{name}_threaded", measure(name, file, threads=None, limit=SOLVER_LIMIT, key="elapsed")


def targets(results):
    """Targets: list of (measure, target, measured value, whether the target is met)."""

    def of(name, size, key="seconds"):
        return (results.get((name, size)) or {}).get(key, float("nan"))

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
        at_least(f"plain NumPy and SciPy over ours at {size:,}", least, of("plain_numpy", size) / of("ours", size))
    at_least("the paper's dense method over ours at 25,000: time", 80, of("dense", 25_000) / of("ours", 25_000))
    peak = of("dense", 25_000, "peak_bytes") / of("ours", 25_000, "peak_bytes")
    at_least("the paper's dense method over ours at 25,000: memory", 20, peak)
    at_most("time at 1,000,000 over time at 100,000", 14, of("ours", 1_000_000) / of("ours", 100_000))
    at_most("peak memory at 1,000,000, GB", 2.5, of("ours", 1_000_000, "peak_bytes") / 1e9)
    at_least("meshes per second, 2 processes over 1", 1.8, of("throughput", 0, "two") / of("throughput", 0, "one"))
    at_most("import heatwalk, seconds", 0.5, of("import_heatwalk", 0))
    return [row for row in rows if row[2] == row[2]]


def write(results, folder):
    """Write the tables as Markdown, all results as JSON, and the log-log plot."""
    folder.mkdir(parents=True, exist_ok=True)

    sizes = sorted(size for name, size in results if name == "ours")
    lines = [
        "# Performance",
        "",
        "Made by `python -m tests.benchmarks.scaling`. CPU seconds, one thread, minimum of two to five processes. "
        "Load average of the "
        f"last 15 minutes, of which 1 is due to this benchmark itself: {results['load', 0]['average']:.1f} on "
        f"{results['load', 0]['processors']} processors.",
        "",
    ]
    lines += ["| measure | target | reached | |", "| --- | --- | --- | --- |"]
    lines += [f"| {m} | {t} | {v:.3g} | {'met' if met else 'missed'} |" for m, t, v, met in targets(results)]
    lines += [
        "",
        "| vertices | pairs | " + " | ".join(STAGES) + " | total | peak GB | SciPy's eigsh |",
        "|" + " --- |" * 9,
    ]
    for size in sizes:
        row = results["ours", size]
        stages = " | ".join(f"{row[stage]:.3f}" for stage in STAGES)
        lines.append(
            f"| {row['n']:,} | {row['pairs']} | {stages} | {row['seconds']:.2f} | {row['peak_bytes'] / 1e9:.2f} "
            f"| {results['scipy_eigsh', size]['seconds']:.2f} |"
        )
    lines += ["", *solver_lines(results)]
    (folder / "performance.md").write_text("\n".join(lines) + "\n")
    (folder / "performance.json").write_text(
        json.dumps(
            [{"measurement": name, "size": size, **(row or {})} for (name, size), row in results.items()], indent=1
        )
        + "\n"
    )
    plot(results, folder / "performance.png")


def solver_lines(results):
    """The comparison of the sparse solvers, as lines of Markdown."""
    lines = [
        "## Sparse solver",
        "",
        "Ordering and factorising the matrix of the eigensolver, and solving "
        f"{N_SOLVES} blocks of two columns with it: CPU seconds with one thread, elapsed seconds with the default "
        f"number of threads, and peak memory of the process. Limit: {SOLVER_LIMIT} s per process.",
        "",
        "| vertices | solver | order + factor | solve | total | over ours | elapsed, threaded | over ours | peak GB "
        "| million entries |",
        "|" + " --- |" * 10,
    ]
    for size in sorted({size for name, size in results if name in SOLVERS}):
        ours, ours_threaded = results["solver_heatwalk", size], results["solver_heatwalk_threaded", size]
        for name, (label, _) in SOLVERS.items():
            if (name, size) not in results:  # it would have taken too much memory
                continue
            row, threaded = results[name, size], results[f"{name}_threaded", size]
            cells = [f"{size:,}", label]
            if row:
                cells += [f"{row[key]:.3f}" for key in ("factor", "solve", "seconds")]
                cells += [ratio(row, ours, "seconds")]
            else:
                cells += ["did not finish", "", "", ""]
            cells += [f"{threaded['elapsed']:.3f}" if threaded else "did not finish"]
            cells += [ratio(threaded, ours_threaded, "elapsed")]
            cells += [f"{row['peak_bytes'] / 1e9:.2f}" if row else ""]
            cells += [f"{row['entries'] / 1e6:.1f}" if row and row["entries"] else ""]
            lines.append("| " + " | ".join(cells) + " |")
    return lines


def ratio(row, ours, key):
    """How many times longer than ours; empty if either did not finish."""
    return f"{row[key] / ours[key]:.2f}" if row and ours else ""


# What was measured, as the legend names it, with its number as a group of the house style.
ALTERNATIVES = {
    "scipy_eigsh": ("SciPy eigsh alone", 1),
    "plain_numpy": ("SciPy eigsh + blocked NumPy", 3),
    "dense": ("the paper's n × n, NumPy", 4),
}
STAGE_NAMES = {
    "spectrum": ("eigenpairs", 2), "walk": ("walk", 5), "operator": ("Laplacian", 1), "dissipators": ("dissipators", 4),
}  # fmt: skip


def chart(results):
    """Seconds and memory against the number of vertices, as plain data."""
    from studies.figures.charts import Axis, Chart, Panel, Series, logarithmic_ticks

    sizes = sorted(size for name, size in results if name == "ours")

    def series(label, name, key, group):
        at = sorted(size for other, size in results if other == name)
        values = tuple(results[name, size][key] / (1e9 if key == "peak_bytes" else 1) for size in at)
        return Series(label, tuple(map(float, at)), values, group=group)

    def panel(title, unit, drawn):
        vertices = Axis("vertices", ticks=logarithmic_ticks(sizes[0], sizes[-1]), logarithmic=True)
        return Panel(vertices, Axis(unit, logarithmic=True), title, series=tuple(drawn), own_legend=True)

    def against_alternatives(key):
        measured = {name for name, _ in results}
        others = [(label, name, key, group) for name, (label, group) in ALTERNATIVES.items() if name in measured]
        return [series(*each) for each in (("heatwalk.segment", "ours", key, 0), *others)]

    stages = [series(label, "ours", stage, group) for stage, (label, group) in STAGE_NAMES.items()]
    panels = (
        panel("Time", "CPU seconds, one thread", against_alternatives("seconds")),
        panel("Time of each step", "CPU seconds", [series("heatwalk.segment", "ours", "seconds", 0), *stages]),
        panel("Peak memory", "GB", against_alternatives("peak_bytes")),
    )
    return Chart("Time and memory by the number of vertices", panels, subtitle="all axes are logarithmic")


def plot(results, path):
    """Draw the chart."""
    from studies.figures.drawing import draw, save  # not in the processes whose memory is measured

    save(draw(chart(results)), path)


def load(folder):
    """The results in a folder that `write` has written."""
    rows = json.loads((folder / "performance.json").read_text())
    return {(row.pop("measurement"), row.pop("size")): row for row in rows}


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--largest", type=int, default=SIZES[-1], help="number of vertices of the largest surface")
    parser.add_argument("--output", type=Path, default=Path("results/performance"))
    parts = parser.add_mutually_exclusive_group()
    parts.add_argument("--solvers", action="store_true", help="the sparse solvers alone; the rest as it is stored")
    parts.add_argument("--redraw", action="store_true", help="measure nothing: tables and plot of the stored results")
    parser.add_argument("--measure", choices=[*MEASUREMENTS, *SOLVERS], help=argparse.SUPPRESS)
    parser.add_argument("--input", type=Path, help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        _measure_here(arguments.measure, arguments.input)
    else:
        if arguments.largest < SIZES[0]:
            parser.error(f"--largest must be at least {SIZES[0]:,}, got {arguments.largest:,}")
        plan = planned(arguments.largest)
        if arguments.redraw:
            results = load(arguments.output)
        elif arguments.solvers:
            results = load(arguments.output) | run(affordable(only_solvers(plan), free_memory()))
        else:
            results = run(affordable(plan, free_memory()))
        write(results, arguments.output)
        for measure_name, target, value, met in targets(results):
            print(f"{'met   ' if met else 'MISSED'} {value:>9.3g} {target:>8}  {measure_name}")
