"""Exact maximum inner product search among the rows of a matrix, over a tree of the rows.

Notes
-----
The rows B_x of a heat kernel's factor lie on a surface in R^k. Halving them across their principal direction until a
leaf holds ``LEAF`` gives a balanced tree. Each node has a centre c and orthonormal axes T_1 … T_a, which soon span the
surface's tangent plane; with N their orthogonal complement, its rows c + d obey for any query q

    ⟨q, c + d⟩ ≤ ⟨q, c⟩ + Σ_i |q_Ti| max|d_Ti| + |q_N| max|d_N|,

where max|d_N| falls with the square of the node's diameter; the radius of a ball would only fall with the diameter
itself. This bounds the head, the first columns, which carry almost all of the rows' length; the other columns, the
tail, are bounded by the product of the two lengths. A node is left out when this bound, or |q| max|B_y|, is below the
best product found. As h(x, y) ≥ h(x, x) needs |B_y| ≥ |B_x|, the latter leaves out all that lies downhill.

The rows ask in the order of the leaves, each starting from the leaf in which the one before found its answer.
"""

import numpy as np

from heatwalk.numerics.compilation import compiled

# Rows in a leaf. With 16, and so twice the nodes, tree and search together take a third longer.
LEAF = 32

# Axes of a node: two for the tangent plane; a third for the gap where both sides of a thin part lie in one node. A
# fourth does not pay.
AXES = 3

# Share of the rows' squared length that the tail may carry.
TAIL_SHARE = 1e-6

# Rows, and their heads, are a multiple of so many columns wide, for the vector registers.
STEP = 4

# Rows of a node that its axes are estimated from, in one round of power iteration. The bounds hold for any axes, and a
# second round costs more than it saves.
SAMPLE = 16

# What rounding may add to a product or a bound, relative to the product of the two lengths; also the share of a
# vector's squared length below which what is left of it after a projection is rounding and has no direction.
ROUNDING = 1e-13

# Columns of ``extent``, after max|d_T1| … max|d_Ta|.
NORMAL, TAIL, LENGTH = AXES, AXES + 1, AXES + 2


