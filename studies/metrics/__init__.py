"""How far apart two segmentations are; `studies.metrics.psb` holds the Princeton benchmark's own metrics."""

from studies.metrics.change_percentage import change_percentage, match_labels, van_dongen
from studies.metrics.rand_index import rand_index_error

__all__ = ["change_percentage", "match_labels", "rand_index_error", "van_dongen"]
