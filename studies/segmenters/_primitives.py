"""Merging regions that a plane, a sphere or a cylinder fits well."""

import heapq

import numpy as np
from numpy.typing import NDArray

from heatwalk.numerics.compilation import compiled
from studies.segmenters._merging import Regions, is_left, join, linked_regions, next_pair, numbered, pairs_of

_TURN = 1e-15  # rotations by less, relative to the trace, end the iteration of Jacobi
_FLAT = 1e-12  # variances below this, relative to the largest, are rounding


@compiled
def merge_by_primitives(
    pairs: NDArray[np.int64],
    bends: NDArray[np.float64],
    moments: NDArray[np.float64],
    normals: NDArray[np.float64],
    concavity: float,
    n_regions: int,
) -> NDArray[np.int64]:
    """Merge neighbours until ``n_regions`` are left, or none are neighbours: the pair first that a primitive fits best.

    Parameters
    ----------
    pairs : (p, 2) int array
        adjacent faces
    bends : (p, 2) float array
        length of the edge between them, and its product with the angle in radians if it is concave; overwritten by the
        sums over the border of two regions
    moments : (m, 10, 10) float array
        integrals of the products of the monomials 1, x, y, z, xx, yy, zz, xy, xz, yz over each face; overwritten by
        those of the regions
    normals : (m, 3, 3) float array
        integrals of the products of the components of the normals; overwritten too
    concavity : float
        the error of a union counts 1 + concavity × the mean concave angle of the border within it
    n_regions : int
        number of regions at which to stop

    Returns
    -------
    (m,) int64 array
        for each face the number of its region, numbered in the order of their first faces
    """
    regions = linked_regions(pairs, bends, len(moments))
    work, scatter, axes = np.empty((10, 10)), np.empty((3, 3)), np.empty((3, 3))
    heap = [(0.0, 0, 0) for _ in range(0)]
    for i in range(len(pairs)):
        if is_left(regions, i):
            heap.append((_cost(regions, i, moments, normals, concavity, work, scatter, axes), i, 0))
    heapq.heapify(heap)
    left = len(moments)
    while left > n_regions:
        i = next_pair(heap, regions)
        if i < 0:
            break
        kept, gone = join(regions, i)
        _add(moments, kept, gone)
        _add(normals, kept, gone)
        for j in pairs_of(regions, kept):
            cost = _cost(regions, j, moments, normals, concavity, work, scatter, axes)
            heapq.heappush(heap, (cost, j, regions.version[j]))
        left -= 1
    return numbered(regions)


@compiled
def primitive_errors(
    moments: NDArray[np.float64], normals: NDArray[np.float64], axes: NDArray[np.float64]
) -> tuple[float, float, float]:
    """Integrals of the squared distance of a region from the plane, the sphere and the cylinder that fit it.

    The distance from a sphere or a cylinder of radius r is approximated by (d² - r²) / 2r, where d is that from its
    centre or axis; the axis is the direction in which the normals vary least.

    Parameters
    ----------
    moments : (10, 10) float array
    normals : (3, 3) float array
        as in `merge_by_primitives`
    axes : (3, 3) float array
        working memory
    """
    # Loops instead of operations on arrays, which take several times as long to compile.
    area = moments[0, 0]
    if area <= 0:
        return 0.0, 0.0, 0.0
    mean, covariance, scatter = np.empty(3), np.empty((3, 3)), normals.copy()
    for i in range(3):
        mean[i] = moments[0, 1 + i] / area
    for i in range(3):
        for j in range(3):
            covariance[i, j] = moments[1 + i, 1 + j] / area - mean[i] * mean[j]
    variances = covariance.copy()
    _diagonalise(variances, axes)
    plane = max(min(variances[0, 0], variances[1, 1], variances[2, 2]), 0.0)
    # A sphere is where |x|² is a linear function of x; a cylinder, where that of the projection is.
    square = np.zeros(6)
    square[:3] = 1.0
    sphere = _residual(moments, mean, variances, axes, square, 3)
    _diagonalise(scatter, axes)
    _largest_first(scatter, axes)
    for i in range(3):
        square[i] -= axes[i, 2] ** 2
    square[3] = -2 * axes[0, 2] * axes[1, 2]
    square[4] = -2 * axes[0, 2] * axes[2, 2]
    square[5] = -2 * axes[1, 2] * axes[2, 2]
    mixed = _form(axes, covariance, 0, 1)
    difference = _form(axes, covariance, 0, 0) - _form(axes, covariance, 1, 1)
    turn = 0.5 * np.arctan2(2 * mixed, difference)
    c, s = np.cos(turn), np.sin(turn)
    for i in range(3):
        axes[i, 0], axes[i, 1] = c * axes[i, 0] + s * axes[i, 1], c * axes[i, 1] - s * axes[i, 0]
    for i in range(2):
        variances[i, i] = _form(axes, covariance, i, i)
    cylinder = _residual(moments, mean, variances, axes, square, 2)
    return area * plane, area * sphere, area * cylinder


