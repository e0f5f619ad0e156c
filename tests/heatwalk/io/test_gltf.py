import base64
import json
import re
from urllib.parse import quote

import numpy as np
import pytest
import trimesh

from heatwalk.io import read_mesh
from heatwalk.meshes import MeshError, inspect_mesh
from tests.helpers.mesh_files import TETRAHEDRON, is_mesh

METRES = "coordinates are in metres, with Y up, as glTF has them"
VERTICES, FACES = TETRAHEDRON


class Document:
    """A glTF document that grows by accessors, and its buffer."""

    def __init__(self):
        self.buffer = b""
        self.content = {
            "asset": {"version": "2.0"}, "accessors": [], "bufferViews": [], "meshes": [], "nodes": [],
            "scenes": [{"nodes": []}], "scene": 0,
        }  # fmt: skip

    def view(self, data, **options):
        self.buffer += b"\0" * (-len(self.buffer) % 4)
        self.content["bufferViews"].append(
            {"buffer": 0, "byteOffset": len(self.buffer), "byteLength": len(data), **options}
        )
        self.buffer += data
        return len(self.content["bufferViews"]) - 1

    def accessor(self, values, dtype, **options):
        values = np.asarray(values, dtype)
        component = {"i1": 5120, "u1": 5121, "i2": 5122, "u2": 5123, "u4": 5125, "f4": 5126}[dtype]
        kind = "SCALAR" if values.ndim == 1 else f"VEC{values.shape[1]}"
        self.content["accessors"].append(
            {"bufferView": self.view(values.tobytes()), "componentType": component, "count": len(values), "type": kind}
            | options
        )
        return len(self.content["accessors"]) - 1

    def primitive(self, vertices=VERTICES, faces=FACES, dtype="u2", **options):
        primitive = {"attributes": {"POSITION": self.accessor(vertices, "f4")}}
        if faces is not None:
            primitive["indices"] = self.accessor(np.ravel(faces), dtype)
        return primitive | options

    def mesh(self, *primitives, **options):
        self.content["meshes"].append({"primitives": list(primitives), **options})
        return len(self.content["meshes"]) - 1

    def node(self, is_root=True, **options):
        self.content["nodes"].append(options)
        number = len(self.content["nodes"]) - 1
        if is_root:
            self.content["scenes"][0]["nodes"].append(number)
        return number

    def glb(self):
        self.content["buffers"] = [{"byteLength": len(self.buffer)}]
        text = json.dumps(self.content).encode()
        text += b" " * (-len(text) % 4)
        data = self.buffer + b"\0" * (-len(self.buffer) % 4)
        chunks = np.array([len(text), 0x4E4F534A], "<u4").tobytes() + text
        chunks += np.array([len(data), 0x004E4942], "<u4").tobytes() + data
        return b"glTF" + np.array([2, 12 + len(chunks)], "<u4").tobytes() + chunks

    def gltf(self, uri):
        self.content["buffers"] = [{"byteLength": len(self.buffer), "uri": uri}]
        return json.dumps(self.content).encode()


def read(tmp_path, document, name="mesh.glb"):
    (tmp_path / name).write_bytes(document if isinstance(document, bytes) else document.glb())
    return read_mesh(tmp_path / name)


def one_mesh(**options):
    document = Document()
    document.node(mesh=document.mesh(document.primitive(**options)))
    return document


@pytest.mark.parametrize("dtype", ["u1", "u2", "u4"])
def test_a_mesh_is_read_as_it_is_whatever_the_type_of_its_indices(tmp_path, dtype):
    mesh = read(tmp_path, one_mesh(dtype=dtype))
    assert is_mesh(mesh, VERTICES, FACES)
    assert mesh.notes == (METRES,)


@pytest.mark.parametrize("uri", ["data", "next to it", "percent"])
def test_a_text_file_finds_its_buffer(tmp_path, uri):
    document = one_mesh()
    if uri == "data":
        text = document.gltf("data:application/octet-stream;base64," + base64.b64encode(document.buffer).decode())
    else:
        name = "bufér 1.bin" if uri == "percent" else "a.bin"
        (tmp_path / name).write_bytes(document.buffer)
        text = document.gltf(quote(name) if uri == "percent" else name)
    assert is_mesh(read(tmp_path, text, "mesh.GLTF"), VERTICES, FACES)


