import numpy as np
import pytest
import scipy.sparse.linalg
import trimesh
from scipy.spatial import Delaunay

from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from tests.helpers.dense import cotangent_operator
from tests.helpers.meshes import bundled

REAL = ["ant", "cow", "bunny", "airplane", "bone"]


def operator(mesh):
    return stiffness_and_mass(unit_area(mesh.vertices, mesh.faces), mesh.faces)


@pytest.mark.parametrize("name", REAL)
def test_stiffness_is_symmetric_with_zero_row_sums(name):
    stiffness, _ = operator(bundled(name))
    assert abs(stiffness - stiffness.T).max() == 0
    assert np.abs(stiffness.sum(axis=1)).max() < 1e-12 * abs(stiffness).max()


@pytest.mark.parametrize("name", REAL)
def test_stiffness_is_positive_semi_definite(name):
    stiffness, _ = operator(bundled(name))
    scale = abs(stiffness).max()
    lowest = scipy.sparse.linalg.eigsh(stiffness / scale, 1, sigma=-1e-3, return_eigenvectors=False)
    assert lowest[0] > -1e-12


@pytest.mark.parametrize("name", REAL)
def test_masses_sum_to_the_area_of_one(name):
    _, mass = operator(bundled(name))
    assert mass.min() > 0
    assert mass.sum() == pytest.approx(1, rel=1e-12)


def test_stiffness_and_mass_equal_those_computed_from_the_angles():
    mesh = bundled("ant")
    stiffness, mass = stiffness_and_mass(mesh.vertices, mesh.faces)
    expected_stiffness, expected_mass = cotangent_operator(mesh.vertices, mesh.faces)
    np.testing.assert_allclose(stiffness.toarray(), expected_stiffness, atol=1e-9 * abs(expected_stiffness).max())
    np.testing.assert_allclose(mass, np.diag(expected_mass), rtol=1e-9)


def test_dirichlet_energy_of_a_linear_function_on_a_plane_is_area_times_slope_squared():
    rng = np.random.default_rng(1)
    points = np.column_stack([rng.random((300, 2)), np.zeros(300)])
    faces = Delaunay(points[:, :2]).simplices  # any triangulation: obtuse and sliver triangles are among these
    stiffness, mass = stiffness_and_mass(points, faces)
    slope = np.array([3.0, -2.0, 0.0])
    height = points @ slope
    assert height @ stiffness @ height == pytest.approx(mass.sum() * (slope @ slope), rel=1e-9)


def test_the_papers_operator_is_a_sixth_of_the_laplace_beltrami_operator():
    # Desbrun et al. 1999: (1/4A) Σ (cot α + cot β)(x_j − x_i) with A the whole ring. On a sphere of radius R the
    # Laplace-Beltrami operator takes the coordinates to a vector of length 2/R.
    mesh = trimesh.creation.icosphere(4, radius=1.5)
    stiffness, mass = stiffness_and_mass(mesh.vertices, mesh.faces)
    whole_ring = 3 * mass
    desbrun = -2 * (stiffness @ mesh.vertices) / (4 * whole_ring[:, None])
    regular = np.bincount(mesh.faces.ravel()) == 6  # at the twelve others no lumped mass converges point by point
    np.testing.assert_allclose(6 * np.linalg.norm(desbrun[regular], axis=1), 2 / 1.5, rtol=2e-2)


def test_a_zero_area_triangle_leaves_everything_finite_and_semi_definite():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [2, 0, 0], [1, 1, 0], [1, -1, 0]], dtype=float)
    faces = np.array([[0, 1, 2], [0, 1, 3], [1, 2, 3], [2, 0, 4], [0, 0, 3]])
    stiffness, mass = stiffness_and_mass(vertices, faces)
    assert np.isfinite(stiffness.toarray()).all()
    assert (mass > 0).all()
    eigenvalues = np.linalg.eigvalsh(stiffness.toarray())
    assert eigenvalues[0] > -1e-12 * eigenvalues[-1]
    assert np.abs(stiffness.sum(axis=1)).max() < 1e-12 * eigenvalues[-1]


def test_a_triangle_of_coincident_points_conducts_nothing():
    mesh = bundled("ant")
    points = np.vstack([mesh.vertices, np.tile(mesh.vertices[0], (2, 1))])
    n = len(mesh.vertices)
    faces = np.vstack([mesh.faces, [[0, n, n + 1]]])
    stiffness, _ = stiffness_and_mass(points, faces)
    expected, _ = stiffness_and_mass(mesh.vertices, mesh.faces)
    assert abs(stiffness[:n][:, :n] - expected).max() == 0
    assert abs(stiffness[n:]).max() == 0


@pytest.mark.parametrize("scale", [1e-200, 1e-30, 1.0, 1e30, 1e200])
def test_unit_area_holds_at_any_scale(scale):
    mesh = bundled("cow")
    scaled = unit_area(mesh.vertices * scale, mesh.faces)
    np.testing.assert_allclose(scaled, unit_area(mesh.vertices, mesh.faces), rtol=0, atol=1e-12)
    assert trimesh.Trimesh(scaled, mesh.faces, process=False).area == pytest.approx(1)


def test_components_are_numbered_by_their_smallest_vertex():
    faces = np.array([[5, 6, 7], [0, 2, 4], [1, 3, 8], [8, 9, 3]])
    assert vertex_components(10, faces).tolist() == [0, 1, 0, 1, 0, 2, 2, 2, 1, 1]
