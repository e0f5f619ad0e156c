"""The Heat Walk: segmentation of triangle meshes by the pathways of largest heat-flow capacity.

>>> import heatwalk
>>> seg = heatwalk.segment(vertices, faces, time=1.0)
>>> seg.labels, seg.exemplars

The names below are loaded when they are first used: SciPy takes longer to import than most meshes to segment.
"""

from importlib import import_module

__version__ = "0.1.0"

_HOME = {
    "ALGORITHM_VERSION": "segmentation",
    "LoadedMesh": "io",
    "MeshError": "meshes",
    "MeshReport": "meshes",
    "Segmentation": "segmentation",
    "SpectrumError": "spectrum",
    "check_mesh": "meshes",
    "faces_from_vertices": "segmentation",
    "inspect_mesh": "meshes",
    "read_mesh": "io",
    "segment": "segmentation",
    "segment_at_times": "segmentation",
}

__all__ = list(_HOME)


def __getattr__(name):
    if name not in _HOME:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_HOME[name]}"), name)


def __dir__():
    return [*globals(), *__all__]
