"""Meshes and segmentations in files: one module per format.

The names below are loaded on first use, so that importing this package costs nothing.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from heatwalk.io.colours import label_colours as label_colours
    from heatwalk.io.integers import parse_integers as parse_integers
    from heatwalk.io.integers import read_integers as read_integers
    from heatwalk.io.ply import write_ply as write_ply
    from heatwalk.io.reading import LoadedMesh as LoadedMesh
    from heatwalk.io.reading import read_mesh as read_mesh
    from heatwalk.io.seg import read_seg as read_seg
    from heatwalk.io.seg import write_seg as write_seg
    from heatwalk.io.writing import write_mesh as write_mesh

_MODULES = {
    "LoadedMesh": "reading",
    "label_colours": "colours",
    "parse_integers": "integers",
    "read_integers": "integers",
    "read_mesh": "reading",
    "read_seg": "seg",
    "write_mesh": "writing",
    "write_ply": "ply",
    "write_seg": "seg",
}

__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
