"""The Heat Walk: segmentation of triangle meshes by the pathways of largest heat-flow capacity.

A dumbbell has two regions in which heat accumulates, its ends; its handle, label 2, dissipates heat:

>>> import numpy as np
>>> import trimesh
>>> import heatwalk
>>> sphere = trimesh.creation.icosphere(4)
>>> x, y, z = sphere.vertices.T
>>> radius = 0.3 + 0.1 * x + x**2
>>> seg = heatwalk.segment(np.column_stack([3 * x, radius * y, radius * z]), sphere.faces, time=1.0)
>>> np.unique(seg.labels)
array([0, 1, 2])
>>> x[seg.exemplars].round().tolist()
[1.0, -1.0]
>>> seg.face_labels.shape
(5120,)

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
    from heatwalk.options import ALGORITHM_VERSION as ALGORITHM_VERSION
    from heatwalk.robust.segmentation import segment_robust as segment_robust
    from heatwalk.segmentation import Segmentation as Segmentation
    from heatwalk.segmentation import faces_from_vertices as faces_from_vertices
    from heatwalk.segmentation import segment as segment
    from heatwalk.segmentation import segment_at_times as segment_at_times
    from heatwalk.spectrum import SpectrumError as SpectrumError

__version__ = "0.1.0"

_MODULES = {
    "ALGORITHM_VERSION": "options",
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
    "segment_robust": "robust.segmentation",
}

__all__ = list(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)


def __dir__() -> list[str]:
    return [*globals(), *__all__]