@compiled
def _form(axes: NDArray[np.float64], matrix: NDArray[np.float64], i: int, j: int) -> float:
    """The product of an axis, a 3 x 3 matrix and an axis."""
    total = 0.0
    for k in range(3):
        for n in range(3):
            total += axes[k, i] * matrix[k, n] * axes[n, j]
    return total


@compiled
def _cost(
    regions: Regions,
    i: int,
    moments: NDArray[np.float64],
    normals: NDArray[np.float64],
    concavity: float,
    work: NDArray[np.float64],
    scatter: NDArray[np.float64],
    axes: NDArray[np.float64],
) -> float:
    """The error of the primitive that fits the two regions of a pair best, larger across a concave border."""
    a, b = regions.ends[i, 0], regions.ends[i, 1]
    for j in range(10):
        for k in range(10):
            work[j, k] = moments[a, j, k] + moments[b, j, k]
    for j in range(3):
        for k in range(3):
            scatter[j, k] = normals[a, j, k] + normals[b, j, k]
    plane, sphere, cylinder = primitive_errors(work, scatter, axes)
    length, bend = regions.weights[i, 0], regions.weights[i, 1]
    return min(plane, sphere, cylinder) * (1 + concavity * (bend / length if length > 0 else 0.0))


@compiled
def _add(matrices: NDArray[np.float64], to: int, of: int) -> None:
    """Add one of several matrices to another."""
    for j in range(matrices.shape[1]):
        for k in range(matrices.shape[2]):
            matrices[to, j, k] += matrices[of, j, k]


@compiled
def _residual(
    moments: NDArray[np.float64],
    mean: NDArray[np.float64],
    variances: NDArray[np.float64],
    axes: NDArray[np.float64],
    square: NDArray[np.float64],
    n_axes: int,
) -> float:
    """The mean squared distance from the quadric on which a sum of squares is linear in the first coordinates."""
    area = moments[0, 0]
    level = rest = 0.0
    with_points = np.zeros(3)
    for i in range(6):
        level += square[i] * moments[0, 4 + i] / area
        for j in range(6):
            rest += square[i] * moments[4 + i, 4 + j] * square[j] / area
        for k in range(3):
            with_points[k] += square[i] * moments[1 + k, 4 + i] / area
    rest -= level**2
    largest = max(variances[0, 0], variances[1, 1], variances[2, 2] if n_axes == 3 else 0.0)
    squared_radius = level
    for i in range(n_axes):
        middle = slope = 0.0
        for k in range(3):
            middle += axes[k, i] * mean[k]
            slope += axes[k, i] * (with_points[k] - level * mean[k])
        centre = middle
        if variances[i, i] > _FLAT * largest:
            slope /= variances[i, i]
            rest -= slope**2 * variances[i, i]
            centre = slope / 2
        squared_radius += centre**2 - 2 * centre * middle
    if squared_radius <= 0:
        return np.inf
    return max(rest, 0.0) / (4 * squared_radius)


@compiled
def _diagonalise(matrix: NDArray[np.float64], axes: NDArray[np.float64]) -> None:
    """Make a symmetric 3 x 3 matrix diagonal, by Jacobi's rotations; the columns of ``axes`` are its eigenvectors."""
    axes[:] = 0.0
    for i in range(3):
        axes[i, i] = 1.0
    trace = abs(matrix[0, 0]) + abs(matrix[1, 1]) + abs(matrix[2, 2])
    for _ in range(20):
        if abs(matrix[0, 1]) + abs(matrix[0, 2]) + abs(matrix[1, 2]) <= _TURN * trace:
            return
        for i in range(2):
            for j in range(i + 1, 3):
                if matrix[i, j] == 0.0:
                    continue
                angle = 0.5 * np.arctan2(2 * matrix[i, j], matrix[i, i] - matrix[j, j])
                c, s = np.cos(angle), np.sin(angle)
                for k in range(3):
                    x, y = matrix[k, i], matrix[k, j]
                    matrix[k, i], matrix[k, j] = c * x + s * y, c * y - s * x
                for k in range(3):
                    x, y = matrix[i, k], matrix[j, k]
                    matrix[i, k], matrix[j, k] = c * x + s * y, c * y - s * x
                for k in range(3):
                    x, y = axes[k, i], axes[k, j]
                    axes[k, i], axes[k, j] = c * x + s * y, c * y - s * x


@compiled
def _largest_first(matrix: NDArray[np.float64], axes: NDArray[np.float64]) -> None:
    """Order the columns of ``axes`` so that the one with the smallest eigenvalue is the last."""
    least = 0
    for i in range(1, 3):
        if matrix[i, i] < matrix[least, least]:
            least = i
    if least < 2:
        for k in range(3):
            axes[k, least], axes[k, 2] = axes[k, 2], axes[k, least]
