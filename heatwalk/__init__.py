"""The Heat Walk: segmentation of triangle meshes by the pathways of largest heat-flow capacity.

A dumbbell with 2,562 vertices falls into its two ends; the handle dissipates heat:

>>> import numpy as np, trimesh
>>> import heatwalk
>>> mesh = trimesh.creation.icosphere(4)
>>> x = mesh.vertices[:, :1]
>>> vertices = mesh.vertices * np.hstack([3 + 0 * x, 0.2 + x**2, 0.2 + x**2])
>>> seg = heatwalk.segment(vertices, mesh.faces, time=4.0)
>>> len(seg.exemplars)
2
>>> seg.labels.shape, seg.face_labels.shape
((2562,), (5120,))

The names below are loaded on first use: SciPy and numba take longer to import than most meshes to segment.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from heatwalk.io.reading import LoadedMesh as LoadedMesh
    from heatwalk.io.reading import read_mesh as read_mesh
    from heatwalk.meshes import MeshError as MeshError
    from heatwalk.meshes import MeshReport as MeshReport
    from heatwalk.meshes import check_mesh as check_mesh
    from heatwalk.meshes import inspect_mesh as inspect_mesh
    from heatwalk.segmentation import ALGORITHM_VERSION as ALGORITHM_VERSION
    from heatwalk.segmentation import Segmentation as Segmentation
    from heatwalk.segmentation import faces_from_vertices as faces_from_vertices
    from heatwalk.segmentation import segment as segment
    from heatwalk.segmentation import segment_at_times as segment_at_times
    from heatwalk.spectrum import SpectrumError as SpectrumError

__version__ = "0.1.0"

_MODULES = {
    "ALGORITHM_VERSION": "segmentation",
    "LoadedMesh": "io.reading",
    "MeshError": "meshes",
    "MeshReport": "meshes",
    "Segmentation": "segmentation",
    "SpectrumError": "spectrum",
    "check_mesh": "meshes",
    "faces_from_vertices": "segmentation",
    "inspect_mesh": "meshes",
    "read_mesh": "io.reading",
    "segment": "segmentation",
    "segment_at_times": "segmentation",
}

__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
