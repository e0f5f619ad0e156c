"""glTF 2.0 files, text (.gltf) or binary (.glb): the triangles of their scene, placed by its transforms.

Not read by trimesh: trimesh 5.2 ignores sparse accessors, normalized integers and triangle fans, reads compressed
meshes that it cannot decode as zeros, and leaves out meshes of nodes with a camera and of files without a scene.
"""

import base64
import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import unquote

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.cells import strip_triangles
from heatwalk.io.numbers import BYTE_ORDER_MARK
from heatwalk.io.placing import Part, join_parts, placed
from heatwalk.io.polygons import RawMesh
from heatwalk.meshes import MeshError

_MAGIC = b"glTF"
_JSON, _BINARY = 0x4E4F534A, 0x004E4942  # types of chunks
_COMPONENTS = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_TRIANGLES, _STRIP, _FAN = 4, 5, 6

# Extensions without which positions or faces are not what the file means.
_COMPRESSED = ("KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression")
_INSTANCES = "EXT_mesh_gpu_instancing"


def read_gltf(data: bytes, folder: Path | None = None) -> RawMesh:
    """Read the contents of a .gltf or .glb file; ``folder`` contains the files that it refers to."""
    document, chunk = _parse(data)
    version = str(document.get("asset", {}).get("version", ""))
    if not version.startswith("2."):
        raise MeshError(f"is glTF of version {version or 'unknown'}; only version 2 is read")
    for extension in _COMPRESSED:
        if extension in document.get("extensionsRequired", ()):
            raise MeshError(f"is compressed by {extension}, which is not read: export it without compression")
    return _Reader(document, chunk, folder).read()


def external_buffers(data: bytes, folder: Path) -> list[Path]:
    """The files that a .gltf file refers to for its geometry."""
    buffers = _parse(data)[0].get("buffers", [])
    uris = [buffer["uri"] for buffer in buffers if "uri" in buffer]
    return [folder / unquote(uri) for uri in uris if not uri.startswith("data:")]


def _parse(data: bytes) -> tuple[dict[str, Any], bytes | None]:
    """The JSON document, and the binary chunk of a .glb file."""
    text, chunk = data.removeprefix(BYTE_ORDER_MARK), None
    if data.startswith(_MAGIC):
        chunks = dict(reversed(list(_chunks(data))))  # the first of each type
        if _JSON not in chunks:
            raise MeshError("has no JSON chunk: the file is damaged")
        text, chunk = chunks[_JSON], chunks.get(_BINARY)
    try:
        document = json.loads(text)
    except ValueError as error:
        raise MeshError(f"not a glTF file, or it is truncated: {error}") from error
    if not isinstance(document, dict):
        raise MeshError("not a glTF file: its JSON is not an object")
    return document, chunk


def _chunks(data: bytes) -> Iterator[tuple[int, bytes]]:
    """Type and contents of the chunks of a .glb file."""
    version, length = (int(value) for value in np.frombuffer(data[4:12].ljust(8, b"\0"), "<u4"))
    if version != 2:
        raise MeshError(f"is glTF of version {version}; only version 2 is read")
    if len(data) < length:
        raise MeshError(f"declares {length:,} bytes but contains {len(data):,}: the file is truncated")
    at = 12
    while at + 8 <= length:
        size, kind = (int(value) for value in np.frombuffer(data[at : at + 8], "<u4"))
        if at + 8 + size > length:
            raise MeshError("a chunk is longer than the file: the file is damaged")
        yield kind, data[at + 8 : at + 8 + size]
        at += 8 + size


class _Node(NamedTuple):
    """A node of the scene, and the transform to the coordinates of the scene."""

    number: int
    to_scene: NDArray[np.float64]


