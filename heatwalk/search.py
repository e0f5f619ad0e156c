"""Exact maximum inner product search among the rows of a matrix, over a tree of the rows.

Notes
-----
The rows B_x of a heat kernel's factor lie on a surface in R^k. Halving them along their principal direction until a
leaf holds ``LEAF`` gives a balanced tree. Each node has a centre c and orthonormal directions T, the first two nearly
tangent to the surface; with N the orthogonal complement, rows c + d of the node obey for any query q

    ⟨q, c + d⟩ ≤ ⟨q, c⟩ + |q_T1| max|d_T1| + |q_T2| max|d_T2| + … + |q_N| max|d_N|,

and max|d_N| falls with the square of the node's diameter, where a ball's radius falls with the diameter itself. This is
applied to the head, the first columns, which carry almost all of the rows' length; the other columns, the tail,
are bounded by the product of the two lengths. A node is left out when this bound, or |q| max|B_y|, is below
the best product found. As h(x, y) ≥ h(x, x) needs |B_y| ≥ |B_x|, the latter leaves out all that lies downhill.

Queries go through the leaves in order and start from the leaf in which the query before found its answer. On meshes,
20 to 300 inner products a row are left.
"""

import numpy as np
from numba import njit

# Rows in a leaf: 16 doubles side by side are one pass of a processor's vector registers.
LEAF = 16

# Share of the rows' squared length that the tail may carry; 1e-4 tests hardly more nodes than 0 does. The head is a
# multiple of HEAD_STEP columns wide, for the vector registers.
TAIL_SHARE = 1e-4
HEAD_STEP = 8

# Directions that a node is measured along, and where its other extents stand.
AXES = 3
TAIL, LENGTH = AXES + 1, AXES + 2
# Rows that principal directions are estimated from, and rounds of power iteration. The bounds hold for any directions.
SAMPLE = 32
ROUNDS = 2

# What rounding may add to a product or a bound, relative to the product of two lengths; and the length, relative to
# that of the rows, below which what is left of a vector is rounding and has no direction.
ROUNDING = 1e-13


def compiled(function):
    """``function`` compiled by numba when first called, and kept on disk for later processes where that is possible."""
    options = {"nogil": True, "fastmath": {"reassoc", "contract"}}
    try:
        return njit(cache=True, **options)(function)
    except RuntimeError:  # neither the package's folder nor the user's cache can be written
        return njit(**options)(function)


