"""Self-intersections: bumps that are pushed through the opposite side of the shape."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb._displacement import deform
from perturb._normals import is_degenerate
from perturb._places import vertex_areas
from perturb.meshes import LENGTHS, edge_graph, vertex_normals
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh
    from scipy.sparse import csr_array

TRIES_PER_BUMP = 100  # vertices at which a bump is tried, before none is said to be possible
NEARER_THAN_ROUNDING = 1e-6  # of the diagonal; two sides of a sheet without thickness are not opposite sides


@dataclass(frozen=True)
class SelfIntersections(Perturbation):
    """Push smooth bumps inwards until they come out on the opposite side of the shape.

    Parameters
    ----------
    amount : int
        How many bumps.
    unit : str
        "count".
    radius : float
        How far a bump reaches along the edges from its tip, as a share of the bounding-box diagonal.
    protrusion : float
        How far its tip comes out on the opposite side, as a share of the diagonal.
    thickness : float
        The largest thickness of the shape at which a bump is made, as a share of the diagonal.

    Notes
    -----
    Tips are random vertices, all parts of the surface being equally likely, at which the ray against the normal meets
    the surface again within `thickness`, outside of the bump. Bumps do not overlap. A vertex of a bump moves in
    parallel to this ray, by a share of (1 − t²)² of what the tip does, where t is its distance from the tip along the
    edges, relative to the radius. The faces and their connections remain the same. For each bump, a hundred
    vertices are tried.

    ``intersecting_faces`` and ``intersecting_faces_before`` in `Perturbed.applied` are the numbers of faces that
    intersect another one, as found by pymeshlab, independently of how bumps are made. No bump is made where faces
    intersect already, and if one of them intersects nothing afterwards, a PerturbationError reports it.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> flat = perturb.as_trimesh(sphere.vertices * [1, 1, 0.2], sphere.faces)
    >>> pierced = perturb.SelfIntersections(amount=1, radius=0.1)(flat, np.random.default_rng(0))
    >>> pierced.applied["intersecting_faces_before"], pierced.applied["intersecting_faces"] > 5
    (0, True)
    """

    amount: float = 4
    unit: str = "count"
    radius: float = 0.04
    protrusion: float = 0.03
    thickness: float = 0.25

    name: ClassVar[str] = "self_intersections"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": ("count",)}

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_number("amount", whole=True)
        for field in ("radius", "protrusion", "thickness"):
            self.check_number(field, positive=True)

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `vertices` (k,), the tips, and compute `depths` (k,), from each to the opposite side, over the diagonal.

        Raises
        ------
        PerturbationError
            If there are not so many places at which a bump can be made.
        """
        vertices, depths = self._tips(mesh, rng) if self.amount else ([], [])
        if len(vertices) < self.amount:
            raise PerturbationError(
                f"self_intersections: {self.amount:g} bumps were requested, but only {len(vertices)} were found that "
                f"reach an opposite side within {self.thickness:g} of the bounding-box diagonal and touch neither each "
                "other nor faces that intersect already; lower amount or radius, or raise thickness"
            )
        return {"vertices": np.array(vertices, dtype=np.int64), "depths": np.array(depths)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        diagonal = LENGTHS["bounding_box_diagonal"](mesh)
        normals, graph = vertex_normals(mesh), edge_graph(mesh).tocsr()
        displacement = np.zeros(mesh.vertices.shape)
        bumps = []
        for vertex, depth in zip(parameters["vertices"], parameters["depths"], strict=True):
            fall_off = np.maximum(1 - _distances(graph, vertex, self.radius * diagonal) ** 2, 0) ** 2
            displacement -= fall_off[:, None] * (depth + self.protrusion) * diagonal * normals[vertex]
            bumps.append(fall_off > 0)
        result, counterpart, facts = deform(self, mesh, displacement)
        intersecting = _intersecting_faces(result)
        without = sum(not intersecting[bump[mesh.faces].any(axis=1)].any() for bump in bumps)
        if without:
            raise PerturbationError(
                f"self_intersections: {without} of {len(bumps)} bumps would not intersect the surface; raise "
                "protrusion or radius"
            )
        return self.finish(
            mesh,
            result,
            counterpart,
            intersecting_faces_before=int(np.count_nonzero(_intersecting_faces(mesh))),
            intersecting_faces=int(np.count_nonzero(intersecting)),
            **facts,
        )

    def _tips(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> tuple[list[int], list[float]]:
        """As many tips as requested, or all that there are, and the depths to the opposite side."""
        diagonal = LENGTHS["bounding_box_diagonal"](mesh)
        vertices, faces = (np.asarray(mesh.vertices) - mesh.bounds[0]) / diagonal, np.asarray(mesh.faces)
        corners = vertices[faces]
        solid = ~is_degenerate(vertices, faces)
        normals, graph = vertex_normals(mesh), edge_graph(mesh).tocsr()
        area = np.where(normals.any(axis=1), vertex_areas(mesh), 0)
        taken = np.zeros(len(vertices), dtype=bool)  # by bumps so far, and by faces that intersect already
        taken[faces[_intersecting_faces(mesh)]] = True
        tips: list[int] = []
        depths: list[float] = []
        tries = min(int(self.amount) * TRIES_PER_BUMP, int(np.count_nonzero(area)))
        for vertex in rng.choice(len(area), tries, replace=False, p=area / area.sum()) if tries else []:
            own = _distances(graph, vertex, self.radius * diagonal) < 1
            if taken[own].any():
                continue
            candidates = solid & ~own[faces].any(axis=1)
            depth = _first_hit(corners[candidates], vertices[vertex], -normals[vertex])
            if NEARER_THAN_ROUNDING < depth <= self.thickness:
                tips.append(int(vertex))
                depths.append(depth)
                taken |= own
                if len(tips) == self.amount:
                    break
        return tips, depths


def _distances(graph: csr_array, vertex: int, radius: float) -> np.ndarray:
    """(n,) distances of all vertices from one along the edges, relative to a radius; infinite beyond it."""
    from scipy.sparse.csgraph import dijkstra

    return dijkstra(graph, indices=np.array(vertex), limit=radius) / radius


def _first_hit(corners: np.ndarray, origin: np.ndarray, direction: np.ndarray) -> float:
    """Distance at which a ray first meets one of (k, 3, 3) triangles; infinite if it meets none.

    Möller and Trumbore 1997, doi:10.1080/10867651.1997.10487468.
    """
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    across = np.cross(direction, second)
    determinant = np.einsum("ij,ij->i", first, across)
    with np.errstate(divide="ignore", invalid="ignore"):  # a triangle in parallel to the ray is not met
        offset = origin - corners[:, 0]
        u = np.einsum("ij,ij->i", offset, across) / determinant
        normal = np.cross(offset, first)
        v = normal @ direction / determinant
        distance = np.einsum("ij,ij->i", normal, second) / determinant
        met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    return float(distance[met].min(initial=np.inf))


def _intersecting_faces(mesh: trimesh.Trimesh) -> np.ndarray:
    """(m,) bool: the faces that intersect another one, apart from common edges and corners."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    vertices = (np.asarray(mesh.vertices) - mesh.bounds[0]) / LENGTHS["bounding_box_diagonal"](mesh)
    meshes.add_mesh(pymeshlab.Mesh(vertices, np.asarray(mesh.faces)))
    meshes.compute_selection_by_self_intersections_per_face()
    return meshes.current_mesh().face_selection_array()
