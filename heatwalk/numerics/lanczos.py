"""Block Lanczos iteration with full reorthogonalisation.

V = orthonormal basis of the start block                                          `_orthonormalise`
repeat:
    W = S times the last block of V
    W = V C + Q R, with Q orthonormal and orthogonal to V                         `Basis.split`
        take out the components in the last two blocks, which are all of them but for rounding
        take out the components in all of V: once is then enough
        orthonormalise the rest
    extend the projection Vᵀ S V by C
    yield V, Vᵀ S V, Q, R: the caller derives eigenpairs and their errors, and stops when satisfied
    V = [V, Q]
"""

from collections.abc import Callable, Iterator, Sequence

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled
from heatwalk.numerics.threads import Result, number_of_threads, shared, worth_sharing

# Rows over which products are summed at a time: as many as stay in the cache while the basis passes by.
PIECE = 2**12

# Columns of the basis that are stored together. Memory that is not filled yet is not taken either.
COLUMNS_PER_CHUNK = 32

# Rows of the basis that are combined at a time.
STRIPE = 2**13

Array = NDArray[np.float64]


def lanczos(apply: Callable[[Array], Array], start: Array) -> Iterator[tuple["Basis", Array, Array, Array]]:
    """Build the Krylov space of a symmetric operator step by step, without end.

    Parameters
    ----------
    apply : function
        from an (n, w) float array in Fortran order to the operator S times it, a new such array
    start : (n, w) float array in Fortran order
        w even; overwritten

    Yields
    ------
    basis : Basis
        V; the caller may append ``rest`` only if it then ends the iteration
    projected : (p, p) float array
        Vᵀ S V
    rest : (n, w) float array
        the next block: S V = V ``projected``, plus ``rest`` @ ``coupling`` in the last w columns
    coupling : (w, w) float array

    Raises
    ------
    scipy.linalg.LinAlgError
        if nothing remains: V contains everything that the iteration can reach

    Examples
    --------
    >>> eigenvalues = 0.5 ** np.arange(40)
    >>> start = np.asfortranarray(np.random.default_rng(0).standard_normal((40, 2)))
    >>> iteration = lanczos(lambda block: np.asfortranarray(eigenvalues[:, None] * block), start)
    >>> for _ in range(8):
    ...     basis, projected, rest, coupling = next(iteration)
    >>> np.allclose(np.linalg.eigvalsh(projected)[-3:], [0.25, 0.5, 1])
    True
    """
    width = start.shape[1]
    squares = _sum(lambda first, last: _products_with([start], start.T, first, last), *start.shape)
    basis = Basis(_orthonormalise(start, squares)[0])
    projected = np.empty((0, 0))
    while True:
        inner, rest, coupling = basis.split(apply(basis.last))
        projected = np.block([[projected, inner[:-width]], [inner[:-width].T, inner[-width:]]])
        yield basis, projected, rest, coupling
        basis.append(rest)


