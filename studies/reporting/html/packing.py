"""Scenes as a page contains them: JSON that describes them, and one compressed block of coordinates and labels.

Coordinates are 16-bit numbers within the bounding box of their surface, labels and values of functions 8-bit numbers,
eigenvectors 16-bit numbers.
Arrays that are equal, such as the faces of an original and of its noisy variants, are stored once.
"""

from __future__ import annotations

import base64
import gzip
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from heatwalk.io import label_colours
from studies.figures.colours import BACKGROUND
from studies.figures.scenes import Field, Heat, Scene, Surface, Viewport

VERSION = 1  # raise it when the format changes: pages are then made again

STEPS = 65535  # of a coordinate along the bounding box
NO_LABEL = 255
NO_VALUE = 255
EIGENVECTOR_STEPS = 32767  # of an eigenvector from 0 to its largest value
LEVELS = 254  # steps of the values of a function
COLOURS = 60  # after which the colours of labels repeat
MOST_LABELS = 240  # a multiple of `COLOURS`

ALIGNMENT = 4  # bytes, so that 16-bit and 32-bit numbers can be read in place


@dataclass(frozen=True)
class PackedScenes:
    """Scenes as plain values that JSON can represent.

    Parameters
    ----------
    values : mapping
        what `pack` returns
    """

    values: Mapping[str, Any]

    @property
    def content(self) -> str:
        """What the scenes were made from."""
        return str(self.values["content"])

    @property
    def count(self) -> int:
        """How many scenes there are."""
        return len(self.values["scenes"])

    @property
    def numbers(self) -> dict[str, int]:
        """The number of each scene by its key; keys of several parts, divided by spaces, name the scene by each."""
        return {key: i for i, scene in enumerate(self.values["scenes"]) for key in str(scene["key"]).split()}


def pack(scenes: Sequence[Scene], *, slider: str = "level", content: str = "") -> PackedScenes:
    """Scenes as plain values.

    Parameters
    ----------
    scenes : sequence of Scene
        at least one
    slider : str
        the name, among those that are picked, that has a slider
    content : str
        what the scenes were made from, by which a page tells whether it has to make them again

    Examples
    --------
    >>> square = Surface(np.array([[0.0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]]), np.array([[0, 1, 2], [0, 2, 3]]))
    >>> scene = Scene({"model": "square", "level": 0.0}, [Viewport(square, labels=np.array([0, 0, 1, -1]))])
    >>> unpack(pack([scene]))[0].viewports[0].labels
    array([ 0,  0,  1, -1])
    """
    blocks = _Blocks()
    surfaces: dict[int, int] = {}
    packed_surfaces: list[dict[str, Any]] = []
    packed: list[dict[str, Any]] = []
    for scene in scenes:
        viewports = []
        for each in scene.viewports:
            if id(each.surface) not in surfaces:
                surfaces[id(each.surface)] = len(packed_surfaces)
                packed_surfaces.append(_packed_surface(each.surface, blocks))
            viewports.append(
                {
                    "surface": surfaces[id(each.surface)],
                    "title": each.title,
                    "row": each.row,
                    "note": each.note,
                    "labels": None if each.labels is None else blocks.add(_bytes_of_labels(each.labels)),
                    "changed": None if each.changed is None else blocks.add(each.changed.astype(np.uint8)),
                    "fields": {name: _packed_field(one, blocks) for name, one in each.fields.items()},
                    **_packed_extras(each, blocks),
                }
            )
        packed.append(
            {
                "at": dict(scene.at),
                "text": scene.text,
                "value": None if scene.value is None or np.isnan(scene.value) else float(scene.value),
                "axes": None if scene.axes is None else np.round(scene.axes, 6).ravel().tolist(),
                "key": scene.key,
                "viewports": viewports,
                **({"slider": scene.slider} if scene.slider else {}),
            }
        )
    return PackedScenes(
        {
            "version": VERSION,
            "content": content,
            "slider": slider,
            "surfaces": packed_surfaces,
            "scenes": packed,
            "blocks": blocks.places,
            "data": blocks.encoded(),
        }
    )


def unpack(packed: PackedScenes) -> list[Scene]:
    """The scenes again: coordinates and values of functions up to rounding, everything else exactly.

    Labels from 240 on, whose colours repeat, are the number of their colour.
    """
    values = packed.values
    data = gzip.decompress(base64.b64decode(values["data"]))

    def block(number: int, dtype: type) -> np.ndarray:
        start, length = values["blocks"][number]
        return np.frombuffer(data[start : start + length], dtype)

    surfaces = []
    for each in values["surfaces"]:
        quantised = block(each["positions"], np.uint16).reshape(-1, 3)
        vertices = np.array(each["low"]) + quantised / STEPS * np.array(each["size"])
        faces = block(each["faces"], np.uint32 if each["wide"] else np.uint16).reshape(-1, 3)
        surfaces.append(Surface(vertices, faces.astype(np.int64)))
    scenes = []
    for scene in values["scenes"]:
        viewports = []
        for each in scene["viewports"]:
            labels = None if each["labels"] is None else block(each["labels"], np.uint8).astype(np.int64)
            viewports.append(
                Viewport(
                    surfaces[each["surface"]],
                    each["title"],
                    each["row"],
                    each["note"],
                    None if labels is None else np.where(labels == NO_LABEL, BACKGROUND, labels),
                    None if each["changed"] is None else block(each["changed"], np.uint8).astype(bool),
                    {
                        name: _unpacked_field(one, block(one["values"], np.uint8))
                        for name, one in each["fields"].items()
                    },
                    each.get("shows", ""),
                    _unpacked_heat(each["heat"], block) if "heat" in each else None,
                    block(each["faded"], np.uint8).astype(bool) if "faded" in each else None,
                    np.array(each["axes"]).reshape(3, 3) if "axes" in each else None,
                )
            )
        axes = None if scene["axes"] is None else np.array(scene["axes"]).reshape(3, 3)
        scenes.append(
            Scene(scene["at"], viewports, scene["text"], scene["value"], axes, scene["key"], scene.get("slider", ""))
        )
    return scenes


