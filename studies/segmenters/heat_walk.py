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
        result = heatwalk.segment(
            vertices,
            faces,
            self.time,
            time_unit=self.time_unit,
            density=self.density,
            split_dissipators=self.split_dissipators,
        )
        if self.split_dissipators:
            return result.labels
        return np.where(result.dissipates, -1, result.labels)
