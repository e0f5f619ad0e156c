"""OBJ files (Wavefront).

Not read by trimesh: trimesh 5.2 sorts faces by material, splits vertices at texture seams (or fails if asked not to),
resolves relative indices from the end of the file, and reads the invalid index 0 as 1.
"""

import re

import numpy as np

from heatwalk.io.polygons import RawMesh, triangulate


def read_obj(data: bytes) -> RawMesh:
    """Read the vertices and faces of an OBJ file; all other statements are ignored."""
    text = re.sub(r"\\\r?\n", " ", data.decode("utf-8-sig", errors="replace"))  # continued lines
    vertices: list[list[str]] = []
    polygons: list[list[int]] = []
    for line in text.splitlines():
        keyword, *values = line.partition("#")[0].split() or [""]
        if keyword == "v":
            vertices.append(values[:3])
        elif keyword == "f":
            corners = [int(value.partition("/")[0]) for value in values]
            polygons.append([i + len(vertices) if i < 0 else i - 1 for i in corners])
    return RawMesh(np.array(vertices, dtype=float), triangulate(polygons), len(polygons))