class Basis:
    """Orthonormal columns that are added block by block, and products with them.

    Parameters
    ----------
    block : (n, w) float array
        the first w columns, orthonormal
    """

    def __init__(self, block: Array) -> None:
        width = block.shape[1]
        self._columns = width * max(1, COLUMNS_PER_CHUNK // width)
        self._chunks: list[Array] = []
        self._blocks: list[Array] = []
        self._used = self._columns  # columns of the last chunk
        self.append(block)

    def append(self, block: Array) -> None:
        """Add a block of orthonormal columns, orthogonal to the present ones."""
        n, width = block.shape
        if self._used == self._columns:
            self._chunks.append(np.empty((n, self._columns), order="F"))
            self._used = 0
        self._blocks.append(self._chunks[-1][:, self._used : self._used + width])
        self._used += width

        def copy(start: int, stop: int) -> None:
            self._blocks[-1][start:stop] = block[start:stop]

        _on_pieces(copy, n, width)

    @property
    def last(self) -> Array:
        """The block added last."""
        return self._blocks[-1]

    @property
    def _shape(self) -> tuple[int, int]:
        """The rows and columns."""
        n, width = self.last.shape
        return n, width * len(self._blocks)

    def _filled(self) -> list[Array]:
        """The chunks, the last one as far as it is filled."""
        return [*self._chunks[:-1], self._chunks[-1][:, : self._used]]

    def split(self, block: Array) -> tuple[Array, Array, Array]:
        """``block`` = basis @ inner + rest @ coupling, with rest orthonormal and orthogonal to the basis.

        The image of the last block is, but for rounding, in the span of the last two blocks and the rest. Their
        components are removed first: rounding is then small relative to what remains, and a single pass over the whole
        basis is enough. Each pass is over pieces of the rows, and pieces are shared among threads.
        """
        chunks, recent, rows = self._filled(), self._blocks[-2:], block.T
        first = _sum(lambda start, stop: _products_with(recent, rows, start, stop), *recent[0].shape)

        def remove_first(start: int, stop: int) -> Array:
            _remove(recent, first, rows, start, stop)
            return _products_with(chunks, rows, start, stop)

        inner = _sum(remove_first, *self._shape)

        def remove_inner(start: int, stop: int) -> Array:
            _remove(chunks, inner, rows, start, stop)
            return _products_with([block], rows, start, stop)

        rest, coupling = _orthonormalise(block, _sum(remove_inner, *self._shape))
        inner[-len(first) :] += first
        return inner, rest, coupling

    def remove_components(self, block: Array) -> tuple[Array, Array]:
        """Coefficients of ``block`` in the basis, and what remains of it; overwrites it."""
        chunks, rows = self._filled(), block.T
        coefficients = _sum(lambda start, stop: _products_with(chunks, rows, start, stop), *self._shape)
        _on_pieces(lambda start, stop: _remove(chunks, coefficients, rows, start, stop), *self._shape)
        return coefficients, block

    def combine(self, mix: Array) -> Array:
        """basis @ ``mix``, with at most as many columns as the basis, which is lost: the result reuses its memory."""
        n, columns = len(self.last), mix.shape[1]
        chunks, self._chunks, self._blocks = self._filled(), [], []

        def combine_rows(start: int) -> None:
            rows = slice(start, start + STRIPE)
            stripe = np.concatenate([chunk[rows] for chunk in chunks], axis=1) @ mix
            for i in range(0, columns, self._columns):
                part = stripe[:, i : i + self._columns]
                chunks[i // self._columns][rows, : part.shape[1]] = part

        shared(combine_rows, range(0, n, STRIPE))
        del chunks[-(-columns // self._columns) :]
        result = np.empty((n, columns), order="F")
        for i, chunk in enumerate(chunks):
            part = result[:, i * self._columns : (i + 1) * self._columns]
            part[:] = chunk[:, : part.shape[1]]
        return result


def _on_pieces(function: Callable[[int, int], Result], n: int, columns: int) -> list[Result]:
    """What a function returns for ranges of 0 … n that begin at multiples of `PIECE`, one for each thread.

    ``columns`` is how many it works on.
    """
    n_pieces = -(-n // PIECE)
    n_ranges = min(number_of_threads(), n_pieces) if worth_sharing(n, columns) else 1
    bounds = [min(i * n_pieces // n_ranges * PIECE, n) for i in range(n_ranges + 1)]
    return shared(function, bounds[:-1], bounds[1:])


def _sum(function: Callable[[int, int], Array], n: int, columns: int) -> Array:
    """The sum of all rows that a function returns for ranges of 0 … n, a row for each piece.

    Neither the pieces nor the order in which they are added depend on the number of threads.
    """
    return np.concatenate(_on_pieces(function, n, columns)).sum(axis=0)


def _products_with(chunks: Sequence[Array], rows: Array, start: int, stop: int) -> Array:
    """The products of the columns of ``chunks`` with ``rows``, each over the pieces of a range."""
    return np.concatenate([_multiply(chunk.T, rows, start, stop) for chunk in chunks], axis=1)


def _remove(chunks: Sequence[Array], coefficients: Array, rows: Array, start: int, stop: int) -> None:
    """Subtract the columns of ``chunks`` times their coefficients from a range of ``rows``."""
    at = 0
    for chunk in chunks:
        _subtract(chunk.T, rows, start, stop, coefficients[at : at + chunk.shape[1]])
        at += chunk.shape[1]


@compiled
def _multiply(basis: Array, rows: Array, start: int, stop: int) -> Array:
    """basis @ rows.T over each piece of a range of their columns: (pieces, len(basis), len(rows)) array.

    Two rows with two at a time: the speed of memory is the limit, and BLAS, made for larger matrices, takes longer.
    """
    products = np.empty(((stop - start + PIECE - 1) // PIECE, len(basis), len(rows)))
    for piece in range(len(products)):
        first = start + piece * PIECE
        last = min(first + PIECE, stop)
        for i in range(0, len(basis), 2):
            u, v = basis[i, first:last], basis[i + 1, first:last]
            for j in range(0, len(rows), 2):
                a, b, c, d = _products(u, v, rows[j, first:last], rows[j + 1, first:last])
                products[piece, i, j], products[piece, i + 1, j] = a, b
                products[piece, i, j + 1], products[piece, i + 1, j + 1] = c, d
    return products


@compiled
def _products(u: Array, v: Array, x: Array, y: Array) -> tuple[float, float, float, float]:
    """⟨u, x⟩, ⟨v, x⟩, ⟨u, y⟩, ⟨v, y⟩ in one pass."""
    a = b = c = d = 0.0
    for i in range(len(u)):
        a += u[i] * x[i]
        b += v[i] * x[i]
        c += u[i] * y[i]
        d += v[i] * y[i]
    return a, b, c, d


@compiled
def _subtract(basis: Array, rows: Array, start: int, stop: int, coefficients: Array) -> None:
    """Subtract basis.T @ ``coefficients`` from a range of the columns of ``rows``."""
    for first in range(start, stop, PIECE):
        last = min(first + PIECE, stop)
        for i in range(0, len(basis), 2):
            u, v = basis[i, first:last], basis[i + 1, first:last]
            for j in range(0, len(rows), 2):
                x, y = rows[j, first:last], rows[j + 1, first:last]
                a, b = coefficients[i, j], coefficients[i + 1, j]
                c, d = coefficients[i, j + 1], coefficients[i + 1, j + 1]
                for k in range(len(u)):
                    x[k] -= a * u[k] + b * v[k]
                    y[k] -= c * u[k] + d * v[k]


@compiled
def _divide(rows: Array, triangle: Array, start: int, stop: int) -> None:
    """Replace the columns start … stop of ``rows`` by the inverse of ``triangle``.T times them."""
    for j in range(len(rows)):
        x = rows[j, start:stop]
        for i in range(j):
            y, factor = rows[i, start:stop], triangle[i, j]
            for k in range(len(x)):
                x[k] -= factor * y[k]
        scale = 1 / triangle[j, j]
        for k in range(len(x)):
            x[k] *= scale


def _orthonormalise(block: Array, squares: Array) -> tuple[Array, Array]:
    """``block`` = q @ r with orthonormal q; overwrites it. LinAlgError if its columns are linearly dependent.

    ``squares`` is block.T @ block.

    By Cholesky QR, applied twice: for its speed, and because each row keeps its own precision. Householder reflections
    would carry rounding errors from large rows to the tiny rows of vertices without mass, and spoil the residual there.
    """

    def divide(start: int, stop: int) -> Array:
        _divide(block.T, triangle, start, stop)
        return _products_with([block], block.T, start, stop)

    triangle = first = scipy.linalg.cholesky(squares)
    triangle = scipy.linalg.cholesky(_sum(divide, *block.shape))
    _on_pieces(lambda start, stop: _divide(block.T, triangle, start, stop), *block.shape)
    return block, triangle @ first
