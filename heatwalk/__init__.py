"""The Heat Walk: segmentation of triangle meshes by the pathways of largest heat-flow capacity.

>>> import heatwalk
>>> seg = heatwalk.segment(vertices, faces, time=1.0)
>>> seg.labels, seg.exemplars
"""

from heatwalk.meshes import LoadedMesh, MeshError, inspect_mesh, read_mesh
from heatwalk.segmentation import ALGORITHM_VERSION, Segmentation, faces_from_vertices, segment
from heatwalk.spectrum import SpectrumError

__version__ = "0.1.0"

__all__ = [
    "ALGORITHM_VERSION",
    "LoadedMesh",
    "MeshError",
    "Segmentation",
    "SpectrumError",
    "faces_from_vertices",
    "inspect_mesh",
    "read_mesh",
    "segment",
]
