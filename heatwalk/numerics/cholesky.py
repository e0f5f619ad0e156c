"""Sparse Cholesky factorisation of a matrix on a mesh, in dense panels: one panel a separator of nested dissection."""

import numpy as np

from heatwalk.numerics.compilation import compiled

# Panels of at most this many columns are eliminated by loops of our own, wider ones by LAPACK and BLAS.
NARROW = 12

# Pieces wider than this are cut into several panels: half of a panel's square block is zeros, stored and multiplied.
WIDEST = 256

# Entries of the factor that are read ahead of the backward substitution. It goes from the last panel to the first, and
# memory is a third as quick downwards as upwards: so a stretch is read upwards first, and then used from the cache.
AHEAD = 2**15


class Cholesky:
    """A - shift = L Lᵀ, symmetric positive definite, for solving with blocks of right-hand sides.

    Parameters
    ----------
    matrix : (n, n) scipy.sparse.csr_array, A in the order of elimination
    starts : (p + 1,) int array, the pieces of that order (see ``nested_dissection``)
    shift : float

    Notes
    -----
    A panel holds the columns of one piece J: with D the square block of L on its diagonal and F the block below it,
    reduced to the rows that are not zero, it stores D⁻¹ above F D⁻¹. A step of a substitution is then a single product
    with the panel, forwards [D⁻¹; F D⁻¹] x, backwards its transpose: each stored number is read once a pass for all
    right-hand sides, and memory's speed is the limit.
    """

    def __init__(self, matrix, starts, shift=0.0):
        self._starts = starts = _cut(starts, WIDEST)
        # One type, so that the loops are compiled once.
        indptr, indices = (array.astype(np.int32, copy=False) for array in (matrix.indptr, matrix.indices))
        self._row_starts, self._rows = _rows_of_panels(indptr, indices, starts)
        widths = np.diff(starts)
        self._panel_starts = np.append(0, np.cumsum(widths * (widths + np.diff(self._row_starts))))
        self._panels = np.zeros(self._panel_starts[-1])
        _factorise(
            indptr, indices, matrix.data, shift, starts, self._row_starts, self._rows, self._panel_starts, self._panels
        )

    def solve(self, block):
        """(A - shift)⁻¹ ``block``: (n, k) float array, in Fortran order."""
        sides = block.shape[1]
        x = np.zeros((sides + sides % 2, len(block)))
        x[:sides] = block.T
        _substitute(x, self._starts, self._row_starts, self._rows, self._panel_starts, self._panels)
        return x[:sides].T


