"""Dissipator regions by the relative-entropy test (paper, section 5 and Algorithm 2)."""

import numpy as np
from numpy.typing import NDArray

from heatwalk.kernel import HeatKernel
from heatwalk.numerics.threads import PIECES_PER_THREAD, number_of_threads, shared, worth_sharing

# Least density, relative to the largest, inside a logarithm: smaller values are rounding errors of the kernel.
MIN_DENSITY = 1e-16

# An excess this small, relative to the mean square of log(q_C/u), is a tie: the vertex does not dissipate. Its sign is
# rounding error, and would depend on the processor, the number of threads and the path of the solver.
TIE = 1e-10

# So is an excess this small relative to the root mean square: it is the rounding of the sums.
ROUNDING = 1e-15

# A region is uniform, and none of its vertices dissipates, if its mean density deviates from the uniform one by at most
# this root mean square, relative to it: an error of the eigensolver.
UNIFORM = 1e-10

# Bytes of the densities that are processed together: few enough for the cache.
BLOCK_BYTES = 2**20


def relative_entropy_excess(
    kernel: HeatKernel,
    labels: NDArray[np.int64],
    weights: NDArray[np.float64] | None = None,
    sources: NDArray[np.float64] | None = None,
) -> NDArray[np.float64]:
    """How much farther each vertex is from the mean density of its region than from the uniform density.

    Parameters
    ----------
    kernel : HeatKernel
        of a mesh with n vertices
    labels : (n,) int array, 0 … K-1
        the accumulator regions
    weights : (n,) float array, optional
        measure with respect to which densities are summed: by default every vertex counts 1, as in the paper; the mass
        gives integrals over the surface
    sources : (n,) float array, optional
        with what weight the heat of each vertex counts in the mean density of its region: by default every vertex
        counts 1, as in the paper

    Returns
    -------
    (n,) float array
        KL(p_x ‖ q_C) − KL(p_x ‖ uniform) in nats; vertex x dissipates if it is positive; 0 if it is a tie (see `TIE`)

    Notes
    -----
    p_x(y) ∝ h(x, y) is the density of vertex x, and q_C that of its region C. The entropy of p_x is part of both
    divergences, so that their difference is −Σ_y p_x(y) log(q_C(y)/u(y)) with the uniform density u: one product with
    the factor of the kernel per region, O(n k) each, and no logarithm of the n x n kernel. The uniform density is that
    of the connected component of x, which heat cannot leave; on a connected mesh it is over all vertices, as in the
    paper.
    Heat that has flowed for long is nearly uniform, and the difference of second order in what is left: both p_x and
    q_C are therefore taken relative to the mean density, whose terms cancel exactly.

    Examples
    --------
    Regions of a single vertex: their mean density is that of the vertex, so that no vertex dissipates.

    >>> kernel = HeatKernel(np.eye(3) + 0.01, np.zeros(3, int), np.ones(3) / 3, time=1.0)
    >>> relative_entropy_excess(kernel, np.arange(3)) < 0
    array([ True,  True,  True])
    """
    import scipy.sparse as sp

    measure = np.ones(len(labels)) if weights is None else weights
    excess = np.empty(len(labels))
    for part in kernel.parts():
        factor, n = kernel.rows(part), len(part)
        region = np.unique(labels[part], return_inverse=True)[1]
        source = np.ones(n) if sources is None else sources[part]
        region_sums = np.asarray(sp.csr_array((source, region, np.arange(n + 1))).T @ factor)
        excess[part] = _excess_of_component(factor, region, region_sums, measure[part])
    return excess


def _excess_of_component(
    factor: NDArray[np.float64],
    region: NDArray[np.int64],
    region_sums: NDArray[np.float64],
    measure: NDArray[np.float64],
) -> NDArray[np.float64]:
    """`relative_entropy_excess` of the vertices of a component, from their regions and the sum of rows of each."""
    total = measure @ factor
    whole = measure.sum()
    scale = whole / (region_sums @ total)
    # The densities of all regions, in blocks of rows: recomputing them in each pass is faster than keeping them.
    height = max(1, BLOCK_BYTES // (8 * len(region_sums)))
    blocks = [slice(start, start + height) for start in range(0, len(factor), height)]
    mean = total / whole
    rounding = sum(shared(lambda rows: measure[rows] @ (factor[rows] - mean), blocks)) / whole  # of the mean

    def largest(rows: slice) -> NDArray[np.float64]:
        return ((factor[rows] - mean - rounding) @ region_sums.T * scale).max(axis=0)

    peak = np.max(shared(largest, blocks), axis=0)
    lowest = MIN_DENSITY * (1 + peak) - 1

    def sums(rows: slice) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        centred, weight = factor[rows] - mean - rounding, measure[rows, None]
        log_ratio = np.log1p(np.maximum(centred @ region_sums.T * scale, lowest))
        weighted = weight * log_ratio
        return weighted.sum(axis=0), (weight * log_ratio**2).sum(axis=0), weighted.T @ centred

    log_sums, square_sums, weighted_sums = np.zeros(len(scale)), np.zeros(len(scale)), np.zeros_like(region_sums)
    # Some blocks at a time, as their sums may take more memory than all else.
    n_together = PIECES_PER_THREAD * number_of_threads() if worth_sharing(len(factor)) else 1
    for start in range(0, len(blocks), n_together):
        for log_sum, square_sum, weighted_sum in shared(sums, blocks[start : start + n_together]):
            log_sums += log_sum
            square_sums += square_sum
            weighted_sums += weighted_sum
    deviation = np.sqrt(square_sums / whole)
    tolerance = np.where(deviation <= UNIFORM, np.inf, deviation * np.maximum(TIE * deviation, ROUNDING))

    def excess(rows: slice) -> NDArray[np.float64]:
        difference = np.einsum("ij,ij->i", factor[rows], weighted_sums[region[rows]]) / (factor[rows] @ total)
        difference += log_sums[region[rows]] / whole
        return np.where(np.abs(difference) <= tolerance[region[rows]], 0, -difference)

    return np.concatenate(shared(excess, blocks))


def divergence_from_uniform(kernel: HeatKernel, weights: NDArray[np.float64] | None = None) -> NDArray[np.float64]:
    """KL(p_x ‖ uniform) of every vertex, in nats (paper, Figure 4 b); uniform over the component of the vertex.

    Parameters
    ----------
    kernel : HeatKernel
        of a mesh with n vertices
    weights : (n,) float array, optional
        as in `relative_entropy_excess`

    Returns
    -------
    (n,) float array

    Notes
    -----
    The divergence from the mean density of the region (Figure 4 c) is this plus `relative_entropy_excess`. The entropy
    of p_x does not factor: O(n² k) time, in blocks of bounded memory.

    Examples
    --------
    >>> kernel = HeatKernel(np.ones((3, 1)), np.zeros(3, int), np.ones(3) / 3, time=1.0)
    >>> divergence_from_uniform(kernel)
    array([0., 0., 0.])
    """
    measure = np.ones(len(kernel.factor)) if weights is None else weights
    divergence = np.empty(len(kernel.factor))
    for part in kernel.parts():
        part_measure = measure[part].sum()
        for rows, block in kernel.row_blocks(part, BLOCK_BYTES):
            density = np.maximum(block, MIN_DENSITY * block.max(axis=1, keepdims=True))
            density /= (density @ measure[part])[:, None]
            divergence[part[rows]] = (density * np.log(density * part_measure)) @ measure[part]
    return divergence
