"""Segment one mesh, print its segments, and save it coloured by segment.

python examples/segment_a_mesh.py [MESH [OUT.ply]]
"""

import sys
from importlib.metadata import distribution
from pathlib import Path

import numpy as np

import heatwalk
from heatwalk.io import write_ply

COW = distribution("pymeshlab").locate_file("pymeshlab/tests/sample_meshes/cow.obj")


def main(path: str = str(COW), output: str = "segments.ply") -> None:
    mesh = heatwalk.read_mesh(path)
    seg = heatwalk.segment(mesh.vertices, mesh.faces)

    print(f"{Path(path).name}: {len(mesh.vertices):,} vertices, {len(seg.exemplars)} accumulator regions")
    for region, exemplar in enumerate(seg.exemplars):
        size = np.count_nonzero(seg.labels == region)
        print(f"  region {region}: {size:,} vertices around vertex {exemplar}")
    print(f"  dissipator region: {np.count_nonzero(seg.dissipates):,} vertices")

    write_ply(output, mesh.vertices, mesh.faces, seg.labels, len(seg.exemplars))
    print(f"written: {output}")


if __name__ == "__main__":
    main(*sys.argv[1:])
