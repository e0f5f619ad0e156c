"""The trivial segmentation: everything is one segment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from studies.segmenters.about import About


@dataclass(frozen=True)
class OneSegment:
    """Everything is one segment. Nothing changes it, which shows that robustness alone is worth nothing.

    Examples
    --------
    >>> OneSegment()(np.eye(3), np.array([[0, 1, 2]]))
    array([0])
    """

    algorithm_version: ClassVar[int] = 1
    labels_of: ClassVar[str] = "faces"
    about: ClassVar[About] = About(title="One segment", baseline=True)

    def __call__(self, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.int64]:
        """Labels of the faces.

        Parameters
        ----------
        vertices : (n, 3) float array
            coordinates
        faces : (m, 3) int array
            vertices of each face

        Returns
        -------
        (m,) int64 array
        """
        return np.zeros(len(faces), dtype=np.int64)
