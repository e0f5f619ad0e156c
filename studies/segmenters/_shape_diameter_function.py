"""The shape diameter function: how thick a body is behind each face."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from studies.segmenters._dual_graph import DualGraph
from studies.segmenters._optional import optional

# Of the longest side of the bounding box; single precision resolves about 1e-7.
_OFFSET = 1e-5

_GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))
_AT_ONCE = 2_000_000  # rays: a few hundred megabytes


def cone_of_rays(n_rays: int, cone: float) -> NDArray[np.float64]:
    """Directions (n, 3) in a cone around the z axis, in a spiral of Vogel that is densest at the axis.

    Parameters
    ----------
    n_rays : int
    cone : float
        opening angle in degrees

    Examples
    --------
    >>> rays = cone_of_rays(25, 120.0)
    >>> np.degrees(np.arccos(rays[[0, -1], 2])).round(1).tolist()
    [0.0, 60.0]
    """
    tilt = np.arctan(np.tan(np.radians(cone / 2)) * np.arange(n_rays) / max(n_rays - 1, 1))
    turn = _GOLDEN_ANGLE * np.arange(n_rays)
    return np.column_stack([np.sin(tilt) * np.cos(turn), np.sin(tilt) * np.sin(turn), np.cos(tilt)])


def by_embree(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], graph: DualGraph, n_rays: int, cone: float
) -> NDArray[np.float64]:
    """Thickness behind the centre of each face, by rays against its normal: (m,), NaN where none hits.

    Rays that hit another face from outside do not count, nor do those whose length differs from their median by more
    than 1.5 median absolute deviations.

    Parameters
    ----------
    vertices : (n, 3) float array
        coordinates of about unit size
    faces : (m, 3) int array
        vertices of each face
    graph : DualGraph
        of the mesh
    n_rays : int
        rays per face
    cone : float
        opening angle of the cone of the rays, in degrees
    """
    scenes, meshes = (optional(f"embreex.{name}", "shape_diameter") for name in ("rtcore_scene", "mesh_construction"))
    scene = scenes.EmbreeScene()
    meshes.TriangleMesh(scene, vertices.astype(np.float32), faces.astype(np.int32))
    inward = _inward_normals(graph)
    along = vertices[faces[:, 1]] - vertices[faces[:, 0]]
    along /= np.maximum(np.linalg.norm(along, axis=1), np.finfo(float).tiny)[:, None]
    across = np.cross(inward, along)
    origins = graph.centres + _OFFSET * inward
    cone_rays = cone_of_rays(n_rays, cone)
    lengths = np.full((len(faces), n_rays), np.inf)
    has_normal = np.flatnonzero(inward.any(axis=1))
    for some in np.array_split(has_normal, max(1, -(-len(has_normal) * n_rays // _AT_ONCE))):
        frames = np.stack([along[some], across[some], inward[some]], axis=1)
        directions = np.einsum("ri,fij->frj", cone_rays, frames).reshape(-1, 3)
        hits = scene.run(
            np.repeat(origins[some], n_rays, axis=0).astype(np.float32), directions.astype(np.float32), output=True
        )
        leaves = (hits["primID"] >= 0) & (np.einsum("ij,ij->i", inward[hits["primID"]], directions) < 0)
        lengths[some] = np.where(leaves, hits["tfar"], np.inf).reshape(-1, n_rays)
    return _robust_means(lengths)


def by_meshlab(
    vertices: NDArray[np.float64], faces: NDArray[np.int64], graph: DualGraph, n_rays: int, cone: float
) -> NDArray[np.float64]:
    """The same by MeshLab's filter, at vertices, from which the mean is carried to the faces."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces.astype(np.int32)))
    meshes.compute_scalar_by_shape_diameter_function_per_vertex(rays=n_rays, cone_amplitude=cone)
    thickness = np.asarray(meshes.current_mesh().vertex_scalar_array())
    if len(thickness) != len(vertices):
        raise ValueError(f"MeshLab returned {len(thickness)} values for {len(vertices)} vertices")
    corners = np.where(np.isfinite(thickness) & (thickness > 0), thickness, np.nan)[faces]
    known = np.isfinite(corners)
    return np.where(
        known.any(axis=1), np.where(known, corners, 0).sum(axis=1) / np.maximum(known.sum(axis=1), 1), np.nan
    )


def _inward_normals(graph: DualGraph) -> NDArray[np.float64]:
    """The normals of the faces, turned over as a whole if the signed volume says that they point inwards."""
    volume = np.einsum("ij,ij,i->", graph.centres, graph.normals, graph.areas)
    return graph.normals if volume < 0 else -graph.normals


def _robust_means(lengths: NDArray[np.float64]) -> NDArray[np.float64]:
    """The mean of the finite values of each row that are near their median; NaN for a row without any."""
    counts = np.isfinite(lengths).sum(axis=1)
    deviations = np.abs(lengths - _medians(lengths, counts)[:, None])
    near = deviations <= 1.5 * _medians(deviations, counts)[:, None]
    sums = np.where(near, lengths, 0).sum(axis=1)
    return np.where(counts > 0, sums / np.maximum(near.sum(axis=1), 1), np.nan)


def _medians(values: NDArray[np.float64], counts: NDArray[np.int64]) -> NDArray[np.float64]:
    """The median of the finite values of each row, of which there are ``counts``; 0 for a row without any."""
    ordered = np.sort(values, axis=1)
    rows = np.arange(len(values))
    middle = (ordered[rows, np.maximum(counts - 1, 0) // 2] + ordered[rows, counts // 2 * (counts > 0)]) / 2
    return np.where(counts > 0, middle, 0)
