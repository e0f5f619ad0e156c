"""The Heat Walk as a segmenter."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

import heatwalk
from heatwalk.options import DENSITIES, TIME_UNITS
from studies.segmenters.about import About

_BIBTEX = """\
@article{benjamin2011heatwalk,
  author = {Benjamin, W. and Polk, A. W. and Vishwanathan, S. V. N. and Ramani, K.},
  title = {Heat Walk: Robust Salient Segmentation of Non-rigid Shapes},
  journal = {Computer Graphics Forum},
  volume = {30},
  number = {7},
  year = {2011},
  doi = {10.1111/j.1467-8659.2011.02060.x}
}"""


class _NotCompiledError(Exception):
    """Something that segmenting needs has to be compiled first."""


def _refuse() -> None:
    raise _NotCompiledError


@dataclass(frozen=True)
class HeatWalk:
    """`heatwalk.segment` with fixed options; its dissipators have the label -1.

    Parameters
    ----------
    time : float
        time of the walk, in units of ``time_unit``
    time_unit : {"paper", "standard", "fiedler"}
        as in `heatwalk.segment`
    density : {"vertices", "area"}
        as in `heatwalk.segment`
    split_dissipators : bool
        whether each connected component of the dissipator region is a segment; its labels are then not -1

    Examples
    --------
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(2)
    >>> sphere.apply_scale([3, 1, 1])  # doctest: +ELLIPSIS
    <trimesh.Trimesh(...)>
    >>> HeatWalk(time=0.5)(sphere.vertices, sphere.faces).shape
    (162,)
    """

    time: float = 1.0
    time_unit: str = "paper"
    density: str = "vertices"
    split_dissipators: bool = False

    def __post_init__(self) -> None:
        if isinstance(self.time, int | float) and not 0 < self.time < math.inf:
            raise ValueError(f"segmenter.time is {self.time!r}: it must be above 0 and finite")
        for option, valid in (("time_unit", TIME_UNITS), ("density", DENSITIES)):
            if getattr(self, option) not in valid:
                raise ValueError(f"segmenter.{option} is {getattr(self, option)!r}: choose one of {', '.join(valid)}")

    algorithm_version: ClassVar[int | str] = heatwalk.ALGORITHM_VERSION
    about: ClassVar[About] = About(
        title="Heat Walk",
        source=(
            "W. Benjamin, A. W. Polk, S. V. N. Vishwanathan, K. Ramani, Heat Walk: Robust Salient Segmentation of "
            "Non-rigid Shapes, 2011"
        ),
        bibtex=_BIBTEX,
    )

    @classmethod
    def is_compiled(cls) -> bool:
        """Whether this process has everything that segmenting needs compiled or in numba's cache; then it is loaded."""
        from heatwalk.numerics.compilation import announced

        try:
            with announced(_refuse):
                cls.compile_ahead()
        except _NotCompiledError:
            return False
        return True

    @staticmethod
    def compile_ahead() -> None:
        """Compile everything that segmenting needs."""
        from heatwalk.segmentation import compile_ahead

        compile_ahead()

    def __call__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """Labels of the vertices.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face

        Returns
        -------
        (n,) int64 array

        Raises
        ------
        heatwalk.MeshError
            If the mesh cannot be segmented.
        """
        return self.labels_in(self.segmentation(vertices, faces))

    def segmentation(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> heatwalk.Segmentation:
        """The complete result of `heatwalk.segment`."""
        return heatwalk.segment(vertices, faces, self.time, threads=1, **self._options())

    def segmentations(
        self, vertices: NDArray[np.float64], faces: NDArray[np.int64], times: Sequence[float]
    ) -> Iterator[heatwalk.Segmentation]:
        """The complete results of `heatwalk.segment_at_times`, which solves one eigenproblem for all times."""
        return heatwalk.segment_at_times(vertices, faces, times, threads=1, **self._options())

    def at_times(
        self, vertices: NDArray[np.float64], faces: NDArray[np.int64], times: Sequence[float]
    ) -> Iterator[NDArray[np.int64]]:
        """Labels of the vertices at each of ``times``.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face
        times : iterable of float
            times of the walk, in units of ``time_unit``

        Returns
        -------
        iterator of (n,) int64 array
        """
        return map(self.labels_in, self.segmentations(vertices, faces, times))

    def _options(self) -> dict[str, Any]:
        """The options of `heatwalk.segment` other than the time."""
        return {
            "time_unit": self.time_unit,
            "density": self.density,
            "split_dissipators": self.split_dissipators,
        }

    def labels_in(self, result: heatwalk.Segmentation) -> NDArray[np.int64]:
        """Labels of the vertices, -1 for the dissipator region unless it is split."""
        return result.labels if self.split_dissipators else np.where(result.dissipates, -1, result.labels)
