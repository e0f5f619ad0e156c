"""CPU seconds of each perturbation, and over those of segmenting the same mesh.

python -m tests.benchmarks.perturbations [--sizes 5000 25000 400000]

One thread, one process; the mesh has nothing cached. A share above 1 is a perturbation slower than segmenting.
"""

import argparse
import time

import numpy as np
import trimesh
from threadpoolctl import threadpool_limits

import heatwalk
import perturb
from tests.benchmarks.scaling import timed
from tests.benchmarks.surfaces import surface

SIZES = (5_000, 25_000, 400_000)
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


def measure(n_vertices):
    """Seconds of segmenting, and of each perturbation by name, on a surface of about that many vertices."""
    vertices, faces = surface(n_vertices)
    segmenting = timed(lambda: heatwalk.segment(vertices, faces))
    seconds = {}
    for name, perturbation in PERTURBATIONS.items():
        mesh = trimesh.Trimesh(vertices, faces, process=False)
        start = time.process_time()
        perturbation(mesh, np.random.default_rng(0))
        seconds[name] = time.process_time() - start
    return segmenting, seconds


def table(figures):
    """Markdown: a row a perturbation; at each size its seconds, and in brackets its share of segmenting."""
    lines = [
        "| perturbation | " + " | ".join(f"{size:,}" for size in figures) + " |",
        "| --- |" + " --- |" * len(figures),
        "| segmenting | " + " | ".join(f"{segmenting:.2f}" for segmenting, _ in figures.values()) + " |",
    ]
    for name in PERTURBATIONS:
        cells = [f"{seconds[name]:.2f} ({seconds[name] / segmenting:.2f})" for segmenting, seconds in figures.values()]
        lines.append(f"| {name} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--sizes", type=int, nargs="+", default=SIZES, help="vertices of the surfaces")
    with threadpool_limits(1):
        print(table({size: measure(size) for size in parser.parse_args().sizes}))