@pytest.mark.parametrize("uri", ["gone.bin", "https://example.org/a.bin"])
def test_a_buffer_that_is_not_there_is_named(tmp_path, uri):
    with pytest.raises(MeshError, match=re.escape(uri)):
        read(tmp_path, one_mesh().gltf(uri), "mesh.gltf")


def test_transforms_of_all_ancestors_are_applied_and_instances_are_copies(tmp_path):
    document = Document()
    mesh = document.mesh(document.primitive())
    turned = document.node(False, mesh=mesh, rotation=[0, 0, np.sqrt(0.5), np.sqrt(0.5)], translation=[10, 0, 0])
    matrix = np.diag([2.0, 3, 4, 1])
    matrix[:3, 3] = [0, 0, 5]
    document.node(children=[turned], matrix=matrix.T.ravel().tolist())
    document.node(mesh=mesh, scale=[1, 1, 1])
    found = read(tmp_path, document)
    x, y, z = VERTICES.T
    moved = np.column_stack([2 * (10 - y), 3 * x, 4 * z + 5])
    assert found.vertices == pytest.approx(np.vstack([moved, VERTICES]))
    assert np.array_equal(found.faces, np.vstack([FACES, np.array(FACES) + 4]))
    assert found.notes == ("joined 2 parts of the scene", METRES)


def test_a_mirrored_part_keeps_facing_outwards(tmp_path):
    document = one_mesh()
    document.content["nodes"][0]["scale"] = [-1, 1, 1]
    mesh = read(tmp_path, document)
    assert trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).volume == pytest.approx(1 / 6)


def test_a_scene_of_trimesh_has_its_area_and_bounds(tmp_path):
    scene = trimesh.Scene()
    scene.add_geometry(trimesh.creation.box(), transform=trimesh.transformations.rotation_matrix(0.7, [1, 2, 3]))
    scene.add_geometry(trimesh.creation.icosphere(2), transform=np.diag([2, 2, 2, 1]))
    mesh = read(tmp_path, scene.export(file_type="glb"))
    expected = scene.to_mesh()
    report = inspect_mesh(mesh.vertices, mesh.faces)
    assert report.area == pytest.approx(expected.area, rel=1e-6)
    assert report.is_watertight
    assert [mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)] == pytest.approx(expected.bounds, abs=1e-6)


def test_strips_and_fans_are_triangles_of_one_orientation(tmp_path):
    corners = [[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0], [0, 2, 0], [1, 2, 0]]
    for mode, indices, area in ((5, range(6), 2), (6, [0, 1, 3, 5, 4, 2], 2)):
        document = one_mesh(vertices=corners, faces=list(indices), mode=mode)
        mesh = read(tmp_path, document)
        report = inspect_mesh(mesh.vertices, mesh.faces)
        assert (report.n_faces, report.area) == (4, pytest.approx(area))
        assert report.is_consistently_oriented
        normals = np.cross(*np.diff(mesh.vertices[mesh.faces], axis=1).transpose(1, 0, 2))
        assert (normals[:, 2] >= 0).all()  # the last one of the fan has no area


def test_corners_without_indices_are_taken_in_their_order(tmp_path):
    soup = VERTICES[np.array(FACES)].reshape(-1, 3)
    mesh = read(tmp_path, one_mesh(vertices=soup, faces=None))
    assert np.array_equal(mesh.vertices[mesh.faces].reshape(-1, 3), soup)
    assert "12 of 12 vertices coincide exactly" in mesh.notes[-1]


def test_sparse_and_normalized_and_interleaved_positions_are_read(tmp_path):
    document = Document()
    sparse = document.primitive(np.zeros((4, 3)))
    rows = document.view(np.array([1, 2, 3], "u1").tobytes())
    values = document.view(VERTICES[1:].astype("f4").tobytes())
    document.content["accessors"][sparse["attributes"]["POSITION"]]["sparse"] = {
        "count": 3, "indices": {"bufferView": rows, "componentType": 5121}, "values": {"bufferView": values},
    }  # fmt: skip
    normalized = document.primitive()
    normalized["attributes"]["POSITION"] = document.accessor(VERTICES * 127, "i1", normalized=True)
    interleaved = document.primitive()
    rows = np.zeros(4, [("skipped", "f4", 3), ("position", "f4", 3)])
    rows["position"] = VERTICES
    document.content["accessors"][interleaved["attributes"]["POSITION"]] |= {
        "bufferView": document.view(rows.tobytes(), byteStride=24),
        "byteOffset": 12,
    }
    document.node(mesh=document.mesh(sparse, normalized, interleaved))
    mesh = read(tmp_path, document)
    assert np.array_equal(mesh.vertices, np.vstack([VERTICES] * 3))


