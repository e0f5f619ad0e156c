"""Block Lanczos iteration with full reorthogonalisation."""

import numpy as np
import scipy.linalg
from scipy.linalg.blas import dgemm, dtrsm

from heatwalk.numerics.compilation import compiled

# Blocks of the basis that are stored together.
STORED_BLOCKS = 4

# Rows of the basis that are combined at a time.
STRIPE = 2**13


def lanczos(apply, start):
    """Krylov space of a symmetric operator, step by step without end.

    Parameters
    ----------
    apply : function from a (n, w) float array in Fortran order to the operator S times it, a new such array
    start : (n, w) float array in Fortran order, w even; overwritten

    Yields
    ------
    basis : Basis of V, to which the caller may add ``rest`` only to end the iteration
    projected : Vᵀ S V
    rest, coupling : S V = V ``projected`` + ``rest`` @ ``coupling`` in the last block, with rest the next block

    Raises
    ------
    scipy.linalg.LinAlgError
        where nothing is left: V holds all that the iteration ever reaches
    """
    width = start.shape[1]
    basis = Basis(_orthonormal(start)[0])
    projected = np.empty((0, 0))
    while True:
        inner, rest, coupling = basis.split(apply(basis.last))
        projected = np.block([[projected, inner[:-width]], [inner[:-width].T, inner[-width:]]])
        yield basis, projected, rest, coupling
        basis.append(rest)


class Basis:
    """Orthonormal columns that come in blocks; the products with them."""

    def __init__(self, block):
        self._columns = STORED_BLOCKS * block.shape[1]
        self._chunks, self._used = [], self._columns
        self._blocks = []
        self.append(block)

    def append(self, block):
        n, width = block.shape
        if self._used == self._columns:
            self._chunks.append(np.empty((n, self._columns), order="F"))
            self._used = 0
        self._blocks.append(self._chunks[-1][:, self._used : self._used + width])
        self._blocks[-1][:] = block
        self._used += width

    @property
    def last(self):
        return self._blocks[-1]

    def _filled(self):
        return [*self._chunks[:-1], self._chunks[-1][:, : self._used]]

    def split(self, block):
        """``block`` = basis @ inner + rest @ coupling, with rest orthonormal and orthogonal to the basis.

        The image of the last block lies, but for rounding, in the last two blocks and the rest. These are taken out
        first, so that rounding is small against what then remains, and once over the whole basis is enough.
        """
        recent, block = _take_out(self._blocks[-2:], block)
        inner, block = self.take_out(block)
        inner[-len(recent) :] += recent
        return inner, *_orthonormal(block)

    def take_out(self, block):
        """Coefficients of ``block`` in the basis, and what is left of it; overwrites it."""
        return _take_out(self._filled(), block)

    def combined(self, mix):
        """basis @ ``mix``, of no more columns than the basis, which is lost: its memory is used, stripe by stripe."""
        n, columns = len(self.last), mix.shape[1]
        chunks, self._chunks, self._blocks = self._filled(), [], []
        for start in range(0, n, STRIPE):
            stripe = np.concatenate([chunk[start : start + STRIPE] for chunk in chunks], axis=1) @ mix
            for i in range(0, columns, self._columns):
                part = stripe[:, i : i + self._columns]
                chunks[i // self._columns][start : start + STRIPE, : part.shape[1]] = part
        del chunks[-(-columns // self._columns) :]
        result = np.empty((n, columns), order="F")
        for i, chunk in enumerate(chunks):
            part = result[:, i * self._columns : (i + 1) * self._columns]
            part[:] = chunk[:, : part.shape[1]]
        return result


def _take_out(chunks, block):
    """Coefficients of ``block`` in the orthonormal columns of ``chunks``, and what is left of it; overwrites it."""
    return np.concatenate([_project(chunk.T, block.T) for chunk in chunks]), block


@compiled
def _project(rows, block):
    """Take from the rows of ``block`` their parts along ``rows``, orthonormal: the coefficients.

    Modified Gram-Schmidt, two rows from two at a time: memory's speed is the limit, and BLAS, made for larger
    matrices, takes twice as long.
    """
    coefficients = np.empty((len(rows), len(block)))
    for i in range(0, len(rows), 2):
        for j in range(0, len(block), 2):
            a, b, c, d = _products(rows[i], rows[i + 1], block[j], block[j + 1])
            _subtract(rows[i], rows[i + 1], block[j], block[j + 1], a, b, c, d)
            coefficients[i, j], coefficients[i + 1, j] = a, b
            coefficients[i, j + 1], coefficients[i + 1, j + 1] = c, d
    return coefficients


@compiled
def _products(u, v, x, y):
    a = b = c = d = 0.0
    for i in range(len(u)):
        a += u[i] * x[i]
        b += v[i] * x[i]
        c += u[i] * y[i]
        d += v[i] * y[i]
    return a, b, c, d


@compiled
def _subtract(u, v, x, y, a, b, c, d):
    for i in range(len(u)):
        x[i] -= a * u[i] + b * v[i]
        y[i] -= c * u[i] + d * v[i]


def _orthonormal(block):
    """``block`` = q @ r with orthonormal q; overwrites it. LinAlgError where its columns depend on one another.

    By Cholesky's r, twice over, for its speed and because it keeps each row's own precision: Householder's q would
    carry rounding from large rows to the tiny ones of vertices without mass, and spoil the residual there.
    """
    r = np.eye(block.shape[1])
    for _ in range(2):
        triangle = scipy.linalg.cholesky(dgemm(1, block, block, trans_a=True))
        block = dtrsm(1, triangle, block, side=1, overwrite_b=True)
        r = triangle @ r
    return block, r
