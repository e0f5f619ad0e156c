"""Operations on sparse symmetric matrices without superfluous copies."""

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    import scipy.sparse as sp


def scale_symmetric(matrix: "sp.csc_array", scale: NDArray[np.float64]) -> "sp.csr_array":
    """diag(``scale``) @ ``matrix`` @ diag(``scale``) of a symmetric matrix; the result shares its indices."""
    import scipy.sparse as sp

    rows = matrix.T.tocsr()  # the transpose of a csc_array is a csr_array without a copy
    data = rows.data * np.repeat(scale, np.diff(rows.indptr))
    data *= scale[rows.indices]
    return sp.csr_array((data, rows.indices, rows.indptr), shape=matrix.shape)


def permute_symmetric(matrix: "sp.csr_array", order: NDArray[np.integer]) -> "sp.csr_array":
    """``matrix[order][:, order]``."""
    rank = np.empty(len(order), matrix.indices.dtype)
    rank[order] = np.arange(len(order), dtype=rank.dtype)
    rows = matrix[order]
    rows.indices = rank[rows.indices]
    rows.has_sorted_indices = False
    return rows


def diagonal_block(matrix: "sp.csr_array", start: int, stop: int) -> "sp.csr_array":
    """``matrix[start:stop, start:stop]`` of a block-diagonal matrix with a block boundary at ``start`` and ``stop``."""
    import scipy.sparse as sp

    first, last = matrix.indptr[start], matrix.indptr[stop]
    parts = matrix.data[first:last], matrix.indices[first:last] - start, matrix.indptr[start : stop + 1] - first
    return sp.csr_array(parts, shape=(stop - start, stop - start))
