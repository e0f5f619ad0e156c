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
from scipy.linalg.blas import dgemm, dtrsm

from heatwalk.numerics.compilation import compiled
from heatwalk.numerics.threads import shared

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
    basis = Basis(_orthonormalise(start)[0])
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
        self._blocks = [block]

    def append(self, block: Array) -> None:
        """Add a block of orthonormal columns, orthogonal to the present ones; not copied if it is in Fortran order."""
        self._blocks.append(np.asfortranarray(block))

    @property
    def last(self) -> Array:
        """The block added last."""
        return self._blocks[-1]

    def split(self, block: Array) -> tuple[Array, Array, Array]:
        """``block`` = basis @ inner + rest @ coupling, with rest orthonormal and orthogonal to the basis.

        The image of the last block is, but for rounding, in the span of the last two blocks and the rest. Their
        components are removed first: rounding is then small relative to what remains, and a single pass over the whole
        basis is enough.
        """
        recent, block = _remove_components(self._blocks[-2:], block)
        inner, block = self.remove_components(block)
        inner[-len(recent) :] += recent
        return inner, *_orthonormalise(block)

    def remove_components(self, block: Array) -> tuple[Array, Array]:
        """Coefficients of ``block`` in the basis, and what remains of it; overwrites it."""
        return _remove_components(self._blocks, block)

    def combine(self, mix: Array) -> Array:
        """basis @ ``mix``, with at most as many columns as the basis, which is lost: the result reuses its memory."""
        (n, width), columns = self.last.shape, mix.shape[1]
        blocks, self._blocks = self._blocks, []

        def combine_rows(start: int) -> None:
            rows = slice(start, start + STRIPE)
            stripe = np.concatenate([block[rows] for block in blocks], axis=1) @ mix
            for i in range(0, columns, width):
                part = stripe[:, i : i + width]
                blocks[i // width][rows, : part.shape[1]] = part

        shared(combine_rows, range(0, n, STRIPE))
        del blocks[-(-columns // width) :]
        result = np.empty((n, columns), order="F")
        for i, block in enumerate(blocks):
            part = result[:, i * width : (i + 1) * width]
            part[:] = block[:, : part.shape[1]]
        return result


def _remove_components(blocks: Sequence[Array], block: Array) -> tuple[Array, Array]:
    """Coefficients of ``block`` in the orthonormal columns of ``blocks``, and what remains of it; overwrites it."""
    return np.concatenate([_project(each.T, block.T) for each in blocks]), block


@compiled
def _project(rows: Array, block: Array) -> Array:
    """Remove from the rows of ``block`` their components along the orthonormal ``rows``; returns the coefficients.

    Modified Gram-Schmidt, two rows from two at a time: the speed of memory is the limit, and BLAS, made for larger
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
def _subtract(u: Array, v: Array, x: Array, y: Array, a: float, b: float, c: float, d: float) -> None:
    """x -= a u + b v and y -= c u + d v in one pass."""
    for i in range(len(u)):
        x[i] -= a * u[i] + b * v[i]
        y[i] -= c * u[i] + d * v[i]


def _orthonormalise(block: Array) -> tuple[Array, Array]:
    """``block`` = q @ r with orthonormal q; overwrites it. LinAlgError if its columns are linearly dependent.

    By Cholesky QR, applied twice: for its speed, and because each row keeps its own precision. Householder reflections
    would carry rounding errors from large rows to the tiny rows of vertices without mass, and spoil the residual there.
    """
    r = np.eye(block.shape[1])
    for _ in range(2):
        triangle = scipy.linalg.cholesky(dgemm(1, block, block, trans_a=True))
        block = dtrsm(1, triangle, block, side=1, overwrite_b=True)
        r = triangle @ r
    return block, r
