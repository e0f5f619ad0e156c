"""What a metric is: a column, and the function that computes its values from two segmentations."""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from dataclasses import dataclass
from numbers import Integral, Real
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from studies.columns import Column

# What the columns of these pandas dtypes hold, apart from missing values.
_KINDS: dict[str, type] = {"float64": Real, "int64": Integral, "string": str}


class TriangleMesh(Protocol):
    """A triangle mesh as metrics read it, such as a `trimesh.Trimesh` or a `heatwalk.LoadedMesh`."""

    @property
    def vertices(self) -> NDArray[np.float64]:
        """Coordinates, (n, 3)."""

    @property
    def faces(self) -> NDArray[np.int64]:
        """Vertices of each face, (m, 3)."""


@dataclass(frozen=True)
class Comparison:
    """Two segmentations of the same points.

    Parameters
    ----------
    reference : (p,) int array
        labels of the reference segmentation
    labels : (p,) int array
        labels of the same points in the segmentation that is compared with it
    mesh : TriangleMesh, optional
        the mesh of the reference segmentation
    points : (p,) int array, optional
        the vertices of ``mesh`` that are compared; only with ``mesh``

    Examples
    --------
    >>> import numpy as np
    >>> comparison = Comparison(np.array([0, 0, 1, 1]), np.array([5, 5, 5, 7]))
    >>> comparison.mesh is None
    True
    """

    reference: NDArray[np.integer]
    labels: NDArray[np.integer]
    mesh: TriangleMesh | None = None
    points: NDArray[np.integer] | None = None


@dataclass(frozen=True, kw_only=True)
class Metric:
    """A column of every study in which segmentations are compared.

    A module of `studies.metrics` that defines ``METRICS``, a tuple of metrics, adds their columns to rows and tables.

    Parameters
    ----------
    column : Column
        the column of the values. Its dtype can hold missing values.
    function : callable
        computes the value, a float or an int, of a `Comparison`
    symmetric : bool
        whether exchanging the two segmentations never changes the value
    needs_mesh : bool
        whether ``function`` reads ``mesh`` and ``points`` of the comparison. Without a mesh the value is missing.
    may_be_missing : bool
        whether ``function`` returns None for some segmentations that have no such value

    Examples
    --------
    The share of points whose label is a different number, in percent:

    >>> import numpy as np
    >>> changed = Metric(
    ...     column=Column(name="changed", heading="changed %", format=".1f", unit="%", lower_is_better=True),
    ...     function=lambda comparison: float(100 * (comparison.reference != comparison.labels).mean()),
    ...     symmetric=True,
    ... )
    >>> changed(Comparison(np.array([0, 0, 1, 1]), np.array([0, 0, 0, 1])))
    25.0

    See Also
    --------
    studies.testing.check_metric : checks that a metric keeps to its contract
    """

    column: Column
    function: Callable[[Comparison], float | int | None]
    symmetric: bool = False
    needs_mesh: bool = False
    may_be_missing: bool = False

    def __call__(self, comparison: Comparison) -> Any:
        """The value for a comparison; None, a missing value, if it needs a mesh and has none.

        Raises
        ------
        TypeError
            If the function returns a value that the column cannot hold.
        """
        if self.needs_mesh and comparison.mesh is None:
            return None
        value = self.function(comparison)
        if not _fits(value, self.column.dtype):
            raise TypeError(
                f"the metric {self.column.name} returned {reprlib.repr(value)}, which is no {self.column.dtype}"
            )
        return value


def _fits(value: Any, dtype: str) -> bool:
    """Whether a column of a pandas dtype can hold a value."""
    if value is None or dtype.lower() not in _KINDS:
        return True
    if isinstance(value, Integral):
        return abs(int(value)) < 2**63 and dtype != "string"
    return isinstance(value, _KINDS[dtype.lower()])
