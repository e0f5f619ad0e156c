"""The heat kernel of a mesh as a low-rank factor, never as an n x n matrix."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from heatwalk.spectrum import Spectrum

# Eigenvalues with e^{-λt} below this are omitted from the kernel. Every exemplar of 76 benchmark meshes is the same for
# all values up to 1e-10; this leaves a margin of two digits.
MIN_DECAY = 1e-12

# Eigenvalues this close to the limit (relative) are treated as copies of an eigenvalue within it.
MULTIPLICITY_TOLERANCE = 1e-6

# Bytes that a block of kernel rows may take.
BLOCK_BYTES = 64 * 2**20


@dataclass(frozen=True)
class HeatKernel:
    """h_t(x, y) = Σ_i e^{-λ_i t} φ_i(x) φ_i(y) of a mesh with n vertices (paper, equation 1).

    Attributes
    ----------
    factor : (n, k) float array
        B, with h_t(x, y) = B[x] · B[y] within a component; heat does not cross from one component to another
    component : (n,) int array
    mass : (n,) float array
        Σ_y mass[y] h_t(x, y) = 1
    time : float
        standard time t of the heat equation ∂u/∂t = Δu on the mesh of area 1

    Examples
    --------
    >>> kernel = HeatKernel(np.array([[1.0, 0.5], [1.0, -0.5]]), np.zeros(2, int), np.array([0.5, 0.5]), 1.0)
    >>> kernel.diagonal()
    array([1.25, 1.25])
    >>> [block for _, block in kernel.row_blocks(np.arange(2))]
    [array([[1.25, 0.75],
           [0.75, 1.25]])]
    """

    factor: NDArray[np.float64]
    component: NDArray[np.int64]
    mass: NDArray[np.float64]
    time: float

    @classmethod
    def from_spectrum(cls, spectrum: "Spectrum", time: float) -> "HeatKernel":
        """Create the kernel at a standard time.

        Parameters
        ----------
        spectrum : Spectrum
        time : float

        Returns
        -------
        HeatKernel

        Raises
        ------
        ValueError
            if ``spectrum`` lacks eigenvalues that the kernel at this time requires
        """
        required = largest_eigenvalue(time)
        if spectrum.limit < required * (1 - 1e-12):
            raise ValueError(
                f"time {time:g} requires eigenvalues up to {required:g}; the spectrum ends at {spectrum.limit:g}"
            )
        n_columns = _count_columns(spectrum.eigenvalues, required)
        decay = np.exp(-0.5 * time * spectrum.eigenvalues[:, :n_columns])
        factor = spectrum.eigenvectors[:, :n_columns] * decay[spectrum.component]
        return cls(factor, spectrum.component, spectrum.mass, time)

    def diagonal(self) -> NDArray[np.float64]:
        """h_t(x, x), (n,) float array: the heat kernel signature, and the first heat potential s₁ of the walk."""
        return np.einsum("ij,ij->i", self.factor, self.factor)

    def parts(self) -> list[NDArray[np.int64]]:
        """The vertices of each component, ascending."""
        order = np.argsort(self.component, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(self.component[order])) + 1)

    def rows(self, part: NDArray[np.int64]) -> NDArray[np.float64]:
        """Rows of the factor for one of the `parts`; not copied if the mesh is connected."""
        return self.factor if len(part) == len(self.factor) else self.factor[part]

    def row_blocks(
        self, vertices: NDArray[np.int64], block_bytes: int | None = None
    ) -> Iterator[tuple[slice, NDArray[np.float64]]]:
        """Rows of the kernel among vertices of one component, in blocks of bounded size, by default `BLOCK_BYTES`.

        Yields
        ------
        rows : slice into ``vertices``
        block : (len(vertices[rows]), len(vertices)) float array
            h_t(vertices[rows], vertices)
        """
        factor = self.factor[vertices]
        height = max(1, (block_bytes or BLOCK_BYTES) // (8 * len(vertices)))
        for start in range(0, len(vertices), height):
            rows = slice(start, min(start + height, len(vertices)))
            yield rows, factor[rows] @ factor.T


def largest_eigenvalue(time: float, min_decay: float = MIN_DECAY) -> float:
    """The eigenvalue above which e^{-λt} is below ``min_decay`` at a standard time."""
    return float(-np.log(min_decay) / time)


def _count_columns(eigenvalues: NDArray[np.float64], limit: float) -> int:
    """Number of columns up to the last eigenvalue within ``limit``, and those of the same multiple eigenvalue."""
    within = (eigenvalues <= limit * (1 + MULTIPLICITY_TOLERANCE)).any(axis=0)
    return int(np.flatnonzero(within)[-1]) + 1
