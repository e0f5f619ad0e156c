"""Sparse Cholesky factorisation in dense panels, one panel per piece of the nested dissection.

A - shift I = L Lᵀ. The columns of L that belong to one piece J form a panel: D, the square block on the diagonal, above
F, the block below it reduced to its non-zero rows R(J). A panel stores [D⁻¹; F D⁻¹] column by column, so that a step of
a substitution is a single product with the panel.

    symbolic factorisation                                                            `_panel_rows`
        for each piece J in order of elimination:
            R(J) = rows below J in the columns J of A, and in R(C) of each child C of J
            parent of J = the piece that contains the first row of R(J)

    numeric factorisation, right-looking                                              `_factorise`
        for each piece J in order of elimination:
            add the columns J of A - shift I to the panel                             `_add_matrix_columns`
            D Dᵀ = block on the diagonal; F = block below it D⁻ᵀ                      `_eliminate_narrow`,
            store [D⁻¹; F D⁻¹] in the panel                                           `_eliminate_wide`
            for each later piece K with columns in R(J):                              `_update_panels`
                subtract the part of F Fᵀ in the columns K from the panel of K        `_subtract_narrow`,
                                                                                      `_subtract_wide`
    forward substitution: L y = x in place                                            `_substitute_forward`
        for each piece J in order of elimination:
            [x(J); z] = [D⁻¹; F D⁻¹] x(J);   x(R(J)) -= z

    backward substitution: Lᵀ x = y in place                                          `_substitute_backward`
        for each piece J in reverse order:
            x(J) = [D⁻¹; F D⁻¹]ᵀ [x(J); -x(R(J))]

Each stored number is read once per pass for two right-hand sides: the speed of memory is the limit.

Parts of the tree of pieces are shared among threads (`heatwalk.numerics.subtrees`). What a part subtracts from places
outside it is kept, and subtracted in the order of the pieces: each number is the result of the same operations in the
same order for any number of threads.

    for each part, subtrees first                                                     `_factorise_part`
        for each earlier part with rows in its columns: wait for it, subtract it      `_update_from`
        factorise it, and keep F of its pieces with rows beyond it                    `_factorise`
"""

from concurrent.futures import Future
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled, inlined
from heatwalk.numerics.subtrees import Part, independent_ranges, stretches
from heatwalk.numerics.threads import number_of_threads, results, shared, started, worth_sharing

if TYPE_CHECKING:
    import scipy.sparse as sp

# Panels of at most this many columns are eliminated by loops, wider ones by LAPACK and BLAS.
MAX_NARROW_WIDTH = 12

# Wider pieces are split into several panels: half of the square block of a panel is zeros, stored and multiplied.
MAX_PANEL_WIDTH = 256

# Entries of the factor that are read ahead of the backward substitution. It visits the panels from last to first, and
# memory is about three times slower downwards than upwards: so a stretch is first read upwards, then used from cache.
READ_AHEAD_ENTRIES = 2**15


class Panels(NamedTuple):
    """The panels of a factor and where they are.

    starts : (p + 1,) int array, panel j has the columns starts[j] … starts[j + 1]
    row_starts, rows : its rows below the diagonal block are rows[row_starts[j] : row_starts[j + 1]], ascending
    entry_starts, entries : its numbers are entries[entry_starts[j] : entry_starts[j + 1]], column by column
    """

    starts: NDArray[np.int64]
    row_starts: NDArray[np.int64]
    rows: NDArray[np.int32]
    entry_starts: NDArray[np.int64]
    entries: NDArray[np.float64]


