"""Isotropic remeshing, and what of the new surface belongs to what of the old one."""

from __future__ import annotations

import numpy as np

from perturb._welding import separate_coincident
from perturb.perturbation import PerturbationError

MAX_SIZE_OVER_EDGE = 1e6  # ordinary meshes have less than 1e3


def remesh_isotropically(
    vertices: np.ndarray,
    faces: np.ndarray,
    length: float,
    *,
    iterations: int,
    sharp_angle: float,
    selected: np.ndarray | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Return vertices and faces of a mesh with edges of about that length; of the selected (m,) bool faces, if given.

    Edges sharper than ``sharp_angle``, in degrees between the normals of two faces, are preserved.
    """
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    chosen = {} if selected is None else {"f_scalar_array": selected.astype(float)}
    meshes.add_mesh(pymeshlab.Mesh(separate_coincident(vertices, faces), faces, **chosen))
    meshes.meshing_remove_unreferenced_vertices()
    if selected is not None:
        meshes.compute_selection_by_scalar_per_face(minq=0.5, maxq=1.5, inclusive=True)
    # Every option is given, because pymeshlab remembers those of an earlier call.
    meshes.meshing_isotropic_explicit_remeshing(
        iterations=iterations,
        adaptive=False,
        selectedonly=selected is not None,
        targetlen=pymeshlab.PureValue(length),
        featuredeg=sharp_angle,
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


def require_even_size(vertices: np.ndarray, faces: np.ndarray, name: str) -> None:
    """Raise PerturbationError for a shape next to which its own triangles are so small that MeshLab would not end."""
    edges = np.linalg.norm(vertices[faces] - vertices[np.roll(faces, -1, axis=1)], axis=2)
    ratio = np.ptp(vertices[faces], axis=(0, 1)).max() / max(np.median(edges), np.finfo(float).tiny)
    if ratio > MAX_SIZE_OVER_EDGE:
        raise PerturbationError(
            f"{name}: a component is {ratio:.2g} times as large as the median edge is long, possibly because of "
            "a vertex far away; remove it"
        )


def closest_points(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(k,) the triangle closest to each of (k, 3) points, and (k, 3) barycentric coordinates of the closest point."""
    import pymeshlab

    meshes = pymeshlab.MeshSet()
    meshes.add_mesh(pymeshlab.Mesh(vertices, faces))
    meshes.add_mesh(pymeshlab.Mesh(points))
    # Every option is given, because pymeshlab remembers those of an earlier call.
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


def nearest_corners(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """(k,) for each of (k, 3) points the nearest corner of the triangle closest to it."""
    corners = faces[closest_points(vertices, faces, points)[0]]
    distance = np.linalg.norm(vertices[corners] - points[:, None], axis=2)
    return np.take_along_axis(corners, distance.argmin(axis=1)[:, None], axis=1)[:, 0]
