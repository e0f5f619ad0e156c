"""Elimination order for the sparse factorisation of a matrix on a mesh: nested dissection by breadth-first levels.

    todo = [all vertices but the hubs]
    while todo:
        S = a subset from todo
        if S is small: S is a piece of the order
        levels of S: breadth-first search from a vertex at one of its ends           `_breadth_first_levels`
        separator: the level of least isoperimetric ratio that is not lopsided       `_choose_separator`
        reduced to its vertices with a neighbour in the next level                   `_place_separator`
        the separator is a piece, eliminated after all other vertices of S
        todo += [the vertices before the separator, the vertices after it]
    the hubs are the last pieces

On a surface the levels are geodesic circles, and the level of least isoperimetric ratio (its length over the square
root of the smaller area that it bounds) is usually where a limb begins. Compared with the thinnest level near the
middle, this choice saves a fifth of the entries of the factor and half of its arithmetic.

References
----------
A. George, "Nested dissection of a regular finite element mesh", 1973, doi:10.1137/0710032;
A. George and J. W. H. Liu, 1978, doi:10.1137/0715069 (levels of a pseudo-peripheral vertex).
"""

from itertools import count
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled
from heatwalk.numerics.threads import number_of_threads, spread, worth_sharing

if TYPE_CHECKING:
    import scipy.sparse as sp

# Subsets of at most this many vertices are not cut further.
LEAF_SIZE = 16

# Either side of a separator has at least this share of the subset.
MIN_SHARE = 0.15

# Subsets with more than one in so many of the vertices of each thread are cut once at a time, then shared out again.
SHARES_PER_THREAD = 8

# Vertices with more than this times √n neighbours are eliminated last: if the hub of a fan were eliminated before its
# rim, it would couple every vertex of the rim with every other. (The rule of AMD, the usual minimum-degree ordering.)
HUB_DEGREE = 10


