"""Dissipator regions by the relative-entropy test (paper, section 5 and Algorithm 2)."""

import numpy as np
import scipy.sparse as sp

# Least density, relative to the largest, that enters a logarithm: below it stands only the rounding of the kernel.
LEAST_DENSITY = 1e-16

# Bytes of the densities that are looked at together: few enough for the cache.
BLOCK_BYTES = 2**20


def relative_entropy_excess(kernel, labels, weights=None):
    """How much farther each vertex is from its region's mean density than from the uniform one.

    Parameters
    ----------
    kernel : heatwalk.kernel.HeatKernel of a mesh with n vertices
    labels : (n,) int array, 0 … K-1, the accumulator regions
    weights : (n,) float array or None
        measure in which densities are sums: None counts vertices, as printed in the paper; the mass gives areas

    Returns
    -------
    (n,) float array, KL(p_x ‖ q_C) − KL(p_x ‖ uniform) in nats; vertex x dissipates where it is positive

    Notes
    -----
    p_x(y) ∝ h(x, y) is the density of vertex x and q_C that of its region C. The entropy of p_x stands in both
    divergences, so that their difference is −Σ_y p_x(y) log(q_C(y)/u(y)), u the uniform density over all n vertices: a
    product with the factor of the kernel for each region, O(n k) each, without a logarithm of the n x n kernel.
    """
    measure = np.ones(len(labels)) if weights is None else weights
    excess = np.empty(len(labels))
    for part in kernel.parts():
        factor, n = kernel.rows(part), len(part)
        region = np.unique(labels[part], return_inverse=True)[1]
        inside = sp.csr_array((np.ones(n), region, np.arange(n + 1))).T @ factor
        of_all = measure[part] @ factor
        # Densities of all its regions in blocks of rows, made again in each pass: to keep them takes longer.
        height = max(1, BLOCK_BYTES // (8 * len(inside)))
        blocks = [slice(start, start + height) for start in range(0, n, height)]
        hottest = np.max([(factor[rows] @ inside.T).max(axis=0) for rows in blocks], axis=0)
        pull = np.zeros_like(inside)
        for rows in blocks:
            density = np.maximum(factor[rows] @ inside.T, LEAST_DENSITY * hottest)
            log_ratio = np.log(density * (measure.sum() / (inside @ of_all)))  # log(q_C / u)
            pull += (measure[part[rows], None] * log_ratio).T @ factor[rows]
        for rows in blocks:
            excess[part[rows]] = -np.einsum("ij,ij->i", factor[rows], pull[region[rows]]) / (factor[rows] @ of_all)
    return excess


def divergence_from_uniform(kernel, weights=None):
    """KL(p_x ‖ uniform) of every vertex, in nats (paper, Figure 4 b): (n,) float array.

    The divergence from the region's mean (Figure 4 c) is this plus ``relative_entropy_excess``. The entropy of p_x does
    not factor: this takes O(n² k) time, in blocks of bounded memory.
    """
    measure = np.ones(len(kernel.factor)) if weights is None else weights
    divergence = np.empty(len(kernel.factor))
    for part in kernel.parts():
        for rows, block in kernel.row_blocks(part):
            density = np.maximum(block, LEAST_DENSITY * block.max(axis=1, keepdims=True))
            density /= (density @ measure[part])[:, None]
            divergence[part[rows]] = (density * np.log(density * measure.sum())) @ measure[part]
    return divergence
