"""The heat kernel averaged over a range of times, which moves less than the kernel at any one of them.

The mean of the heat kernels at the times t₁ … t_m is

    h̄(x, y) = 1/m Σ_j h_{t_j}(x, y) = Σ_i g(λ_i) φ_i(x) φ_i(y),    g(λ) = 1/m Σ_j e^{−λ t_j},

so that it costs no more than a single one: the same eigenpairs with other weights. As g(λ) > 0 it is positive
semi-definite, h̄ = B̄ B̄ᵀ with B̄ = Φ g(Λ)^{1/2}, which is all that the theorem of the walk requires (see
`heatwalk.accumulators`); and as g(0) = 1 it has unit mass, Σ_y mass[y] h̄(x, y) = 1, so that its rows are densities, as
the dissipator test requires.
"""

import numpy as np
from numpy.typing import NDArray

from heatwalk.kernel import MULTIPLICITY_TOLERANCE, HeatKernel, largest_eigenvalue
from heatwalk.spectrum import Spectrum

TIMES_PER_OCTAVE = 2


def times_around(time: float, octaves: float) -> NDArray[np.float64]:
    """Logarithmically spaced times around one of them.

    Parameters
    ----------
    time : float
        the middle
    octaves : float, >= 0
        how far the first and the last time are apart

    Returns
    -------
    (m,) float array, ascending
        `TIMES_PER_OCTAVE`, and one more

    Examples
    --------
    >>> times_around(1.0, octaves=2).round(3)
    array([0.5  , 0.707, 1.   , 1.414, 2.   ])
    """
    return time * 2 ** np.linspace(-octaves / 2, octaves / 2, round(octaves * TIMES_PER_OCTAVE) + 1)


def averaged_kernel(spectrum: Spectrum, times: NDArray[np.float64], min_decay: float) -> HeatKernel:
    """The mean of the heat kernels at several standard times.

    Parameters
    ----------
    spectrum : Spectrum
        up to `largest_eigenvalue` of the shortest time at least
    times : (m,) float array, m >= 1
    min_decay : float
        eigenvalues with a weight g(λ) below this are omitted

    Returns
    -------
    HeatKernel
        its ``time`` is the geometric mean of the times

    Raises
    ------
    ValueError
        if ``spectrum`` lacks eigenvalues that the shortest time requires

    Examples
    --------
    >>> import numpy as np
    >>> spectrum = Spectrum(
    ...     np.array([[0.0, 1.0]]), np.array([[1.0, 1], [1, -1]]), np.zeros(2, int), np.array([0.5, 0.5]), 99.0, 0.0
    ... )
    >>> kernel = averaged_kernel(spectrum, np.log([2.0, 4.0]), 1e-12)
    >>> (kernel.factor @ kernel.factor.T).round(3)
    array([[1.375, 0.625],
           [0.625, 1.375]])
    """
    required = largest_eigenvalue(float(np.min(times)), min_decay)
    if spectrum.limit < required * (1 - 1e-12):
        raise ValueError(
            f"time {np.min(times):g} requires eigenvalues up to {required:g}; the spectrum ends at {spectrum.limit:g}"
        )
    # Of one time, exactly the weights of the kernel at that time: √(x²) is x.
    weight = np.square(np.exp(-0.5 * np.multiply.outer(times, spectrum.eigenvalues))).mean(axis=0)
    n_columns = int(np.flatnonzero((weight >= min_decay ** (1 + MULTIPLICITY_TOLERANCE)).any(axis=0))[-1]) + 1
    root = np.sqrt(weight[:, :n_columns])
    factor = spectrum.eigenvectors[:, :n_columns] * (root if len(root) == 1 else root[spectrum.component])
    return HeatKernel(factor, spectrum.component, spectrum.mass, float(np.exp(np.mean(np.log(times)))))
