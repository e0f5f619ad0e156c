"""The eigenpairs of any mesh, and what is left of a mesh as a surface."""

import numpy as np
import pytest
import scipy.linalg
import trimesh

from heatwalk import MeshError
from heatwalk.laplacian import stiffness_and_mass, unit_area
from studies.segmenters._spectrum import Surface, eigenpairs_up_to, first_eigenpairs, scaled_to_unit_area
from tests.helpers.parts import star


def test_first_eigenpairs_are_those_of_a_dense_solver_on_the_mesh_of_area_1():
    vertices, faces, _ = star(2)
    stiffness, mass = stiffness_and_mass(unit_area(vertices, faces), faces)
    expected = scipy.linalg.eigh(stiffness.toarray(), np.diag(mass), eigvals_only=True)[:8]
    spectrum = first_eigenpairs(Surface.of(30 * vertices + 5, faces), 7)
    assert spectrum.eigenvectors.shape == (len(vertices), 8)
    assert spectrum.eigenvalues[0] == pytest.approx(expected, abs=1e-9)


def test_a_part_has_the_eigenvalues_that_it_has_alone():
    vertices, faces, _ = star(2)
    sphere = trimesh.creation.icosphere(1)
    both = Surface.of(
        np.vstack([sphere.vertices + 9, vertices]), np.vstack([sphere.faces, faces + len(sphere.vertices)])
    )
    part = both.part(np.flatnonzero(both.component == 1))
    alone = Surface.of(vertices, faces)
    assert first_eigenpairs(part, 5).eigenvalues[0] == pytest.approx(first_eigenpairs(alone, 5).eigenvalues[0])
    assert np.array_equal(part.on_mesh(np.zeros(len(vertices), int)) == 0, both.component == 1)


def test_a_small_surface_has_fewer_eigenpairs_than_asked_for():
    tetrahedron = np.vstack([np.zeros(3), np.eye(3)]), np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]])
    assert first_eigenpairs(Surface.of(*tetrahedron), 10).eigenvectors.shape == (4, 4)


def test_all_eigenvalues_up_to_a_limit_are_there():
    surface = Surface.of(*star(2)[:2])
    limit = first_eigenpairs(surface, 9).eigenvalues[0, -1]
    assert eigenpairs_up_to(surface, limit * 1.0001).eigenvalues.shape[1] == 10


def test_what_is_no_surface_is_left_out():
    vertices, faces, _ = star(1)
    n = len(vertices)
    with_rubbish = np.vstack([vertices, vertices[:1], [[50.0, 0, 0]]])
    surface = Surface.of(with_rubbish, np.vstack([faces, faces[3:4, ::-1], [[0, 1, n]], [[2, 2, 5]]]))
    assert np.array_equal(surface.kept, range(n))
    assert len(surface.faces) == len(faces)
    assert np.array_equal(surface.on_mesh(np.arange(n)), [*range(n), -1, -1])


def test_masses_are_the_area():
    surface = Surface.of(*star(2)[:2])
    assert surface.masses().sum() == pytest.approx(1)
    assert (surface.masses() > 0).all()


@pytest.mark.parametrize("scale", [1e-200, 1, 1e200])
def test_scaling_ignores_vertices_without_a_face(scale):
    vertices, faces, _ = star(1)
    scaled = scaled_to_unit_area(scale * np.vstack([vertices, [[1e3, np.nan, 0]]]), faces)
    assert trimesh.Trimesh(scaled, faces, process=False).area == pytest.approx(1)


@pytest.mark.parametrize("vertices", [np.zeros((3, 3)), np.arange(3.0)[:, None] * np.ones(3)])
def test_a_mesh_without_area_is_refused(vertices):
    with pytest.raises(MeshError, match="no area"):
        scaled_to_unit_area(vertices, np.array([[0, 1, 2]]))
