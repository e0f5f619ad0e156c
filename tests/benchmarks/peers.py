"""Where segmenting stands beside other methods and packages: seconds, memory and accuracy on the same meshes.

    python -m tests.benchmarks.peers --psb MeshsegBenchmark-1.0.zip [--limit 600] [--methods NAME …] [--redraw]

Each method has a new process with one thread, which goes from the smallest mesh to the largest, after a first call on a
small one that loads and compiles what it needs. It ends a method that exceeds the limit of CPU seconds or memory on a
mesh; the larger meshes are then not tried. Nor are those for which a method would need more than the limit if its time
grew with the number of vertices. Measurements are added to those that are stored in ``peers.json``.

The two smaller meshes are models of the Princeton benchmark, on which labels are compared with people's segmentations;
without ``--psb``, and for the larger ones, a bundled model that is decimated or refined.
"""

import argparse
import json
import os
import resource
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import psutil

SIZES = (5_000, 25_000, 100_000, 1_000_000)
MODELS = {5_000: "1", 25_000: "281"}  # of the Princeton benchmark: a human and an armadillo
LIMIT = 600  # CPU seconds for one mesh
MEMORY = 16_000_000_000  # bytes
PAIRS = 30  # eigenpairs of a spectrum
THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
BASELINES = {"one_segment", "voronoi", "felzenszwalb"}
DRAWN = ("heat_walk", "heat_walk_robust", "eigsh", "vhacd", "coacd", "randomized_cuts")


def coacd(vertices, faces):
    """Faces by the hulls of CoACD with its own options."""
    import coacd as package

    package.set_log_level("off")
    return _by_hulls(vertices, faces, package.run_coacd(package.Mesh(vertices, faces), seed=0))


def vhacd(vertices, faces):
    """Faces by the hulls of V-HACD with its own options."""
    import numpy as np
    import vhacdx

    return _by_hulls(vertices, faces, vhacdx.compute_vhacd(vertices, faces.astype(np.uint32)))


def _by_hulls(vertices, faces, hulls):
    """The hull in which the centre of each face is deepest."""
    import numpy as np

    from studies.segmenters.convex_decomposition import _outside

    centres = vertices[faces].mean(axis=1)
    return np.argmin([_outside(centres, np.asarray(hull[0])) for hull in hulls], axis=0)


