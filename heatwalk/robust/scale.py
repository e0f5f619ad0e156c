"""The time at which the number of regions is most stable, near a given one.

The number of regions decreases as heat flows for longer, in steps between which it is constant. A time just before such
a step is a bad one: the slightest change of the shape moves the step across it. Of the numbers of regions over a window
of times around the given one, that which lasts longest (on the logarithmic scale) is taken; and of its times, the one
nearest to the given one that keeps a distance from both steps. One region for each connected component, which is the
end of all shapes, is taken only if there is no other number.

The regions are only counted for this, and not by walks: each vertex follows the largest capacity among the *edges* to a
vertex of higher potential, to a peak of the mesh, and the regions of the peaks are joined as `heatwalk.robust.merging`
joins those of the walk. On the benchmark this number is that of the walk at 96 % of the times, at a tenth of the cost.
"""

import math

import numpy as np
from numpy.typing import NDArray

from heatwalk.kernel import HeatKernel
from heatwalk.numerics.compilation import compiled
from heatwalk.robust.averaging import averaged_kernel
from heatwalk.robust.merging import merge_regions, saddles_between
from heatwalk.robust.options import Options
from heatwalk.segmentation import PAPER_TIME
from heatwalk.spectrum import Spectrum

# Regions are counted at so many times per octave, from 1 in the unit of the paper on: whatever the given time is, their
# number changes at the same times. The time that is taken is one of these, too.
PER_OCTAVE = 8

# Octaves that the time keeps from the first and the last with its number of regions, if these are far enough apart.
DISTANCE = 0.5

# Least weight of an eigenvalue in the kernels in which regions are counted: it decides how many are required at the
# shortest time. With 1e-7 the number is the same at 99 % of the times.
MIN_DECAY = 1e-3


def stable_time(spectrum: Spectrum, edges: NDArray[np.int64], time: float, options: Options) -> float:
    """The nearest time to a given one at which the number of regions is the most frequent one around it.

    Parameters
    ----------
    spectrum : Spectrum
        up to `largest_eigenvalue` of the shortest time at least, with `MIN_DECAY`
    edges : (e, 2) int array
        of the mesh, each once
    time : float
        standard time
    options : Options

    Returns
    -------
    float
        of several numbers that are the most frequent ones, the largest is taken

    Notes
    -----
    The number is taken to be the same at all times between two at which it is the same, as it hardly ever increases:
    that leaves about a dozen of the times to be tried.
    """
    given = round(math.log2(time / PAPER_TIME) * PER_OCTAVE)
    before, after = (round(octaves * PER_OCTAVE) for octaves in (options.octaves_before, options.octaves_after))
    steps = np.arange(given - before, given + after + 1)
    tried = PAPER_TIME * 2 ** (steps / PER_OCTAVE)
    numbers = np.zeros(len(tried), dtype=np.int64)

    def fill(first: int, last: int) -> None:
        """Count the regions between two times at which they are counted."""
        if numbers[first] == numbers[last]:
            numbers[first:last] = numbers[first]
        elif last - first > 1:
            middle = (first + last) // 2
            numbers[middle] = _count_at(spectrum, edges, tried[middle], options)
            fill(first, middle)
            fill(middle, last)

    for end in (0, -1):
        numbers[end] = _count_at(spectrum, edges, tried[end], options)
    fill(0, len(tried) - 1)
    frequency = np.bincount(numbers)
    if numbers.max() > len(spectrum.eigenvalues):
        frequency[: len(spectrum.eigenvalues) + 1] = 0
    most_frequent = np.flatnonzero(frequency == frequency.max())[-1]
    chosen = steps[numbers == most_frequent]
    skipped = min(round(DISTANCE * PER_OCTAVE), (len(chosen) - 1) // 2)
    step = min(chosen[skipped : len(chosen) - skipped], key=lambda step: abs(step - given))
    return float(PAPER_TIME * 2 ** (step / PER_OCTAVE))


def _count_at(spectrum: Spectrum, edges: NDArray[np.int64], time: float, options: Options) -> int:
    """The number of regions at a standard time."""
    return count_regions(averaged_kernel(spectrum, options.averaged(time), MIN_DECAY), edges, options)


def count_regions(kernel: HeatKernel, edges: NDArray[np.int64], options: Options) -> int:
    """The number of regions around the persistent peaks of a kernel along the edges of the mesh.

    Parameters
    ----------
    kernel : HeatKernel
    edges : (e, 2) int array
    options : Options
        which regions are joined

    Returns
    -------
    int

    Examples
    --------
    Two peaks, and a vertex between them:

    >>> kernel = HeatKernel(np.array([[2.0, 0], [0.5, 0.5], [0, 2]]), np.zeros(3, int), np.ones(3) / 3, time=1.0)
    >>> edges = np.array([[0, 1], [1, 2]])
    >>> [count_regions(kernel, edges, Options(persistence=share, join_small=False)) for share in (0.5, 0.2)]
    [2, 1]
    """
    potential = kernel.diagonal()
    peak = _steepest_ascent(kernel.factor, potential, edges)
    while not np.array_equal(farther := peak[peak], peak):
        peak = farther
    peaks, labels = np.unique(peak, return_inverse=True)
    saddles = saddles_between(kernel, labels, edges)
    areas = np.bincount(labels, kernel.mass).astype(np.float64)
    return len(merge_regions(saddles, peaks, potential[peaks], areas, **options.joining).exemplars)


@compiled
def _steepest_ascent(
    factor: NDArray[np.float64], potential: NDArray[np.float64], edges: NDArray[np.int64]
) -> NDArray[np.int64]:
    """For each vertex the neighbour of largest capacity among those of higher potential; itself if none is higher."""
    best = np.zeros(len(potential))
    target = np.arange(len(potential))
    for e in range(len(edges)):
        low, high = edges[e, 0], edges[e, 1]
        if potential[low] == potential[high]:
            continue
        if potential[low] > potential[high]:
            low, high = high, low
        capacity = 0.0
        for j in range(factor.shape[1]):
            capacity += factor[low, j] * factor[high, j]
        if target[low] == low or capacity > best[low]:
            best[low], target[low] = capacity, high
    return target
