"""The heat kernel of a mesh as a low-rank factor; never as an n x n matrix."""

from dataclasses import dataclass

import numpy as np

# Eigenvalues whose e^{-λt} is below this are left out of the kernel. Every exemplar on 76 benchmark meshes is the
# same from 1e-10 down; this leaves a margin of two digits.
SMALLEST_DECAY = 1e-12

# Bytes of scratch that a block of kernel rows may take.
BLOCK_BYTES = 64 * 2**20


@dataclass(frozen=True)
class HeatKernel:
    """h_t(x, y) = Σ_i e^{-λ_i t} φ_i(x) φ_i(y) of a mesh with n vertices (paper, equation 1).

    Attributes
    ----------
    factor : (n, k) float array B with h_t(x, y) = B[x] · B[y] within a component; heat does not cross to another
    component : (n,) int array
    mass : (n,) float array; Σ_y mass[y] h_t(x, y) = 1
    time : float, standard time t of the heat equation ∂u/∂t = Δu on the mesh of area 1
    """

    factor: np.ndarray
    component: np.ndarray
    mass: np.ndarray
    time: float

    @classmethod
    def from_spectrum(cls, spectrum, time):
        """The kernel at standard time ``time``.

        Raises
        ------
        ValueError
            when ``spectrum`` does not reach the eigenvalues that this time needs
        """
        needed = largest_eigenvalue(time)
        if spectrum.limit < needed * (1 - 1e-12):
            raise ValueError(
                f"time {time:g} needs eigenvalues up to {needed:g}; the spectrum holds those up to {spectrum.limit:g}"
            )
        used = min(spectrum.eigenvalues.shape[1], _columns(spectrum.eigenvalues, needed))
        decay = np.exp(-0.5 * time * spectrum.eigenvalues[:, :used])
        return cls(spectrum.eigenvectors[:, :used] * decay[spectrum.component], spectrum.component, spectrum.mass, time)

    def diagonal(self):
        """h_t(x, x): (n,) float array. The heat kernel signature; the walk's first heat potential s₁."""
        return np.einsum("ij,ij->i", self.factor, self.factor)

    def parts(self):
        """The vertices of each component: a list of ascending int arrays."""
        order = np.argsort(self.component, kind="stable")
        return np.split(order, np.flatnonzero(np.diff(self.component[order])) + 1)

    def rows(self, part):
        """Rows of the factor of one of the ``parts``: those of a mesh in one piece need no copy."""
        return self.factor if len(part) == len(self.factor) else self.factor[part]

    def row_blocks(self, vertices):
        """Rows of the kernel among ``vertices`` of one component, in blocks of bounded size.

        Yields
        ------
        rows : slice into ``vertices``
        block : (len(rows), len(vertices)) float array, h_t(vertices[rows], vertices)
        """
        factor = self.factor[vertices]
        height = max(1, BLOCK_BYTES // (8 * len(vertices)))
        for start in range(0, len(vertices), height):
            rows = slice(start, min(start + height, len(vertices)))
            yield rows, factor[rows] @ factor.T


def largest_eigenvalue(time):
    """The eigenvalue above which e^{-λt} is below ``SMALLEST_DECAY`` at standard time ``time``."""
    return -np.log(SMALLEST_DECAY) / time


def _columns(eigenvalues, limit):
    """Columns up to the last eigenvalue within ``limit``, and those of the same multiple eigenvalue."""
    within = (eigenvalues <= limit * (1 + 1e-6)).any(axis=0)
    return int(np.flatnonzero(within)[-1]) + 1
