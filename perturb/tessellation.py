"""Tessellation: other triangles for the same surface, at any density."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._remeshing import closest_points, nearest_corners, remesh_isotropically, require_even_size
from perturb._welding import Packing, count_coincident, find_parts
from perturb.meshes import as_trimesh, random_direction
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class Tessellation(Perturbation):
    """Replace the triangles of the surface by others, more or fewer.

    Parameters
    ----------
    amount : float
        The ratio of the number of faces to that before. 1 is another tessellation of the same density; 0, the neutral
        amount, leaves the mesh unchanged.
    unit : str
        "ratio_of_faces".
    method : str
        "isotropic": nearly equilateral triangles of uniform size. "subdivision": each triangle is divided into four at
        the midpoints of its edges, as often as needed; amount must be 4, 16, 64 … "anisotropic": triangles longer by
        `stretch` in one random direction. "irregular": nearly equilateral triangles whose size grows by `grading` from
        an extremity of the shape in a random direction to what is farthest from there.
    stretch : float
        For anisotropic triangles, the ratio of the length along the direction to that across, above 1. This is the
        target; preserved edges and curvature reduce it by up to a half. Where the surface is perpendicular to the
        direction, triangles are not elongated.
    grading : float
        For irregular triangles, the ratio of the longest edges to the shortest, above 1.

    Notes
    -----
    Isotropic remeshing (pymeshlab's) splits, collapses and flips edges, which preserves the topology, and shifts
    vertices along the surface. The other two methods are isotropic in a warped space: compressed along the direction,
    or inverted in a sphere, which preserves angles and changes sizes. All new vertices are on the original surface.
    The edge length is searched for in up to MAX_TRIES tries, until the number of faces is met within TOLERANCE;
    `Perturbed.applied` contains the ratio that was reached. Edges sharper than SHARP_ANGLE degrees are preserved, so a
    coarse tessellation of a shape with many of them may be impossible: a PerturbationError reports what was reached.

    Vertices that coincide remain apart, and components are not joined. The counterpart of a vertex is the nearest
    corner of the triangle closest to it; on a mesh with coinciding vertices, of its own component. A vertex without
    faces is removed, except by subdivision.

    References
    ----------
    Paper, section 6.6 and Figure 13, which do not specify how the tessellations were made. Isotropic remeshing: Botsch
    and Kobbelt 2004, doi:10.1145/1057432.1057457.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> fine = perturb.Tessellation(amount=4, method="subdivision")(sphere, np.random.default_rng(0))
    >>> len(sphere.faces), len(fine.mesh.faces)
    (1280, 5120)
    """

    amount: float = 1.0
    unit: str = "ratio_of_faces"
    method: str = "isotropic"
    stretch: float = 4.0
    grading: float = 8.0

    name: ClassVar[str] = "tessellation"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {
        "unit": ("ratio_of_faces",),
        "method": ("isotropic", "subdivision", "anisotropic", "irregular"),
    }

    TOLERANCE: ClassVar[float] = 0.05  # of the number of faces
    MAX_TRIES: ClassVar[int] = 8
    SHARP_ANGLE: ClassVar[float] = 45.0  # degrees between the normals of two faces
    ITERATIONS: ClassVar[int] = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("stretch", "grading"):
            self.check_number(field)
            if getattr(self, field) <= 1:
                raise PerturbationError(f"tessellation: {field} is {getattr(self, field):g}; it must be above 1")
        if self.method == "subdivision" and self.amount not in (0.0, *4.0 ** np.arange(16)):
            raise PerturbationError(
                f"tessellation: amount is {self.amount:g}, but subdivision makes 4, 16, 64 … times the faces; "
                "choose one of these, or method=isotropic for other amounts"
            )

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `direction` (3,), a unit vector; nothing for the isotropic methods."""
        return {} if self.method in ("isotropic", "subdivision") else {"direction": random_direction(rng)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        if self.amount == 0 or self.method == "subdivision":
            result, counterpart = self._subdivide(mesh), np.arange(len(mesh.vertices))
        else:
            result, counterpart = self._remesh(mesh, parameters)
        return self.finish(
            mesh,
            result,
            counterpart,
            ratio_of_faces_reached=len(result.faces) / len(mesh.faces),
            counterpart_by="closest_point",
        )

    def _subdivide(self, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
        """Divide each triangle into four until there are `amount` times as many; unchanged for an amount of 0."""
        from trimesh.remesh import subdivide

        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        for _ in range(round(np.log2(self.amount) / 2) if self.amount else 0):
            vertices, faces = subdivide(vertices, faces)
        return as_trimesh(vertices, faces)

    def _remesh(self, mesh: trimesh.Trimesh, parameters: Parameters) -> tuple[trimesh.Trimesh, np.ndarray]:
        """Return the remeshed surface and (n,) the counterpart of each vertex."""
        faces = np.asarray(mesh.faces)
        # In a box of size 1, so that the result does not depend on the mesh's own unit.
        corner, size = mesh.bounds[0], mesh.extents.max()
        vertices = (np.asarray(mesh.vertices) - corner) / size
        part = find_parts(vertices, faces)
        new_vertices, new_faces, new_part = self._search_density(vertices, faces, part, parameters)
        used = np.unique(faces)
        counterpart = np.full(len(vertices), -1)
        packing = Packing(vertices, faces, part)
        counterpart[used] = nearest_corners(
            packing.pack(new_vertices, new_part), new_faces, packing.pack(vertices[used], part[used])
        )
        return as_trimesh(new_vertices * size + corner, new_faces), counterpart

    def _search_density(
        self, vertices: np.ndarray, faces: np.ndarray, part: np.ndarray, parameters: Parameters
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return vertices on the surface; faces, as many as requested within TOLERANCE; and the part of each vertex."""
        from trimesh.triangles import area

        warped = self._warp(vertices, np.unique(faces), parameters)
        warped = Packing(warped, faces, part).pack(warped, part)
        require_even_size(warped, faces, self.name)
        n_target = self.amount * len(faces)
        length = np.sqrt(area(warped[faces]).sum() / n_target * 4 / np.sqrt(3))  # of equilateral triangles
        for _ in range(self.MAX_TRIES):
            new_vertices, new_faces = remesh_isotropically(
                warped, faces, length, iterations=self.ITERATIONS, sharp_angle=self.SHARP_ANGLE
            )
            ratio = len(new_faces) / n_target
            if abs(ratio - 1) <= self.TOLERANCE:
                break
            length *= np.sqrt(ratio)
        else:
            n_coincident = count_coincident(vertices, faces)
            apart = f", and {n_coincident} coinciding vertices apart (merge them first)" if n_coincident else ""
            raise PerturbationError(
                f"tessellation: {self.amount:g} times the faces were requested, but {ratio * self.amount:.3g} times "
                f"reached, preserving edges sharper than {self.SHARP_ANGLE:g} degrees{apart}; choose a larger amount"
            )
        triangle, weights = closest_points(warped, faces, new_vertices)
        return np.einsum("ij,ijk->ik", weights, vertices[faces[triangle]]), new_faces, part[faces[triangle, 0]]

    def _warp(self, vertices: np.ndarray, used: np.ndarray, parameters: Parameters) -> np.ndarray:
        """(n, 3) the vertices in the space in which triangles are to be equilateral and of uniform size."""
        if self.method == "isotropic":
            return vertices
        direction = parameters["direction"]
        if self.method == "anisotropic":
            return vertices + (1 / self.stretch - 1) * (vertices @ direction)[:, None] * direction
        return self._invert(vertices, used, direction)

    def _invert(self, vertices: np.ndarray, used: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """(n, 3) the vertices inverted in a sphere whose centre is at some distance above the highest used vertex.

        Lengths shrink with the square of the distance from the centre, which is chosen so that the longest edges are
        `grading` times the shortest.
        """
        from scipy.optimize import brentq

        height = vertices @ direction
        top = vertices[used[height[used].argmax()]]

        def excess_grading(log_distance: float) -> float:
            nearest = np.exp(log_distance)
            farthest = np.linalg.norm(vertices[used] - top - nearest * direction, axis=1).max()
            return (farthest / nearest) ** 2 - self.grading

        nearest = np.exp(brentq(excess_grading, -20, 20))
        centre = top + nearest * direction
        offset = vertices - centre
        return centre + offset * nearest**2 / np.sum(offset**2, axis=1, keepdims=True)
