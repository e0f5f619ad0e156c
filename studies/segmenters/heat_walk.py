"""The Heat Walk as a segmenter."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

import heatwalk


@dataclass(frozen=True)
class HeatWalk:
    """``heatwalk.segment`` with fixed options; its dissipators are the label -1."""

    time: float = 1.0
    time_unit: str = "paper"
    density: str = "vertices"
    split_dissipators: bool = False

    algorithm_version: ClassVar[int] = heatwalk.ALGORITHM_VERSION

    def __call__(self, vertices, faces):
        return self._labels(self.segmentation(vertices, faces))

    def segmentation(self, vertices, faces):
        """All that `heatwalk.segment` gives."""
        return heatwalk.segment(vertices, faces, self.time, **self._options())

    def segmentations(self, vertices, faces, times):
        """All that `heatwalk.segment_at_times` gives: from one eigenproblem, an iterator."""
        return heatwalk.segment_at_times(vertices, faces, times, **self._options())

    def at_times(self, vertices, faces, times):
        """Labels at each of ``times``: an iterator of arrays."""
        return map(self._labels, self.segmentations(vertices, faces, times))

    def _options(self):
        return {
            "time_unit": self.time_unit,
            "density": self.density,
            "split_dissipators": self.split_dissipators,
        }

    def _labels(self, result):
        return result.labels if self.split_dissipators else np.where(result.dissipates, -1, result.labels)
