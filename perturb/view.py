"""View: what scanners see of a shape from some sides only."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb.meshes import as_trimesh, without_faces
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


@dataclass(frozen=True)
class View(Perturbation):
    """Keep only the faces that a scanner sees from at least one of its positions around the shape.

    Parameters
    ----------
    amount : float
        The share of the directions around the shape from which no scanner looks, 0 to 1. At 1 a single position
        remains. 0, the neutral amount, leaves the mesh unchanged, including what no scanner would see.
    unit : str
        "share_of_directions".
    positions : int
        The number of positions all around, of which ``round((1 - amount) * positions)`` are used, at least one: those
        nearest to a random direction.
    distance : float
        From the centre of the bounding box to the scanner, in bounding-box diagonals, above 0.5.
    max_incidence : float
        The largest angle between the normal of a face and the direction to a scanner that sees it, in degrees, above 0
        and at most 90. The light of real scanners is lost at grazing angles.

    Notes
    -----
    The positions are a spiral of equal areas around the random direction, so those of a larger amount are among those
    of a smaller one. At each, the scanner sends rays in a regular grid, of RAYS_PER_EDGE rays per median edge length
    where the shape is nearest to average. A face is seen if it is the first (or lies exactly on the first) along one of
    the rays, from either side. A face between the rays is seen if its plane is first along the ray nearest to its
    centre.

    Vertices that lose their last face are removed. ``applied["share_of_area_seen"]`` is the share of the surface that
    remains, and ``applied["positions_used"]`` the number of positions. If nothing is in the way of any face, the mesh
    remains as it is.

    References
    ----------
    Scans from one or several sides are among the transformations of Boyer et al. 2011, "SHREC 2011: robust feature
    detection and description benchmark", arXiv:1102.4258. Depth buffer: Catmull 1974.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> seen = perturb.View(amount=1)(sphere, np.random.default_rng(0))
    >>> seen.applied["positions_used"], 0.2 < seen.applied["share_of_area_seen"] < 0.4
    (1, True)
    """

    amount: float = 1.0
    unit: str = "share_of_directions"
    positions: int = 24
    distance: float = 2.0
    max_incidence: float = 80.0

    name: ClassVar[str] = "view"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("share_of_directions",)}

    RAYS_PER_EDGE: ClassVar[float] = 4.0
    MAX_RAYS: ClassVar[int] = 4096  # along each side of the image

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", maximum=1)
        self.check_number("positions", positive=True, whole=True)
        self.check_number("distance")
        if self.distance <= 0.5:
            raise PerturbationError(f"view: distance is {self.distance:g}; it must be above 0.5, outside of the shape")
        self.check_number("max_incidence", maximum=90, positive=True)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `rotation` (3, 3), which takes the z axis to the direction that the positions are around."""
        from scipy.spatial.transform import Rotation

        return {"rotation": Rotation.from_quat(rng.standard_normal(4)).as_matrix()}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        from trimesh.triangles import area

        if self.amount == 0:
            result, counterpart = as_trimesh(mesh.vertices, mesh.faces), np.arange(len(mesh.vertices))
            return self.finish(mesh, result, counterpart, positions_used=0, faces_removed=0, share_of_area_seen=1.0)
        vertices, faces = self._in_unit_box(mesh), np.asarray(mesh.faces)
        directions = self._directions() @ parameters["rotation"].T
        seen = self._seen(vertices, faces, directions)
        rest, counterpart = without_faces(mesh, ~seen)
        areas = area(vertices[faces])
        return self.finish(
            mesh,
            rest,
            counterpart,
            positions_used=len(directions),
            faces_removed=int(np.count_nonzero(~seen)),
            share_of_area_seen=areas[seen].sum() / areas.sum(),
        )

    def _directions(self) -> np.ndarray:
        """(k, 3) unit vectors to the positions that are used, around the z axis."""
        used = max(1, round((1 - self.amount) * self.positions))
        i = np.arange(used)
        z = 1 - (2 * i + 1) / self.positions
        angle = i * np.pi * (3 - np.sqrt(5))
        return np.stack([np.sqrt(1 - z**2) * np.cos(angle), np.sqrt(1 - z**2) * np.sin(angle), z], axis=1)

    @staticmethod
    def _in_unit_box(mesh: trimesh.Trimesh) -> np.ndarray:
        """(n, 3) the vertices, with the box around those with faces centred at 0, and its diagonal 1."""
        low, high = mesh.bounds
        size = (high - low).max()
        centred = (np.asarray(mesh.vertices) - low) / size - (high - low) / size / 2
        return centred / np.linalg.norm((high - low) / size)

    def _seen(self, vertices: np.ndarray, faces: np.ndarray, directions: np.ndarray) -> np.ndarray:
        """(m,) bool: whether a face is seen from one of the directions (k, 3)."""
        from perturb._visibility import mark_visible  # imported here, because it loads numba

        n_rays = self._rays_per_side(vertices, faces)
        # The tangent of half the angle at which the sphere around the box appears.
        half_width = 0.5 / np.sqrt(self.distance**2 - 0.25)
        nearest = np.zeros((n_rays, n_rays))
        seen = np.zeros(len(faces), dtype=bool)
        for direction in directions:
            right, up = _across(direction)
            depth = self.distance - vertices @ direction
            image = np.stack([vertices @ right, vertices @ up], axis=1) / depth[:, None]
            pixels = (image / half_width + 1) * n_rays / 2
            facing = self._facing(vertices, faces, direction) & ~seen
            mark_visible(pixels, 1 / depth, faces, facing, nearest, seen)
        return seen

    def _facing(self, vertices: np.ndarray, faces: np.ndarray, direction: np.ndarray) -> np.ndarray:
        """(m,) bool: whether the angle of incidence is small enough; False for faces without area."""
        a, b, c = vertices[faces].transpose(1, 0, 2)
        normals = np.cross(b - a, c - a)
        towards = self.distance * direction - (a + b + c) / 3
        cosine = np.cos(np.radians(self.max_incidence))
        length = np.linalg.norm(normals, axis=1) * np.linalg.norm(towards, axis=1)
        return (length > 0) & (np.abs((normals * towards).sum(axis=1)) >= cosine * length)

    def _rays_per_side(self, vertices: np.ndarray, faces: np.ndarray) -> int:
        """Return how many rays are in each direction of the image; PerturbationError if they would be too sparse."""
        edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, -1, axis=1)], axis=2)
        per_diagonal = 1 / max(np.median(edges), np.finfo(float).tiny)
        if per_diagonal > self.MAX_RAYS:
            raise PerturbationError(
                f"view: the bounding-box diagonal is {per_diagonal:.2g} times the median edge length, so a scanner "
                "sees no details, possibly because of a vertex far away; remove it"
            )
        return int(np.ceil(min(self.RAYS_PER_EDGE * per_diagonal, self.MAX_RAYS)))


def _across(direction: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return two unit vectors (3,), perpendicular to a direction and to each other."""
    helper = np.eye(3)[np.abs(direction).argmin()]
    right = np.cross(helper, direction)
    right /= np.linalg.norm(right)
    return right, np.cross(direction, right)
