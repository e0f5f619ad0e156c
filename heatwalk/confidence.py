"""How near the label of each vertex is to another one.

The label of a vertex x changes if a vertex on its path x → e₁(x) → … chooses another vertex, whose path ends in another
region; or, by the dissipator test, if the sign of the excess changes. The margin of a choice is the share by which the
capacity to the chosen vertex exceeds that to the best one of those that lead to another region,

    1 − max_{y leads elsewhere} h(x, y) / h(x, e₁(x)),

where y is any vertex that some vertex chooses, as all paths go through these. The margin of the test is
1 − e^{−|excess|}: the excess is a difference of two divergences, in nats.
"""

import numpy as np
from numpy.typing import NDArray

from heatwalk.accumulators import HeatWalk
from heatwalk.kernel import BLOCK_BYTES, HeatKernel
from heatwalk.numerics.threads import shared


def label_margin(
    kernel: HeatKernel, walk: HeatWalk, labels: NDArray[np.int64], excess: NDArray[np.float64]
) -> NDArray[np.float64]:
    """The smaller of `walk_margin` and `dissipator_margin`; of vertices that dissipate, the latter.

    Parameters
    ----------
    kernel : HeatKernel
    walk : HeatWalk
    labels : (n,) int array
        as in `walk_margin`
    excess : (n,) float array
        as in `dissipator_margin`

    Returns
    -------
    (n,) float array
        in [0, 1]

    Examples
    --------
    >>> from heatwalk.accumulators import heat_walk
    >>> kernel = HeatKernel(np.array([[2.0, 0], [0, 2], [1, 0.75]]), np.zeros(3, int), np.ones(3) / 3, time=1.0)
    >>> walk = heat_walk(kernel)
    >>> label_margin(kernel, walk, walk.labels, np.log([0.25, 4, 0.5]))
    array([0.75, 0.75, 0.25])
    """
    of_test = dissipator_margin(excess)
    return np.where(excess > 0, of_test, np.minimum(of_test, walk_margin(kernel, walk, labels)))


def walk_margin(kernel: HeatKernel, walk: HeatWalk, labels: NDArray[np.int64]) -> NDArray[np.float64]:
    """The least margin of the choices on the path of each vertex.

    Parameters
    ----------
    kernel : HeatKernel
        of a mesh with n vertices
    walk : HeatWalk
        of this kernel
    labels : (n,) int array
        the region that each vertex reaches: ``walk.labels``, or these joined

    Returns
    -------
    (n,) float array
        in [0, 1]; 1 where no path leads to another region

    Notes
    -----
    O(n p k) time for p vertices that others choose, 20 to 500 on organic shapes; memory is bounded.

    Examples
    --------
    Two vertices that keep their heat, and one that is nearer to the first than to the second:

    >>> from heatwalk.accumulators import heat_walk
    >>> kernel = HeatKernel(np.array([[2.0, 0], [0, 2], [1, 0.75]]), np.zeros(3, int), np.ones(3) / 3, time=1.0)
    >>> walk_margin(kernel, walk := heat_walk(kernel), walk.labels)
    array([1.  , 1.  , 0.25])
    """
    best = np.einsum("ij,ij->i", kernel.factor, kernel.factor[walk.pointer])
    elsewhere = np.full(len(labels), -np.inf)
    chosen = np.unique(walk.pointer)
    for part in kernel.parts():
        of_part = chosen[np.isin(chosen, part)] if len(part) < len(labels) else chosen
        order = part[np.argsort(labels[part], kind="stable")]
        for vertices in np.split(order, np.flatnonzero(np.diff(labels[order])) + 1):
            others = kernel.factor[of_part[labels[of_part] != labels[vertices[0]]]]
            height = max(1, BLOCK_BYTES // (8 * max(len(others), 1)))
            blocks = [vertices[start : start + height] for start in range(0, len(vertices), height)]
            if len(others):
                largest = shared(lambda rows, others=others: (kernel.factor[rows] @ others.T).max(axis=1), blocks)
                elsewhere[vertices] = np.concatenate(largest)
    margin = np.clip(1 - elsewhere / best, 0, 1)
    return least_on_path(margin, walk.pointer)


def dissipator_margin(excess: NDArray[np.float64]) -> NDArray[np.float64]:
    """The margin of the dissipator test.

    Parameters
    ----------
    excess : (n,) float array
        `heatwalk.dissipators.relative_entropy_excess`, in nats

    Returns
    -------
    (n,) float array
        in [0, 1]

    Examples
    --------
    >>> dissipator_margin(np.log([1.0, 0.5, 4.0]))
    array([0.  , 0.5 , 0.75])
    """
    return -np.expm1(-np.abs(excess))


def least_on_path(margin: NDArray[np.float64], pointer: NDArray[np.int64]) -> NDArray[np.float64]:
    """The smallest value on the path of each vertex, by pointer doubling."""
    least, reached = np.minimum(margin, margin[pointer]), pointer
    while not np.array_equal(farther := reached[reached], reached):
        least, reached = np.minimum(least, least[reached]), farther
    return least