class Cholesky:
    """A - shift I = L Lᵀ, symmetric positive definite, for solving blocks of right-hand sides.

    Parameters
    ----------
    matrix : (n, n) scipy.sparse.csr_array
        A, in the order of elimination
    piece_starts : (p + 1,) int array
        the pieces of that order (see `heatwalk.numerics.dissection.nested_dissection`)
    shift : float

    Raises
    ------
    numpy.linalg.LinAlgError
        if A - shift I is not positive definite
    """

    def __init__(self, matrix: "sp.csr_array", piece_starts: NDArray[np.int64], shift: float = 0.0) -> None:
        starts = _split_wide_pieces(piece_starts, MAX_PANEL_WIDTH)
        # A single index type, so that the loops are compiled once.
        indptr, indices = (array.astype(np.int32, copy=False) for array in (matrix.indptr, matrix.indices))
        row_starts, rows = _panel_rows(indptr, indices, starts)
        widths = np.diff(starts)
        entry_starts = np.append(0, np.cumsum(widths * (widths + np.diff(row_starts))))
        self._panels = panels = Panels(starts, row_starts, rows, entry_starts, np.zeros(entry_starts[-1]))
        panel_of = _panel_of_columns(starts)
        subtrees = _subtrees(panels, panel_of)
        self._parts = [_part(panels, *bounds, bounds in subtrees) for bounds in stretches(subtrees, len(widths))]
        self._subtrees = [i for i, part in enumerate(self._parts) if part.is_subtree]
        # The largest first: begun last, it would keep the other threads waiting.
        self._subtrees.sort(key=lambda i: -_n_entries(panels, self._parts[i]))
        _factorise_parts(indptr, indices, matrix.data, shift, panels, panel_of, self._parts)

    @property
    def n_entries(self) -> int:
        """Numbers stored in the panels."""
        return len(self._panels.entries)

    def solve(self, block: NDArray[np.float64]) -> NDArray[np.float64]:
        """(A - shift I)⁻¹ ``block``: (n, k) float array in Fortran order."""
        n_sides = block.shape[1]
        x = np.zeros((n_sides + n_sides % 2, len(block)))
        x[:n_sides] = block.T
        kept = [np.empty((len(x), len(part.rows))) for part in self._parts]

        def forward(i: int) -> None:
            _substitute_forward(x, self._panels, self._parts[i].first, self._parts[i].last, kept[i])

        def backward(i: int) -> None:
            _substitute_backward(x, self._panels, self._parts[i].first, self._parts[i].last)

        shared(forward, self._subtrees)
        for part, values in zip(self._parts, kept, strict=True):
            if not part.is_subtree:
                _substitute_forward(x, self._panels, part.first, part.last, values)
            _subtract_kept(x, part.rows, values)
        for part in reversed(self._parts):
            if not part.is_subtree:
                _substitute_backward(x, self._panels, part.first, part.last)
        shared(backward, self._subtrees)
        return x[:n_sides].T


