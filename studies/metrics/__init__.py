"""How far apart two segmentations are.

Each metric is a file that computes a value and declares its column. `studies.metrics.psb` contains the metrics of the
Princeton benchmark, which compare labels of faces.
"""

from studies.metrics.adapted_rand_error import adapted_rand_error
from studies.metrics.boundary_distance import boundary_distances
from studies.metrics.change_percentage import change_percentage, match_labels
from studies.metrics.metric import Comparison, Metric, TriangleMesh
from studies.metrics.rand_index import rand_index_error
from studies.metrics.registry import columns, compare, registered
from studies.metrics.segment_count import segment_count_difference
from studies.metrics.van_dongen import van_dongen
from studies.metrics.variation_of_information import variation_of_information

__all__ = [
    "Comparison",
    "Metric",
    "TriangleMesh",
    "adapted_rand_error",
    "boundary_distances",
    "change_percentage",
    "columns",
    "compare",
    "match_labels",
    "rand_index_error",
    "registered",
    "segment_count_difference",
    "van_dongen",
    "variation_of_information",
]