def palette() -> list[str]:
    """The colour of each label as "#rrggbb", and at last that of the background."""
    colours = label_colours(np.arange(COLOURS + 1), dissipator=COLOURS)[:, :3]
    return [f"#{red:02x}{green:02x}{blue:02x}" for red, green, blue in colours.tolist()]


def _packed_surface(surface: Surface, blocks: _Blocks) -> dict[str, Any]:
    vertices = np.asarray(surface.vertices, np.float64)
    low, size = vertices.min(axis=0), np.ptp(vertices, axis=0)
    quantised = np.rint((vertices - low) / np.where(size > 0, size, 1.0) * STEPS).astype(np.uint16)
    wide = len(vertices) > STEPS
    return {
        "low": low.tolist(),
        "size": size.tolist(),
        "radius": float(np.linalg.norm(vertices - (low + size / 2), axis=1).max()) or 1.0,
        "positions": blocks.add(quantised),
        "faces": blocks.add(surface.faces.astype(np.uint32 if wide else np.uint16)),
        "wide": wide,
    }


def _bytes_of_labels(labels: np.ndarray) -> np.ndarray:
    """Labels as 8-bit numbers with the same colours."""
    # Labels from 240 on become one of 180 to 239, which has the same colour.
    repeated = np.where(labels < MOST_LABELS, labels, labels % COLOURS + MOST_LABELS - COLOURS)
    return np.where(labels < 0, NO_LABEL, repeated).astype(np.uint8)


def _packed_field(shown: Field, blocks: _Blocks) -> dict[str, Any]:
    spread = shown.high - shown.low or 1.0
    share = np.clip((shown.values - shown.low) / spread, 0, 1)
    steps = np.where(np.isnan(share), NO_VALUE, np.rint(np.nan_to_num(share) * LEVELS)).astype(np.uint8)
    packed = {"low": float(shown.low), "high": float(shown.high), "unit": shown.unit, "values": blocks.add(steps)}
    return {**packed, "diverging": True} if shown.diverging else packed


def _unpacked_field(packed: Mapping[str, Any], steps: np.ndarray) -> Field:
    low, high = packed["low"], packed["high"]
    values = np.where(steps == NO_VALUE, np.nan, low + steps / LEVELS * (high - low))
    return Field(values, low, high, packed["unit"], packed.get("diverging", False))


def _packed_extras(viewport: Viewport, blocks: _Blocks) -> dict[str, Any]:
    """What only some viewports have, so that pages without it are as they were."""
    extras: dict[str, Any] = {}
    if viewport.shows:
        extras["shows"] = viewport.shows
    if viewport.faded is not None:
        extras["faded"] = blocks.add(viewport.faded.astype(np.uint8))
    if viewport.axes is not None:
        extras["axes"] = np.round(viewport.axes, 6).ravel().tolist()
    if viewport.heat is not None:
        extras["heat"] = _packed_heat(viewport.heat, blocks)
    return extras


def _packed_heat(heat: Heat, blocks: _Blocks) -> dict[str, Any]:
    """Eigenpairs with 16-bit eigenvectors, each relative to its largest value; missing ones have no weight."""
    scales = np.abs(heat.eigenvectors).max(axis=0, initial=0)
    quantised = np.rint(heat.eigenvectors / np.where(scales > 0, scales, 1.0) * EIGENVECTOR_STEPS).astype(np.int16)
    return {
        "eigenvalues": [[float(each) if np.isfinite(each) else None for each in row] for row in heat.eigenvalues],
        "scales": scales.tolist(),
        "vectors": blocks.add(quantised),
        "components": blocks.add(heat.component.astype(np.uint32)),
        "time": float(heat.time),
        "point": int(heat.point),
    }


def _unpacked_heat(packed: Mapping[str, Any], block: Callable[[int, type], np.ndarray]) -> Heat:
    eigenvalues = np.array([[np.inf if each is None else each for each in row] for row in packed["eigenvalues"]])
    scales = np.array(packed["scales"])
    vectors = block(packed["vectors"], np.int16).reshape(-1, len(scales)) / EIGENVECTOR_STEPS * scales
    return Heat(
        eigenvalues, vectors, block(packed["components"], np.uint32).astype(np.int64), packed["time"], packed["point"]
    )


class _Blocks:
    """Arrays one after another, equal ones once."""

    def __init__(self) -> None:
        self.places: list[list[int]] = []
        self._data = bytearray()
        self._numbers: dict[bytes, int] = {}

    def add(self, array: np.ndarray) -> int:
        """The number of the block with the bytes of an array."""
        content = np.ascontiguousarray(array).tobytes()
        if content not in self._numbers:
            self._numbers[content] = len(self.places)
            self.places.append([len(self._data), len(content)])
            self._data += content + bytes(-len(content) % ALIGNMENT)
        return self._numbers[content]

    def encoded(self) -> str:
        """Everything, compressed, in base64."""
        return base64.b64encode(gzip.compress(bytes(self._data), mtime=0)).decode("ascii")


def read_packed(text: str) -> PackedScenes | None:
    """Scenes from the JSON of an earlier page; None if it is damaged, or of another version."""
    try:
        values = json.loads(text)
        packed = PackedScenes(values)
        return packed if values["version"] == VERSION and packed.count and values["data"] else None
    except (ValueError, KeyError, TypeError):
        return None
