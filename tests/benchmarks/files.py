"""CPU seconds of reading and writing mesh files, beside segmenting the same mesh and beside other libraries.

    python -m tests.benchmarks.files [--size 274000] [--largest 1000000] [--output results/performance]

Each library is measured in its own process with one thread, after a first time on a small mesh: the minimum of three
times, or of as many as a second and a half has room for. A library without a format has no value there. The coordinates
have all digits of a double, and all read the same files. The others read as they do by default, but trimesh without
merging vertices, except for STL, where all merge them.
"""

import argparse
import contextlib
import io
import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil

from tests.benchmarks.scaling import peak_memory
from tests.helpers.surfaces import surface

SIZE, LARGEST, SMALL = 274_000, 1_000_000, 1_000
REPETITIONS, ENOUGH = 3, 1.5  # times, seconds
MOST_OF_SEGMENTING, MOST_OF_OTHERS = 0.15, 2

# The files that are read, and the library that can write each with all digits.
READ = {
    "OFF": ("a.off", "heatwalk"), "OBJ": ("a.obj", "heatwalk"), "PLY, ASCII": ("text.ply", "heatwalk"),
    "PLY, binary": ("binary.ply", "pymeshlab"), "STL, ASCII": ("text.stl", "vtk"),
    "STL, binary": ("binary.stl", "heatwalk"),
    "VTK, ASCII": ("text.vtk", "vtk"), "VTK, binary": ("binary.vtk", "vtk"), "VTP": ("a.vtp", "vtk"),
    "glTF, binary": ("a.glb", "trimesh"), "3MF": ("a.3mf", "trimesh"), "Gmsh, ASCII": ("text.msh", "meshio"),
    "Gmsh, binary": ("binary.msh", "meshio"),
}  # fmt: skip
WRITTEN = ("OFF", "OBJ", "PLY, ASCII", "PLY, binary", "STL, binary")
LIBRARIES = ("heatwalk", "vtk", "pymeshlab", "meshio", "trimesh")
SEGMENTING, LABELS = "segmenting", "labels (.seg)"


class Heatwalk:
    """This package."""

    def read(self, path):
        from heatwalk.io import read_mesh

        read_mesh(path)

    def write(self, path, vertices, faces):
        from heatwalk.io import write_mesh, write_ply

        if path.name == "binary.ply":
            write_ply(path, vertices, faces, np.zeros(len(vertices), dtype=np.int64))
        else:
            write_mesh(path, vertices, faces)


class Vtk:
    """VTK, whose meshes are made before the clock starts."""

    def read(self, path):
        reader = self._class(path, "Reader")()
        reader.SetFileName(str(path))
        reader.Update()

    def prepare(self, vertices, faces):
        import pyvista

        return pyvista.PolyData(vertices, np.column_stack([np.full(len(faces), 3), faces]).ravel())

    def write(self, path, mesh):
        writer = self._class(path, "Writer")()
        writer.SetFileName(str(path))
        writer.SetInputData(mesh)
        if hasattr(writer, "SetFileTypeToASCII"):
            writer.SetFileTypeToASCII() if path.stem == "text" else writer.SetFileTypeToBinary()
        writer.Write()

    def _class(self, path, kind):
        from vtkmodules import vtkIOGeometry, vtkIOLegacy, vtkIOPLY, vtkIOXML

        module, name = {
            ".obj": (vtkIOGeometry, "OBJ"),
            ".stl": (vtkIOGeometry, "STL"),
            ".ply": (vtkIOPLY, "PLY"),
            ".vtk": (vtkIOLegacy, "PolyData"),
            ".vtp": (vtkIOXML, "XMLPolyData"),
        }[path.suffix]
        return getattr(module, f"vtk{name}{kind}")


class Pymeshlab:
    """The VCG library by pymeshlab, whose meshes are made before the clock starts."""

    def read(self, path):
        import pymeshlab

        if path.suffix not in (".off", ".obj", ".ply", ".stl"):
            raise KeyError(path.suffix)
        meshes = pymeshlab.MeshSet()
        meshes.load_new_mesh(str(path))

    def prepare(self, vertices, faces):
        import pymeshlab

        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
        return meshes

    def write(self, path, meshes):
        options = {"binary": path.stem == "binary"} if path.suffix in (".ply", ".stl") else {}
        options |= {"save_vertex_normal": False} if path.suffix != ".stl" else {}
        meshes.save_current_mesh(str(path), **options)


