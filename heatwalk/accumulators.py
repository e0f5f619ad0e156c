"""The heat walk (paper, section 4): every vertex walks along the largest heat-flow capacity to its exemplar.

The paper's Algorithm 1 repeats, over a shrinking set E of exemplars,

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

# Values this near the largest (relative) count as tied with it; the smallest vertex index wins.
TIE = 1e-10


@dataclass(frozen=True)
class HeatWalk:
    """The forest that the walk leaves on n vertices, and its history.

    Attributes
    ----------
    pointer : (n,) int array, e₁(x): the vertex that x chooses. A root points to itself.
    first_potential : (n,) float array, s₁(x) = h(x, x)
    potential : (n,) float array, s₂(x) = h(x, e₁(x)), which no later step changes
    exemplars : (K,) int array, the roots, ascending
    labels : (n,) int array, 0 … K-1: the index in ``exemplars`` of the root that x reaches
    """

    pointer: np.ndarray
    first_potential: np.ndarray
    potential: np.ndarray
    exemplars: np.ndarray
    labels: np.ndarray

    @cached_property
    def steps(self):
        """Where each vertex stands after 0, 1, 2 … steps: a list of (n,) int arrays of vertices.

        The first has every vertex at itself, the last at its root. ``np.unique(steps[m])`` are the exemplars left
        after m steps, the paper's E; vertices with the same value form one region after m steps (Figure 3).
        """
        steps = [np.arange(len(self.pointer))]
        while not np.array_equal(following := self.pointer[steps[-1]], steps[-1]):
            steps.append(following)
        return steps

    def settled_shares(self):
        """The share of vertices that have reached their exemplar after 0, 1, 2 … steps: (steps + 1,) float array."""
        return np.array([np.mean(vertices == self.steps[-1]) for vertices in self.steps])

    def path(self, vertex):
        """The path π of ``vertex``: a list of vertices from it to its exemplar."""
        path = [int(vertex)]
        while (following := int(self.pointer[path[-1]])) != path[-1]:
            path.append(following)
        return path


def heat_walk(kernel):
    """Walk every vertex to its exemplar.

    Parameters
    ----------
    kernel : heatwalk.kernel.HeatKernel

    Returns
    -------
    HeatWalk
    """
    pointer, potential = maximum_inner_products(kernel)
    roots = _roots(pointer)
    pointer = np.where(roots == np.arange(len(roots)), roots, pointer)
    reached = np.zeros(len(roots), dtype=bool)
    reached[roots] = True
    labels = (np.cumsum(reached) - 1)[roots]
    return HeatWalk(pointer, kernel.diagonal(), potential, np.flatnonzero(reached), labels)


def maximum_inner_products(kernel):
    """For each vertex x the vertex y of largest h(x, y), and that value.

    Exact, by a search over a tree (``heatwalk.numerics.search``): about O(n k log n) time on meshes, O(n k) memory.
    Of the values within ``TIE`` of the largest, the smallest vertex index is taken.

    Returns
    -------
    argmax : (n,) int array
    maximum : (n,) float array
    """
    # Here, so that importing the package does not wait for numba.
    from heatwalk.numerics.search import largest_inner_products

    argmax = np.empty(len(kernel.factor), dtype=np.int64)
    maximum = np.empty(len(kernel.factor))
    for vertices in kernel.parts():
        best, maximum[vertices], _ = largest_inner_products(kernel.rows(vertices), TIE)
        argmax[vertices] = vertices[best]
    return argmax, maximum


def blocked_maximum_inner_products(kernel):
    """What ``maximum_inner_products`` gives, from all n² products in blocks of rows: the reference, O(n² k) time."""
    argmax = np.empty(len(kernel.factor), dtype=np.int64)
    maximum = np.empty(len(kernel.factor))
    for vertices in kernel.parts():
        for rows, block in kernel.row_blocks(vertices):
            best = block.max(axis=1)
            argmax[vertices[rows]] = vertices[(block >= (best * (1 - TIE))[:, None]).argmax(axis=1)]
            maximum[vertices[rows]] = best
    return argmax, maximum


def _roots(pointer):
    """The root that each vertex reaches, by pointer doubling.

    Where ties within ``TIE`` close a ring of vertices, its smallest vertex is the root.
    """
    reached = pointer
    smallest = np.minimum(np.arange(len(pointer)), pointer)  # on the way from each vertex to where it has got
    for _ in range(len(pointer).bit_length()):
        smallest = np.minimum(smallest, smallest[reached])
        farther = reached[reached]
        if np.array_equal(farther, reached):
            break
        reached = farther
    return smallest[reached]