def _split_wide_pieces(starts: NDArray[np.int64], max_width: int) -> NDArray[np.int64]:
    """The starts of the same pieces, those wider than ``max_width`` split evenly into as few as possible."""
    n_parts = -(-np.diff(starts) // max_width)
    part = np.arange(n_parts.sum()) - np.repeat(np.cumsum(n_parts) - n_parts, n_parts)
    width = np.repeat(np.diff(starts), n_parts)
    return np.append(np.repeat(starts[:-1], n_parts) + part * width // np.repeat(n_parts, n_parts), starts[-1])


@compiled
def _panel_of_columns(starts: NDArray[np.int64]) -> NDArray[np.int64]:
    """The panel of each column: (n,) int array."""
    panel_of = np.empty(starts[-1], np.int64)
    for j in range(len(starts) - 1):
        panel_of[starts[j] : starts[j + 1]] = j
    return panel_of


# --- parts that are shared among threads


def _subtrees(panels: Panels, panel_of: NDArray[np.int64]) -> list[tuple[int, int]]:
    """Ranges of panels that need nothing from panels outside them: all panels if there is nothing to share."""
    n_panels = len(panels.starts) - 1
    if not worth_sharing(panels.starts[-1]):
        return [(0, n_panels)]
    has_parent = np.diff(panels.row_starts) > 0
    parents = np.full(n_panels, -1)
    parents[has_parent] = panel_of[panels.rows[panels.row_starts[:-1][has_parent]]]
    return independent_ranges(parents, np.diff(panels.entry_starts), number_of_threads())


def _part(panels: Panels, first: int, last: int, is_subtree: bool) -> Part:
    """A range of panels, with their rows beyond it."""
    bounds = panels.row_starts[first : last + 1]
    rows = panels.rows[bounds[0] : bounds[-1]]
    is_outer = rows >= panels.starts[last]
    n_outer = np.diff(np.append(0, np.cumsum(is_outer))[bounds - bounds[0]])
    return Part(first, last, is_subtree, first + np.flatnonzero(n_outer), rows[is_outer])


def _n_entries(panels: Panels, part: Part) -> int:
    """Numbers stored for the panels of a part."""
    return int(panels.entry_starts[part.last] - panels.entry_starts[part.first])


def _factorise_parts(
    indptr: NDArray[np.int32],
    indices: NDArray[np.int32],
    data: NDArray[np.float64],
    shift: float,
    panels: Panels,
    panel_of: NDArray[np.int64],
    parts: list[Part],
) -> None:
    """Fill the panels, whose entries are zero: each subtree, and each panel of the top, as a task."""
    tasks = [part for part in parts if part.is_subtree]
    tasks.sort(key=lambda part: -_n_entries(panels, part))
    top = [j for part in parts if not part.is_subtree for j in range(part.first, part.last)]
    tasks += [_part(panels, j, j + 1, False) for j in top]

    task_of_panel = np.full(len(panels.starts) - 1, -1)
    task_of_panel[top] = np.arange(len(tasks) - len(top), len(tasks))
    needed: list[list[int]] = [[] for _ in tasks]
    for source in sorted(range(len(tasks)), key=lambda task: tasks[task].first):
        for task in np.unique(task_of_panel[panel_of[tasks[source].rows]]):
            needed[task].append(source)

    futures: list[Future[NDArray[np.float64]]] = []

    def run(task: int) -> NDArray[np.float64]:
        part = tasks[task]
        for source in needed[task]:
            lower = futures[source].result()
            _update_from(panels, part.first, tasks[source].outer, panels.starts[tasks[source].last], lower)
        return _factorise(indptr, indices, data, shift, panels, panel_of, part.first, part.last)

    started(run, range(len(tasks)), into=futures)
    results(futures)


# --- symbolic factorisation


@compiled
def _panel_rows(
    indptr: NDArray[np.int32], indices: NDArray[np.int32], starts: NDArray[np.int64]
) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
    """The non-zero rows of L below the diagonal block of each panel, ascending: row_starts and rows of `Panels`."""
    n_panels = len(starts) - 1
    panel_of = _panel_of_columns(starts)
    last_panel = np.full(starts[-1], -1)  # the last panel to which each row was added
    first_child, next_sibling = np.full(n_panels, -1), np.full(n_panels, -1)
    row_starts = np.zeros(n_panels + 1, np.int64)
    rows = np.empty(8 * starts[-1], np.int32)
    for j in range(n_panels):
        begin = end = row_starts[j]
        for column in range(starts[j], starts[j + 1]):
            column_rows = indices[indptr[column] : indptr[column + 1]]
            rows = _reserve(rows, end + len(column_rows))
            end = _append_new_rows(column_rows, starts[j + 1], j, last_panel, rows, end)
        child = first_child[j]
        while child >= 0:
            rows = _reserve(rows, end + row_starts[child + 1] - row_starts[child])
            child_rows = rows[row_starts[child] : row_starts[child + 1]]
            end = _append_new_rows(child_rows, starts[j + 1], j, last_panel, rows, end)
            child = next_sibling[child]
        rows[begin:end].sort()
        row_starts[j + 1] = end
        if end > begin:
            parent = panel_of[rows[begin]]
            next_sibling[j] = first_child[parent]
            first_child[parent] = j
    return row_starts, rows[: row_starts[-1]].copy()


@compiled
def _reserve(rows: NDArray[np.int32], size: int) -> NDArray[np.int32]:
    """An array with the same contents and room for at least ``size`` (or twice its) entries."""
    if size > len(rows):
        return np.concatenate((rows, np.empty(len(rows), np.int32)))
    return rows


@compiled
def _append_new_rows(
    candidates: NDArray[np.int32],
    panel_end: int,
    panel: int,
    last_panel: NDArray[np.int64],
    rows: NDArray[np.int32],
    end: int,
) -> int:
    """Append the rows from ``panel_end`` on that the panel does not have yet at ``end``; returns the new end."""
    for row in candidates:
        if row >= panel_end and last_panel[row] != panel:
            last_panel[row] = panel
            rows[end] = row
            end += 1
    return end


# --- numeric factorisation


@inlined
def _panel(panels: Panels, j: int) -> tuple[NDArray[np.float64], NDArray[np.int32]]:
    """Panel j, (width, width + rows below): row i is column i of [D; F]; and its rows below the diagonal block."""
    below = panels.rows[panels.row_starts[j] : panels.row_starts[j + 1]]
    width = panels.starts[j + 1] - panels.starts[j]
    entries = panels.entries[panels.entry_starts[j] : panels.entry_starts[j + 1]]
    return entries.reshape(width, width + len(below)), below


@compiled
def _largest_height(panels: Panels, first: int, last: int) -> int:
    """The columns and the rows below the diagonal block of that of these panels that has most of both together."""
    largest = 0
    for j in range(first, last):
        below = panels.row_starts[j + 1] - panels.row_starts[j]
        largest = max(largest, panels.starts[j + 1] - panels.starts[j] + below)
    return largest


@inlined
def _n_before(rows: NDArray[np.int32], end: int) -> int:
    """How many of the ascending rows are before ``end``: nearly always all."""
    n = len(rows)
    while n > 0 and rows[n - 1] >= end:
        n -= 1
    return n


@compiled
def _copy(source: NDArray[np.float64], target: NDArray[np.float64]) -> None:
    """Copy an array of two dimensions.

    An assignment to a slice would do the same, but numba compiles ten seconds on the message for unequal shapes.
    """
    for i in range(source.shape[0]):
        for j in range(source.shape[1]):
            target[i, j] = source[i, j]


@compiled
def _factorise(
    indptr: NDArray[np.int32],
    indices: NDArray[np.int32],
    data: NDArray[np.float64],
    shift: float,
    panels: Panels,
    panel_of: NDArray[np.int64],
    first: int,
    last: int,
) -> NDArray[np.float64]:
    """Fill the panels first … last; returns Fᵀ of their rows beyond the columns of these, one after the other."""
    end = panels.starts[last]
    position = np.empty(panels.starts[-1], np.int64)
    height = _largest_height(panels, first, last)
    buffer, work = np.empty((MAX_NARROW_WIDTH, height)), np.empty(height)
    n_kept = 0
    for j in range(first, last):
        panel, below = _panel(panels, j)
        n_kept += len(panel) * (len(below) - _n_before(below, end))
    kept, at = np.empty(n_kept), 0
    for j in range(first, last):
        panel, below = _panel(panels, j)
        _add_matrix_columns(indptr, indices, data, shift, panels.starts[j], panel, below, position)
        if len(panel) <= MAX_NARROW_WIDTH:
            lower = buffer[: len(panel), : len(below)]
            _eliminate_narrow(panel, lower)
        else:
            lower = _eliminate_wide(panel)
        n_inner = _n_before(below, end)
        _update_panels(panels, panel_of, lower, below, n_inner, position, work)
        size = len(panel) * (len(below) - n_inner)
        _copy(lower[:, n_inner:], kept[at : at + size].reshape(len(panel), len(below) - n_inner))
        at += size
    return kept


@compiled
def _update_from(panels: Panels, k: int, outer: NDArray[np.int64], end: int, kept: NDArray[np.float64]) -> None:
    """Subtract F Fᵀ of the panels ``outer``, whose Fᵀ from the row ``end`` on are ``kept``, from panel k."""
    target, target_below = _panel(panels, k)
    start, stop = panels.starts[k], panels.starts[k + 1]
    at = 0
    for i in range(len(outer)):
        panel, all_below = _panel(panels, outer[i])
        below = all_below[_n_before(all_below, end) :]
        lower = kept[at : at + len(panel) * len(below)].reshape(len(panel), len(below))
        at += lower.size
        first = _n_before(below, start)
        if first == len(below) or below[first] >= stop:
            continue
        position = np.empty(len(below), np.int64)
        last = _locate_rows(below, first, start, stop, target_below, position)
        if len(lower) > MAX_NARROW_WIDTH:
            _subtract_wide(lower, first, last, position, target)
        else:
            _subtract_narrow(lower, first, last, position, target, np.empty(len(below)))


@inlined
def _add_matrix_columns(
    indptr: NDArray[np.int32],
    indices: NDArray[np.int32],
    data: NDArray[np.float64],
    shift: float,
    start: int,
    panel: NDArray[np.float64],
    below: NDArray[np.int32],
    position: NDArray[np.int64],
) -> None:
    """Add the columns of A - shift I, on and below the diagonal, from ``start`` on to their panel."""
    width = len(panel)
    for i in range(len(below)):
        position[below[i]] = width + i
    for column in range(start, start + width):
        panel[column - start, column - start] -= shift
        for i in range(indptr[column], indptr[column + 1]):
            row = indices[i]
            if row >= start + width:
                panel[column - start, position[row]] += data[i]
            elif row >= column:
                panel[column - start, row - start] += data[i]


@inlined
def _eliminate_narrow(panel: NDArray[np.float64], lower: NDArray[np.float64]) -> None:
    """Replace a panel of A by [D⁻¹; F D⁻¹], and put Fᵀ into ``lower``; for a few columns."""
    _cholesky_columns(panel)
    _copy(panel[:, len(panel) :], lower)
    _multiply_by_inverse(panel)


@inlined
def _cholesky_columns(panel: NDArray[np.float64]) -> None:
    """Replace a panel of A by [D; F], column by column."""
    width = len(panel)
    for column in range(width):
        line = panel[column, column:]
        if not line[0] > 0:
            raise np.linalg.LinAlgError("Matrix is not positive definite.")
        scale = 1 / np.sqrt(line[0])
        for i in range(len(line)):
            line[i] *= scale
        for other in range(column + 1, width):
            factor, source, target = panel[column, other], panel[column, other:], panel[other, other:]
            for i in range(len(target)):
                target[i] -= factor * source[i]


@inlined
def _multiply_by_inverse(panel: NDArray[np.float64]) -> None:
    """Replace [D; F] by [D⁻¹; F D⁻¹], from the last column to the first: each is a combination of those after it."""
    width = len(panel)
    for column in range(width - 1, -1, -1):
        scale = 1 / panel[column, column]
        panel[column, column] = 1
        for other in range(width - 1, column, -1):
            factor, source, target = panel[column, other], panel[other, other:], panel[column, other:]
            target[0] = 0
            for i in range(len(target)):
                target[i] -= factor * source[i]
        line = panel[column, column:]
        for i in range(len(line)):
            line[i] *= scale


@inlined
def _eliminate_wide(panel: NDArray[np.float64]) -> NDArray[np.float64]:
    """Replace a panel of A by [D⁻¹; F D⁻¹] and return Fᵀ; for many columns."""
    width = len(panel)
    inverse = np.linalg.inv(np.linalg.cholesky(panel[:, :width].copy().T))
    lower = np.dot(inverse, panel[:, width:].copy())
    _copy(inverse.T, panel[:, :width])
    _copy(np.dot(inverse.T, lower), panel[:, width:])
    return lower


@inlined
def _update_panels(
    panels: Panels,
    panel_of: NDArray[np.int64],
    lower: NDArray[np.float64],
    below: NDArray[np.int32],
    n_inner: int,
    position: NDArray[np.int64],
    work: NDArray[np.float64],
) -> None:
    """Subtract F Fᵀ from the panels that contain the first ``n_inner`` of the columns ``below``; ``lower`` is Fᵀ."""
    first: int = np.int64(0)  # type: ignore[assignment]  # a literal 0 would have all below compiled for it too
    while first < n_inner:
        k = panel_of[below[first]]
        target, target_below = _panel(panels, k)
        last = _locate_rows(below, first, panels.starts[k], panels.starts[k + 1], target_below, position)
        if len(lower) > MAX_NARROW_WIDTH:
            _subtract_wide(lower, first, last, position, target)
        else:
            _subtract_narrow(lower, first, last, position, target, work)
        first = last


@inlined
def _locate_rows(
    below: NDArray[np.int32],
    first: int,
    target_start: int,
    target_end: int,
    target_below: NDArray[np.int32],
    position: NDArray[np.int64],
) -> int:
    """Put the positions of the rows below[first:] in a target panel into ``position``[first:].

    Returns the end of those that are columns of the target.
    """
    last = first
    while last < len(below) and below[last] < target_end:
        position[last] = below[last] - target_start
        last += 1
    at, width = 0, target_end - target_start
    for i in range(last, len(below)):
        while target_below[at] != below[i]:
            at += 1
        position[i] = width + at
    return last


@inlined
def _subtract_wide(
    lower: NDArray[np.float64], first: int, last: int, position: NDArray[np.int64], target: NDArray[np.float64]
) -> None:
    """Subtract the columns first … last of F Fᵀ from a panel, as one matrix product."""
    update = np.dot(lower[:, first:last].copy().T, lower[:, first:].copy())
    for row in range(last - first):
        line = target[position[first + row]]
        for i in range(row, update.shape[1]):
            line[position[first + i]] -= update[row, i]


@inlined
def _subtract_narrow(
    lower: NDArray[np.float64],
    first: int,
    last: int,
    position: NDArray[np.int64],
    target: NDArray[np.float64],
    work: NDArray[np.float64],
) -> None:
    """Subtract the columns first … last of F Fᵀ from a panel, one column at a time."""
    width, n_below = lower.shape
    for row in range(first, last):
        product = work[: n_below - row]
        product[:] = 0
        for column in range(width):
            factor, source = lower[column, row], lower[column, row:]
            for i in range(len(product)):
                product[i] += factor * source[i]
        line, positions = target[position[row]], position[row:n_below]
        for i in range(len(product)):
            line[positions[i]] -= product[i]


# --- substitution. The rows of x are the right-hand sides. Their number is even: two at a time share a pass over the
# panels. (Loops over two or four columns of a panel at a time are slower.)


@compiled
def _substitute_forward(
    x: NDArray[np.float64], panels: Panels, first: int, last: int, kept: NDArray[np.float64]
) -> None:
    """The steps first … last of L⁻¹ on each row of x, in place.

    What is to be subtracted beyond the columns of these panels is put into ``kept``, one value after the other.
    """
    end = panels.starts[last]
    work = np.empty((2, _largest_height(panels, first, last)))
    n_kept = 0
    for j in range(first, last):
        panel, below = _panel(panels, j)
        start, width, n_inner = panels.starts[j], len(panel), _n_before(below, end)
        one, two = work[0, : panel.shape[1]], work[1, : panel.shape[1]]
        one_below, two_below = one[width:], two[width:]
        for side in range(0, len(x), 2):
            x_one, x_two = x[side], x[side + 1]
            _multiply(panel, x_one[start : start + width], x_two[start : start + width], one, two)
            for i in range(width):
                x_one[start + i] = one[i]
                x_two[start + i] = two[i]
            for i in range(n_inner):
                x_one[below[i]] -= one_below[i]
                x_two[below[i]] -= two_below[i]
            for i in range(len(below) - n_inner):
                kept[side, n_kept + i] = one_below[n_inner + i]
                kept[side + 1, n_kept + i] = two_below[n_inner + i]
        n_kept += len(below) - n_inner


@compiled
def _subtract_kept(x: NDArray[np.float64], rows: NDArray[np.int32], kept: NDArray[np.float64]) -> None:
    """Subtract what a forward substitution has kept for these rows."""
    for side in range(len(x)):
        for i in range(len(rows)):
            x[side, rows[i]] -= kept[side, i]


@compiled
def _substitute_backward(x: NDArray[np.float64], panels: Panels, first: int, last: int) -> float:
    """The steps last … first of L⁻ᵀ on each row of x, in place.

    The result is only there to keep the reading ahead from being optimised away.
    """
    work = np.empty((2, _largest_height(panels, first, last)))
    read_from, total = panels.entry_starts[last], 0.0
    for j in range(last - 1, first - 1, -1):
        if panels.entry_starts[j] < read_from:
            begin = max(panels.entry_starts[first], min(panels.entry_starts[j], read_from - READ_AHEAD_ENTRIES))
            total += _sum(panels.entries[begin:read_from])
            read_from = begin
        panel, below = _panel(panels, j)
        start, width = panels.starts[j], len(panel)
        one, two = work[0, : panel.shape[1]], work[1, : panel.shape[1]]
        one_below, two_below = one[width:], two[width:]
        for side in range(0, len(x), 2):
            x_one, x_two = x[side], x[side + 1]
            for i in range(width):
                one[i] = x_one[start + i]
                two[i] = x_two[start + i]
            for i in range(len(below)):
                one_below[i] = -x_one[below[i]]
                two_below[i] = -x_two[below[i]]
            _multiply_transposed(panel, one, two, x_one[start : start + width], x_two[start : start + width])
    return total


@compiled
def _sum(entries: NDArray[np.float64]) -> float:
    """Sum of an array: reads it into the cache."""
    total = 0.0
    for i in range(len(entries)):
        total += entries[i]
    return total


@compiled
def _multiply(
    panel: NDArray[np.float64],
    x_one: NDArray[np.float64],
    x_two: NDArray[np.float64],
    one: NDArray[np.float64],
    two: NDArray[np.float64],
) -> None:
    """Put ``panel``.T @ x into ``one`` and ``two``."""
    one[:] = 0
    two[:] = 0
    for column in range(len(panel)):
        line, factor_one, factor_two = panel[column], x_one[column], x_two[column]
        for i in range(len(line)):
            one[i] += line[i] * factor_one
            two[i] += line[i] * factor_two


@compiled
def _multiply_transposed(
    panel: NDArray[np.float64],
    one: NDArray[np.float64],
    two: NDArray[np.float64],
    x_one: NDArray[np.float64],
    x_two: NDArray[np.float64],
) -> None:
    """Put ``panel`` @ ``one`` and ``two`` into x."""
    for column in range(len(panel)):
        line = panel[column]
        total_one = total_two = 0.0
        for i in range(len(line)):
            total_one += line[i] * one[i]
            total_two += line[i] * two[i]
        x_one[column], x_two[column] = total_one, total_two
