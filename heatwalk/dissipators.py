"""Dissipator regions by the relative-entropy test (paper, section 5 and Algorithm 2)."""

import numpy as np

# Least density, relative to the largest, that enters a logarithm: below it stands only the rounding of the kernel.
LEAST_DENSITY = 1e-16


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
    parts = kernel.parts()
    total = np.empty(len(labels))  # Σ_y h(x, y)
    for part in parts:
        factor = kernel.rows(part)
        total[part] = factor @ (factor.T @ measure[part])

    order = np.argsort(labels, kind="stable")
    excess = np.empty(len(labels))
    for members in np.split(order, np.flatnonzero(np.diff(labels[order])) + 1):
        part = parts[kernel.component[members[0]]]
        factor, inside = kernel.rows(part), kernel.factor[members]
        heat = factor @ inside.sum(axis=0)
        density = np.maximum(heat, LEAST_DENSITY * heat.max())
        log_ratio = np.log(density * (measure.sum() / (measure[part] @ heat)))  # log(q_C / u)
        excess[members] = -(inside @ (factor.T @ (measure[part] * log_ratio)))
    return excess / total


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
