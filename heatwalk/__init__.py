"""The Heat Walk: segmentation of triangle meshes by the pathways of largest heat-flow capacity.

>>> import heatwalk
>>> seg = heatwalk.segment(vertices, faces, time=1.0)
>>> seg.labels, seg.exemplars

Meshes in files are read by ``heatwalk.files``, which is not imported here: it takes trimesh, and longer.
"""

from heatwalk.meshes import MeshError, MeshReport, check_mesh, inspect_mesh
from heatwalk.segmentation import ALGORITHM_VERSION, Segmentation, faces_from_vertices, segment
from heatwalk.spectrum import SpectrumError

__version__ = "0.1.0"

__all__ = [
    "ALGORITHM_VERSION",
    "MeshError",
    "MeshReport",
    "Segmentation",
    "SpectrumError",
    "check_mesh",
    "faces_from_vertices",
    "inspect_mesh",
    "segment",
]
