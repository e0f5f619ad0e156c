"""Other triangles for the same surface, at any density."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import pymeshlab
import trimesh
from scipy.optimize import brentq

from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed


@dataclass(frozen=True)
class Tessellation(Perturbation):
    """The surface is covered by other triangles, more or fewer.

    amount : the number of faces over that before, above 0. 1 is another tessellation of the same density;
        0, the neutral amount, leaves the mesh as it is.
    method : isotropic, triangles nearly equilateral and of one size; subdivision, each triangle cut into four at
        the midpoints of its edges, as often as needed: amount is 4, 16, 64 …; anisotropic, triangles longer by
        `stretch` in one direction, which is random; irregular, triangles nearly equilateral whose size grows
        by `grading` from one extremity of the shape, in a random direction, to what is farthest from there.
    stretch : of anisotropic triangles, the length along the direction over that across, above 1; what is aimed
        at, of which kept edges and curvature take up to a half. A place that faces the direction shows none.
    grading : of irregular triangles, the longest edges over the shortest, above 1.

    Isotropic remeshing splits, collapses and flips edges, which keeps the topology, and shifts vertices along
    the surface (Botsch and Kobbelt 2004, doi:10.1145/1057432.1057457; pymeshlab's). The others are isotropic in
    a warped space: pressed together along the direction, or inverted in a sphere, which keeps angles and changes
    sizes. All new vertices lie on the original surface. The length of the edges is searched for, up to TRIES
    times, until the number of faces is met within TOLERANCE; `applied` holds the ratio reached. Edges sharper
    than SHARP degrees are kept, and so a coarse tessellation of a shape with many may be out of reach:
    PerturbationError with what was reached.

    A vertex's counterpart is, of the triangle with the point closest to it, the nearest corner. A vertex without
    faces is gone, except by subdivision.
    Source: paper section 6.6, Figure 13, which does not say how the tessellations were made.
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
    TRIES: ClassVar[int] = 8
    SHARP: ClassVar[float] = 45.0  # degrees between the normals of two faces
    ITERATIONS: ClassVar[int] = 3

    def __post_init__(self) -> None:
        super().__post_init__()
        for field in ("stretch", "grading"):
            self._check_number(field)
            if getattr(self, field) <= 1:
                raise PerturbationError(f"tessellation: {field} is {getattr(self, field):g}; it must be above 1")
        if self.method == "subdivision" and self.amount not in (0.0, *4.0 ** np.arange(16)):
            raise PerturbationError(
                f"tessellation: amount is {self.amount:g}, and subdivision makes 4, 16, 64 … times the faces; "
                "give one of these, or method=isotropic for what is between"
            )

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """`direction` (3,): a unit vector; for the isotropic methods nothing."""
        if self.method in ("isotropic", "subdivision"):
            return {}
        direction = rng.standard_normal(3)
        return {"direction": direction / np.linalg.norm(direction)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
        if self.amount == 0 or self.method == "subdivision":
            new = vertices.copy(), faces.copy()
            for _ in range(round(np.log2(self.amount) / 2) if self.amount else 0):
                new = trimesh.remesh.subdivide(*new)
            result = trimesh.Trimesh(*new, process=False)
            counterpart = np.arange(len(vertices))
        else:
            # In a box of size 1, so that what follows does not depend on the mesh's own units.
            corner, size = mesh.bounds[0], mesh.extents.max()
            unit = (vertices - corner) / size
            new_vertices, new_faces = self._remeshed(unit, faces, parameters)
            counterpart = np.full(len(vertices), -1)
            used = np.unique(faces)
            counterpart[used] = _nearest_corners(new_vertices, new_faces, unit[used])
            result = trimesh.Trimesh(new_vertices * size + corner, new_faces, process=False)
        return self._finish(
            mesh,
            result,
            counterpart,
            ratio_of_faces_reached=len(result.faces) / len(faces),
            counterpart_by="closest_point",
        )

    def _remeshed(
        self, vertices: np.ndarray, faces: np.ndarray, parameters: Parameters
    ) -> tuple[np.ndarray, np.ndarray]:
        """Vertices on the surface, and faces, as many as asked for within TOLERANCE."""
        warped = self._warped(vertices, np.unique(faces), parameters)
        wanted = self.amount * len(faces)
        area = trimesh.triangles.area(warped[faces]).sum()
        length = np.sqrt(area / wanted * 4 / np.sqrt(3))  # of equilateral triangles
        for _ in range(self.TRIES):
            new_vertices, new_faces = self._isotropic(warped, faces, length)
            ratio = len(new_faces) / wanted
            if abs(ratio - 1) <= self.TOLERANCE:
                break
            length *= np.sqrt(ratio)
        else:
            raise PerturbationError(
                f"tessellation: {self.amount:g} times the faces are asked for and {ratio * self.amount:.3g} times "
                f"reached, keeping edges sharper than {self.SHARP:g} degrees; ask for more"
            )
        triangle, weights = _closest(warped, faces, new_vertices)
        return np.einsum("ij,ijk->ik", weights, vertices[faces[triangle]]), new_faces

    def _warped(self, vertices: np.ndarray, used: np.ndarray, parameters: Parameters) -> np.ndarray:
        """(n, 3) the vertices in the space in which triangles are to be equilateral and of one size."""
        if self.method == "isotropic":
            return vertices
        direction = parameters["direction"]
        height = vertices @ direction
        if self.method == "anisotropic":
            return vertices + (1 / self.stretch - 1) * height[:, None] * direction
        # Inverted about a point at some distance above the highest vertex, where lengths shrink with the square of
        # the distance.
        top = vertices[used[height[used].argmax()]]

        def excess(log_distance: float) -> float:
            nearest = np.exp(log_distance)
            farthest = np.linalg.norm(vertices[used] - top - nearest * direction, axis=1).max()
            return (farthest / nearest) ** 2 - self.grading

        nearest = np.exp(brentq(excess, -20, 20))
        centre = top + nearest * direction
        offset = vertices - centre
        return centre + offset * nearest**2 / np.sum(offset**2, axis=1, keepdims=True)

    def _isotropic(self, vertices: np.ndarray, faces: np.ndarray, length: float) -> tuple[np.ndarray, np.ndarray]:
        """Remeshed with edges of about that length."""
        meshes = pymeshlab.MeshSet()
        meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
        meshes.meshing_remove_unreferenced_vertices()
        # Every option is given: pymeshlab remembers what an earlier call was given.
        meshes.meshing_isotropic_explicit_remeshing(
            iterations=self.ITERATIONS,
            adaptive=False,
            selectedonly=False,
            targetlen=pymeshlab.PureValue(length),
            featuredeg=self.SHARP,
            checksurfdist=True,
            maxsurfdist=pymeshlab.PureValue(length / 4),
            splitflag=True,
            collapseflag=True,
            swapflag=True,
            smoothflag=True,
            reprojectflag=True,
        )
        remeshed = meshes.current_mesh()
        return remeshed.vertex_matrix(), remeshed.face_matrix().astype(np.int64)


def _closest(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k,) the triangle closest to each of (k, 3) points, and (k, 3) barycentric coordinates of the closest point."""
    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    meshes.add_mesh(pymeshlab.Mesh(points))
    meshes.transfer_attributes_per_vertex(
        sourcemesh=0,
        targetmesh=1,
        vertexsampling=False,
        geomtransfer=False,
        normaltransfer=False,
        colortransfer=False,
        qualitytransfer=False,
        selectiontransfer=False,
        qualitydistance=False,
        savebarycentric=True,
        upperbound=pymeshlab.PureValue(10.0),  # beyond any distance in a box of size 1
        onselected=False,
    )
    found = meshes.mesh(1)
    triangle = found.vertex_custom_scalar_attribute_array("NearestFaceIndex").ravel().astype(np.int64)
    return triangle, found.vertex_custom_point_attribute_matrix("BarycentricCoords")


def _nearest_corners(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(k,) the vertex nearest to each of (k, 3) points, of the triangle that is closest to it."""
    corners = faces[_closest(vertices, faces, points)[0]]
    distance = np.linalg.norm(vertices[corners] - points[:, None], axis=2)
    return np.take_along_axis(corners, distance.argmin(axis=1)[:, None], axis=1)[:, 0]
