"""Methods that can be studied.

A method is a callable ``(vertices (n, 3) float64, faces (m, 3) int64) -> labels``, one integer a vertex or one a face.
The label -1, where it is used, is the rest that belongs to no part; pictures show it grey. `make` turns a
configuration into a `Segmenter`, which gives labels of vertices whatever the method gives.
"""

from studies.segmenters.external import External
from studies.segmenters.heat_walk import HeatWalk
from studies.segmenters.labels import LabelError, at_vertices
from studies.segmenters.segmenter import Segmenter, SegmenterError, make

__all__ = ["External", "HeatWalk", "LabelError", "Segmenter", "SegmenterError", "at_vertices", "make"]