def vcg_shape_diameter(vertices, faces):
    """The shape diameter of each vertex by MeshLab's filter: no segments."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    meshes.compute_scalar_by_shape_diameter_function_per_vertex()
    meshes.current_mesh().vertex_scalar_array()


def eigsh(vertices, faces):
    """Eigenpairs by SciPy: no segments."""
    import scipy.sparse as sp
    from scipy.sparse.linalg import eigsh as solve

    from heatwalk.laplacian import stiffness_and_mass, unit_area

    stiffness, mass = stiffness_and_mass(unit_area(vertices, faces), faces)
    solve(stiffness, PAIRS, sp.diags_array(mass).tocsc(), sigma=-0.01)


def pyfm(vertices, faces):
    """Eigenpairs by pyFM: no segments."""
    from pyFM.mesh import TriMesh

    TriMesh(vertices, faces).process(k=PAIRS, intrinsic=False, verbose=False)


def spectrum(vertices, faces):
    """Eigenpairs by this package, those that segmenting needs: no segments."""
    import numpy as np

    from heatwalk.kernel import largest_eigenvalue
    from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
    from heatwalk.segmentation import PAPER_TIME
    from heatwalk.spectrum import SpectrumSolver

    faces = np.asarray(faces, np.int64)
    matrices = stiffness_and_mass(unit_area(vertices, faces), faces)
    SpectrumSolver(*matrices, vertex_components(len(vertices), faces)).up_to(largest_eigenvalue(PAPER_TIME))


def cholespy(vertices, faces):
    """One factorisation by CHOLMOD, and as many solutions as the eigensolver of this package needs: no segments."""
    import numpy as np

    from tests.benchmarks.scaling import N_SOLVES, shifted_matrix, solver_cholmod

    matrix = shifted_matrix(vertices, faces)
    run = solver_cholmod(matrix, [np.ones((len(vertices), 2))] * N_SOLVES)
    run.send(next(run))


# Name: function, what it is called in the table, what it computes.
OTHERS = {
    "coacd": (coacd, "CoACD, its own options", "segments"),
    "vhacd": (vhacd, "V-HACD, its own options", "segments"),
    "vcg_shape_diameter": (vcg_shape_diameter, "shape diameter by MeshLab", "a value per vertex"),
    "eigsh": (eigsh, f"{PAIRS} eigenpairs by SciPy's eigsh", "eigenpairs"),
    "pyfm": (pyfm, f"{PAIRS} eigenpairs by pyFM", "eigenpairs"),
    "spectrum": (spectrum, "eigenpairs by this package", "eigenpairs"),
    "cholespy": (cholespy, "factor and 41 solutions by cholespy", "solutions"),
}


def names():
    """The shipped methods but the baselines, and the others."""
    from docs.methods import methods

    return [*(name for name in methods() if name not in BASELINES), *OTHERS]


# --- one method, in a process of its own


def measure(name, psb, sizes, limit):
    """Print a line of JSON for each mesh, the smallest first."""
    import numpy as np
    import trimesh

    from studies.execution.peak_memory import peak_memory

    resource.setrlimit(resource.RLIMIT_DATA, (MEMORY, MEMORY))
    warm = trimesh.creation.icosphere(3).apply_scale([4, 1.2, 1])
    _function(name, None)(np.array(warm.vertices), np.array(warm.faces))
    previous = None
    for size in sizes:
        model = _model(psb, size)
        vertices, faces = _mesh(model, size)
        if previous and previous[0] * len(vertices) / previous[1] > limit:
            print(json.dumps({"size": size, "failure": f"> {limit:,} s, expected"}), flush=True)
            return
        function = _function(name, model)
        resource.setrlimit(resource.RLIMIT_CPU, (int(time.process_time()) + limit, resource.RLIM_INFINITY))
        with peak_memory() as memory:
            start = time.process_time()
            labels = function(vertices, faces)
            seconds = time.process_time() - start
        resource.setrlimit(resource.RLIMIT_CPU, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        row = {"size": size, "vertices": len(vertices), "seconds": seconds, "megabytes": memory.megabytes}
        if labels is not None:
            row["segments"] = len(np.unique(labels))
            row["error"] = _rand_index_error(model, labels, faces)
        print(json.dumps(row), flush=True)
        previous = seconds, len(vertices)


def _function(name, model):
    """The method as a function of arrays, told the number of segments of a model if it needs to be."""
    if name in OTHERS:
        return OTHERS[name][0]
    from docs.methods import methods
    from studies.datasets.bundled import Bundled

    return methods()[name].for_model(model or Bundled(["ant"]).models()[0])


def _model(psb, size):
    """The model of the benchmark with about so many vertices, or None."""
    from studies.datasets.psb import PSB

    return PSB(psb, models=[int(MODELS[size])]).models()[0] if psb and size in MODELS else None


def _mesh(model, size):
    """Vertices and faces."""
    from tests.helpers.surfaces import surface

    if model is None:
        return surface(size)
    mesh = model.load()
    return mesh.vertices, mesh.faces


def _rand_index_error(model, labels, faces):
    """The mean over people's segmentations of a model; None if there are none."""
    import numpy as np

    from heatwalk.segmentation import faces_from_vertices
    from studies.metrics.rand_index import rand_index_error

    if model is None:
        return None
    labels = np.asarray(labels)
    if len(labels) != len(faces):
        labels = faces_from_vertices(labels, faces)
    return float(np.mean([rand_index_error(each, labels) for each in model.human_segmentations()]))


# --- all methods


def in_a_process(name, psb, sizes, limit):
    """What `measure` prints, and why it ended early, if it did: rows by size."""
    environment = os.environ | dict.fromkeys(THREADS, "1")
    command = [sys.executable, "-m", "tests.benchmarks.peers", "--measure", name, "--limit", str(limit)]
    command += ["--psb", str(psb)] if psb else []
    command += ["--sizes", *map(str, sizes)]
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    rows = {row.pop("size"): row for row in map(json.loads, run.stdout.splitlines())}
    if run.returncode:
        size = next(size for size in sizes if size not in rows)
        rows[size] = {"failure": _failure(run, limit)}
    return rows


def _failure(run, limit):
    """Why a process ended early, in a few words."""
    if run.returncode == -signal.SIGXCPU:
        return f"> {limit:,} s"
    last = run.stderr.strip().splitlines()[-1] if run.stderr.strip() else f"exit code {run.returncode}"
    if "MemoryError" in last or "bad_alloc" in last:
        return f"> {MEMORY / 1e9:g} GB"
    reason = last.partition(": ")[2] or last
    return textwrap.shorten(reason.partition(": ")[0], 90)


