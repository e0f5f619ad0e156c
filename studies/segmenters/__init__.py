"""Segmentation methods that can be studied.

A method is a callable ``(vertices (n, 3) float64, faces (m, 3) int64) -> labels``: one integer per vertex or per face.
The label -1, if a method uses it, marks what belongs to no part; pictures show it in grey. `make_segmenter` turns
options into a `Segmenter`, which returns labels of vertices whatever the method returns.
"""

from studies.segmenters.about import About
from studies.segmenters.external import External
from studies.segmenters.heat_walk import HeatWalk
from studies.segmenters.labels import LabelError, labels_at_vertices
from studies.segmenters.segmenter import Segmenter, SegmenterError, make_segmenter

__all__ = [
    "About",
    "External",
    "HeatWalk",
    "LabelError",
    "Segmenter",
    "SegmenterError",
    "labels_at_vertices",
    "make_segmenter",
]
