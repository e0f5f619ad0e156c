"""Eigenpairs of the Laplace–Beltrami operator of any mesh."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.meshes import (
    DEGENERATE_RATIO,
    MeshError,
    check_mesh,
    drop_unreferenced,
    face_areas,
    referenced,
    repeats_earlier_face,
)
from heatwalk.spectrum import Spectrum, SpectrumSolver
from studies.segmenters._components import segment_components

_NO_AREA = "all {} triangles are degenerate: the mesh has no area"


@dataclass(frozen=True)
class Surface:
    """What of a mesh is a surface: without unreferenced vertices, repeated faces, and faces collapsed to an edge.

    Attributes
    ----------
    vertices : (p, 3) float array
        scaled to area 1
    faces : (q, 3) int array
        indices into these vertices
    kept : (p,) int array, ascending
        the index of each vertex in the mesh
    n_vertices : int
        vertices of the mesh
    component : (p,) int array
        the connected component of each vertex, 0, 1, 2 …

    Examples
    --------
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(1)
    >>> surface = Surface.of(np.vstack([[[9.0, 9, 9]], sphere.vertices]), sphere.faces + 1)
    >>> len(surface.vertices), surface.n_vertices, surface.on_mesh(np.zeros(42, int))[:3]
    (42, 43, array([-1,  0,  0]))
    """

    vertices: NDArray[np.float64]
    faces: NDArray[np.int64]
    kept: NDArray[np.int64]
    n_vertices: int
    component: NDArray[np.int64]

    @classmethod
    def of(cls, vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> Surface:
        """The surface of a mesh.

        Raises
        ------
        heatwalk.MeshError
            If nothing is left that has an area, or a coordinate is NaN or infinite.
        """
        n_vertices = len(vertices)
        is_collapsed = _is_collapsed(vertices, faces)
        if is_collapsed.all():
            raise MeshError(_NO_AREA.format(len(faces)))
        vertices, faces, kept = drop_unreferenced(vertices, faces[~is_collapsed])
        vertices, faces = check_mesh(vertices, faces)
        faces = faces[~repeats_earlier_face(faces)]
        return cls(unit_area(vertices, faces), faces, kept, n_vertices, vertex_components(len(vertices), faces))

    def on_mesh(self, labels: NDArray[np.int64]) -> NDArray[np.int64]:
        """Labels of the vertices of the mesh, from those of the surface: -1 for vertices that are not of it."""
        result = np.full(self.n_vertices, -1, dtype=np.int64)
        result[self.kept] = labels
        return result

    def part(self, vertices: NDArray[np.int64]) -> Surface:
        """The surface of some vertices, ascending, which are one or more components; its mesh is this surface."""
        number = np.full(len(self.vertices), -1)
        number[vertices] = np.arange(len(vertices))
        faces = number[self.faces[number[self.faces[:, 0]] >= 0]]
        component = np.unique(self.component[vertices], return_inverse=True)[1]
        return Surface(self.vertices[vertices], faces, vertices, len(self.vertices), component)

    def masses(self) -> NDArray[np.float64]:
        """The area of each vertex, a third of that of its faces: (p,)."""
        thirds = np.repeat(face_areas(self.vertices, self.faces) / 3, 3)
        return np.asarray(np.bincount(self.faces.ravel(), thirds, len(self.vertices)), np.float64)

    def solver(self) -> SpectrumSolver:
        """The eigensolver of the surface, in its present size."""
        return SpectrumSolver(*stiffness_and_mass(self.vertices, self.faces), self.component)


def first_eigenpairs(surface: Surface, count: int) -> Spectrum:
    """The constant and the ``count`` eigenfunctions after it, of a surface of one component, scaled to area 1.

    Parameters
    ----------
    surface : Surface
    count : int

    Returns
    -------
    Spectrum
        with ``count + 1`` columns; fewer if the surface has not so many vertices

    Raises
    ------
    heatwalk.spectrum.SpectrumError
        If the eigensolver does not reach its required residual.

    Examples
    --------
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(3)
    >>> pairs = first_eigenpairs(Surface.of(sphere.vertices, sphere.faces), 3)
    >>> (pairs.eigenvalues / (4 * np.pi)).round(1)
    array([[0., 2., 2., 2.]])
    """
    count = min(count, len(surface.vertices) - 1)
    solver = _scaled(surface).solver()
    limit = 4 * np.pi * (count + 1)  # as many as there are on an average surface of area 1, by Weyl's law
    while (spectrum := solver.up_to(limit)).eigenvalues.shape[1] <= count:
        limit *= 2
    width = count + 1
    return Spectrum(
        spectrum.eigenvalues[:, :width],
        spectrum.eigenvectors[:, :width],
        spectrum.component,
        spectrum.mass,
        float(spectrum.eigenvalues[0, count]),
        spectrum.residual,
    )


def eigenpairs_up_to(surface: Surface, limit: float) -> Spectrum:
    """The eigenpairs up to an eigenvalue of a surface of one component, which is scaled to area 1."""
    return _scaled(surface).solver().up_to(limit)


def _scaled(surface: Surface) -> Surface:
    """The surface scaled to area 1."""
    return dataclasses.replace(surface, vertices=unit_area(surface.vertices, surface.faces))


def segment_surface(
    surface: Surface, n_segments: int, segment: Callable[[Surface, int], NDArray[np.int64]]
) -> NDArray[np.int64]:
    """Segment each component of a surface on its own, with its share of the segments.

    Parameters
    ----------
    surface : Surface
    n_segments : int
    segment : callable
        (a surface of one component, a number of segments above 1) -> labels of its vertices, 0, 1, 2 …

    Returns
    -------
    (n,) int64 array
        labels of the vertices of the mesh, see `segment_components`

    Examples
    --------
    >>> import trimesh
    >>> sphere = trimesh.creation.icosphere(1)
    >>> two = sphere + sphere.copy().apply_translation([3, 0, 0])
    >>> segment_surface(Surface.of(two.vertices, two.faces), 2, lambda part, count: part.faces)[[0, 50]]
    array([0, 1])
    """

    def segment_part(vertices: NDArray[np.int64], count: int) -> NDArray[np.int64]:
        return segment(surface.part(vertices), count)

    labels = segment_components(surface.vertices, surface.component, surface.masses(), n_segments, segment_part)
    return surface.on_mesh(labels)


def scaled_to_unit_area(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.float64]:
    """The vertices of a mesh scaled to area 1; those without a face are moved into the mesh.

    Raises
    ------
    heatwalk.MeshError
        If the mesh has no area, or a coordinate of a face is NaN or infinite.
    """
    used = referenced(faces, len(vertices))
    if not np.isfinite(vertices[used]).all():
        raise MeshError("a vertex of a face has NaN or infinite coordinates")
    corners = vertices[faces].reshape(-1, 3)
    if not np.ptp(corners, axis=0).max() > 0:
        raise MeshError(_NO_AREA.format(len(faces)))
    vertices = np.where(used[:, None], vertices, corners[0])
    extent = np.ptp(vertices, axis=0).max()
    if not face_areas(vertices / extent, faces).sum() > 0:
        raise MeshError(_NO_AREA.format(len(faces)))
    return unit_area(vertices, faces)


def _is_collapsed(vertices: NDArray[np.float64], faces: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Whether two corners of each face coincide: (m,)."""
    corners = vertices[faces]
    sides = np.abs(corners - np.roll(corners, 1, axis=1)).max(axis=2)
    return sides.min(axis=1) <= DEGENERATE_RATIO * sides.max(axis=1)
