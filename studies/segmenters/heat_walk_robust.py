"""The robust variant of the Heat Walk as a segmenter."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

import heatwalk
from heatwalk.robust.options import Options
from heatwalk.robust.repair import Repair
from heatwalk.robust.segmentation import ROBUST_VERSION, compile_ahead, segment_robust_at_times
from studies.segmenters.about import About
from studies.segmenters.heat_walk import HeatWalk

# The switches, and what names of methods call what each of them does.
PARTS = {
    "stitch": "stitching",
    "cut_handles": "handles",
    "fill_holes": "holes",
    "remove_spikes": "spikes",
    "fair": "fairing",
    "average": "average",
    "choose_time": "time",
    "merge": "merge",
    "join_small": "join",
}


@dataclass(frozen=True)
class HeatWalkRobust(HeatWalk):
    """`heatwalk.segment_robust` with fixed options; its dissipators have the label -1.

    Every part is a switch; with all of them off and ``density="vertices"``, this is `HeatWalk`.

    Parameters
    ----------
    time, time_unit, density, split_dissipators
        as of `HeatWalk`
    stitch, cut_handles, fill_holes, remove_spikes, fair
        as of `heatwalk.robust.repair.Repair`
    average, octaves, choose_time, octaves_before, octaves_after, merge, persistence, join_small, min_area, refine,
    hierarchy, max_curvature, prominence, min_part
        as of `heatwalk.robust.options.Options`

    Examples
    --------
    >>> HeatWalkRobust().name, HeatWalkRobust(merge=False, time=2.0).name
    ('HeatWalkRobust', 'HeatWalkRobust (without merge, time=2.0)')
    >>> off = dict.fromkeys(PARTS, False)
    >>> HeatWalkRobust(**off | {"merge": True}).name
    'HeatWalkRobust (merge only)'
    >>> HeatWalkRobust(**off).name, HeatWalkRobust(**off, density="vertices").name
    ('HeatWalkRobust (density only)', 'HeatWalkRobust (nothing only, density=vertices)')
    """

    density: str = "area"
    stitch: bool = True
    cut_handles: bool = True
    fill_holes: bool = True
    remove_spikes: bool = True
    fair: bool = True
    average: bool = True
    octaves: float = Options.octaves
    choose_time: bool = True
    octaves_before: float = Options.octaves_before
    octaves_after: float = Options.octaves_after
    merge: bool = True
    persistence: float = Options.persistence
    join_small: bool = True
    min_area: float = Options.min_area
    refine: bool = Options.refine
    hierarchy: bool = Options.hierarchy
    max_curvature: float = Options.max_curvature
    prominence: float = Options.prominence
    min_part: float = Options.min_part

    algorithm_version: ClassVar[str] = f"{heatwalk.ALGORITHM_VERSION}.{ROBUST_VERSION}"
    about: ClassVar[About] = About(title="Robust Heat Walk", source=f"This project, after {HeatWalk.about.source}")

    def __post_init__(self) -> None:
        super().__post_init__()
        try:
            self._parts()
        except ValueError as error:
            raise ValueError(f"segmenter.{error}") from error

    @property
    def name(self) -> str:
        """The name with the parts that are used, unless all are, and further options that are not the default."""
        on = [called for switch, called in PARTS.items() if getattr(self, switch)]
        off = [called for switch, called in PARTS.items() if not getattr(self, switch)]
        alone = on or ["density" if self.density == HeatWalkRobust.density else "nothing"]
        parts = f"without {', '.join(off)}" if len(on) >= len(off) else f"{', '.join(alone)} only"
        others = [
            f"{field.name}={getattr(self, field.name)}"
            for field in dataclasses.fields(self)
            if field.name not in PARTS and getattr(self, field.name) != field.default
        ]
        told = ", ".join([parts] * bool(off) + others)
        return f"{type(self).__name__} ({told})" if told else type(self).__name__

    @staticmethod
    def compile_ahead() -> None:
        """Compile everything that segmenting needs."""
        compile_ahead()

    def segmentation(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> heatwalk.Segmentation:
        """The complete result of `heatwalk.segment_robust`."""
        return next(self.segmentations(vertices, faces, [self.time]))

    def segmentations(
        self, vertices: NDArray[np.float64], faces: NDArray[np.int64], times: Sequence[float]
    ) -> Iterator[heatwalk.Segmentation]:
        """The complete results of `heatwalk.segment_robust` at each of ``times``, from one eigenproblem."""
        return segment_robust_at_times(vertices, faces, times, options=self._parts(), threads=1, **self._options())

    def _parts(self) -> Options:
        """The options of `heatwalk.segment_robust` that are not those of `heatwalk.segment`."""
        names = [field.name for field in dataclasses.fields(Options) if field.name != "repair"]
        repair = Repair(self.stitch, self.cut_handles, self.fill_holes, self.remove_spikes, self.fair)
        return Options(repair, **{name: getattr(self, name) for name in names})


@dataclass(frozen=True)
class HeatWalkParts(HeatWalkRobust):
    """`HeatWalkRobust` with limbs cut into parts, and borders at creases: nearer to what people see, and less stable.

    Examples
    --------
    >>> HeatWalkParts().name, HeatWalkParts(prominence=1.4).name
    ('HeatWalkParts', 'HeatWalkParts (prominence=1.4)')
    """

    refine: bool = True
    hierarchy: bool = True

    about: ClassVar[About] = About(title="Heat Walk parts", source=HeatWalkRobust.about.source)
