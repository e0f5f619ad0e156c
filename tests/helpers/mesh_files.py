"""Mesh files for the tests: the formats written plainly, independently of the package, with all digits of a double."""

import numpy as np
import pytest
import trimesh

from heatwalk.io import read_mesh

OCTAHEDRON = trimesh.convex.convex_hull(np.vstack([np.eye(3), -np.eye(3)]))
TETRAHEDRON = (
    np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]]),
    np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]),
)
CUBE_QUADS = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
CUBE_VERTICES = np.array([[x, y, z] for z in (0.0, 1) for y in (0.0, 1) for x in (0.0, 1)])


def off_bytes(vertices, faces):
    rows = [" ".join(map(repr, row)) for row in np.asarray(vertices).tolist()]
    rows += [f"{len(face)} {' '.join(map(str, face))}" for face in faces]
    return f"OFF\n{len(vertices)} {len(faces)} 0\n{chr(10).join(rows)}\n".encode()


def obj_bytes(vertices, faces):
    rows = ["v " + " ".join(map(repr, row)) for row in np.asarray(vertices).tolist()]
    rows += ["f " + " ".join(str(corner + 1) for corner in face) for face in faces]
    return ("\n".join(rows) + "\n").encode()


def ply_bytes(vertices, faces, form):
    header = (
        f"ply\nformat {form} 1.0\ncomment made by a test\nelement vertex {len(vertices)}\nproperty double x\n"
        f"property double y\nproperty double z\nelement face {len(faces)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    ).encode()
    if form == "ascii":
        return header + off_bytes(vertices, faces).split(b"\n", 2)[2]
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}[form]
    rows = [bytes([len(face)]) + np.array(face, dtype=order + "i4").tobytes() for face in faces]
    return header + np.asarray(vertices).astype(order + "f8").tobytes() + b"".join(rows)


def stl_text_bytes(vertices, faces):
    facets = [
        "facet normal 0 0 0\n outer loop\n"
        + "".join(f"  vertex {x!r} {y!r} {z!r}\n" for x, y, z in np.asarray(vertices)[face].tolist())
        + " endloop\nendfacet\n"
        for face in faces
    ]
    return f"solid thing\n{''.join(facets)}endsolid thing\n".encode()


def stl_binary_bytes(vertices, faces):
    record = np.zeros(len(faces), dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attributes", "<u2")])
    record["corners"] = np.asarray(vertices)[np.asarray(faces)]
    return b"solid misleading".ljust(80) + np.uint32(len(faces)).tobytes() + record.tobytes()


FORMATS = {
    "off": (".off", off_bytes),
    "obj": (".obj", obj_bytes),
    "ply ascii": (".ply", lambda v, f: ply_bytes(v, f, "ascii")),
    "ply little endian": (".ply", lambda v, f: ply_bytes(v, f, "binary_little_endian")),
    "ply big endian": (".ply", lambda v, f: ply_bytes(v, f, "binary_big_endian")),
    "stl ascii": (".stl", stl_text_bytes),
    "stl binary": (".stl", stl_binary_bytes),
}
every_format = pytest.mark.parametrize(("suffix", "encode"), FORMATS.values(), ids=FORMATS)


def read_bytes(tmp_path, data, suffix):
    path = tmp_path / f"mesh{suffix}"
    path.write_bytes(data)
    return read_mesh(path)


def is_mesh(mesh, vertices, faces):
    return np.array_equal(mesh.vertices, vertices) and np.array_equal(mesh.faces, faces)