def largest_inner_products(rows, tie):
    """For each row x the row y of largest inner product ⟨x, y⟩, and that product.

    Parameters
    ----------
    rows : (n, k) float array, n > 0; quick where the first columns carry most of the length
    tie : float, products within ``tie`` of the largest (relative) count as equal to it: the smallest row wins

    Returns
    -------
    argmax : (n,) int array
    maximum : (n,) float array
    n_products : int, inner products computed
    """
    rows = np.ascontiguousarray(rows, dtype=np.float64)
    n, k = rows.shape
    n_leaves = -(-n // LEAF)
    n_nodes = 2 * n_leaves - 1

    energy = np.einsum("ij,ij->j", rows, rows)
    tail = energy[::-1].cumsum()[::-1]
    width = HEAD_STEP * max(1, -(-np.count_nonzero(tail > TAIL_SHARE * tail[0]) // HEAD_STEP))
    head = np.zeros((n, width))
    head[:, :k] = rows[:, :width]

    # Padding rows of zeros, numbered n, fill the last leaf.
    order = np.append(np.arange(n), np.full(n_leaves * LEAF - n, n))
    span = np.empty((n_nodes, 2), dtype=np.int64)
    frame = np.zeros((n_nodes, 1 + AXES, width))
    extent = np.zeros((n_nodes, AXES + 3))
    smallest = np.full(n_nodes, n)
    _split(head, order, span, frame, extent)
    del head
    leaves = np.zeros((n_leaves, k, LEAF))
    _fill(rows, order, span, width, leaves, extent, smallest)

    argmax, maximum = np.empty(n, dtype=np.int64), np.empty(n)
    n_products = _search(leaves, order, span, frame, extent, smallest, tie, argmax, maximum)
    return argmax, maximum, n_products


# Nodes are numbered in preorder: a node over m leaves has its first child at node + 1 and the next node that is not
# below it at node + 2m - 1. Of a node,
#   span      first leaf, and the one after the last
#   frame     centre, directions T1, T2 … (0 where the rows have no such extent)
#   extent    max|d_T1|, max|d_T2| …, max|d_N|, longest tail, longest row
#   smallest  smallest row index


@compiled
def _remove(vector, direction):
    """Take from ``vector`` its part along ``direction``, and return how much that was."""
    along = 0.0
    for j in range(len(vector)):
        along += vector[j] * direction[j]
    for j in range(len(vector)):
        vector[j] -= along * direction[j]
    return along


@compiled
def _square(vector):
    square = 0.0
    for j in range(len(vector)):
        square += vector[j] * vector[j]
    return square


@compiled
def _split(head, order, span, frame, extent):
    n, width = head.shape
    key = np.empty(n)
    span[0, 0], span[0, 1] = 0, len(order) // LEAF
    for node in range(len(span)):
        first, last = span[node, 0], span[node, 1]
        start, stop = first * LEAF, min(last * LEAF, n)
        _set_frame(head, start, stop, frame[node], extent[node])
        if last - first > 1:
            middle = (first + last) // 2
            span[node + 1, 0], span[node + 1, 1] = first, middle
            other = node + 2 * (middle - first)
            span[other, 0], span[other, 1] = middle, last
            for i in range(start, stop):
                key[i] = 0.0
                for j in range(width):
                    key[i] += head[i, j] * frame[node, 1, j]
            _select(key, order, head, start, stop - 1, middle * LEAF)


@compiled
def _set_frame(head, start, stop, frame, extent):
    """The frame and the extents of the node that holds head[start:stop]."""
    width = head.shape[1]
    step = (stop - start + SAMPLE - 1) // SAMPLE
    count = (stop - start + step - 1) // step
    for i in range(start, stop, step):
        for j in range(width):
            frame[0, j] += head[i, j] / count
    for axis in range(1, AXES + 1):
        _set_axis(head, start, stop, step, frame, axis)

    low, high = np.full(AXES, np.inf), np.full(AXES, -np.inf)
    remainder = np.empty(width)
    farthest = 0.0
    for i in range(start, stop):
        for j in range(width):
            remainder[j] = head[i, j] - frame[0, j]
        # What is left after each axis, not the difference of squared lengths: that would lose half of the digits.
        for axis in range(AXES):
            along = _remove(remainder, frame[axis + 1])
            low[axis], high[axis] = min(low[axis], along), max(high[axis], along)
        farthest = max(farthest, _square(remainder))
    for axis in range(AXES):
        for j in range(width):
            frame[0, j] += (low[axis] + high[axis]) / 2 * frame[axis + 1, j]
        extent[axis] = (high[axis] - low[axis]) / 2
    extent[AXES] = np.sqrt(farthest)


@compiled
def _set_axis(head, start, stop, step, frame, axis):
    """Set frame[axis] to the direction of most variance orthogonal to the axes before it, by power iteration."""
    width = head.shape[1]
    direction, product, offset = np.zeros(width), np.zeros(width), np.empty(width)
    for turn in range(ROUNDS + 1):
        farthest = 0.0
        product[:] = 0.0
        for i in range(start, stop, step):
            for j in range(width):
                offset[j] = head[i, j] - frame[0, j]
            for before in range(1, axis):
                _remove(offset, frame[before])
            if turn > 0:
                along = 0.0
                for j in range(width):
                    along += offset[j] * direction[j]
                for j in range(width):
                    product[j] += along * offset[j]
            elif _square(offset) > farthest:  # start from the farthest row
                farthest = _square(offset)
                product[:] = offset
        # Orthogonal to working precision only after a second time.
        for _ in range(2):
            square = _square(product)
            for before in range(1, axis):
                _remove(product, frame[before])
            left = _square(product)
            if left <= square * ROUNDING:
                return
            for j in range(width):
                product[j] /= np.sqrt(left)
        direction[:] = product
    frame[axis] = direction


@compiled
def _select(key, order, head, low, high, middle):
    """Rearrange low … high so that no key before ``middle`` is larger than one from it on (Hoare's quickselect)."""
    while low < high:
        a, b, c = key[low], key[(low + high) // 2], key[high]
        pivot = max(min(a, b), min(max(a, b), c))
        i, j = low, high
        while i <= j:
            while key[i] < pivot:
                i += 1
            while key[j] > pivot:
                j -= 1
            if i <= j:
                key[i], key[j] = key[j], key[i]
                order[i], order[j] = order[j], order[i]
                for column in range(head.shape[1]):
                    head[i, column], head[j, column] = head[j, column], head[i, column]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@compiled
def _fill(rows, order, span, width, leaves, extent, smallest):
    n, k = rows.shape
    for node in range(len(span) - 1, -1, -1):
        first, last = span[node, 0], span[node, 1]
        if last - first > 1:
            below = (node + 1, node + 2 * ((first + last) // 2 - first))
            for child in below:
                extent[node, TAIL] = max(extent[node, TAIL], extent[child, TAIL])
                extent[node, LENGTH] = max(extent[node, LENGTH], extent[child, LENGTH])
                smallest[node] = min(smallest[node], smallest[child])
            continue
        for i in range(LEAF):
            row = order[first * LEAF + i]
            if row < n:
                length = tail = 0.0
                for j in range(k):
                    leaves[first, j, i] = rows[row, j]
                    length += rows[row, j] ** 2
                for j in range(width, k):
                    tail += rows[row, j] ** 2
                extent[node, TAIL] = max(extent[node, TAIL], np.sqrt(tail))
                extent[node, LENGTH] = max(extent[node, LENGTH], np.sqrt(length))
                smallest[node] = min(smallest[node], row)


@compiled
def _search(leaves, order, span, frame, extent, smallest, tie, argmax, maximum):
    k, width = leaves.shape[1], frame.shape[2]
    query = np.zeros(max(k, width))
    products = np.empty(LEAF)
    n_products = 0
    warm = 0  # the leaf of the answer to the query before
    for x in range(len(argmax)):
        head = tail = 0.0
        for j in range(k):
            query[j] = leaves[x // LEAF, j, x % LEAF]
            if j < width:
                head += query[j] ** 2
            else:
                tail += query[j] ** 2
        # The largest product so far and its row; the smallest row tied with it, that one's product and leaf.
        best, row = head + tail, order[x]
        answer, held, home = row, best, x // LEAF
        length, tail = np.sqrt(best), np.sqrt(tail)
        lost = True
        while lost:
            lost = False
            floor = best * (1 - tie)
            node = -1  # stands for the warm leaf, before the tree
            while node < len(span):
                leaf = warm
                if node >= 0:
                    first, last = span[node, 0], span[node, 1]
                    reach = length * extent[node, LENGTH]
                    useful = reach >= floor
                    if useful:
                        bound = tail * extent[node, TAIL]
                        for j in range(width):
                            bound += query[j] * frame[node, 0, j]
                        across = head * (1 + ROUNDING)
                        for axis in range(AXES):
                            along = 0.0
                            for j in range(width):
                                along += query[j] * frame[node, axis + 1, j]
                            bound += abs(along) * extent[node, axis]
                            across -= along * along
                        bound += np.sqrt(max(across, 0.0)) * extent[node, AXES]
                        slack = ROUNDING * reach
                        # Where nothing can be larger, only a tie with a smaller row counts.
                        useful = bound + slack >= floor and (bound > best + slack or smallest[node] < answer)
                    if not useful:
                        node += 2 * (last - first) - 1
                        continue
                    if last - first > 1 or first == warm:
                        node += 1
                        continue
                    leaf = first
                node += 1
                n_products += LEAF
                products[:] = 0.0
                for j in range(k):
                    for i in range(LEAF):
                        products[i] += query[j] * leaves[leaf, j, i]
                for i in range(LEAF):
                    if products[i] < floor:
                        continue
                    y = order[leaf * LEAF + i]
                    if products[i] > best:
                        floor = products[i] * (1 - tie)
                        if held < floor:
                            # Rows passed over for ``answer`` may tie with the new largest: once more, knowing it.
                            lost |= best >= floor
                            answer, held, home = y, products[i], leaf
                        best, row = products[i], y
                    if y < answer:
                        answer, held, home = y, products[i], leaf
            if lost:
                answer, held = row, best
        argmax[order[x]], maximum[order[x]] = answer, best
        warm = home
    return n_products