def largest_inner_products(rows, tie):
    """For each row x the row y of largest inner product ⟨x, y⟩, and that product.

    Parameters
    ----------
    rows : (n, k) float array, n > 0; quick where they lie on a surface and the first columns carry most of the length
    tie : float, products within ``tie`` of the largest (relative) count as equal to it: the smallest row wins

    Returns
    -------
    argmax : (n,) int array
    maximum : (n,) float array
    n_products : int, inner products computed
    """
    n, k = rows.shape
    squares = np.einsum("ij,ij->j", rows, rows)
    tails = squares[::-1].cumsum()[::-1]
    width = max(STEP, _padded(np.count_nonzero(tails > TAIL_SHARE * tails[0])))
    sorted_rows = np.zeros((n, _padded(k)))
    sorted_rows[:, :k] = rows

    n_nodes = 2 * -(-n // LEAF) - 1
    order = np.arange(n)
    span = np.empty((n_nodes, 2), dtype=np.int64)
    frame = np.zeros((n_nodes, 1 + AXES, width))
    extent = np.zeros((n_nodes, AXES + 3))
    smallest = np.full(n_nodes, n)
    _split(sorted_rows, order, span, frame, extent)
    _measure(sorted_rows, order, span, width, extent, smallest)

    argmax, maximum = np.empty(n, dtype=np.int64), np.empty(n)
    n_products = _search(sorted_rows, order, span, frame, extent, smallest, tie, argmax, maximum)
    return argmax, maximum, n_products


def _padded(columns):
    return -(-columns // STEP) * STEP


# Nodes are numbered in preorder: a node of m leaves has its first child at node + 1, and the next node that is not
# below it is node + 2m - 1. Of a node,
#   span      its first leaf, and the one after its last
#   frame     c, T_1 … T_a (0 where the rows have no such extent)
#   extent    max|d_T1| … max|d_Ta|, max|d_N|, its longest tail, its longest row
#   smallest  its smallest row index


@compiled
def _dot(a, b):
    total = 0.0
    for j in range(len(a)):
        total += a[j] * b[j]
    return total


@compiled
def _remove(vector, direction):
    """Take from ``vector`` its part along ``direction``, and return how much that was."""
    along = _dot(vector, direction)
    for j in range(len(vector)):
        vector[j] -= along * direction[j]
    return along


@compiled
def _split(rows, order, span, frame, extent):
    """Put the rows into the order of the tree; the frames of its nodes, and their extents up to max|d_N|."""
    n = len(rows)
    key, sample = np.empty(n), np.empty((SAMPLE, frame.shape[2]))
    span[0, 0], span[0, 1] = 0, (n + LEAF - 1) // LEAF
    for node in range(len(span)):
        first, last = span[node, 0], span[node, 1]
        start, stop = first * LEAF, min(last * LEAF, n)
        _set_frame(rows, start, stop, frame[node], extent[node], key, sample)
        if last - first > 1:
            middle = (first + last) // 2
            span[node + 1, 0], span[node + 1, 1] = first, middle
            other = node + 2 * (middle - first)
            span[other, 0], span[other, 1] = middle, last
            _select(key, order, rows, start, stop - 1, middle * LEAF)


@compiled
def _set_frame(rows, start, stop, frame, extent, key, sample):
    """The frame and the extents of the node that holds rows[start:stop]; their places along its first axis as keys."""
    width = frame.shape[1]
    step = (stop - start + SAMPLE - 1) // SAMPLE
    count = (stop - start + step - 1) // step
    for i in range(count):
        for j in range(width):
            sample[i, j] = rows[start + i * step, j]
            frame[0, j] += sample[i, j] / count
    for i in range(count):
        for j in range(width):
            sample[i, j] -= frame[0, j]
    for axis in range(1, AXES + 1):
        _set_axis(sample[:count], frame, axis)

    low, high = np.full(AXES, np.inf), np.full(AXES, -np.inf)
    farthest = 0.0
    for i in range(start, stop):
        along, across = _coordinates(rows[i], frame)
        key[i] = along[0]
        for axis in range(AXES):
            low[axis], high[axis] = min(low[axis], along[axis]), max(high[axis], along[axis])
            across -= along[axis] ** 2
        farthest = max(farthest, across)
    for axis in range(AXES):
        for j in range(width):
            frame[0, j] += (low[axis] + high[axis]) / 2 * frame[axis + 1, j]
        extent[axis] = (high[axis] - low[axis]) / 2
    extent[NORMAL] = np.sqrt(farthest)


@compiled
def _coordinates(row, frame):
    """⟨d, T_1⟩ … ⟨d, T_a⟩ of a row c + d, and |d|² with what rounding may take from it; in one pass over the row."""
    square = along_1 = along_2 = along_3 = 0.0
    for j in range(frame.shape[1]):
        offset = row[j] - frame[0, j]
        square += offset * offset
        along_1 += offset * frame[1, j]
        along_2 += offset * frame[2, j]
        along_3 += offset * frame[3, j]
    return (along_1, along_2, along_3), square * (1 + ROUNDING)


@compiled
def _products(query, frame):
    """⟨q, c⟩, and ⟨q, T_1⟩ … ⟨q, T_a⟩."""
    centre = along_1 = along_2 = along_3 = 0.0
    for j in range(frame.shape[1]):
        centre += query[j] * frame[0, j]
        along_1 += query[j] * frame[1, j]
        along_2 += query[j] * frame[2, j]
        along_3 += query[j] * frame[3, j]
    return centre, (along_1, along_2, along_3)


@compiled
def _set_axis(sample, frame, axis):
    """Set frame[axis] to the direction of most variance in ``sample``, whose part along it is taken from the rows.

    The axes before it have been taken from them already.
    """
    farthest, start = 0.0, 0
    for i in range(len(sample)):
        square = _dot(sample[i], sample[i])
        if square > farthest:
            farthest, start = square, i
    product = frame[axis]
    for i in range(len(sample)):
        along = _dot(sample[i], sample[start])
        for j in range(len(product)):
            product[j] += along * sample[i, j]
    # Orthogonal to working precision only after a second time.
    for _ in range(2):
        square = _dot(product, product)
        for before in range(1, axis):
            _remove(product, frame[before])
        left = _dot(product, product)
        if left <= square * ROUNDING:
            product[:] = 0
            return
        for j in range(len(product)):
            product[j] /= np.sqrt(left)
    for i in range(len(sample)):
        _remove(sample[i], product)


@compiled
def _select(key, order, rows, low, high, middle):
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
                for column in range(rows.shape[1]):
                    rows[i, column], rows[j, column] = rows[j, column], rows[i, column]
                i += 1
                j -= 1
        if middle <= j:
            high = j
        elif middle >= i:
            low = i
        else:
            return


@compiled
def _measure(rows, order, span, width, extent, smallest):
    """Longest tail, longest row and smallest row index of every node, from the leaves up; ``rows`` in tree order."""
    n = len(rows)
    for node in range(len(span) - 1, -1, -1):
        first, last = span[node, 0], span[node, 1]
        if last - first > 1:
            for child in (node + 1, node + 2 * ((first + last) // 2 - first)):
                extent[node, TAIL] = max(extent[node, TAIL], extent[child, TAIL])
                extent[node, LENGTH] = max(extent[node, LENGTH], extent[child, LENGTH])
                smallest[node] = min(smallest[node], smallest[child])
            continue
        for i in range(first * LEAF, min(last * LEAF, n)):
            tail = _dot(rows[i, width:], rows[i, width:])
            extent[node, TAIL] = max(extent[node, TAIL], np.sqrt(tail))
            extent[node, LENGTH] = max(extent[node, LENGTH], np.sqrt(_dot(rows[i, :width], rows[i, :width]) + tail))
            smallest[node] = min(smallest[node], order[i])


@compiled
def _search(rows, order, span, frame, extent, smallest, tie, argmax, maximum):
    n = len(rows)
    width = frame.shape[2]
    query = np.empty(rows.shape[1])
    products = np.empty(LEAF)
    n_products = 0
    warm = 0  # the leaf of the answer to the query before
    for x in range(n):
        query[:] = rows[x]
        head, tail = _dot(query[:width], query[:width]), _dot(query[width:], query[width:])
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
                    if first <= warm < last:  # its bound would not be below the answer that it holds
                        node += 1
                        continue
                    reach = length * extent[node, LENGTH]
                    useful = reach >= floor
                    if useful:
                        bound, along = _products(query, frame[node])
                        bound += tail * extent[node, TAIL]
                        across = head * (1 + ROUNDING)
                        for axis in range(AXES):
                            bound += abs(along[axis]) * extent[node, axis]
                            across -= along[axis] ** 2
                        bound += np.sqrt(max(across, 0.0)) * extent[node, NORMAL]
                        slack = ROUNDING * reach
                        # Where nothing can be larger, only a tie with a smaller row counts.
                        useful = bound + slack >= floor and (bound > best + slack or smallest[node] < answer)
                    if not useful:
                        node += 2 * (last - first) - 1
                        continue
                    if last - first > 1:
                        node += 1
                        continue
                    leaf = first
                node += 1
                start = leaf * LEAF
                size = min(LEAF, n - start)
                n_products += size
                for i in range(size):
                    products[i] = _dot(rows[start + i], query)
                for i in range(size):
                    if products[i] < floor:
                        continue
                    y = order[start + i]
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