class _Reader:
    """The contents of one file."""

    def __init__(self, document: dict[str, Any], chunk: bytes | None, folder: Path | None):
        self._document = document
        self._chunk = chunk
        self._folder = folder
        self._buffers: dict[int, bytes] = {}
        self._n_other_primitives = 0
        self._n_skinned = 0

    def read(self) -> RawMesh:
        """All triangles of the scene."""
        nodes, meshes = self._items("nodes"), self._items("meshes")
        parts: list[Part] = []
        drawn: set[int] = set()
        for index, to_scene in self._scene():
            node = nodes[index]
            if _INSTANCES in node.get("extensions", {}):
                raise MeshError(f"node {index} is drawn several times by {_INSTANCES}, which is not read")
            if "mesh" not in node:
                continue
            drawn.add(node["mesh"])
            if "skin" in node:  # a skin places the vertices, not the node
                self._n_skinned += 1
                to_scene = np.eye(4)
            weights = node.get("weights", meshes[node["mesh"]].get("weights", []))
            parts += [placed(part, to_scene) for part in self._mesh(node["mesh"], weights)]
        if not nodes:
            drawn.update(range(len(meshes)))
            parts = [part for mesh in range(len(meshes)) for part in self._mesh(mesh, meshes[mesh].get("weights", []))]
        return join_parts(parts, self._notes(len(meshes) - len(drawn)))

    def _notes(self, n_left: int) -> list[str]:
        """What was left out, and the unit."""
        notes = []
        if len(self._items("scenes")) > 1:
            notes.append(f"read scene {self._document.get('scene', 0)} of {len(self._items('scenes'))}")
        if n_left:
            notes.append(f"ignored {n_left:,} mesh{'es' * (n_left != 1)} that the scene does not contain")
        if self._n_skinned:
            notes.append("read what a skeleton moves in its pose at rest")
        if self._n_other_primitives:
            notes.append("ignored points and lines")
        return [*notes, "coordinates are in metres, with Y up, as glTF has them"]

    def _items(self, name: str) -> list[Any]:
        """One of the lists of the document."""
        return self._document.get(name, [])

    def _scene(self) -> list[_Node]:
        """The nodes of the scene that is shown by default; of a file without scenes all nodes."""
        nodes, scenes = self._items("nodes"), self._items("scenes")
        if scenes:
            roots = scenes[self._document.get("scene", 0)].get("nodes", [])
        else:
            children = {child for node in nodes for child in node.get("children", [])}
            roots = [i for i in range(len(nodes)) if i not in children]
        found: list[_Node] = []
        waiting = [_Node(root, np.eye(4)) for root in reversed(roots)]
        while waiting:
            index, to_parent = waiting.pop()
            if not 0 <= index < len(nodes):
                raise MeshError(f"the scene refers to node {index}, but there are {len(nodes)} nodes")
            to_scene = to_parent @ _transform(nodes[index])
            found.append(_Node(index, to_scene))
            if len(found) > len(nodes):
                raise MeshError("a node is its own descendant, or has two parents: the scene is not a tree")
            waiting += [_Node(child, to_scene) for child in reversed(nodes[index].get("children", []))]
        return found

    def _mesh(self, index: int, weights: list[float]) -> Iterator[Part]:
        """The triangles of each primitive of a mesh, with its morph targets."""
        for number, primitive in enumerate(self._items("meshes")[index]["primitives"]):
            where = f"primitive {number} of mesh {index} (counted from 0)"
            mode = primitive.get("mode", _TRIANGLES)
            if mode not in (_TRIANGLES, _STRIP, _FAN):
                self._n_other_primitives += 1
                continue
            position = primitive.get("attributes", {}).get("POSITION")
            if position is None:
                continue  # nothing to draw, says the specification
            vertices = self._accessor(position, 3)
            for weight, target in zip(weights, primitive.get("targets", []), strict=False):
                if weight and "POSITION" in target:
                    vertices = vertices + weight * self._accessor(target["POSITION"], 3)
            indices = np.arange(len(vertices))
            if "indices" in primitive:
                indices = self._accessor(primitive["indices"], 1).ravel().astype(np.int64)
            outside = np.flatnonzero(indices >= len(vertices))
            if len(outside):
                raise MeshError(
                    f"{where} refers to vertex {indices[outside[0]]}, but there are {len(vertices)} vertices"
                )
            if mode == _TRIANGLES and len(indices) % 3:
                raise MeshError(f"{where} has {len(indices)} corners, which is not a multiple of three")
            yield Part(vertices, _triangles(indices, mode))

    def _accessor(self, index: int, width: int) -> NDArray[np.float64]:
        """The values of an accessor, (count, width)."""
        where = f"accessor {index}"
        if not 0 <= index < len(self._items("accessors")):
            raise MeshError(f"{where} is referred to, but there are {len(self._items('accessors'))}")
        accessor = self._items("accessors")[index]
        kind = np.dtype(_COMPONENTS[accessor["componentType"]])
        count = accessor["count"]
        if _WIDTHS.get(accessor["type"]) != width:
            raise MeshError(f"{where} has values of the type {accessor['type']}, where {width} numbers are required")
        if "bufferView" in accessor:
            values = self._view(accessor["bufferView"], accessor.get("byteOffset", 0), count, width, kind, where)
        elif "sparse" in accessor:
            values = np.zeros((count, width), kind)
        else:
            raise MeshError(f"{where} has no data: the mesh is compressed, which is not read, or the file is damaged")
        if "sparse" in accessor:
            sparse = accessor["sparse"]
            at, given = sparse["indices"], sparse["values"]
            at_kind = np.dtype(_COMPONENTS[at["componentType"]])
            rows = self._view(at["bufferView"], at.get("byteOffset", 0), sparse["count"], 1, at_kind, where).ravel()
            if len(rows) and rows.max() >= count:
                raise MeshError(f"{where} replaces value {rows.max()}, but has {count}")
            values = values.copy()
            values[rows] = self._view(
                given["bufferView"], given.get("byteOffset", 0), sparse["count"], width, kind, where
            )
        if accessor.get("normalized") and kind.kind != "f":
            return np.maximum(values.astype(np.float64) / np.iinfo(kind).max, -1.0)
        return values.astype(np.float64)

    def _view(self, index: int, offset: int, count: int, width: int, kind: np.dtype, where: str) -> NDArray:
        """``count`` rows of ``width`` values from a view of a buffer."""
        view = self._items("bufferViews")[index]
        for extension in _COMPRESSED:
            if extension in view.get("extensions", {}):
                raise MeshError(f"is compressed by {extension}, which is not read: export it without compression")
        begin = view.get("byteOffset", 0)
        data = self._buffer(view["buffer"])[begin : begin + view["byteLength"]]
        row = width * kind.itemsize
        stride = view.get("byteStride", row)
        needed = offset + (count - 1) * stride + row if count else 0
        if min(offset, begin, stride, count) < 0 or needed > len(data):
            raise MeshError(f"{where} needs {needed:,} bytes, but its buffer has {len(data):,}: the file is truncated")
        if count and stride == row:
            return np.frombuffer(data, kind, count * width, offset).reshape(count, width)
        at = offset + np.arange(count)[:, None] * stride + np.arange(row)
        return np.ascontiguousarray(np.frombuffer(data, np.uint8)[at]).view(kind).reshape(count, width)

    def _buffer(self, index: int) -> bytes:
        """The contents of a buffer: the chunk of a .glb file, a data URI, or another file."""
        if index not in self._buffers:
            self._buffers[index] = self._load(self._items("buffers")[index])
        return self._buffers[index]

    def _load(self, buffer: dict[str, Any]) -> bytes:
        """The contents of a buffer."""
        uri = buffer.get("uri")
        if uri is None:
            if self._chunk is None:
                raise MeshError("a buffer has no data: the file is damaged, or compressed in a way that is not read")
            return self._chunk
        if uri.startswith("data:"):
            return base64.b64decode(uri.partition(",")[2])
        if "://" in uri or self._folder is None:
            raise MeshError(f"refers to {uri}, which is not a file next to it")
        path = self._folder / unquote(uri)
        try:
            return path.read_bytes()
        except OSError as error:
            raise MeshError(f"refers to {path}, which cannot be read: {error.strerror or error}") from error


def _triangles(indices: NDArray[np.int64], mode: int) -> NDArray[np.int64]:
    """The triangles of a primitive, (m, 3)."""
    if mode == _TRIANGLES:
        return indices.reshape(-1, 3)
    if mode == _STRIP:
        return np.array(strip_triangles(indices.tolist()), dtype=np.int64).reshape(-1, 3)
    return np.column_stack([indices[1:-1], indices[2:], np.full(max(len(indices) - 2, 0), indices[0])])


def _transform(node: dict[str, Any]) -> NDArray[np.float64]:
    """The matrix of a node: it takes the coordinates of the node to those of its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=np.float64).reshape(4, 4).T
    matrix = np.eye(4)
    x, y, z, w = node.get("rotation", (0.0, 0.0, 0.0, 1.0))
    length = float(np.sqrt(x * x + y * y + z * z + w * w)) or 1.0
    x, y, z, w = x / length, y / length, z / length, w / length
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    matrix[:3, :3] = rotation * np.asarray(node.get("scale", (1.0, 1.0, 1.0)), dtype=np.float64)
    matrix[:3, 3] = node.get("translation", (0.0, 0.0, 0.0))
    return matrix
