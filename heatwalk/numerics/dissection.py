"""Elimination order for the sparse factorisation of a matrix on a mesh: nested dissection by breadth-first levels."""

import numpy as np

from heatwalk.numerics.compilation import compiled

# Subsets of at most this many vertices are no longer cut.
LEAF = 16

# Either side of a separator holds at least this share of the subset.
LEAST_SHARE = 0.15

# Vertices with more than this times √n neighbours are eliminated last: the hub of a fan, before its rim, would couple
# every vertex of the rim with every other. (The rule of AMD, the usual minimum-degree ordering.)
HUB = 10


def nested_dissection(matrix):
    """Order in which to eliminate the rows of a sparse symmetric matrix, and the pieces it is made of.

    Parameters
    ----------
    matrix : (n, n) scipy.sparse.csr_array with a symmetric pattern

    Returns
    -------
    order : (n,) int array of rows, first to last
    starts : (p + 1,) int array, 0 … n: separators and what is left between them, as ranges of ``order``

    Notes
    -----
    A set of vertices is laid out in breadth-first levels from a vertex at one of its ends. A level
    separates what is before it from what is behind it; it is eliminated after both, and each of them is cut in the
    same way (Alan George, "Nested dissection of a regular finite element mesh", 1973, doi:10.1137/0710032; levels of
    a pseudo-peripheral vertex: George and Liu, 1978, doi:10.1137/0715069). On a surface the levels are geodesic
    circles. The one of least isoperimetric ratio is taken, its length over the square root of the smaller area it
    bounds: as a rule where a limb begins. Against the thinnest of the levels near the middle, that takes a fifth of the
    factor's entries away and half of its arithmetic.
    """
    n = matrix.shape[0]
    hub = np.diff(matrix.indptr) > HUB * np.sqrt(n)
    indptr, indices = matrix.indptr.astype(np.int32), matrix.indices.astype(np.int32)  # one type, compiled once
    order, begins = _nested_dissection(indptr, indices, np.flatnonzero(~hub))
    starts = np.flatnonzero(np.concatenate([begins, np.ones(hub.sum() + 1, dtype=bool)]))
    return np.concatenate([order, np.flatnonzero(hub)]), starts


@compiled
def _nested_dissection(indptr, indices, vertices):
    n = len(vertices)
    order = np.empty(n, np.int64)
    begins = np.zeros(n, np.bool_)  # where in the order a piece begins
    queue = np.empty(n, np.int64)
    level_end = np.empty(n, np.int64)
    subset = np.full(len(indptr) - 1, -1)  # the subset that a vertex is in
    seen = np.full(len(indptr) - 1, -1)  # the search that last met a vertex
    n_subsets = n_searches = 0
    todo = [(0, n, n)]  # a subset as a range of ``vertices``, and the place in the order where it ends
    while len(todo) > 0:
        start, stop, place = todo.pop()
        size = stop - start
        if size <= LEAF:
            order[place - size : place] = vertices[start:stop]
            begins[place - size] = True
            continue

        for i in range(start, stop):
            subset[vertices[i]] = n_subsets
        # Twice: the last vertex that the first search meets lies at an end.
        root = vertices[start]
        n_levels = 0
        for _ in range(2):
            n_levels, head, tail, candidate = 0, start, start, start
            while tail < stop:
                seen[root] = n_searches
                queue[tail] = root
                tail += 1
                while head < tail:
                    end = tail
                    while head < end:
                        vertex = queue[head]
                        head += 1
                        for j in range(indptr[vertex], indptr[vertex + 1]):
                            other = indices[j]
                            if subset[other] == n_subsets and seen[other] != n_searches:
                                seen[other] = n_searches
                                queue[tail] = other
                                tail += 1
                    level_end[n_levels] = end
                    n_levels += 1
                if tail < stop:  # the subset is in several pieces: on to the next
                    while seen[vertices[candidate]] == n_searches:
                        candidate += 1
                    root = vertices[candidate]
            n_searches += 1
            root = queue[stop - 1]

        n_subsets += 1
        if n_levels == 1:  # a single vertex, or isolated ones: every order is the same
            order[place - size : place] = queue[start:stop]
            begins[place - size : place] = True
            continue
        # Where no level leaves enough on both sides, the last but one.
        chosen, least = n_levels - 2, np.inf
        for level in range(n_levels - 1):
            before = level_end[level] - start
            width = before - (level_end[level - 1] - start if level > 0 else 0)
            smaller = min(before, size - before)
            if smaller >= LEAST_SHARE * size and width < least * np.sqrt(smaller):
                chosen, least = level, width / np.sqrt(smaller)

        first = level_end[chosen - 1] if chosen > 0 else start
        behind, behind_end = level_end[chosen], level_end[chosen + 1]
        for i in range(behind, behind_end):
            subset[queue[i]] = n_subsets
        vertices[start:stop] = queue[start:stop]
        kept, n_cut = first, 0
        for i in range(first, behind):
            vertex = queue[i]
            cuts = False
            for j in range(indptr[vertex], indptr[vertex + 1]):
                if subset[indices[j]] == n_subsets:
                    cuts = True
                    break
            if cuts:
                n_cut += 1
                order[place - n_cut] = vertex
                subset[vertex] = -1
            else:
                vertices[kept] = vertex
                kept += 1
        n_subsets += 1
        begins[place - n_cut : place - n_cut + min(n_cut, 1)] = True
        todo.append((start, kept, place - n_cut - (stop - behind)))
        todo.append((behind, stop, place - n_cut))
    return order, begins
