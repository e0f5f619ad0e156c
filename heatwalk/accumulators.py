"""The heat walk (paper, section 4): every vertex walks along the largest heat-flow capacity to its exemplar.

Algorithm 1 of the paper repeats, over a shrinking set E of exemplars,

    e(x) = argmax_{y in E} min(h(x, y), s(y)),    s(x) = max_{y in E} min(h(x, y), s(y)),

from s₁(x) = h(x, x). The walk follows from its first step alone:

**Theorem.** e₁(x) = argmax_y h(x, y), and every later step follows the pointers of the first, x → e₁(x) → e₁(e₁(x)) …

*Proof.* h = B Bᵀ is positive semi-definite, so h(x, y)² ≤ s₁(x) s₁(y).

1. If s₁(y) ≥ s₁(x) then h(x, y) ≤ s₁(y), and the capacity min(h(x, y), s₁(y)) is h(x, y). If s₁(y) < s₁(x) then both
   the capacity and h(x, y) < s₁(x) lose to y = x. So the caps do not matter in the first step.
2. s₂(y) = max_z h(y, z) ≥ h(x, y) for every x. So no cap binds in any later step either, and since e₁(x) is itself an
   exemplar, it is still the best choice of x among those left. ∎

The regions are therefore the trees of the forest x → e₁(x), the exemplars its roots, and it makes no difference whether
Algorithm 1 updates in place or all at once.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from heatwalk.kernel import HeatKernel

# Values this close to the largest (relative) count as tied with it; the smallest vertex index wins.
TIE = 1e-10


@dataclass(frozen=True)
class HeatWalk:
    """The forest of the walk on n vertices, and its history.

    Attributes
    ----------
    pointer : (n,) int array
        e₁(x), the vertex that x chooses; a root points to itself
    first_potential : (n,) float array
        s₁(x) = h(x, x)
    potential : (n,) float array
        s₂(x) = h(x, e₁(x)), which later steps do not change
    exemplars : (K,) int array, ascending
        the roots
    labels : (n,) int array, 0 … K-1
        the index in ``exemplars`` of the root that x reaches
    """

    pointer: NDArray[np.int64]
    first_potential: NDArray[np.float64]
    potential: NDArray[np.float64]
    exemplars: NDArray[np.int64]
    labels: NDArray[np.int64]

    @cached_property
    def steps(self) -> list[NDArray[np.int64]]:
        """The vertex that each vertex has reached after 0, 1, 2 … steps: a list of (n,) int arrays.

        In the first array every vertex is at itself, in the last at its root. ``np.unique(steps[m])`` are the exemplars
        left after m steps, the paper's E; vertices with equal values form one region after m steps (Figure 3).
        """
        steps = [np.arange(len(self.pointer))]
        while not np.array_equal(following := self.pointer[steps[-1]], steps[-1]):
            steps.append(following)
        return steps

    def settled_shares(self) -> NDArray[np.float64]:
        """The share of vertices that have reached their exemplar after 0, 1, 2 … steps.

        Returns
        -------
        (steps + 1,) float array
            ascending; the last is 1
        """
        return np.array([np.mean(vertices == self.steps[-1]) for vertices in self.steps])

    def path(self, vertex: int) -> list[int]:
        """The path π of a vertex: the vertices from it to its exemplar."""
        path = [int(vertex)]
        while (following := int(self.pointer[path[-1]])) != path[-1]:
            path.append(following)
        return path


def heat_walk(kernel: HeatKernel) -> HeatWalk:
    """Walk every vertex to its exemplar.

    Parameters
    ----------
    kernel : HeatKernel

    Returns
    -------
    HeatWalk

    Examples
    --------
    >>> rows = np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    >>> walk = heat_walk(HeatKernel(rows, np.zeros(3, int), np.ones(3) / 3, time=1.0))
    >>> walk.exemplars, walk.labels
    (array([1, 2]), array([0, 0, 1]))
    """
    pointer, potential = maximum_inner_products(kernel)
    roots = _find_roots(pointer)
    pointer = np.where(roots == np.arange(len(roots)), roots, pointer)
    is_root = np.zeros(len(roots), dtype=bool)
    is_root[roots] = True
    labels = (np.cumsum(is_root) - 1)[roots]
    return HeatWalk(pointer, kernel.diagonal(), potential, np.flatnonzero(is_root), labels)


def maximum_inner_products(kernel: HeatKernel) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """For each vertex x, the vertex y of largest h(x, y), and that value.

    Parameters
    ----------
    kernel : HeatKernel

    Returns
    -------
    argmax : (n,) int array
        the smallest vertex index among the values within `TIE` of the largest
    maximum : (n,) float array

    Notes
    -----
    Exact, by a tree search (`heatwalk.numerics.search`): about O(n k log n) time on meshes, O(n k) memory.
    """
    from heatwalk.numerics.search import largest_inner_products  # imports numba

    argmax = np.empty(len(kernel.factor), dtype=np.int64)
    maximum = np.empty(len(kernel.factor))
    for vertices in kernel.parts():
        best, maximum[vertices], _ = largest_inner_products(kernel.rows(vertices), TIE)
        argmax[vertices] = vertices[best]
    return argmax, maximum


def blocked_maximum_inner_products(kernel: HeatKernel) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Compute the same as `maximum_inner_products` from all n² products, in blocks of rows: the reference, O(n² k)."""
    argmax = np.empty(len(kernel.factor), dtype=np.int64)
    maximum = np.empty(len(kernel.factor))
    for vertices in kernel.parts():
        for rows, block in kernel.row_blocks(vertices):
            best = block.max(axis=1)
            argmax[vertices[rows]] = vertices[(block >= (best * (1 - TIE))[:, None]).argmax(axis=1)]
            maximum[vertices[rows]] = best
    return argmax, maximum


def _find_roots(pointer: NDArray[np.int64]) -> NDArray[np.int64]:
    """The root that each vertex reaches, by pointer doubling.

    If ties within `TIE` close a ring of vertices, its smallest vertex is the root.
    """
    reached = pointer
    smallest = np.minimum(np.arange(len(pointer)), pointer)  # on the path from each vertex to the one it has reached
    for _ in range(len(pointer).bit_length()):
        smallest = np.minimum(smallest, smallest[reached])
        farther = reached[reached]
        if np.array_equal(farther, reached):
            break
        reached = farther
    return smallest[reached]
