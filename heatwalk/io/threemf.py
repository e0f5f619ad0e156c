"""3MF files (3D Manufacturing Format): the objects to build, placed by their transforms.

Not read by trimesh: trimesh 5.2 needs two more libraries for it, reads all objects of a model that another one refers
to as one, and repeats their faces where it is referred to again.
"""

import io
import posixpath
import re
import xml.etree.ElementTree as ET
import zipfile
import zlib
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from heatwalk.io.numbers import parse_numbers, shown, to_integers
from heatwalk.io.placing import Part, join_parts, placed
from heatwalk.io.polygons import Polygons, RawMesh, check_corners
from heatwalk.meshes import MeshError

_MODEL = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
_UNITS = {
    "micron": "micrometres", "millimeter": "millimetres", "centimeter": "centimetres", "inch": "inches",
    "foot": "feet", "meter": "metres",
}  # fmt: skip
# The groups of rows of a mesh, and the tag and the attributes of each row.
_GROUP = re.compile(rb"<(vertices|triangles)\s*>")
_ROWS = {b"vertices": (b"vertex", (b"x", b"y", b"z")), b"triangles": (b"triangle", (b"v1", b"v2", b"v3"))}
_TABLE = "heatwalk-table"  # in the place of rows that are read in bulk
_MAX_DEPTH = 64  # of objects within objects


def read_threemf(data: bytes) -> RawMesh:
    """Read the contents of a 3MF file."""
    try:
        with zipfile.ZipFile(io.BytesIO(data)) as archive:
            return _Package(archive).read()
    except (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError) as error:  # the last: encrypted or compressed oddly
        raise MeshError(f"not a 3MF file, or it is damaged or truncated: {error}") from error
    except ET.ParseError as error:
        raise MeshError(f"its XML cannot be read: {error}") from error


class _Package:
    """The models in the archive."""

    def __init__(self, archive: zipfile.ZipFile):
        self._archive = archive
        self._names = {name.lstrip("/").lower(): name for name in archive.namelist()}
        self._models: dict[str, ET.Element] = {}
        self._objects: dict[str, dict[str, ET.Element]] = {}
        self._tables: list[NDArray[np.float64]] = []

    def read(self) -> RawMesh:
        """The mesh of all items of the build."""
        main = self._main_model()
        root = self._model(main)
        items = [item for build in _children(root, "build") for item in _children(build, "item")]
        if not items:
            raise MeshError("has no items to build: the file contains no placed object")
        parts = [part for item in items for part in self._parts(main, item, np.eye(4), 0)]
        unit = root.get("unit", "millimeter")
        return join_parts(parts, [f"coordinates are in {_UNITS.get(unit, unit)}"])

    def _main_model(self) -> str:
        """The path of the model that the package begins with."""
        if "_rels/.rels" in self._names:
            for relation in ET.fromstring(self._archive.read(self._names["_rels/.rels"])):
                if relation.get("Type") == _MODEL:
                    return relation.get("Target", "")
        models = sorted(name for name in self._names if name.endswith(".model"))
        if not models:
            raise MeshError("contains no 3D model")
        return models[0]

    def _model(self, path: str) -> ET.Element:
        """The root of a model."""
        key = posixpath.normpath(path.lstrip("/")).lower()
        if key not in self._models:
            if key not in self._names:
                raise MeshError(f"refers to {path}, which the archive does not contain")
            root = self._parse(self._archive.read(self._names[key]))
            objects = [item for resources in _children(root, "resources") for item in _children(resources, "object")]
            self._models[key] = root
            self._objects[key] = {item.get("id", ""): item for item in objects}
        return self._models[key]

    def _parse(self, model: bytes) -> ET.Element:
        """The XML of a model."""
        try:
            return ET.fromstring(_shortened(model, self._tables))
        except ET.ParseError:
            return ET.fromstring(model)  # says where in the file the error is

    def _parts(self, path: str, reference: ET.Element, to_scene: NDArray[np.float64], depth: int) -> Iterator[Part]:
        """The meshes of the object that an item or component refers to, in the coordinates of the scene."""
        if depth > _MAX_DEPTH:
            raise MeshError("an object contains itself, or objects are nested too deeply")
        path = next((value for name, value in reference.attrib.items() if name.endswith("}path")), path)
        self._model(path)
        key = posixpath.normpath(path.lstrip("/")).lower()
        index = reference.get("objectid", "")
        found = self._objects[key].get(index)
        if found is None:
            raise MeshError(f"refers to object {index!r}, which the model does not contain")
        to_scene = to_scene @ _transform(reference.get("transform"))
        for mesh in _children(found, "mesh"):
            yield placed(_mesh(mesh, index, self._tables), to_scene)
        for components in _children(found, "components"):
            for component in _children(components, "component"):
                yield from self._parts(path, component, to_scene, depth + 1)


