"""Smooth bending of space, and of the shape in it."""

from __future__ import annotations

from dataclasses import dataclass
from math import comb
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._displacement import deform
from perturb.meshes import LENGTHS, random_direction
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh

UNITS = {"lattice": "bounding_box_diagonal", "bend": "degrees"}


@dataclass(frozen=True)
class Bending(Perturbation):
    """Deform the mesh freely by a lattice of control points, or bend it about one axis.

    Parameters
    ----------
    amount : float
        The largest displacement of a control point along each axis, or the angle between the directions of the shape's
        two ends, depending on `method`.
    unit : str
        "bounding_box_diagonal" for the method "lattice", "degrees" for "bend".
    method : str
        "lattice": free-form deformation by a cubic lattice of control points around the shape, each displaced at
        random, by up to `amount` along each axis. "bend": the longest side of the bounding box becomes an arc, in a
        random direction perpendicular to it.
    control_points : int
        Of the lattice, along each axis, at least 2; one more than the degree of the polynomial.

    Notes
    -----
    The lattice fills the smallest cube around the bounding box. A vertex moves by a mean of the control points'
    displacements, weighted by Bernstein polynomials, so by less than these: the displacements that were reached are in
    `Perturbed.applied`. Space does not fold: the determinant of the Jacobian matrix is positive at every vertex
    (``smallest_volume_ratio`` is its smallest value). Control points are drawn again, up to MAX_TRIES times, until that
    is so; an amount with which it is not raises PerturbationError. Parts that are far apart on the surface can still
    meet in space.

    References
    ----------
    Free-form deformation: Sederberg and Parry 1986, doi:10.1145/15886.15903. Bending: Barr 1984,
    doi:10.1145/964965.808573.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> rod = trimesh.creation.box(extents=[1, 1, 12]).subdivide().subdivide().subdivide()
    >>> bend = perturb.Bending(amount=180, unit="degrees", method="bend")
    >>> bent = bend.apply(rod, {"direction": np.array([1.0, 0.0, 0.0])})
    >>> rod.extents.round(1).tolist(), bent.mesh.extents.round(1).tolist()
    ([1.0, 1.0, 12.0], [4.3, 1.0, 8.6])
    """

    amount: float = 0.15
    unit: str = "bounding_box_diagonal"
    method: str = "lattice"
    control_points: int = 4

    name: ClassVar[str] = "bending"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": tuple(UNITS.values()), "method": tuple(UNITS)}

    MAX_TRIES: ClassVar[int] = 100

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("control_points", whole=True)
        if self.control_points < 2:
            raise PerturbationError(f"bending: control_points is {self.control_points}; it must be at least 2")
        if self.unit != UNITS[self.method]:
            raise PerturbationError(
                f"bending: unit is {self.unit!r}, but method={self.method} needs unit={UNITS[self.method]}"
            )

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `offsets` (c, c, c, 3) of control points, in ±1, or `direction` (3,), a unit vector."""
        if self.method == "bend":
            return {"direction": random_direction(rng)}
        for _ in range(self.MAX_TRIES):
            offsets = rng.uniform(-1, 1, (int(self.control_points),) * 3 + (3,))
            _, volume_ratio = self._deform_freely(mesh, offsets)
            if volume_ratio.min() > 0:
                return {"offsets": offsets}
        raise self._folded()

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        if self.method == "lattice":
            displacement, volume_ratio = self._deform_freely(mesh, parameters["offsets"])
        else:
            displacement, volume_ratio = self._bend(mesh, parameters["direction"])
        if volume_ratio.min() <= 0:
            raise self._folded()
        result, counterpart, facts = deform(self, mesh, displacement)
        return self.finish(
            mesh,
            result,
            counterpart,
            smallest_volume_ratio=float(volume_ratio.min()),
            **facts,
        )

    def _folded(self) -> PerturbationError:
        return PerturbationError(
            f"bending, {self.amount:g} {self.unit}: space would fold, and the surface turn inside out; choose a "
            "smaller amount"
        )

    def _deform_freely(self, mesh: trimesh.Trimesh, offsets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) displacements by the lattice, and (n,) the determinant of the Jacobian matrix."""
        side = mesh.extents.max()
        place = (np.asarray(mesh.vertices) - mesh.bounds.mean(axis=0)) / side + 0.5  # in the unit cube
        weights = _bernstein(place, offsets.shape[0] - 1)
        slopes = _bernstein_slopes(place, offsets.shape[0] - 1)
        scale = self.amount * LENGTHS[self.unit](mesh)

        def combine(x: np.ndarray, y: np.ndarray, z: np.ndarray) -> np.ndarray:
            return np.einsum("ni,nj,nk,ijkd->nd", x, y, z, offsets, optimize=True)

        gradient = np.stack(
            [
                combine(*(slopes[:, axis] if axis == along else weights[:, axis] for axis in range(3)))
                for along in range(3)
            ],
            axis=2,
        )
        jacobian = np.eye(3) + scale / side * gradient
        return scale * combine(weights[:, 0], weights[:, 1], weights[:, 2]), np.linalg.det(jacobian)

    def _bend(self, mesh: trimesh.Trimesh, direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(n, 3) displacements by bending, and (n,) the determinant of the Jacobian matrix."""
        displacement = np.zeros(mesh.vertices.shape)
        if self.amount == 0:
            return displacement, np.ones(len(displacement))
        axis = int(mesh.extents.argmax())
        across = direction - direction[axis] * np.eye(3)[axis]
        across /= np.linalg.norm(across)
        offset = np.asarray(mesh.vertices) - mesh.bounds.mean(axis=0)
        radius = mesh.extents[axis] / np.radians(self.amount)
        angle, height = offset[:, axis] / radius, offset @ across
        displacement += ((radius - height) * (1 - np.cos(angle)))[:, None] * across
        displacement[:, axis] += (radius - height) * np.sin(angle) - offset[:, axis]
        return displacement, 1 - height / radius


def _bernstein(x: np.ndarray, degree: int) -> np.ndarray:
    """(n, 3, degree + 1) the Bernstein polynomials at each of (n, 3) values."""
    return np.stack([comb(degree, i) * x**i * (1 - x) ** (degree - i) for i in range(degree + 1)], axis=-1)


def _bernstein_slopes(x: np.ndarray, degree: int) -> np.ndarray:
    """(n, 3, degree + 1) the derivatives of the Bernstein polynomials at each of (n, 3) values."""
    lower = np.pad(_bernstein(x, degree - 1), ((0, 0), (0, 0), (1, 1)))
    return degree * (lower[..., :-1] - lower[..., 1:])
