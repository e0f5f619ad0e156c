"""Exact maximum inner product search among the rows of a matrix, with a tree over the rows.

The rows B_x of the factor of a heat kernel lie near a surface in R^k. Splitting them in halves across their principal
direction until a leaf has ``LEAF_SIZE`` rows gives a balanced tree. Each node has a centre c and orthonormal axes
T_1 … T_a, which soon span the tangent plane of the surface; with N their orthogonal complement, its rows c + d satisfy,
for any query q,

    ⟨q, c + d⟩ ≤ ⟨q, c⟩ + Σ_i |q_Ti| max|d_Ti| + |q_N| max|d_N|,

where max|d_N| decreases with the square of the diameter of the node, while the radius of a ball would only decrease
with the diameter. This bounds the head, the first columns, which carry almost all of the length of the rows; the other
columns, the tail, are bounded by the product of the two lengths. A node is skipped if this bound, or |q| max|B_y|, is
below the best product found so far. As h(x, y) ≥ h(x, x) requires |B_y| ≥ |B_x|, the latter skips all rows downhill.

    build the tree, from the root down                                                `_build`, `_build_tree`
        frame of each node: centre, axes, extents along and across them               `_set_frame`
        split its rows at the median along the first axis                             `_select`
    longest tail, longest row and smallest row index of each node, leaves first       `_measure_nodes`
    for each row x, in the order of the leaves:                                       `_search`
        best = ⟨x, x⟩
        scan the leaf that contains the answer to the previous row                    `_scan_leaf`
        for each node in preorder:                                                    `_search_tree`
            skip the node and its descendants if no row of it can be an answer        `_can_contain_answer`
            if it is a leaf: scan it
        if a row that ties with the final best may have been skipped: repeat with the final best
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled, inlined
from heatwalk.numerics.threads import PIECES_PER_THREAD, number_of_threads, pieces, shared, spread, worth_sharing

# Rows per leaf. With 16, and so twice as many nodes, building and searching together take a third longer.
LEAF_SIZE = 32

# Axes per node: two for the tangent plane; a third for the gap if both sides of a thin part are in one node. A fourth
# does not pay.
AXES = 3

# Share of the squared length of the rows that the tail may carry.
MAX_TAIL_SHARE = 1e-6

# Rows, and their heads, are padded to a multiple of this many columns, for the vector registers.
COLUMN_MULTIPLE = 4

# Rows of a node from which its axes are estimated, in one round of power iteration. The bounds hold for any axes, and a
# second round costs more than it saves.
SAMPLE_SIZE = 16

# What rounding may add to a product or a bound, relative to the product of the two lengths; also the share of the
# squared length of a vector below which the remainder after a projection is rounding error and has no direction.
ROUNDING = 1e-13

# Columns of `Tree.extent`, after max|d_T1| … max|d_Ta|: max|d_N|, longest tail, longest row.
NORMAL, TAIL, LENGTH = AXES, AXES + 1, AXES + 2


class Tree(NamedTuple):
    """The rows in tree order, and the p nodes in preorder.

    A node with m leaves has its first child at node + 1; the next node outside its subtree is node + 2m - 1.

    rows : (n, k) float array, padded with columns of zeros
    order : (n,) int array, the original index of each row
    leaves : (p, 2) int array, the first leaf of each node and the end of its leaves
    frame : (p, 1 + AXES, width) float array, c and T_1 … T_a (0 if the rows do not extend in so many directions)
    extent : (p, AXES + 3) float array, max|d_T1| … max|d_Ta|, max|d_N|, longest tail, longest row
    smallest : (p,) int array, the smallest original index of its rows
    """

    rows: NDArray[np.float64]
    order: NDArray[np.int64]
    leaves: NDArray[np.int64]
    frame: NDArray[np.float64]
    extent: NDArray[np.float64]
    smallest: NDArray[np.int64]


def largest_inner_products(rows: NDArray[np.float64], tie: float) -> tuple[NDArray[np.int64], NDArray[np.float64], int]:
    """For each row x, the row y of largest inner product ⟨x, y⟩, and that product.

    Parameters
    ----------
    rows : (n, k) float array, n > 0
        fast if the rows lie near a surface and the first columns carry most of the length
    tie : float
        products within ``tie`` (relative) of the largest count as equal to it: the smallest row index wins

    Returns
    -------
    argmax : (n,) int array
    maximum : (n,) float array
    n_products : int
        inner products computed

    Examples
    --------
    >>> rows = np.array([[1.0, 0.0], [2.0, 0.0], [0.0, 1.0]])
    >>> argmax, maximum, n_products = largest_inner_products(rows, tie=1e-10)
    >>> argmax, maximum
    (array([1, 1, 2]), array([2., 4., 1.]))
    """
    tree = _empty_tree(rows)
    _build(tree)
    _measure_nodes(tree)
    argmax, maximum = np.empty(len(rows), dtype=np.int64), np.empty(len(rows))
    n_products = shared(
        lambda bounds: _search(tree, tie, argmax, maximum, *bounds), pieces(len(rows), multiple=LEAF_SIZE)
    )
    return argmax, maximum, sum(n_products)


def _empty_tree(rows: NDArray[np.float64]) -> Tree:
    """A tree for these rows, in their original order; its nodes are not yet set."""
    n, k = rows.shape
    squares = np.einsum("ij,ij->j", rows, rows)
    tails = squares[::-1].cumsum()[::-1]
    width = max(COLUMN_MULTIPLE, _padded(int(np.count_nonzero(tails > MAX_TAIL_SHARE * tails[0]))))
    padded_rows = np.zeros((n, _padded(k)))
    padded_rows[:, :k] = rows
    n_nodes = 2 * -(-n // LEAF_SIZE) - 1
    return Tree(
        rows=padded_rows,
        order=np.arange(n),
        leaves=np.empty((n_nodes, 2), dtype=np.int64),
        frame=np.zeros((n_nodes, 1 + AXES, width)),
        extent=np.zeros((n_nodes, AXES + 3)),
        smallest=np.full(n_nodes, n),
    )


def _padded(n_columns: int) -> int:
    """The next multiple of `COLUMN_MULTIPLE`."""
    return -(-n_columns // COLUMN_MULTIPLE) * COLUMN_MULTIPLE


@compiled
def _dot(a: NDArray[np.float64], b: NDArray[np.float64]) -> float:
    """Inner product of two vectors."""
    total = 0.0
    for j in range(len(a)):
        total += a[j] * b[j]
    return total


@compiled
def _remove_component(vector: NDArray[np.float64], direction: NDArray[np.float64]) -> None:
    """Subtract from a vector its component along a unit vector."""
    along = _dot(vector, direction)
    for j in range(len(vector)):
        vector[j] -= along * direction[j]


# --- building the tree


def _build(tree: Tree) -> None:
    """Put the rows into tree order; set the leaves and frames of the nodes, and their extents up to max|d_N|."""
    n, n_nodes = len(tree.rows), len(tree.leaves)
    key = np.empty(n)
    tree.leaves[0] = 0, (n_nodes + 1) // 2
    largest_whole = n_nodes // (PIECES_PER_THREAD * number_of_threads()) if worth_sharing(n) else n_nodes

    def build(node: int) -> list[tuple[int]]:
        first, last = tree.leaves[node].tolist()
        n_below = 2 * (last - first) - 1
        if n_below <= largest_whole or n_below == 1:
            _build_tree(tree, key, node, node + n_below)
            return []
        _build_tree(tree, key, node, node + 1)
        return [(node + 1,), (node + 2 * ((first + last) // 2 - first),)]

    spread(build, 0)


@compiled
def _build_tree(tree: Tree, key: NDArray[np.float64], begin: int, end: int) -> None:
    """Do the part of `_build` for the nodes begin … end, whose own leaves the parent of the first has set."""
    n = len(tree.rows)
    sample = np.empty((SAMPLE_SIZE, tree.frame.shape[2]))
    for node in range(begin, end):
        first, last = tree.leaves[node, 0], tree.leaves[node, 1]
        start, stop = first * LEAF_SIZE, min(last * LEAF_SIZE, n)
        _set_frame(tree.rows, start, stop, tree.frame[node], tree.extent[node], key, sample)
        if last - first > 1:
            middle = (first + last) // 2
            tree.leaves[node + 1, 0], tree.leaves[node + 1, 1] = first, middle
            other = node + 2 * (middle - first)
            tree.leaves[other, 0], tree.leaves[other, 1] = middle, last
            _select(key, tree.order, tree.rows, start, stop - 1, middle * LEAF_SIZE)


@compiled
def _set_frame(
    rows: NDArray[np.float64],
    start: int,
    stop: int,
    frame: NDArray[np.float64],
    extent: NDArray[np.float64],
    key: NDArray[np.float64],
    sample: NDArray[np.float64],
) -> None:
    """Set the frame and extents of the node with rows[start:stop]; the keys are coordinates along its first axis."""
    width = frame.shape[1]
    step = (stop - start + SAMPLE_SIZE - 1) // SAMPLE_SIZE
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
    _set_extents(rows, start, stop, frame, extent, key)


@compiled
def _set_axis(sample: NDArray[np.float64], frame: NDArray[np.float64], axis: int) -> None:
    """Set frame[axis] to the direction of most variance in ``sample``, and remove that component from the sample.

    The components along the previous axes have been removed already.
    """
    longest, start = 0.0, 0
    for i in range(len(sample)):
        square = _dot(sample[i], sample[i])
        if square > longest:
            longest, start = square, i
    direction = frame[axis]
    for i in range(len(sample)):
        along = _dot(sample[i], sample[start])
        for j in range(len(direction)):
            direction[j] += along * sample[i, j]
    for _ in range(2):  # orthogonal to working precision only after the second time
        square = _dot(direction, direction)
        for previous in range(1, axis):
            _remove_component(direction, frame[previous])
        remainder = _dot(direction, direction)
        if remainder <= square * ROUNDING:
            direction[:] = 0
            return
        for j in range(len(direction)):
            direction[j] /= np.sqrt(remainder)
    for i in range(len(sample)):
        _remove_component(sample[i], direction)


@inlined
def _set_extents(
    rows: NDArray[np.float64],
    start: int,
    stop: int,
    frame: NDArray[np.float64],
    extent: NDArray[np.float64],
    key: NDArray[np.float64],
) -> None:
    """Set the extents of a node up to max|d_N|, and the keys; move the centre to the middle of each axis."""
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
        for j in range(frame.shape[1]):
            frame[0, j] += (low[axis] + high[axis]) / 2 * frame[axis + 1, j]
        extent[axis] = (high[axis] - low[axis]) / 2
    extent[NORMAL] = np.sqrt(farthest)


@inlined
def _coordinates(row: NDArray[np.float64], frame: NDArray[np.float64]) -> tuple[tuple[float, float, float], float]:
    """⟨d, T_1⟩ … ⟨d, T_a⟩ of a row c + d, and |d|² plus what rounding may have lost; in one pass over the row."""
    square = along_1 = along_2 = along_3 = 0.0
    for j in range(frame.shape[1]):
        offset = row[j] - frame[0, j]
        square += offset * offset
        along_1 += offset * frame[1, j]
        along_2 += offset * frame[2, j]
        along_3 += offset * frame[3, j]
    return (along_1, along_2, along_3), square * (1 + ROUNDING)


@compiled
def _select(
    key: NDArray[np.float64],
    order: NDArray[np.int64],
    rows: NDArray[np.float64],
    low: int,
    high: int,
    middle: int,
) -> None:
    """Rearrange low … high so that no key before ``middle`` exceeds one from it on (Hoare's quickselect)."""
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
def _measure_nodes(tree: Tree) -> None:
    """Set the longest tail, longest row and smallest row index of every node, leaves first."""
    n, width = len(tree.rows), tree.frame.shape[2]
    leaves, extent, smallest = tree.leaves, tree.extent, tree.smallest
    for node in range(len(leaves) - 1, -1, -1):
        first, last = leaves[node, 0], leaves[node, 1]
        if last - first > 1:
            for child in (node + 1, node + 2 * ((first + last) // 2 - first)):
                extent[node, TAIL] = max(extent[node, TAIL], extent[child, TAIL])
                extent[node, LENGTH] = max(extent[node, LENGTH], extent[child, LENGTH])
                smallest[node] = min(smallest[node], smallest[child])
            continue
        for i in range(first * LEAF_SIZE, min(last * LEAF_SIZE, n)):
            head, tail = tree.rows[i, :width], tree.rows[i, width:]
            tail_square = _dot(tail, tail)
            extent[node, TAIL] = max(extent[node, TAIL], np.sqrt(tail_square))
            extent[node, LENGTH] = max(extent[node, LENGTH], np.sqrt(_dot(head, head) + tail_square))
            smallest[node] = min(smallest[node], tree.order[i])


# --- searching


class Best(NamedTuple):
    """The best products found for a query so far.

    value, row : the largest product, and its row
    floor : the least product that ties with it
    answer, answer_value, answer_leaf : the smallest row that ties with it, its product and its leaf
    """

    value: float
    row: int
    floor: float
    answer: int
    answer_value: float
    answer_leaf: int


@compiled
def _search(
    tree: Tree, tie: float, argmax: NDArray[np.int64], maximum: NDArray[np.float64], start: int, stop: int
) -> int:
    """Set the results of the rows start … stop, in tree order; returns the number of inner products."""
    rows, order, leaves, frame, extent, smallest = tree  # in the loops below, attributes of a tuple cost time
    width = frame.shape[2]
    query = np.empty(rows.shape[1])
    products = np.empty(LEAF_SIZE)
    n_products = 0
    first_leaf = start // LEAF_SIZE  # the leaf of the answer to the previous query
    for x in range(start, stop):
        for j in range(len(query)):
            query[j] = rows[x, j]
        head_square, tail_square = _dot(query[:width], query[:width]), _dot(query[width:], query[width:])
        square, row = head_square + tail_square, order[x]
        best = Best(square, row, square * (1 - tie), row, square, x // LEAF_SIZE)
        skipped_tie = True
        while skipped_tie:
            best, skipped_tie, n_scanned = _search_tree(
                rows, order, leaves, frame, extent, smallest,
                query, head_square, tail_square, tie, first_leaf, best, products,
            )  # fmt: skip
            n_products += n_scanned
            if skipped_tie:
                best = Best(best.value, best.row, best.floor, best.row, best.value, best.answer_leaf)
        argmax[row], maximum[row] = best.answer, best.value
        first_leaf = best.answer_leaf
    return n_products


@inlined
def _search_tree(
    rows: NDArray[np.float64],
    order: NDArray[np.int64],
    leaves: NDArray[np.int64],
    frame: NDArray[np.float64],
    extent: NDArray[np.float64],
    smallest: NDArray[np.int64],
    query: NDArray[np.float64],
    head_square: float,
    tail_square: float,
    tie: float,
    first_leaf: int,
    best: Best,
    products: NDArray[np.float64],
) -> tuple[Best, bool, int]:
    """Search all rows for products larger than the best, or ties of a smaller row: ``first_leaf`` first.

    Returns the best, whether a row that ties with it may have been skipped, and the number of inner products.
    """
    length, tail = np.sqrt(head_square + tail_square), np.sqrt(tail_square)
    skipped_tie = False
    n_products = 0
    node = -1  # stands for the first leaf, before the tree
    while node < len(leaves):
        leaf = first_leaf
        if node >= 0:
            first, last = leaves[node, 0], leaves[node, 1]
            if first <= first_leaf < last:  # its bound cannot be below the product that it contains
                node += 1
                continue
            if not _can_contain_answer(
                query, head_square, length, tail, frame[node], extent[node], smallest[node], best
            ):
                node += 2 * (last - first) - 1
                continue
            if last - first > 1:
                node += 1
                continue
            leaf = first
        node += 1
        best, skipped, n_scanned = _scan_leaf(rows, order, query, leaf, tie, best, products)
        skipped_tie |= skipped
        n_products += n_scanned
    return best, skipped_tie, n_products


@inlined
def _can_contain_answer(
    query: NDArray[np.float64],
    head_square: float,
    length: float,
    tail: float,
    frame: NDArray[np.float64],
    extent: NDArray[np.float64],
    smallest: int,
    best: Best,
) -> bool:
    """Whether a node may contain a product larger than the best, or a tie of a smaller row."""
    reach = length * extent[LENGTH]
    if reach < best.floor:
        return False
    bound, along = _products_with_frame(query, frame)
    bound += tail * extent[TAIL]
    across = head_square * (1 + ROUNDING)
    for axis in range(AXES):
        bound += abs(along[axis]) * extent[axis]
        across -= along[axis] ** 2
    bound += np.sqrt(max(across, 0.0)) * extent[NORMAL]
    slack = ROUNDING * reach
    # If no product can be larger than the best, only a tie of a smaller row counts.
    return bound + slack >= best.floor and (bound > best.value + slack or smallest < best.answer)


@inlined
def _products_with_frame(
    query: NDArray[np.float64], frame: NDArray[np.float64]
) -> tuple[float, tuple[float, float, float]]:
    """⟨q, c⟩, and ⟨q, T_1⟩ … ⟨q, T_a⟩."""
    centre = along_1 = along_2 = along_3 = 0.0
    for j in range(frame.shape[1]):
        centre += query[j] * frame[0, j]
        along_1 += query[j] * frame[1, j]
        along_2 += query[j] * frame[2, j]
        along_3 += query[j] * frame[3, j]
    return centre, (along_1, along_2, along_3)


@inlined
def _scan_leaf(
    rows: NDArray[np.float64],
    order: NDArray[np.int64],
    query: NDArray[np.float64],
    leaf: int,
    tie: float,
    best: Best,
    products: NDArray[np.float64],
) -> tuple[Best, bool, int]:
    """Update the best with the rows of a leaf.

    Returns the best with its floor, whether a row that ties with it may have been skipped, and the number of products.
    """
    start = leaf * LEAF_SIZE
    size = min(LEAF_SIZE, len(rows) - start)
    for i in range(size):
        products[i] = _dot(rows[start + i], query)
    value, row, floor, answer, answer_value, answer_leaf = best
    skipped_tie = False
    for i in range(size):
        if products[i] < floor:
            continue
        y = order[start + i]
        if products[i] > value:
            floor = products[i] * (1 - tie)
            if answer_value < floor:
                # Rows that were skipped in favour of the old answer may tie with the new largest product.
                skipped_tie |= value >= floor
                answer, answer_value, answer_leaf = y, products[i], leaf
            value, row = products[i], y
        if y < answer:
            answer, answer_value, answer_leaf = y, products[i], leaf
    return Best(value, row, floor, answer, answer_value, answer_leaf), skipped_tie, size
