"""Rasterisation: the shape in voxels, and a surface around them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from perturb.meshes import LENGTHS, as_trimesh
from perturb.perturbation import Parameters, Perturbation, PerturbationError, Perturbed

if TYPE_CHECKING:
    import trimesh


_OVERHANG = 0.25  # voxels, from the centre of an outermost voxel to the surface; 0.5 would make shapes swell more
_MAX_HALVINGS = 20  # of an edge, until it is shorter than half a voxel; an edge has at most 887 voxels


@dataclass(frozen=True)
class Rasterisation(Perturbation):
    """Fill the shape with voxels and extract their surface by marching cubes.

    Parameters
    ----------
    amount : float
        The edge of a voxel, in `unit`; 0, the neutral amount, leaves the mesh unchanged.
    unit : str
        "bounding_box_diagonal" or "mean_edge_length".

    Notes
    -----
    The grid is parallel to the axes, at a random offset. A voxel is filled if the surface passes through it, or if it
    is enclosed by such voxels: windings, non-manifold edges, cracks and holes smaller than a voxel do not matter. Of an
    open surface remains a sheet, one voxel thick, with two sides. Parts less than a voxel apart grow together, and
    cavities are filled. The surface is a quarter of a voxel away from the centres of the outermost voxels, and on
    average as far outside of the former one.

    The counterpart of a vertex is the nearest vertex of the new surface; a vertex farther away from it than FARTHEST
    voxels, for example that of a cavity, and one without faces, have none.

    References
    ----------
    One of the transformations of Boyer et al. 2011, "SHREC 2011: robust feature detection and description benchmark",
    arXiv:1102.4258. Marching cubes: Lewiner et al. 2003, doi:10.1080/10867651.2003.10487582.

    Examples
    --------
    >>> import numpy as np
    >>> import perturb
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere()
    >>> soup = perturb.Unwelded(amount=1)(sphere, np.random.default_rng(0)).mesh
    >>> rasterised = perturb.Rasterisation(amount=0.04)(soup, np.random.default_rng(0)).mesh
    >>> soup.is_watertight, rasterised.is_watertight
    (False, True)
    """

    amount: float = 0.015
    unit: str = "bounding_box_diagonal"

    name: ClassVar[str] = "rasterisation"
    choices: ClassVar[dict[str, tuple[str, ...]]] = {"unit": tuple(LENGTHS)}

    MAX_SIDE: ClassVar[int] = 512  # voxels; their surface takes about a gigabyte to extract
    FARTHEST: ClassVar[float] = 3.0  # voxels; a filled voxel of an outer surface is never that far from an empty one

    def sample(self, mesh: trimesh.Trimesh, rng: np.random.Generator) -> Parameters:
        """Draw `offset` (3,), the position of the grid in voxels, each coordinate from 0 to 1."""
        return {"offset": rng.random(3)}

    def apply(self, mesh: trimesh.Trimesh, parameters: Parameters) -> Perturbed:
        n_vertices = len(mesh.vertices)
        if self.amount == 0:
            return self._finish(mesh, as_trimesh(mesh.vertices, mesh.faces), np.arange(n_vertices), 0)
        low, edge = mesh.bounds[0], self.amount * LENGTHS[self.unit](mesh)
        used = np.unique(mesh.faces)
        vertices = np.zeros((n_vertices, 3))
        vertices[used] = (np.asarray(mesh.vertices)[used] - low) / edge + parameters["offset"]
        self._require_few_voxels(vertices[used])
        filled, corner = _voxels(vertices, np.asarray(mesh.faces))
        new_vertices, new_faces = _surface_of(filled)
        new_vertices += corner
        counterpart = np.full(n_vertices, -1)
        counterpart[used] = _nearest(new_vertices, vertices[used], self.FARTHEST)
        result = as_trimesh((new_vertices - parameters["offset"]) * edge + low, new_faces)
        return self._finish(mesh, result, counterpart, int(np.count_nonzero(filled)))

    def _finish(
        self, mesh: trimesh.Trimesh, result: trimesh.Trimesh, counterpart: np.ndarray, n_voxels: int
    ) -> Perturbed:
        return self.finish(
            mesh,
            result,
            counterpart,
            voxels=n_voxels,
            vertices_without_counterpart=int(np.count_nonzero(counterpart < 0)),
            counterpart_by="nearest_vertex",
        )

    def _require_few_voxels(self, vertices: np.ndarray) -> None:
        """Raise PerturbationError for a grid that would not fit into memory."""
        side = np.ptp(vertices, axis=0).max()
        if side > self.MAX_SIDE:
            raise PerturbationError(
                f"rasterisation: the bounding box is {side:.4g} voxels long, more than {self.MAX_SIDE}; raise amount"
            )


def _voxels(vertices: np.ndarray, faces: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return which voxels of edge 1 are filled (i, j, k), and the centre (3,) of the first."""
    from trimesh.voxel.creation import voxelize_subdivide

    grid = voxelize_subdivide(as_trimesh(vertices, faces), pitch=1.0, max_iter=_MAX_HALVINGS)
    return np.asarray(grid.fill(method="holes").matrix), np.asarray(grid.translation)


def _surface_of(filled: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the vertices and faces of the surface around voxels, with the centre of the first at the origin."""
    from skimage.measure import marching_cubes

    volume = np.pad(filled, 1).astype(np.float32)
    vertices, faces, _, _ = marching_cubes(volume, 1 - _OVERHANG, gradient_direction="ascent")
    return vertices.astype(np.float64) - 1, faces.astype(np.int64)


def _nearest(vertices: np.ndarray, points: np.ndarray, farthest: float) -> np.ndarray:
    """(k,) the vertex nearest to each of (k, 3) points; -1 if it is farther away than `farthest`."""
    from scipy.spatial import cKDTree

    distance, nearest = cKDTree(vertices).query(points, distance_upper_bound=farthest)
    return np.where(np.isfinite(distance), nearest, -1)