def _cut(starts, widest):
    """``starts`` of the same pieces, those wider than ``widest`` in as many even ones as it takes."""
    parts = -(-np.diff(starts) // widest)
    part = np.arange(parts.sum()) - np.repeat(np.cumsum(parts) - parts, parts)
    width = np.repeat(np.diff(starts), parts)
    return np.append(np.repeat(starts[:-1], parts) + part * width // np.repeat(parts, parts), starts[-1])


@compiled
def _piece_of(starts):
    piece = np.empty(starts[-1], np.int64)
    for j in range(len(starts) - 1):
        piece[starts[j] : starts[j + 1]] = j
    return piece


@compiled
def _rows_of_panels(indptr, indices, starts):
    """For each piece the rows below its diagonal block in which L is not zero, ascending: ranges, and rows."""
    n_pieces = len(starts) - 1
    piece = _piece_of(starts)
    met = np.full(starts[-1], -1)
    first_child, next_child = np.full(n_pieces, -1), np.full(n_pieces, -1)
    row_starts = np.zeros(n_pieces + 1, np.int64)
    rows = np.empty(8 * starts[-1], np.int32)
    for j in range(n_pieces):
        begin = end = row_starts[j]
        # The matrix's own entries, and what the pieces left over whose first row is in this one.
        for column in range(starts[j], starts[j + 1]):
            if end + indptr[column + 1] - indptr[column] > len(rows):
                rows = np.concatenate((rows, np.empty(len(rows), np.int32)))
            for row in indices[indptr[column] : indptr[column + 1]]:
                if row >= starts[j + 1] and met[row] != j:
                    met[row] = j
                    rows[end] = row
                    end += 1
        child = first_child[j]
        while child >= 0:
            if end + row_starts[child + 1] - row_starts[child] > len(rows):
                rows = np.concatenate((rows, np.empty(len(rows), np.int32)))
            for i in range(row_starts[child], row_starts[child + 1]):
                row = rows[i]
                if row >= starts[j + 1] and met[row] != j:
                    met[row] = j
                    rows[end] = row
                    end += 1
            child = next_child[child]
        rows[begin:end].sort()
        row_starts[j + 1] = end
        if end > begin:
            parent = piece[rows[begin]]
            next_child[j] = first_child[parent]
            first_child[parent] = j
    return row_starts, rows[: row_starts[-1]].copy()


@compiled
def _factorise(indptr, indices, data, shift, starts, row_starts, rows, panel_starts, panels):
    """Put the panels, one behind the other, into ``panels``, which is zero."""
    n_pieces = len(starts) - 1
    piece = _piece_of(starts)
    place = np.empty(starts[-1], np.int64)
    tallest = np.diff(row_starts).max()
    fronts, work = np.empty((NARROW, tallest)), np.empty(tallest)

    for j in range(n_pieces):
        start, width = starts[j], starts[j + 1] - starts[j]
        below = rows[row_starts[j] : row_starts[j + 1]]
        # Column after column: a row of ``panel`` is a column of L, without the zeros.
        panel = panels[panel_starts[j] : panel_starts[j + 1]].reshape(width, width + len(below))
        for i in range(len(below)):
            place[below[i]] = width + i
        for column in range(start, start + width):
            panel[column - start, column - start] -= shift
            for i in range(indptr[column], indptr[column + 1]):
                row = indices[i]
                if row >= start + width:
                    panel[column - start, place[row]] += data[i]
                elif row >= column:
                    panel[column - start, row - start] += data[i]

        if width <= NARROW:
            lower = fronts[:width, : len(below)]
            _eliminate(panel, lower)
        else:
            inverse = np.linalg.inv(np.linalg.cholesky(panel[:, :width].copy().T))
            lower = np.dot(inverse, panel[:, width:].copy())  # Fᵀ
            panel[:, :width] = inverse.T
            panel[:, width:] = np.dot(inverse.T, lower)

        # The update F Fᵀ goes straight to the panels of the pieces that its columns are in.
        i = 0
        while i < len(below):
            k = piece[below[i]]
            k_start, k_width = starts[k], starts[k + 1] - starts[k]
            k_below = rows[row_starts[k] : row_starts[k + 1]]
            target = panels[panel_starts[k] : panel_starts[k + 1]].reshape(k_width, k_width + len(k_below))
            end = i
            while end < len(below) and below[end] < k_start + k_width:
                place[end] = below[end] - k_start
                end += 1
            at = 0
            for m in range(end, len(below)):
                while k_below[at] != below[m]:
                    at += 1
                place[m] = k_width + at
            if width > NARROW:
                update = np.dot(lower[:, i:end].copy().T, lower[:, i:].copy())
                for row in range(end - i):
                    line = target[below[i + row] - k_start]
                    for m in range(row, len(below) - i):
                        line[place[i + m]] -= update[row, m]
            else:
                for row in range(i, end):
                    product = work[: len(below) - row]
                    product[:] = 0
                    for column in range(width):
                        factor, source = lower[column, row], lower[column, row:]
                        for m in range(len(product)):
                            product[m] += factor * source[m]
                    line, places = target[below[row] - k_start], place[row : len(below)]
                    for m in range(len(product)):
                        line[places[m]] -= product[m]
            i = end


@compiled
def _eliminate(panel, lower):
    """Put D⁻¹ above F D⁻¹ in place of a few columns of the matrix in ``panel``, and Fᵀ into ``lower``."""
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
    lower[:] = panel[:, width:]
    # Times D⁻¹, from the last column to the first: each is a combination of those behind it.
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


@compiled
def _substitute(x, starts, row_starts, rows, panel_starts, panels):
    """Both substitutions in place, on the rows of x, two at a time: their number is even."""
    n_pieces = len(starts) - 1
    work = np.empty((2, (np.diff(starts) + np.diff(row_starts)).max()))
    for j in range(n_pieces):
        start, stop = starts[j], starts[j + 1]
        below = rows[row_starts[j] : row_starts[j + 1]]
        width, height = stop - start, stop - start + len(below)
        panel = panels[panel_starts[j] : panel_starts[j + 1]].reshape(width, height)
        one, two = work[0, :height], work[1, :height]
        one_below, two_below = one[width:], two[width:]
        for side in range(0, len(x), 2):
            x_one, x_two = x[side], x[side + 1]
            _multiply(panel, x_one[start:stop], x_two[start:stop], one, two)
            for i in range(width):
                x_one[start + i] = one[i]
                x_two[start + i] = two[i]
            for i in range(len(below)):
                x_one[below[i]] -= one_below[i]
                x_two[below[i]] -= two_below[i]
    read, total = panel_starts[n_pieces], 0.0
    for j in range(n_pieces - 1, -1, -1):
        if panel_starts[j] < read:
            begin = max(0, min(panel_starts[j], read - AHEAD))
            total += _sum(panels[begin:read])
            read = begin
        start, stop = starts[j], starts[j + 1]
        below = rows[row_starts[j] : row_starts[j + 1]]
        width, height = stop - start, stop - start + len(below)
        panel = panels[panel_starts[j] : panel_starts[j + 1]].reshape(width, height)
        one, two = work[0, :height], work[1, :height]
        one_below, two_below = one[width:], two[width:]
        for side in range(0, len(x), 2):
            x_one, x_two = x[side], x[side + 1]
            for i in range(width):
                one[i] = x_one[start + i]
                two[i] = x_two[start + i]
            for i in range(len(below)):
                one_below[i] = -x_one[below[i]]
                two_below[i] = -x_two[below[i]]
            _multiply_transposed(panel, one, two, x_one[start:stop], x_two[start:stop])
    return total  # of no use but that the entries have to be read for it


@compiled
def _sum(entries):
    total = 0.0
    for i in range(len(entries)):
        total += entries[i]
    return total


# One loop for both sides: each entry is read once. (Two or four columns in one loop are slower.)


@compiled
def _multiply(panel, x_one, x_two, one, two):
    """Put ``panel``.T @ x into ``one`` and ``two``."""
    one[:] = 0
    two[:] = 0
    for column in range(len(panel)):
        line, factor_one, factor_two = panel[column], x_one[column], x_two[column]
        for i in range(len(line)):
            one[i] += line[i] * factor_one
            two[i] += line[i] * factor_two


@compiled
def _multiply_transposed(panel, one, two, x_one, x_two):
    """Put ``panel`` @ ``one`` and ``two`` into x."""
    for column in range(len(panel)):
        line = panel[column]
        total_one = total_two = 0.0
        for i in range(len(line)):
            total_one += line[i] * one[i]
            total_two += line[i] * two[i]
        x_one[column], x_two[column] = total_one, total_two