class Meshio:
    """meshio."""

    def read(self, path):
        import meshio

        meshio.read(path)

    def write(self, path, vertices, faces):
        import meshio

        options = {"binary": path.stem == "binary"} if path.suffix in (".ply", ".stl", ".msh") else {}
        meshio.write(
            path, meshio.Mesh(vertices, [("triangle", faces)]), "gmsh" if path.suffix == ".msh" else None, **options
        )


class Trimesh:
    """trimesh, whose meshes are made before the clock starts."""

    def read(self, path):
        import trimesh

        trimesh.load(path, process=path.suffix == ".stl")

    def prepare(self, vertices, faces):
        import trimesh

        return trimesh.Trimesh(vertices, faces, process=False)

    def write(self, path, mesh):
        options = {"encoding": "ascii" if path.stem == "text" else "binary"} if path.suffix == ".ply" else {}
        mesh.export(path, **options)


CLASSES = dict(zip(LIBRARIES, (Heatwalk, Vtk, Pymeshlab, Meshio, Trimesh), strict=True))


def in_process(*arguments):
    """What a measurement in a process of its own prints."""
    environment = os.environ | dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
    command = [sys.executable, "-m", "tests.benchmarks.files", "--measure", *map(str, arguments)]
    printed = subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout
    return json.loads(printed.splitlines()[-1])


def measure(name, folder):
    """The seconds of a library to read and to write the formats it knows; of segmenting; or the peak of reading."""
    folder = Path(folder)
    if name in ("reading", SEGMENTING):
        return _measure_alone(name, folder)
    library, results = CLASSES[name](), {"read": {}, "write": {}}
    meshes = {}
    for size in ("small", "large"):
        with np.load(folder / f"{size}.npz") as loaded:
            arrays = loaded["vertices"], loaded["faces"]
        meshes[size] = (library.prepare(*arrays),) if hasattr(library, "prepare") else arrays
    for file_format, (file, _) in READ.items():
        results["read"][file_format] = _seconds(lambda size, file=file: library.read(folder / size / file))
        if file_format in WRITTEN:
            target = folder / f"written.{name}" / file
            target.parent.mkdir(exist_ok=True)
            results["write"][file_format] = _seconds(lambda size, to=target: library.write(to, *meshes[size]))
    if name == "heatwalk":
        _measure_labels(results, folder, len(meshes["large"][1]))
    return results


def _measure_labels(results, folder, n_faces):
    """Add the seconds of reading and writing the labels of the faces."""
    from heatwalk.io import read_seg, write_seg

    labels = {"small": np.arange(9), "large": np.random.default_rng(0).integers(0, 12, n_faces)}
    results["write"][LABELS] = _seconds(lambda size: write_seg(folder / f"{size}.seg", labels[size]))
    results["read"][LABELS] = _seconds(lambda size: read_seg(folder / f"{size}.seg"))


def _measure_alone(name, folder):
    """Seconds and peak memory of segmenting, or of reading an OFF file."""
    import heatwalk

    heatwalk.segment(*surface(SMALL))
    if name == "reading":
        function, arguments = heatwalk.read_mesh, [folder / "large/a.off"]
    else:
        with np.load(folder / "large.npz") as loaded:
            function, arguments = heatwalk.segment, [loaded["vertices"], loaded["faces"]]
    start = time.process_time()
    function(*arguments)
    return {"seconds": time.process_time() - start, "peak_bytes": peak_memory()}


def _seconds(function):
    """The least of several times; None if the library cannot do it."""
    taken = []
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        try:
            function("small")
            while len(taken) < REPETITIONS and sum(taken) < ENOUGH:
                start = time.process_time()
                function("large")
                taken.append(time.process_time() - start)
        except (Exception, SystemExit):  # whatever a library raises for a format it lacks
            return None
    return min(taken)