def _children(element: ET.Element, name: str) -> Iterator[ET.Element]:
    """The children of a name, in any namespace."""
    return (child for child in element if isinstance(child.tag, str) and child.tag.rpartition("}")[2] == name)


def _transform(text: str | None) -> NDArray[np.float64]:
    """The (4, 4) matrix of the attribute ``transform``: its twelve numbers are the columns, one after the other."""
    matrix = np.eye(4)
    if text is not None:
        values = parse_numbers(text.encode())
        if values.bad_word is not None or len(values.values) != 12:
            raise MeshError(f"the transform {shown(text.encode())} is not twelve numbers")
        matrix[:3] = values.values.reshape(4, 3).T
    return matrix


def _shortened(model: bytes, tables: list[NDArray[np.float64]]) -> bytes:
    """The XML of a model without the vertices and triangles of the usual layout, which are added to ``tables``.

    The number of its table is in the place of each: the parser takes longer than all other steps.
    """

    if b"<!" in model or _TABLE.encode() in model:  # comments, entities, text as it is
        return model
    kept, at = [], 0
    while (begin := _GROUP.search(model, at)) is not None:
        end = model.find(b"</" + begin[1] + b">", begin.end())
        values = _plain_table(model[begin.end() : max(end, begin.end())], *_ROWS[begin[1]])
        kept.append(model[at : begin.end()])
        at = begin.end()
        if values is not None:
            kept.append(b'<%s number="%d"/>' % (_TABLE.encode(), len(tables)))
            tables.append(values)
            at = end
    return b"".join([*kept, model[at:]])


def _plain_table(rows: bytes, tag: bytes, names: tuple[bytes, ...]) -> NDArray[np.float64] | None:
    """The numbers of rows that have these attributes, in this order, and no others; else None."""
    octets = np.frombuffer(rows, np.uint8)
    is_quoted = np.cumsum(octets == ord('"'), dtype=np.uint8) % 2 == 1  # with the quote that opens
    around = octets[~is_quoted].tobytes().rstrip()
    row = re.match(rb"\s*<" + tag + b"".join(rb"\s+" + name + rb'="' for name in names) + rb"\s*/>", around)
    n_rows = around.count(b"<")
    if row is None or around != row[0] * n_rows:
        return None
    quoted = octets[is_quoted]
    words = quoted.tobytes()
    if (quoted <= ord(" ")).any() or b'""' in words or words.endswith(b'"'):
        return None
    values, bad_word = parse_numbers(words.replace(b'"', b" "))
    is_whole = bad_word is None and len(values) == n_rows * len(names)
    return values.reshape(n_rows, len(names)) if is_whole else None


def _mesh(mesh: ET.Element, index: str, tables: list[NDArray[np.float64]]) -> Part:
    """The mesh of an object."""
    vertices = _table(mesh, "vertices", "vertex", ("x", "y", "z"), index, tables)
    corners = to_integers(_table(mesh, "triangles", "triangle", ("v1", "v2", "v3"), index, tables))
    if corners is None:
        raise MeshError(f"object {index} has a triangle with a corner that is not an integer")
    try:
        check_corners(Polygons(np.full(len(corners), 3), corners.ravel()), len(vertices), "triangle")
    except MeshError as error:
        raise MeshError(f"object {index}: {error}") from error
    return Part(vertices, corners)


def _table(
    mesh: ET.Element, group: str, row: str, names: tuple[str, ...], index: str, tables: list[NDArray[np.float64]]
) -> NDArray[np.float64]:
    """The attributes of the rows of a group as numbers."""
    found = [np.empty((0, len(names)))]
    for items in _children(mesh, group):
        place = next(_children(items, _TABLE), None)
        if place is not None:
            found.append(tables[int(place.get("number", ""))])
            continue
        words = [item.get(name, "missing") for item in _children(items, row) for name in names]
        values, bad_word = parse_numbers(" ".join(words).encode())
        if bad_word is not None or len(values) != len(words):
            at = sum(map(len, found)) + len(values) // len(names)
            raise MeshError(f"{row} {at} (counted from 0) of object {index}: {', '.join(names)} must be numbers")
        found.append(values.reshape(-1, len(names)))
    return np.concatenate(found)
