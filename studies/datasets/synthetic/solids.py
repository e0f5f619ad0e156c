"""Round solids: hulls of two or three balls, and what a chain of them sweeps about an axis.

The distance of a point from such a solid is the least, over the balls between those of the corners, of its distance
from the centre less the radius. It is known in closed form, and so is the centre of the nearest ball, in whose
direction the gradient points.

J.-M. Thiery, É. Guy, T. Boubekeur, Sphere-Meshes: Shape Approximation using Spherical Quadric Error Metrics, ACM Trans.
Graph. 32 (6), 2013, doi:10.1145/2508363.2508384.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Nearest = tuple[Array, Array]  # signed distances (…,), and centres (…, 3) of the nearest balls

Y_AXIS = 1  # about which a lathed solid is round


def dot(a: Array, b: Array) -> Array:
    """The inner product over the last axis of length 3, summed in a fixed order (BLAS may choose another)."""
    return a[..., 0] * b[..., 0] + a[..., 1] * b[..., 1] + a[..., 2] * b[..., 2]


def nearest_on_cone(points: Array, start: Array, end: Array, radius: Array, end_radius: Array) -> Nearest:
    """Distance from the hull of two balls, and the centre of the nearest ball between them.

    Parameters
    ----------
    points, start, end : (…, 3) float arrays
        points in space, and the centres of the two balls; they are broadcast
    radius, end_radius : (…) float arrays
        of the balls; they differ by less than their centres, or by nothing

    Returns
    -------
    distance : (…) float array
        below 0 inside
    centre : (…, 3) float array

    Examples
    --------
    >>> a, b = np.array([0.0, 0.0, 0.0]), np.array([2.0, 0.0, 0.0])
    >>> distance, centre = nearest_on_cone(np.array([1.0, 3.0, 0.0]), a, b, np.array(0.5), np.array(0.5))
    >>> float(distance), centre.tolist()
    (2.5, [1.0, 0.0, 0.0])
    """
    axis = end - start
    length = np.sqrt(dot(axis, axis))
    safe = np.where(length > 0, length, 1.0)  # two equal balls are one
    axis = axis / safe[..., None]
    slope = (end_radius - radius) / safe
    relative = points - start
    along = dot(relative, axis)
    off_axis = relative - along[..., None] * axis
    across = np.sqrt(dot(off_axis, off_axis))
    # Where the derivative of the distance from the centre less the radius is 0.
    share = np.clip((along + slope * across / np.sqrt(1 - slope * slope)) / safe, 0.0, 1.0)
    step = share * length
    distance = np.sqrt((along - step) ** 2 + across * across) - (radius + share * (end_radius - radius))
    return distance, start + step[..., None] * axis


def nearest_on_triangle(points: Array, corners: Array, radii: Array) -> Nearest:
    """Distance from the hull of three balls, and the centre of the nearest ball between them.

    Parameters
    ----------
    points : (…, 3) float array
    corners : (…, 3, 3) float array
        centres of the balls, by ball and coordinate
    radii : (…, 3) float array
        none of the three contains another

    Returns
    -------
    distance : (…) float array
        below 0 inside
    centre : (…, 3) float array

    Examples
    --------
    >>> corners = np.array([[0.0, 0.0, 0.0], [3.0, 0.0, 0.0], [0.0, 3.0, 0.0]])
    >>> distance, centre = nearest_on_triangle(np.array([1.0, 1.0, 2.0]), corners, np.full(3, 0.5))
    >>> float(distance), centre.tolist()
    (1.5, [1.0, 1.0, 0.0])
    """
    origin, u, v = corners[..., 0, :], corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    uu, uv, vv = dot(u, u), dot(u, v), dot(v, v)
    determinant = uu * vv - uv * uv
    rise_u, rise_v = radii[..., 1] - radii[..., 0], radii[..., 2] - radii[..., 0]
    # The gradient of the radius in the plane of the triangle.
    along_u = (rise_u * vv - rise_v * uv) / determinant
    along_v = (rise_v * uu - rise_u * uv) / determinant
    gradient = along_u[..., None] * u + along_v[..., None] * v
    steepness = np.sqrt(1 - dot(gradient, gradient))
    normal = np.cross(u, v) / np.sqrt(determinant)[..., None]
    relative = points - origin
    height = dot(relative, normal)
    foot = relative - height[..., None] * normal + (np.abs(height) / steepness)[..., None] * gradient
    foot_u, foot_v = dot(foot, u), dot(foot, v)
    share_u, share_v = (foot_u * vv - foot_v * uv) / determinant, (foot_v * uu - foot_u * uv) / determinant
    inside = (share_u >= 0) & (share_v >= 0) & (share_u + share_v <= 1)
    distance = np.where(inside, np.abs(height) / steepness - radii[..., 0] - dot(gradient, foot), np.inf)
    centre = origin + foot
    for i, j in ((0, 1), (1, 2), (2, 0)):  # elsewhere the nearest ball is one of an edge, for the distance is convex
        edge_distance, edge_centre = nearest_on_cone(
            points, corners[..., i, :], corners[..., j, :], radii[..., i], radii[..., j]
        )
        closer = ~inside & (edge_distance < distance)
        distance = np.where(closer, edge_distance, distance)
        centre = np.where(closer[..., None], edge_centre, centre)
    return distance, centre


@dataclass(frozen=True, eq=False)
class Solid(ABC):
    """The union of some pieces in a row, each of which belongs to a part of the shape.

    Parameters
    ----------
    parts : (p,) int array
        the part of each piece
    origins : (p, 3) float array
        a point that each piece takes along when it is posed
    rotations : (p, 3, 3) float array
        how each piece is turned against the rest pose
    """

    parts: NDArray[np.int64]
    origins: Array
    rotations: Array

    @abstractmethod
    def nearest(self, points: Array, pieces: NDArray[np.int64]) -> Nearest:
        """Signed distances from pieces and centres of the nearest balls; points (…, 3), pieces (…) are broadcast."""

    @abstractmethod
    def boxes(self) -> tuple[Array, Array]:
        """The least and largest coordinates of each piece."""


@dataclass(frozen=True, eq=False)
class Cones(Solid):
    """Round cones.

    Parameters
    ----------
    starts, ends : (p, 3) float arrays
    radii : (p, 2) float array
        at the starts and at the ends
    """

    starts: Array
    ends: Array
    radii: Array

    def nearest(self, points: Array, pieces: NDArray[np.int64]) -> Nearest:
        """See `Solid.nearest`."""
        radii = self.radii[pieces]
        return nearest_on_cone(points, self.starts[pieces], self.ends[pieces], radii[..., 0], radii[..., 1])

    def boxes(self) -> tuple[Array, Array]:
        """See `Solid.boxes`."""
        low = np.minimum(self.starts - self.radii[:, :1], self.ends - self.radii[:, 1:])
        return low, np.maximum(self.starts + self.radii[:, :1], self.ends + self.radii[:, 1:])


@dataclass(frozen=True, eq=False)
class Triangles(Solid):
    """Round triangles.

    Parameters
    ----------
    corners : (p, 3, 3) float array
        by piece, corner and coordinate
    radii : (p, 3) float array
    """

    corners: Array
    radii: Array

    def nearest(self, points: Array, pieces: NDArray[np.int64]) -> Nearest:
        """See `Solid.nearest`."""
        return nearest_on_triangle(points, self.corners[pieces], self.radii[pieces])

    def boxes(self) -> tuple[Array, Array]:
        """See `Solid.boxes`."""
        radii = self.radii[..., None]
        return (self.corners - radii).min(axis=1), (self.corners + radii).max(axis=1)


@dataclass(frozen=True, eq=False)
class Lathed(Solid):
    """What round cones in a half-plane sweep about an axis: bowls, discs, rings.

    Parameters
    ----------
    centre : (3,) float array
        the point of the axis where y is 0
    frame : (3, 3) float array
        turns coordinates in which y is the axis to those of the shape
    profile : Cones
        in the half-plane x ≥ 0, z = 0
    """

    centre: Array
    frame: Array
    profile: Cones

    def nearest(self, points: Array, pieces: NDArray[np.int64]) -> Nearest:
        """See `Solid.nearest`."""
        relative = points - self.centre
        x, y, z = (dot(relative, self.frame[:, axis]) for axis in range(3))
        around = np.sqrt(x * x + z * z)
        distance, flat = self.profile.nearest(np.stack([around, y, np.zeros_like(y)], axis=-1), pieces)
        on_axis = around == 0
        ratio = flat[..., 0] / np.where(on_axis, 1.0, around)
        local = np.stack([np.where(on_axis, flat[..., 0], ratio * x), flat[..., 1], ratio * z], axis=-1)
        turned = np.stack([dot(local, self.frame[axis]) for axis in range(3)], axis=-1)
        return distance, self.centre + turned

    def boxes(self) -> tuple[Array, Array]:
        """See `Solid.boxes`: of the cylinder that contains the piece."""
        low, high = self.profile.boxes()
        axis = self.frame[:, Y_AXIS]
        across = high[:, :1] * np.sqrt(np.maximum(1 - axis * axis, 0.0))
        ends = low[:, Y_AXIS, None] * axis, high[:, Y_AXIS, None] * axis
        return self.centre + np.minimum(*ends) - across, self.centre + np.maximum(*ends) + across
