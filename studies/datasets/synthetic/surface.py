"""From a shape to a closed mesh with a label for each face, and from one pose of it to another."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.spatial import KDTree
from skimage.measure import marching_cubes

from heatwalk.meshes import face_areas
from studies.datasets.dataset import DatasetError
from studies.datasets.synthetic.fields import Field
from studies.datasets.synthetic.remeshing import remesh
from studies.datasets.synthetic.skeleton import Shape
from studies.datasets.synthetic.solids import Array

COARSEST = 0.045  # spacing of the grid; the thinnest limbs are half as thick again
SPACING = 0.9  # of the grid at most, in target lengths
SHORTER = 0.93  # target length, relative to that of equilateral triangles: edges come out longer than the target


@dataclass(frozen=True, eq=False)
class Surface:
    """A closed mesh and the part of each face.

    Parameters
    ----------
    vertices : (n, 3) float array
    faces : (m, 3) int array
    labels : (m,) int array
        in the order of the shape's parts
    """

    vertices: Array
    faces: NDArray[np.int64]
    labels: NDArray[np.int64]


def field_of(shape: Shape, pose: int) -> Field:
    """The field of a shape in a pose, 1 being the rest pose."""
    return Field(shape.solids(pose), shape.blend, len(shape.parts))


def make_mesh(shape: Shape, pose: int, resolution: int) -> tuple[Array, NDArray[np.int64]]:
    """Mesh a shape in a pose.

    Parameters
    ----------
    shape : Shape
    pose : int
        1 for the rest pose
    resolution : int
        about how many vertices

    Returns
    -------
    vertices : (n, 3) float array
    faces : (m, 3) int array

    Raises
    ------
    DatasetError
        If the surface is not closed or of one component, or if it has not the shape's number of handles.
    """
    field = field_of(shape, pose)
    vertices, faces = extracted(field, COARSEST)
    # Two equilateral triangles for each vertex cover the area.
    length = SHORTER * float(np.sqrt(2 * face_areas(vertices, faces).sum() / (np.sqrt(3) * resolution)))
    if length * SPACING < COARSEST:
        vertices, faces = extracted(field, length * SPACING)
    where = f"shape {shape.name}, pose {pose}, dataset.resolution={resolution}"
    _check_topology(vertices, faces, shape.genus, where)
    vertices, faces = remesh(vertices, faces, field, length)
    _check_topology(vertices, faces, shape.genus, where)
    return vertices, faces


def labelled(shape: Shape, pose: int, vertices: Array, faces: NDArray[np.int64]) -> Surface:
    """A mesh of a shape in a pose with the part of each face: that which is nearest to its centre.

    Raises
    ------
    DatasetError
        If a part has no face.
    """
    labels = field_of(shape, pose).labels(vertices[faces].mean(axis=1))
    lacking = [part for label, part in enumerate(shape.parts) if label not in labels]
    if lacking:
        raise DatasetError(
            f"shape {shape.name}, pose {pose}: no face belongs to {', '.join(lacking)}; raise dataset.resolution"
        )
    return Surface(vertices, faces, labels)


def corresponding(shape: Shape, pose: int, rest: Surface, posed: Surface) -> NDArray[np.int64]:
    """The vertices of a pose that are nearest to where the skeleton carries the vertices of the rest pose.

    Parameters
    ----------
    shape : Shape
    pose : int
    rest, posed : Surface
        of the rest pose and of this one

    Returns
    -------
    (n,) int array
        a vertex of ``posed`` for each vertex of ``rest``
    """
    before, after = field_of(shape, 1), field_of(shape, pose)
    carried = after.projected(before.carried(rest.vertices, after))
    return np.asarray(KDTree(posed.vertices).query(carried)[1], dtype=np.int64)


def extracted(field: Field, spacing: float) -> tuple[Array, NDArray[np.int64]]:
    """The zeros of a field on a grid."""
    low, high = field.bounds()
    start = low - 1.5 * spacing
    counts = np.ceil((high - low) / spacing).astype(np.int64) + 4
    values = field.on_grid(start, spacing, counts)
    vertices, faces, _, _ = marching_cubes(values, 0.0, spacing=(spacing,) * 3, allow_degenerate=False)
    return vertices.astype(np.float64) + start, faces.astype(np.int64)


def _check_topology(vertices: Array, faces: NDArray[np.int64], genus: int, where: str) -> None:
    """Raise DatasetError unless a mesh is closed, oriented, and of one component with so many handles."""
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    advice = "raise dataset.resolution, or choose another dataset.seed"
    if not (mesh.is_watertight and mesh.is_winding_consistent):
        raise DatasetError(f"{where}: the surface is not closed; {advice}")
    if mesh.body_count != 1:
        raise DatasetError(f"{where}: the surface has {mesh.body_count} components instead of one; {advice}")
    if mesh.euler_number != 2 - 2 * genus:
        raise DatasetError(
            f"{where}: the surface has {1 - mesh.euler_number / 2:g} handles instead of {genus}; {advice}"
        )