def table(found, limit):
    """The results as Markdown."""
    sizes = sorted({size for rows in found.values() for size in rows})
    vertices = {
        size: next(row["vertices"] for rows in found.values() if "vertices" in (row := rows.get(size, {})))
        for size in sizes
    }
    titles = _titles()
    heading = ["method", "computes", *(f"{vertices[size]:,} vertices" for size in sizes)]
    heading += [
        f"Rand Index error, {vertices[size]:,}" for size in MODELS if size in sizes and _has_errors(found, size)
    ]
    lines = [
        "# Where it stands beside others",
        "",
        "Made by `python -m tests.benchmarks.peers`. CPU seconds and, in parentheses, the peak memory in MB above what "
        "the process used before, from arrays to the result, with one thread, in a new process for each method. "
        f"Limits: {limit:,} CPU seconds and {MEMORY / 1e9:g} GB; what a method would take more than the limit for, if "
        "its time grew with the number of vertices, is not tried. Methods that are told the number of segments are "
        "told that of people's segmentations. The smaller meshes are models "
        f"{' and '.join(MODELS.values())} of the Princeton benchmark; the Rand Index error is the mean over people's "
        "segmentations. The larger ones are the bundled ant, refined. Load average over the last 15 minutes: "
        f"{psutil.getloadavg()[2]:.1f} on {os.cpu_count()} processors.",
        "",
        f"| {' | '.join(heading)} |",
        "|" + " --- |" * len(heading),
    ]
    for name in sorted(found, key=lambda each: (computes(each) != "segments", _first_seconds(found[each]))):
        cells = [titles[name], computes(name), *(_cell(found[name], size) for size in sizes)]
        cells += [_error(found[name].get(size, {})) for size in MODELS if size in sizes and _has_errors(found, size)]
        lines.append(f"| {' | '.join(cells)} |")
    if absent := [f"`{name}`" for name in names() if name not in found]:
        lines += ["", f"Not measured yet; `--methods` adds them: {', '.join(absent)}."]
    return "\n".join(lines) + "\n"


def _titles():
    """What each method is called in the table."""
    from docs.methods import methods

    found = {name: method.about.title if method.about else method.name for name, method in methods().items()}
    return found | {name: title for name, (_, title, _) in OTHERS.items()}


def computes(name):
    """What a method computes."""
    return OTHERS[name][2] if name in OTHERS else "segments"


def _has_errors(found, size):
    return any(rows.get(size, {}).get("error") is not None for rows in found.values())


def _first_seconds(rows):
    return min(rows.items())[1].get("seconds", float("inf"))


def _cell(rows, size):
    if size not in rows:
        return "not tried"
    row = rows[size]
    if "failure" in row:
        return row["failure"]
    return f"{row['seconds']:.2f} ({row['megabytes']:.0f})"


def _error(row):
    return "" if row.get("error") is None else f"{row['error']:.3f}"


def chart(found):
    """Seconds and memory against the number of vertices, as plain data."""
    from studies.figures.charts import Axis, Chart, Panel, Series, logarithmic_ticks

    titles = _titles()

    def panel(title, unit, key, scale):
        drawn = []
        for group, name in enumerate(name for name in DRAWN if name in found):
            rows = sorted((row for row in found[name].values() if key in row), key=lambda row: row["vertices"])
            at = tuple(float(row["vertices"]) for row in rows)
            drawn.append(
                Series(
                    titles[name],
                    at,
                    tuple(max(row[key], 1) / scale if scale > 1 else row[key] for row in rows),
                    group=group,
                )
            )
        vertices = Axis("vertices", ticks=logarithmic_ticks(SIZES[0], SIZES[-1]), logarithmic=True)
        return Panel(vertices, Axis(unit, logarithmic=True), title, series=tuple(drawn))

    panels = (panel("Time", "CPU seconds, one thread", "seconds", 1), panel("Peak memory", "GB", "megabytes", 1e3))
    return Chart("Time and memory beside other methods", panels, subtitle="all axes are logarithmic")


def load(folder):
    """The stored measurements, by method and size."""
    file = folder / "peers.json"
    stored = json.loads(file.read_text()) if file.exists() else {}
    return {name: {int(size): row for size, row in rows.items()} for name, rows in stored.items()}


def write(found, folder, limit):
    """Store measurements, table and plot."""
    from studies.figures.drawing import draw, save

    (folder / "peers.json").write_text(json.dumps(found, indent=1, sort_keys=True) + "\n")
    (folder / "peers.md").write_text(table(found, limit))
    save(draw(chart(found)), folder / "peers.png")


def main():
    """Measure, and write the table and the plot."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("--psb", help="folder or zip of the Princeton benchmark")
    parser.add_argument("--methods", nargs="+", help="by default all")
    parser.add_argument("--sizes", type=int, nargs="+", default=list(SIZES), choices=SIZES)
    parser.add_argument("--limit", type=int, default=LIMIT, help="CPU seconds for one mesh")
    parser.add_argument("--output", type=Path, default=Path("results/performance"))
    parser.add_argument("--redraw", action="store_true", help="measure nothing: table and plot of what is stored")
    parser.add_argument("--measure", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        measure(arguments.measure, arguments.psb, arguments.sizes, arguments.limit)
        return
    found = load(arguments.output)
    for name in [] if arguments.redraw else arguments.methods or names():
        rows = in_a_process(name, arguments.psb, sorted(arguments.sizes), arguments.limit)
        found[name] = found.get(name, {}) | rows
        print(name, rows, flush=True)
        (arguments.output / "peers.json").write_text(json.dumps(found, indent=1, sort_keys=True) + "\n")
    write(found, arguments.output, arguments.limit)


if __name__ == "__main__":
    main()
