"""OFF files (Geomview's Object File Format, ASCII).

Not read by trimesh: trimesh 5.2 accepts truncated files, reads the lines before a comment twice, and fails on most
pentagons.
"""

import re

import numpy as np

from heatwalk.io.polygons import RawMesh, check_complete, triangulate
from heatwalk.meshes import MeshError


def read_off(data: bytes) -> RawMesh:
    """Read the contents of an OFF file, with or without colours, normals and texture coordinates."""
    text = re.sub(r"#[^\r\n]*", "", data.decode("utf-8-sig", errors="replace"))
    header = re.match(r"\s*[STCN]*OFF\s*(\d+)[ \t]+(\d+)[^\r\n]*", text)
    if header is None:
        raise MeshError("not an OFF file, or its header lacks the vertex and face counts")
    n_vertices, n_faces = int(header[1]), int(header[2])
    rows = [row.split() for row in text[header.end() :].splitlines() if row.strip()]
    vertex_rows, face_rows = rows[:n_vertices], rows[n_vertices : n_vertices + n_faces]
    check_complete(n_faces, sum(len(row) > int(row[0]) for row in face_rows))
    polygons = [[int(corner) for corner in row[1 : 1 + int(row[0])]] for row in face_rows]
    return RawMesh(np.array([row[:3] for row in vertex_rows], dtype=float), triangulate(polygons), n_faces)
