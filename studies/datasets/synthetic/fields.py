"""The function whose zeros are the surface of a shape: the smooth union of its limbs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from studies.datasets.synthetic.solids import Array, Solid, dot

# In blends: how far from a limb it still counts. Beyond, its weight is below e⁻¹⁰: it moves the surface by less than
# 2e-6.
REACH = 10.0
REACH_ON_GRID = 4.0  # vertices on a grid are projected afterwards

TIE = 1e-9  # between distances that differ by rounding alone

PROJECTION_STEPS = 4  # of Newton's method: from a hundredth of the shape off to the rounding error


@dataclass(frozen=True, eq=False)
class Field:
    """Minus ``blend`` times the logarithm of the sum of ``exp(-distance / blend)`` over limbs: below 0 inside.

    Parameters
    ----------
    solids : sequence of Solid
        one for each limb
    blend : float
        over which length limbs melt into each other
    n_parts : int
    """

    solids: Sequence[Solid]
    blend: float
    n_parts: int

    def value_and_gradient(self, points: Array) -> tuple[Array, Array]:
        """The function and its gradient at some points near the surface, (n,) and (n, 3)."""
        nearest = self._nearest(points)
        value, weights = self._blended(nearest)
        gradient = np.zeros_like(points)
        for each, weight in zip(nearest, weights, strict=True):
            reached = weight > 0
            away = points[reached] - each.centre[reached]
            gradient[reached] += (weight[reached] / np.sqrt(dot(away, away)))[:, None] * away
        return value, gradient

    def carried(self, points: Array, other: Field) -> Array:
        """Where points near the surface are in another pose, if each limb takes along what is near to it."""
        nearest = self._nearest(points)
        _, weights = self._blended(nearest)
        carried = np.zeros_like(points)
        for here, there, each, weight in zip(self.solids, other.solids, nearest, weights, strict=True):
            reached, piece = weight > 0, each.piece[weight > 0]
            relative = points[reached] - here.origins[piece]
            unturned = np.einsum("nji,nj->ni", here.rotations[piece], relative)
            turned = there.origins[piece] + np.einsum("nij,nj->ni", there.rotations[piece], unturned)
            carried[reached] += weight[reached, None] * turned
        return carried

    def _nearest(self, points: Array) -> list[_Nearest]:
        return [_nearest(solid, points, REACH * self.blend) for solid in self.solids]

    def _blended(self, nearest: Sequence[_Nearest]) -> tuple[Array, Array]:
        """The function, (n,), and how much of its gradient each limb contributes, (limbs, n)."""
        distances = np.array([each.distance for each in nearest])
        least = distances.min(axis=0)
        if np.isinf(least).any():
            raise ValueError(f"a point is more than {REACH * self.blend:g} outside the box of every limb")
        weights = np.exp((least - distances) / self.blend)
        total = weights.sum(axis=0)
        return least - self.blend * np.log(total), weights / total

    def part_distances(self, points: Array) -> Array:
        """How far each part is from some points near the surface, (n, parts); infinite if it is out of reach."""
        distances = np.full((len(points), self.n_parts), np.inf)
        for solid in self.solids:
            for piece, (inside, distance, _) in enumerate(_pieces(solid, points, REACH * self.blend)):
                part = solid.parts[piece]
                distances[inside, part] = np.minimum(distances[inside, part], distance)
        return distances

    def labels(self, points: Array) -> NDArray[np.int64]:
        """The part that is nearest to each point; the first of those that share the nearest ball of a joint."""
        distances = self.part_distances(points)
        return (distances <= distances.min(axis=1, keepdims=True) + TIE).argmax(axis=1)

    def projected(self, points: Array, steps: int = PROJECTION_STEPS) -> Array:
        """The points moved along the gradient onto the surface."""
        for _ in range(steps):
            value, gradient = self.value_and_gradient(points)
            points = points - (value / (gradient * gradient).sum(axis=1))[:, None] * gradient
        return points

    def bounds(self) -> tuple[Array, Array]:
        """The corners of a box that contains the surface."""
        low, high = zip(*(solid.boxes() for solid in self.solids), strict=True)
        margin = self.blend * np.log(len(self.solids))
        return np.vstack(low).min(axis=0) - margin, np.vstack(high).max(axis=0) + margin

    def on_grid(self, start: Array, spacing: float, counts: NDArray[np.int64]) -> Array:
        """The function on a grid, exact near the surface; elsewhere outside, no more than a bound."""
        margin = REACH_ON_GRID * self.blend + 2 * spacing
        total = np.zeros(counts)
        for solid in self.solids:
            boxes = list(zip(*(_cells(box, start, spacing, counts) for box in _grown(solid, margin)), strict=True))
            first, last = np.min([box[0] for box in boxes], axis=0), np.max([box[1] for box in boxes], axis=0) + 1
            distance = np.full(last - first, np.inf)
            for piece, (low, high) in enumerate(boxes):
                axes = [start[axis] + spacing * np.arange(low[axis], high[axis] + 1) for axis in range(3)]
                points = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)
                inside = tuple(slice(a - f, b - f + 1) for a, b, f in zip(low, high, first, strict=True))
                here = solid.nearest(points, np.array(piece))[0]
                distance[inside] = np.minimum(distance[inside], here)
            total[tuple(map(slice, first, last))] += np.exp(-distance / self.blend)
        smallest = np.exp(-margin / self.blend)
        return -self.blend * np.log(np.maximum(total, smallest))


@dataclass(frozen=True, eq=False)
class _Nearest:
    """The distances of points from a limb, the nearest pieces of it, and the centres of the nearest balls."""

    distance: Array
    piece: NDArray[np.int64]
    centre: Array


def _nearest(solid: Solid, points: Array, reach: float) -> _Nearest:
    """What is nearest within reach; beyond it the distance is infinite."""
    least, pieces = np.full(len(points), np.inf), np.zeros(len(points), dtype=np.int64)
    centres = np.zeros_like(points)
    for piece, (inside, distance, centre) in enumerate(_pieces(solid, points, reach)):
        closer = distance < least[inside]
        chosen = inside[closer]
        least[chosen], pieces[chosen], centres[chosen] = distance[closer], piece, centre[closer]
    return _Nearest(least, pieces, centres)


def _pieces(solid: Solid, points: Array, reach: float) -> Iterator[tuple[NDArray[np.int64], Array, Array]]:
    """For each piece the points within reach of its box, their distances, and the centres of the nearest balls."""
    low, high = _grown(solid, reach)
    near = _inside(points, low.min(axis=0), high.max(axis=0))
    candidates = points[near]
    for piece in range(len(solid.parts)):
        inside = _inside(candidates, low[piece], high[piece])
        yield near[inside], *solid.nearest(candidates[inside], np.array(piece))


def _inside(points: Array, low: Array, high: Array) -> NDArray[np.int64]:
    """Which points are in a box."""
    x, y, z = points.T
    return np.flatnonzero(
        (x >= low[0]) & (x <= high[0]) & (y >= low[1]) & (y <= high[1]) & (z >= low[2]) & (z <= high[2])
    )


def _grown(solid: Solid, margin: float) -> tuple[Array, Array]:
    """The boxes of a solid's pieces with a margin."""
    low, high = solid.boxes()
    return low - margin, high + margin


def _cells(corners: Array, start: Array, spacing: float, counts: NDArray[np.int64]) -> NDArray[np.int64]:
    """The grid points nearest to the corners of boxes."""
    return np.clip(np.rint((corners - start) / spacing).astype(np.int64), 0, counts - 1)
