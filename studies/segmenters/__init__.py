"""Methods that can be studied.

A segmenter is a callable ``(vertices (n, 3) float64, faces (m, 3) int64) -> labels (n,) int``, one label a vertex. The
label -1, where it is used, is the rest that belongs to no part; pictures show it grey.
"""

from studies.segmenters.heat_walk import HeatWalk

__all__ = ["HeatWalk"]
