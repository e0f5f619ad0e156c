"""How far apart two segmentations are.

Each metric is a file that computes a value and declares its column. `studies.metrics.psb` contains the metrics of the
Princeton benchmark, which compare labels of faces.
"""

from studies.metrics.change_percentage import change_percentage, match_labels
from studies.metrics.metric import Comparison, Metric, TriangleMesh
from studies.metrics.rand_index import rand_index_error
from studies.metrics.registry import columns, compare, registered
from studies.metrics.van_dongen import van_dongen

__all__ = [
    "Comparison",
    "Metric",
    "TriangleMesh",
    "change_percentage",
    "columns",
    "compare",
    "match_labels",
    "rand_index_error",
    "registered",
    "van_dongen",
]