def nested_dissection(matrix: "sp.csr_array") -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Order in which to eliminate the rows of a sparse symmetric matrix, and the pieces of that order.

    Parameters
    ----------
    matrix : (n, n) scipy.sparse.csr_array with a symmetric pattern

    Returns
    -------
    order : (n,) int array
        rows, first to last
    starts : (p + 1,) int array, 0 … n
        piece i, a separator or a set of vertices between separators, is ``order[starts[i]:starts[i + 1]]``

    Examples
    --------
    >>> import scipy.sparse as sp
    >>> path = sp.diags_array([1.0, 1.0], offsets=[-1, 1], shape=(40, 40)).tocsr()
    >>> order, starts = nested_dissection(path)
    >>> sorted(order.tolist()) == list(range(40)), np.diff(starts).tolist()
    (True, [8, 10, 1, 9, 10, 1, 1])
    """
    n = matrix.shape[0]
    is_hub = np.diff(matrix.indptr) > HUB_DEGREE * np.sqrt(n)
    # A single index type, so that the loops are compiled once.
    indptr, indices = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)
    order, begins_piece = _dissected(indptr, indices, np.flatnonzero(~is_hub))
    starts = np.flatnonzero(np.concatenate([begins_piece, np.ones(is_hub.sum() + 1, dtype=bool)]))
    return np.concatenate([order, np.flatnonzero(is_hub)]), starts


def _dissected(
    indptr: NDArray[np.int32], indices: NDArray[np.int32], vertices: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.bool_]]:
    """Order of the vertices, and whether a piece begins at each position of it; overwrites ``vertices``."""
    n = len(vertices)
    order, begins_piece = np.empty(n, np.int64), np.zeros(n, np.bool_)
    work = np.empty(n, np.int64), np.empty(n, np.int64)
    marks = np.full(len(indptr) - 1, -1), np.full(len(indptr) - 1, -1)
    largest_whole = n // (SHARES_PER_THREAD * number_of_threads()) if worth_sharing(n) else n
    names = count(step=2 * n + 2)  # more than a call needs for its subsets and searches

    def dissect(start: int, stop: int, position: int) -> list[tuple[int, int, int]]:
        max_cuts = 1 if stop - start > largest_whole else n + 1  # + 1: nothing is left where all are hubs, either
        rest = _dissect(
            indptr, indices, vertices, start, stop, position, max_cuts, next(names), order, begins_piece, *work, *marks
        )
        return [(a, b, c) for a, b, c in rest.tolist()]

    spread(dissect, 0, n, n)
    return order, begins_piece


@compiled
def _dissect(
    indptr: NDArray[np.int32],
    indices: NDArray[np.int32],
    vertices: NDArray[np.int64],
    start: int,
    stop: int,
    position: int,
    max_cuts: int,
    name: int,
    order: NDArray[np.int64],
    begins_piece: NDArray[np.bool_],
    queue: NDArray[np.int64],
    level_ends: NDArray[np.int64],
    subset_of: NDArray[np.int64],
    seen_by: NDArray[np.int64],
) -> NDArray[np.int64]:
    """Dissect the subset vertices[start:stop], whose place in the order ends at ``position``.

    Other calls may work on other subsets at the same time.

    max_cuts : int
        return after so many cuts
    name : int
        the first of the numbers that no other call uses for its subsets and searches
    order, begins_piece : (n,) arrays
        results, filled at the place of the subset
    queue, level_ends : (n,) int arrays
        overwritten between ``start`` and ``stop``
    subset_of, seen_by : (n + hubs,) int arrays
        the subset that each vertex is in, and the last search that met it

    Returns the subsets that are left, a row each: start, stop and position.
    """
    # Literals would have what is called compiled for them too.
    n_levels: int = np.int64(0)  # type: ignore[assignment]
    n_subsets, n_searches = name, name
    todo = [(start, stop, position)]  # subsets as ranges of ``vertices``, each with the end of its place in the order
    n_cuts_left = max_cuts
    while len(todo) > 0 and n_cuts_left > 0:
        start, stop, position = todo.pop()
        size = stop - start
        if size <= LEAF_SIZE:
            _copy(vertices, start, stop, order, position - size)
            begins_piece[position - size] = True
            continue

        for i in range(start, stop):
            subset_of[vertices[i]] = n_subsets
        root = vertices[start]
        ends = level_ends[start:stop]
        for _ in range(2):  # the last vertex that the first search meets is at an end of the subset
            n_levels = _breadth_first_levels(
                indptr, indices, vertices, start, stop, root, n_subsets, n_searches, subset_of, seen_by, queue, ends
            )
            n_searches += 1
            root = queue[stop - 1]
        n_subsets += 1
        if n_levels == 1:  # a single vertex, or isolated ones: any order will do
            _copy(queue, start, stop, order, position - size)
            begins_piece[position - size : position] = True
            continue

        level = _choose_separator(ends, n_levels, start, size)
        first = ends[level - 1] if level > 0 else start
        after = ends[level]
        _copy(queue, start, stop, vertices, start)
        kept_end, n_cut = _place_separator(
            indptr, indices, first, after, ends[level + 1], position, n_subsets, subset_of, queue, vertices, order
        )
        n_subsets += 1
        begins_piece[position - n_cut : position - n_cut + min(n_cut, 1)] = True
        todo.append((start, kept_end, position - n_cut - (stop - after)))
        todo.append((after, stop, position - n_cut))
        n_cuts_left -= 1
    left = np.empty((len(todo), 3), np.int64)
    for i in range(len(todo)):
        left[i, 0], left[i, 1], left[i, 2] = todo[i]
    return left


@compiled
def _copy(source: NDArray[np.int64], start: int, stop: int, target: NDArray[np.int64], at: int) -> None:
    """Copy source[start:stop] to target[at:].

    An assignment to a slice would do the same, but numba compiles seconds on the message for unequal shapes.
    """
    for i in range(stop - start):
        target[at + i] = source[start + i]


@compiled
def _breadth_first_levels(
    indptr: NDArray[np.int32],
    indices: NDArray[np.int32],
    vertices: NDArray[np.int64],
    start: int,
    stop: int,
    root: int,
    subset: int,
    search: int,
    subset_of: NDArray[np.int64],
    seen_by: NDArray[np.int64],
    queue: NDArray[np.int64],
    level_ends: NDArray[np.int64],
) -> int:
    """Lay out a subset in breadth-first levels from ``root``, piece after piece if it is not connected.

    Fills queue[start:stop] and the end of each level in it; returns the number of levels.
    """
    n_levels, head, tail, candidate = 0, start, start, start
    while tail < stop:
        seen_by[root] = search
        queue[tail] = root
        tail += 1
        while head < tail:
            end = tail
            while head < end:
                vertex = queue[head]
                head += 1
                for j in range(indptr[vertex], indptr[vertex + 1]):
                    other = indices[j]
                    if subset_of[other] == subset and seen_by[other] != search:
                        seen_by[other] = search
                        queue[tail] = other
                        tail += 1
            level_ends[n_levels] = end
            n_levels += 1
        if tail < stop:
            while seen_by[vertices[candidate]] == search:
                candidate += 1
            root = vertices[candidate]
    return n_levels


@compiled
def _choose_separator(level_ends: NDArray[np.int64], n_levels: int, start: int, size: int) -> int:
    """The level of least isoperimetric ratio; the last but one if none leaves enough on both sides."""
    chosen, least = n_levels - 2, np.inf
    for level in range(n_levels - 1):
        before = level_ends[level] - start
        width = before - (level_ends[level - 1] - start if level > 0 else 0)
        smaller = min(before, size - before)
        if smaller >= MIN_SHARE * size and width < least * np.sqrt(smaller):
            chosen, least = level, width / np.sqrt(smaller)
    return chosen


@compiled
def _place_separator(
    indptr: NDArray[np.int32],
    indices: NDArray[np.int32],
    first: int,
    after: int,
    after_end: int,
    position: int,
    marker: int,
    subset_of: NDArray[np.int64],
    queue: NDArray[np.int64],
    vertices: NDArray[np.int64],
    order: NDArray[np.int64],
) -> tuple[int, int]:
    """Put the vertices of the level queue[first:after] with a neighbour in the next level at the end of the order.

    The next level, queue[after:after_end], is marked by ``marker``. The other vertices of the level stay with those
    before it, in vertices[first:]; returns the end of these, and the number of vertices put into the order.
    """
    for i in range(after, after_end):
        subset_of[queue[i]] = marker
    kept_end, n_cut = first, 0
    for i in range(first, after):
        vertex = queue[i]
        is_cut = False
        for j in range(indptr[vertex], indptr[vertex + 1]):
            if subset_of[indices[j]] == marker:
                is_cut = True
                break
        if is_cut:
            n_cut += 1
            order[position - n_cut] = vertex
            subset_of[vertex] = -1
        else:
            vertices[kept_end] = vertex
            kept_end += 1
    return kept_end, n_cut
