"""Non-uniform sampling: the same surface, with many vertices in some places and few in others."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._places import draw_places
from perturb._remeshing import closest_points, nearest_corners, remesh_isotropically, require_even_size
from perturb._welding import Packing, find_parts
from perturb.meshes import as_trimesh, random_direction
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Sampling(Perturbation):
    """Sample the surface again, with a density of vertices that varies from place to place.

    Parameters
    ----------
    amount : float
        The ratio of the largest density of vertices to the smallest, at least 1; 1, the neutral amount, leaves the mesh
        unchanged.
    unit : str
        "ratio_of_densities".
    field : str
        Where the surface is dense. "random": around some random places, and coarse around as many others. "direction":
        at one end of the shape in a random direction, and coarse at the other.
    places : int
        How many places of the random field; half of them, rounded up, are dense.
    radius : float
        Standard deviation of the Gaussian bell around each place, relative to the longest side of the bounding box.

    Notes
    -----
    The logarithm of the density is a smooth function: the sum of the bells, or the height. The number of faces remains
    about the same. Triangles are nearly equilateral: the surface is remeshed isotropically (by pymeshlab), one of BANDS
    bands of about equal density after the other, and the new vertices are projected onto the original surface. Edges
    sharper than SHARP_ANGLE degrees are preserved.

    ``density_ratio_reached`` in `Perturbed.applied` is the ratio according to a fit of the areas of the triangles;
    narrow bands and preserved edges keep it below what was asked for. If it is below the square root of that, a
    PerturbationError reports it. Counterparts, coinciding vertices and components are treated as by
    `perturb.Tessellation`, whose method "irregular" varies the size of triangles by a map of space instead.

    References
    ----------
    A perturbation of SHREC's robustness tracks ("sampling"). Isotropic remeshing: Botsch and Kobbelt 2004,
    doi:10.1145/1057432.1057457.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(subdivisions=4)
    >>> uneven = perturb.Sampling(amount=16, field="direction").apply(sphere, {"direction": np.array([0.0, 0.0, 1.0])})
    >>> bool((uneven.mesh.vertices[:, 2] < 0).sum() > 2 * (uneven.mesh.vertices[:, 2] > 0).sum())
    True
    """

    amount: float = 8.0
    unit: str = "ratio_of_densities"
    field: str = "random"
    places: int = 6
    radius: float = 0.2

    name: ClassVar[str] = "sampling"
    neutral: ClassVar[float] = 1.0
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": ("ratio_of_densities",),
        "field": ("random", "direction"),
    }

    BANDS: ClassVar[int] = 6
    ITERATIONS: ClassVar[int] = 2
    SHARP_ANGLE: ClassVar[float] = 45.0  # degrees between the normals of two faces

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.amount < 1:
            raise PerturbationError(
                f"sampling: amount is {self.amount:g}; it must be at least 1, which leaves the mesh unchanged"
            )
        self.check_number("places", positive=True, whole=True)
        self.check_number("radius", positive=True)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `vertices` (k,), the places, dense and coarse ones alternately, or `direction` (3,), a unit vector."""
        if self.field == "direction":
            return {"direction": random_direction(rng)}
        return {"vertices": draw_places(mesh, int(self.places), rng, self.name)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        if self.amount == self.neutral:
            result, counterpart, reached = as_trimesh(mesh.vertices, mesh.faces), np.arange(len(mesh.vertices)), 1.0
        else:
            result, counterpart, reached = self._resample(mesh, parameters)
        return self.finish(
            mesh,
            result,
            counterpart,
            density_ratio_reached=reached,
            ratio_of_faces=len(result.faces) / len(mesh.faces),
            counterpart_by="closest_point",
        )

    def _resample(self, mesh: trimesh.Trimesh, parameters: Parameters) -> tuple[trimesh.Trimesh, np.ndarray, float]:
        """Return the resampled surface, (n,) the counterpart of each vertex, and the ratio of densities."""
        faces, used = np.asarray(mesh.faces), np.unique(mesh.faces)
        # In a box of size 1, so that the result does not depend on the mesh's own unit.
        corner, size = mesh.bounds[0], mesh.extents.max()
        vertices = (np.asarray(mesh.vertices) - corner) / size
        part = find_parts(vertices, faces)
        packing = Packing(vertices, faces, part)
        packed = packing.pack(vertices, part)
        require_even_size(packed, faces, self.name)

        coarseness = _Coarseness(packed, used, parameters, self.radius)
        new_packed, new_faces = self._remesh_in_bands(packed, faces, coarseness)
        reached = _fitted_ratio(new_packed, new_faces, coarseness)
        if reached < np.sqrt(self.amount):
            raise PerturbationError(
                f"sampling: a ratio of densities of {self.amount:g} was requested, but {reached:.3g} reached; choose a "
                "smaller amount, a larger radius, or a finer mesh without sharp edges"
            )
        triangle, weights = closest_points(packed, faces, new_packed)
        new_vertices, new_part = np.einsum("ij,ijk->ik", weights, vertices[faces[triangle]]), part[faces[triangle, 0]]
        counterpart = np.full(len(vertices), -1)
        counterpart[used] = nearest_corners(packing.pack(new_vertices, new_part), new_faces, packed[used])
        return as_trimesh(new_vertices * size + corner, new_faces), counterpart, reached

    def _remesh_in_bands(
        self, vertices: np.ndarray, faces: np.ndarray, coarseness: _Coarseness
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the vertices and faces of the surface with edges whose length grows with the coarseness."""
        from trimesh.triangles import area

        corners = vertices[faces]
        areas = area(corners)
        # So many faces as before: the integral of the density, as that of equilateral triangles, is their number.
        shortest = np.sqrt(
            np.sum(areas / self.amount ** coarseness(corners.mean(axis=1))) / len(faces) * 4 / np.sqrt(3)
        )
        mean_length = np.sqrt(areas.sum() / len(faces) * 4 / np.sqrt(3))
        # Evenly first, so that the densities of the mesh itself do not remain at the borders of the bands.
        vertices, faces = self._remesh(vertices, faces, mean_length)
        for band in range(self.BANDS):
            of_face = np.minimum((coarseness(vertices[faces].mean(axis=1)) * self.BANDS).astype(int), self.BANDS - 1)
            length = shortest * self.amount ** ((band + 0.5) / self.BANDS / 2)
            # All coarser bands with it, where edges become longer: a single band is too narrow for them.
            selected = of_face == band if length < mean_length else of_face >= band
            if selected.any():
                vertices, faces = self._remesh(vertices, faces, length, selected)
        return vertices, faces

    def _remesh(
        self, vertices: np.ndarray, faces: np.ndarray, length: float, selected: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        return remesh_isotropically(
            vertices, faces, length, iterations=self.ITERATIONS, sharp_angle=self.SHARP_ANGLE, selected=selected
        )


class _Coarseness:
    """A smooth function of points: 0 where the surface is densest, 1 where it is coarsest."""

    def __init__(self, vertices: np.ndarray, used: np.ndarray, parameters: Parameters, radius: float) -> None:
        self._direction = parameters.get("direction")
        if self._direction is None:
            self._places = vertices[parameters["vertices"]]
        self._radius = radius
        values = self._value(vertices[used])
        self._low, self._range = values.min(), np.ptp(values)

    def __call__(self, points: np.ndarray) -> np.ndarray:
        """(k,) values at (k, 3) points."""
        return np.clip((self._value(points) - self._low) / self._range, 0, 1)

    def _value(self, points: np.ndarray) -> np.ndarray:
        if self._direction is not None:
            return points @ self._direction
        value = np.zeros(len(points))
        for number, place in enumerate(self._places):
            bell = np.exp(-np.sum((points - place) ** 2, axis=1) / (2 * self._radius**2))
            value += bell if number % 2 else -bell
        return value


def _fitted_ratio(vertices: np.ndarray, faces: np.ndarray, coarseness: _Coarseness) -> float:
    """The ratio of densities at the coarsenesses 0 and 1, by a least-squares line through the logarithms of areas."""
    from trimesh.triangles import area

    corners = vertices[faces]
    areas = area(corners)
    proper = areas > 0
    slope, _ = np.polyfit(coarseness(corners.mean(axis=1))[proper], np.log(areas[proper]), 1, w=np.sqrt(areas[proper]))
    return float(np.exp(slope))
