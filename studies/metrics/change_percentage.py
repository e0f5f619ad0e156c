"""Change Percentage, the share of points whose segment changed, and the matching of segments behind it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray

from studies.columns import Column
from studies.metrics.contingency import contingency_table
from studies.metrics.metric import Metric

if TYPE_CHECKING:
    from scipy.sparse import coo_array

# Tables of at most this many rows and columns together are matched as dense arrays, which takes up to 8 MB.
MAX_DENSE = 2000


def change_percentage(a: ArrayLike, b: ArrayLike) -> float:
    """Twice the share of points that must change their segment, in percent.

    Segments are matched one to one so that as few points as possible change; all points of a segment without
    a partner change. Symmetric, 0 for equal partitions whatever their labels, below 200.

    Parameters
    ----------
    a, b : (n,) int array
        labels of the same n points

    Returns
    -------
    float
        in percent

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    References
    ----------
    W. Benjamin, A. W. Polk, S. V. N. Vishwanathan, K. Ramani, Heat Walk: Robust Salient Segmentation of Non-rigid
    Shapes, Computer Graphics Forum 30 (7), 2011, Table 2.

    Examples
    --------
    >>> change_percentage([0, 0, 0, 0, 1, 1, 1, 1], [4, 4, 4, 2, 2, 2, 2, 2])
    25.0
    """
    table = contingency_table(a, b)
    n, unchanged = table.sum(), table.data[_best_matching(table)].sum()
    return float(200 * (n - unchanged) / n)


def match_labels(reference: ArrayLike, labels: ArrayLike) -> NDArray[np.int64]:
    """Rename labels after the segments of a reference, so that a part keeps its label, and its colour, in all variants.

    Parameters
    ----------
    reference, labels : (n,) int array
        labels of the same n points

    Returns
    -------
    (n,) int64 array
        The same partition as `labels`. A segment has the label of the reference segment that it is matched with
        by the matching behind `change_percentage`. Segments that have no partner, or no point in common with it,
        are numbered from one more than the largest label of the reference, in the order of their own labels.

    Raises
    ------
    ValueError
        If the labels are empty, are not integers, or differ in number.

    Examples
    --------
    >>> match_labels([5, 5, 5, 9], [1, 1, 2, 3])
    array([ 5,  5, 10,  9])
    """
    table = contingency_table(reference, labels)
    reference_labels, (_, segment) = np.unique(reference), np.unique(labels, return_inverse=True)
    cells = _best_matching(table)
    row, column = (numbers[cells] for numbers in table.coords)
    matched = np.zeros(table.shape[1], dtype=bool)
    matched[column] = True
    renamed = np.empty(table.shape[1], dtype=np.int64)
    renamed[column] = reference_labels[row]
    renamed[~matched] = reference_labels[-1] + 1 + np.arange(np.count_nonzero(~matched))
    return renamed[segment]


def _best_matching(table: coo_array) -> NDArray[np.int64]:
    """The one-to-one matching of rows and columns whose cells contain the most points: which cells, ascending.

    Matched rows and columns without a point in common are left out.
    """
    if sum(table.shape) <= MAX_DENSE:
        return _matching_of_dense(table)
    return np.sort(np.concatenate([cells[_best_matching_of_batch(_part(table, cells))] for cells in _batches(table)]))


def _batches(table: coo_array) -> list[NDArray[np.int64]]:
    """The cells in batches that share neither a row nor a column, and so are matched independently of each other."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    row, column = table.coords
    n_rows, n_nodes = table.shape[0], sum(table.shape)
    graph = coo_array((np.ones(table.nnz), (row, n_rows + column)), shape=(n_nodes, n_nodes))
    component = connected_components(graph, directed=False)[1]
    batch_of = np.cumsum(np.bincount(component)) // (MAX_DENSE // 2)  # small components share a batch
    batch = batch_of[component[row]]
    return np.split(np.argsort(batch, kind="stable"), np.cumsum(np.unique(batch, return_counts=True)[1])[:-1])


def _best_matching_of_batch(table: coo_array) -> NDArray[np.int64]:
    return _matching_of_dense(table) if sum(table.shape) <= MAX_DENSE else _matching_of_sparse(table)


def _part(table: coo_array, cells: NDArray[np.int64]) -> coo_array:
    """The table of these cells alone, without empty rows and columns."""
    from scipy.sparse import coo_array

    rows, row = np.unique(table.coords[0][cells], return_inverse=True)
    columns, column = np.unique(table.coords[1][cells], return_inverse=True)
    return coo_array((table.data[cells], (row, column)), shape=(len(rows), len(columns)))


def _matching_of_dense(table: coo_array) -> NDArray[np.int64]:
    """The cells of the best matching of a small table."""
    from scipy.optimize import linear_sum_assignment  # here, because it takes long to import

    return _cells_at(table, *linear_sum_assignment(table.toarray(), maximize=True))


def _matching_of_sparse(table: coo_array) -> NDArray[np.int64]:
    """The cells of the best matching of a large table: time grows with the square of its rows, memory does not."""
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import min_weight_full_bipartite_matching

    (n_rows, n_columns), (row, column) = table.shape, table.coords
    # SciPy matches every row: each may also take a column of its own, which stands for no partner. All contents are
    # raised by one, which alters no comparison of two matchings, because an edge of weight 0 would not count as one.
    alone = np.arange(n_rows)
    weights = np.concatenate([table.data + 1, np.ones(n_rows, table.data.dtype)])
    ends = np.concatenate([row, alone]), np.concatenate([column, n_columns + alone])
    graph = csr_array((weights, ends), shape=(n_rows, n_columns + n_rows))
    matched, partner = min_weight_full_bipartite_matching(graph, maximize=True)
    return _cells_at(table, matched[partner < n_columns], partner[partner < n_columns])


def _cells_at(table: coo_array, row: NDArray[np.integer], column: NDArray[np.integer]) -> NDArray[np.int64]:
    """Which cells of a table are at these rows and columns, those without points left out."""
    n_columns = table.shape[1]
    numbers = table.coords[0].astype(np.int64) * n_columns + table.coords[1]
    return np.flatnonzero(np.isin(numbers, row.astype(np.int64) * n_columns + column))


METRICS = (
    Metric(
        column=Column(
            name="change_percentage",
            heading="CP %",
            format=".2f",
            unit="%",
            lower_is_better=True,
            help="Change Percentage: twice the share of points that must change their segment, under the best "
            "one-to-one matching of segments.",
        ),
        function=lambda comparison: change_percentage(comparison.reference, comparison.labels),
        symmetric=True,
    ),
)