def prepare(folder, size):
    """Write the arrays of a surface and of a small one, and all files that are read."""
    for name, n in (("small", SMALL), ("large", size)):
        (folder / name).mkdir(exist_ok=True)
        vertices, faces = surface(n)
        np.savez(folder / f"{name}.npz", vertices=vertices, faces=faces)
        for file, library in READ.values():
            writer = CLASSES[library]()
            mesh = (writer.prepare(vertices, faces),) if hasattr(writer, "prepare") else (vertices, faces)
            with contextlib.redirect_stdout(io.StringIO()):
                writer.write(folder / name / file, *mesh)


def run(size, largest):
    """All measurements: dict name -> its results."""
    results = {}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        prepare(folder, size)
        for measured in (SEGMENTING, *LIBRARIES):
            results[measured] = in_process(measured, folder)
            print(measured, json.dumps(results[measured]), flush=True)
        if largest:
            vertices, faces = surface(largest)
            np.savez(folder / "large.npz", vertices=vertices, faces=faces)
            Heatwalk().write(folder / "large/a.off", vertices, faces)
            for measured in ("reading", SEGMENTING):
                results[f"{measured}, largest"] = in_process(measured, folder)
                print(measured, largest, json.dumps(results[f"{measured}, largest"]), flush=True)
    return results


def table(results, size, largest):
    """Markdown: a row per format, its seconds, and their ratios to segmenting and to the quickest other library."""
    segmenting = results[SEGMENTING]["seconds"]
    lines = [
        "# Files",
        "",
        "Made by `python -m tests.benchmarks.files`. CPU seconds with one thread, the minimum of up to "
        f"{REPETITIONS}, of reading and writing a mesh of {size:,} vertices, which is segmented in "
        f"{segmenting:.2f} s. "
        "Load average over the last 15 minutes, to which this benchmark contributes 1: "
        f"{psutil.getloadavg()[2]:.1f} on {os.cpu_count()} processors. "
        f"Targets: at most {MOST_OF_SEGMENTING} of segmenting, and {MOST_OF_OTHERS} times the quickest other library. "
        "Some of these copy binary files into memory and look at nothing; reading here always includes the checks, "
        "and the search for coincident vertices and repeated faces.",
        "",
    ]
    if largest:
        reading, whole = (results[f"{name}, largest"]["peak_bytes"] / 1e9 for name in ("reading", SEGMENTING))
        lines += [
            f"Peak memory at {largest:,} vertices: {reading:.2f} GB for reading OFF, {whole:.2f} GB for segmenting.",
            "",
        ]
    for heading, kind in (("Reading", "read"), ("Writing", "write")):
        others = [name for name in LIBRARIES if name != "heatwalk"]
        lines += [
            f"## {heading}",
            "",
            f"| format | heatwalk | over segmenting | over the quickest other | {' | '.join(others)} |",
            "| --- |" + " --- |" * (3 + len(others)),
        ]
        for file_format, seconds in results["heatwalk"][kind].items():
            beside = [results.get(name, {kind: {}})[kind].get(file_format) for name in others]
            known = [value for value in beside if value is not None]
            cells = [f"{seconds:.3f}", _judged(seconds / segmenting, MOST_OF_SEGMENTING)]
            cells += [_judged(seconds / min(known), MOST_OF_OTHERS) if known else ""]
            cells += ["" if value is None else f"{value:.3f}" for value in beside]
            lines.append(f"| {file_format} | " + " | ".join(cells) + " |")
        lines.append("")
    return "\n".join(lines)


def _judged(ratio, most):
    """A ratio, and whether it misses its target."""
    return f"{ratio:.2f}" + (" (missed)" if ratio > most else "")


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--size", type=int, default=SIZE, help="vertices of the mesh")
    parser.add_argument("--largest", type=int, default=LARGEST, help="vertices for the peak memory; 0: not measured")
    parser.add_argument("--output", type=Path, default=Path("results/performance"))
    parser.add_argument("--measure", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.measure:
        print(json.dumps(measure(*options.measure)))
    else:
        written = table(run(options.size, options.largest), options.size, options.largest)
        options.output.mkdir(parents=True, exist_ok=True)
        (options.output / "files.md").write_text(written, encoding="utf-8")
        print(written, end="")