def test_morph_targets_move_the_vertices_by_their_weights(tmp_path):
    document = Document()
    primitive = document.primitive()
    primitive["targets"] = [{"POSITION": document.accessor(np.ones((4, 3)), "f4")}]
    document.node(mesh=document.mesh(primitive, weights=[0.5]))
    assert np.array_equal(read(tmp_path, document).vertices, VERTICES + 0.5)


def test_a_skinned_mesh_is_read_at_rest_and_what_is_not_shown_is_noted(tmp_path):
    document = Document()
    document.node(mesh=document.mesh(document.primitive()), skin=0, translation=[5, 5, 5])
    document.mesh(document.primitive())
    document.content["scenes"].append({"nodes": []})
    document.content["meshes"][0]["primitives"].append(document.primitive(mode=1))
    mesh = read(tmp_path, document)
    assert is_mesh(mesh, VERTICES, FACES)
    assert mesh.notes == (
        "read scene 0 of 2",
        "ignored 1 mesh that the scene does not contain",
        "read what a skeleton moves in its pose at rest",
        "ignored points and lines",
        METRES,
    )


@pytest.mark.parametrize("has_nodes", [True, False])
def test_a_file_without_a_scene_has_all_its_meshes(tmp_path, has_nodes):
    document = one_mesh()
    del document.content["scenes"], document.content["scene"]
    if not has_nodes:
        del document.content["nodes"]
    assert is_mesh(read(tmp_path, document), VERTICES, FACES)


def broken():
    document = one_mesh(faces=[[0, 1, 2], [0, 1, 4]])
    yield "index", document, "primitive 0 of mesh 0 (counted from 0) refers to vertex 4, but there are 4 vertices"
    document = one_mesh(faces=[0, 1, 2, 3])
    yield "corners", document, "has 4 corners, which is not a multiple of three"
    document = one_mesh(mode=0)
    yield "points", document, "has no faces"
    document = one_mesh()
    document.content["accessors"][0]["count"] = 5
    yield "count", document, "accessor 0 needs 60 bytes, but its buffer has 48"
    document = one_mesh()
    document.content["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    yield "draco", document, "is compressed by KHR_draco_mesh_compression, which is not read"
    document = one_mesh()
    document.content["bufferViews"][0]["extensions"] = {"EXT_meshopt_compression": {}}
    yield "meshopt", document, "is compressed by EXT_meshopt_compression"
    document = one_mesh()
    del document.content["accessors"][0]["bufferView"]
    yield "no data", document, "accessor 0 has no data"
    document = one_mesh()
    document.content["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {}}
    yield "instancing", document, "node 0 is drawn several times by EXT_mesh_gpu_instancing"
    document = one_mesh()
    document.content["nodes"][0]["children"] = [0]
    yield "cycle", document, "the scene is not a tree"
    document = one_mesh()
    document.content["nodes"][0]["children"] = [7]
    yield "node", document, "the scene refers to node 7, but there are 1 nodes"
    document = one_mesh()
    document.content["asset"]["version"] = "1.0"
    yield "version", document, "is glTF of version 1.0; only version 2 is read"


@pytest.mark.parametrize(("document", "message"), [case[1:] for case in broken()], ids=[case[0] for case in broken()])
def test_what_is_wrong_is_said(tmp_path, document, message):
    with pytest.raises(MeshError, match=re.escape(message)):
        read(tmp_path, document)


def test_a_file_cut_anywhere_is_an_error(tmp_path):
    data = one_mesh().glb()
    for length in range(1, len(data), 7):
        with pytest.raises(MeshError, match=r"mesh\.glb"):
            read(tmp_path, data[:length])
    text = one_mesh().gltf("a.bin")
    with pytest.raises(MeshError, match="not a glTF file, or it is truncated"):
        read(tmp_path, text[:-10], "mesh.gltf")


def test_infinite_coordinates_are_left_to_the_checks_of_the_mesh(tmp_path):
    document = one_mesh(vertices=[[np.inf, 0, 0], [1, 0, 0], [0, np.nan, 0], [0, 0, 1]])
    document.content["nodes"][0]["scale"] = [2, 2, 2]
    mesh = read(tmp_path, document)
    assert "have NaN or infinite coordinates" in inspect_mesh(mesh.vertices, mesh.faces).problem
