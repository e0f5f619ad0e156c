import numpy as np
import pytest
import scipy.linalg
import scipy.sparse as sp
import trimesh
from scipy.sparse.linalg import eigsh

import heatwalk
import perturb
from heatwalk import spectrum as spectrum_module
from heatwalk.kernel import largest_eigenvalue
from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.spectrum import SpectrumError, SpectrumSolver
from studies.metrics.change_percentage import change_percentage
from tests.helpers.meshes import bundled


def solver(vertices, faces, scale=True):
    points = unit_area(vertices, faces) if scale else vertices
    stiffness, mass = stiffness_and_mass(points, faces)
    return SpectrumSolver(stiffness, mass, vertex_components(len(vertices), faces))


def flat_torus(n):
    """Stiffness and mass of the square torus of area 1 with n² vertices.

    It has no place in space without bending; all its triangles are congruent to one of the plane, and only the
    connectivity wraps around.
    """
    i, j = np.divmod(np.arange(n * n), n)
    here, right = i * n + j, i * n + (j + 1) % n
    up, across = (i + 1) % n * n + j, (i + 1) % n * n + (j + 1) % n
    faces = np.vstack([np.column_stack([here, right, across]), np.column_stack([across, up, here])])
    triangle = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0]]) / n
    local, mass = stiffness_and_mass(triangle, np.array([[0, 1, 2]]))
    entries = np.tile(local.toarray().ravel(), len(faces))
    stiffness = sp.coo_array((entries, (np.repeat(faces, 3, axis=1).ravel(), np.tile(faces, (1, 3)).ravel())))
    return stiffness.tocsc(), np.bincount(faces.ravel(), np.tile(mass, len(faces)))


def test_eigenvalues_of_the_sphere_converge_under_refinement():
    exact = 4 * np.pi * np.repeat([k * (k + 1) for k in range(6)], [2 * k + 1 for k in range(6)])
    errors = []
    for level in (3, 4, 5):
        mesh = trimesh.creation.icosphere(level)
        found = solver(mesh.vertices, mesh.faces).up_to(exact[-1] + 20).eigenvalues[0]
        assert len(found) == 36  # every one of the multiple eigenvalues' 1 + 3 + 5 + 7 + 9 + 11 copies
        errors.append(np.abs(found[1:] / exact[1:] - 1).max())
    assert errors[2] < 0.005
    # The error is proportional to the squared edge length, which each level halves.
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.15)


def test_eigenvalues_of_the_flat_torus_converge_under_refinement():
    waves = np.array([a * a + b * b for a in range(-4, 5) for b in range(-4, 5)])
    exact = 4 * np.pi**2 * np.sort(waves[waves <= 5])
    errors = []
    for n in (20, 40, 80):
        stiffness, mass = flat_torus(n)
        found = SpectrumSolver(stiffness, mass, np.zeros(n * n, dtype=int)).up_to(exact[-1] * 1.1).eigenvalues[0]
        assert len(found) == len(exact)
        errors.append(np.abs(found[1:] / exact[1:] - 1).max())
    assert errors[2] < 0.01
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.15)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.15)


@pytest.mark.parametrize("name", ["ant", "airplane"])
def test_eigenpairs_equal_those_of_a_dense_solver(name):
    mesh = bundled(name)
    points = unit_area(mesh.vertices, mesh.faces)
    stiffness, mass = stiffness_and_mass(points, mesh.faces)
    component = vertex_components(len(points), mesh.faces)
    found = SpectrumSolver(stiffness, mass, component).up_to(400)
    expected = scipy.linalg.eigh(stiffness.toarray(), np.diag(mass), eigvals_only=True)
    expected = expected[expected <= 400]
    ours = np.sort(found.eigenvalues[np.isfinite(found.eigenvalues)])
    np.testing.assert_allclose(ours[: len(expected)], expected, rtol=1e-8, atol=1e-8)
    assert found.residual <= spectrum_module.MAX_RESIDUAL


def test_eigenvectors_are_orthonormal_under_the_mass_and_satisfy_the_equation():
    mesh = bundled("bunny")
    points = unit_area(mesh.vertices, mesh.faces)
    stiffness, mass = stiffness_and_mass(points, mesh.faces)
    found = SpectrumSolver(stiffness, mass, vertex_components(len(points), mesh.faces)).up_to(300)
    values, vectors = found.eigenvalues[0], found.eigenvectors
    assert len(values) > 20
    np.testing.assert_allclose(vectors.T @ (mass[:, None] * vectors), np.eye(len(values)), atol=1e-9)
    np.testing.assert_allclose(stiffness @ vectors, mass[:, None] * vectors * values, atol=1e-7)
    assert np.ptp(vectors[:, 0]) < 1e-13 * abs(vectors[0, 0])


def test_the_same_mesh_gives_the_same_bits():
    mesh = bundled("bunny")
    first, second = (solver(mesh.vertices, mesh.faces).up_to(200) for _ in range(2))
    assert np.array_equal(first.eigenvalues, second.eigenvalues)
    assert np.array_equal(first.eigenvectors, second.eigenvectors)


def test_a_higher_limit_extends_the_spectrum():
    mesh = bundled("bunny")
    once = solver(mesh.vertices, mesh.faces)
    few, many = once.up_to(60), once.up_to(500)
    assert few.eigenvalues.shape[1] < many.eigenvalues.shape[1]
    assert few.eigenvalues.max() <= 60 < many.eigenvalues.max() <= 500
    np.testing.assert_allclose(many.eigenvalues[0, : few.eigenvalues.shape[1]], few.eigenvalues[0], rtol=1e-9)


def test_a_limit_inside_a_multiple_eigenvalue_keeps_all_its_copies():
    mesh = trimesh.creation.icosphere(4)
    once = solver(mesh.vertices, mesh.faces)
    triple = once.up_to(60).eigenvalues[0, 1:4]
    assert np.ptp(triple) < 1e-6 * triple[0]
    assert once.up_to(triple.min()).eigenvalues.shape[1] == 4


def test_every_one_of_many_components_has_its_exact_constant():
    rng = np.random.default_rng(2)
    specks = [trimesh.creation.icosahedron() for _ in range(30)]
    for speck in specks:
        speck.apply_scale(rng.uniform(0.01, 0.05))
        speck.apply_translation(rng.uniform(3, 9, 3))
    mesh = trimesh.util.concatenate([bundled("bunny"), *specks])
    found = solver(mesh.vertices, mesh.faces).up_to(200)
    assert found.eigenvalues.shape[0] == 31
    assert (found.eigenvalues[:, 0] == 0).all()
    for c in range(31):
        members = found.component == c
        expected = 1 / np.sqrt(found.mass[members].sum())
        np.testing.assert_allclose(found.eigenvectors[members, 0], expected, rtol=1e-12)


def test_a_component_alone_and_among_others_has_the_same_eigenvalues():
    bunny, ant = bundled("bunny"), bundled("ant")
    both = trimesh.util.concatenate([bunny, ant])
    points = unit_area(both.vertices, both.faces)
    together = solver(points, both.faces, scale=False).up_to(300)
    n = len(bunny.vertices)
    alone = solver(points[:n], bunny.faces, scale=False).up_to(300)
    values = together.eigenvalues[together.component[0]]
    np.testing.assert_allclose(values[np.isfinite(values)], alone.eigenvalues[0], rtol=1e-9, atol=1e-9)


def test_a_missed_residual_is_an_error(monkeypatch):
    mesh = bundled("bunny")
    monkeypatch.setattr(spectrum_module, "MAX_RESIDUAL", 1e-18)
    with pytest.raises(SpectrumError, match=r"residual of .* remesh or clean"):
        solver(mesh.vertices, mesh.faces).up_to(200)


@pytest.mark.parametrize("factor", [1, spectrum_module.ROUNDING_FACTOR])
def test_residuals_from_rounding_next_to_slivers_are_accepted_because_no_label_depends_on_them(factor, monkeypatch):
    mesh = bundled("cow")
    slivers = perturb.Slivers(0.8, aspect=3000)(mesh, np.random.default_rng(1))
    monkeypatch.setattr(spectrum_module, "ROUNDING_FACTOR", factor)
    if factor == 1:
        with pytest.raises(SpectrumError, match="very flat or very unequal triangles"):
            heatwalk.segment(slivers.mesh.vertices, slivers.mesh.faces)
        return
    found = heatwalk.segment(slivers.mesh.vertices, slivers.mesh.faces).labels[slivers.counterpart]
    assert change_percentage(heatwalk.segment(mesh.vertices, mesh.faces).labels, found) < 0.5


@pytest.mark.parametrize("size", [1e-4, 1e-8])
def test_vertices_of_next_to_no_mass_do_not_spoil_a_small_component(size, monkeypatch):
    ball = trimesh.creation.icosphere(2)
    vertices, faces = np.array(ball.vertices), np.array(ball.faces)
    ring = np.unique(faces[(faces == 7).any(axis=1)])
    vertices[ring] = vertices[7] + size * (vertices[ring] - vertices[7])
    dense = solver(vertices, faces).up_to(100)
    assert dense.mass.min() < 0.1 * size * dense.mass.max()
    monkeypatch.setattr(spectrum_module, "MAX_DENSE_SIZE", 0)
    sparse = solver(vertices, faces).up_to(100)
    assert dense.residual < spectrum_module.MAX_RESIDUAL
    assert np.allclose(dense.eigenvalues, sparse.eigenvalues, rtol=1e-9)
    similarity = dense.eigenvectors.T @ (dense.mass[:, None] * sparse.eigenvectors)
    assert np.allclose(np.linalg.svd(similarity)[1], 1, atol=1e-7)


def test_fiedler_value_of_the_unit_area_sphere_is_eight_pi():
    mesh = trimesh.creation.icosphere(5)
    assert solver(mesh.vertices, mesh.faces).fiedler_value() == pytest.approx(8 * np.pi, rel=2e-3)


@pytest.mark.parametrize("time", [0.13, 1.0, 12.0])
def test_arpack_finds_the_same_eigenpairs(time):
    """An independent solver, at times that need about 150, 20 and 3 pairs: equal eigenvalues, equal kernels."""
    mesh = bundled("cow")
    points = unit_area(mesh.vertices, mesh.faces)
    stiffness, mass = stiffness_and_mass(points, mesh.faces)
    component = vertex_components(len(points), mesh.faces)
    found = SpectrumSolver(stiffness, mass, component).up_to(largest_eigenvalue(time / 6))
    assert component.max() == 0
    count = found.eigenvalues.shape[1]
    values, vectors = eigsh(stiffness, count, sp.diags_array(mass).tocsc(), sigma=-10.0, v0=np.ones(len(mass)), tol=0)
    order = np.argsort(values)
    values, vectors = values[order], vectors[:, order]
    np.testing.assert_allclose(found.eigenvalues[0, 1:], values[1:], rtol=1e-9)
    rows = slice(0, None, 50)
    decay = np.exp(-values * time / 6)
    expected = (vectors[rows] * decay) @ vectors.T
    kernel = (found.eigenvectors[rows] * np.exp(-found.eigenvalues[0] * time / 6)) @ found.eigenvectors.T
    np.testing.assert_allclose(kernel, expected, rtol=0, atol=1e-9 * np.abs(expected).max())


def test_no_copy_of_a_multiple_eigenvalue_is_missed_at_any_limit():
    mesh = trimesh.creation.icosphere(3)
    stiffness, mass = stiffness_and_mass(unit_area(mesh.vertices, mesh.faces), mesh.faces)
    every = scipy.linalg.eigh(stiffness.toarray(), np.diag(mass), eigvals_only=True)
    for last in range(2, 60, 4):
        limit = every[last] * (1 + 1e-5)
        once = SpectrumSolver(stiffness, mass, np.zeros(len(mass), dtype=int))
        assert once.up_to(limit).eigenvalues.shape[1] == np.searchsorted(every, limit), f"up to eigenvalue {last}"


def test_thousands_of_specks_are_solved_separately():
    speck = trimesh.creation.icosahedron()
    n, count = len(speck.vertices), 2000
    shift = np.arange(count)
    vertices = (speck.vertices + 3 * shift[:, None, None] * [1, 0, 0]).reshape(-1, 3)
    faces = (speck.faces + n * shift[:, None, None]).reshape(-1, 3)
    once = solver(vertices, faces)
    found = once.up_to(40 * count)
    alone = solver(speck.vertices, speck.faces).up_to(40).eigenvalues[0]
    np.testing.assert_allclose(found.eigenvalues, np.tile(alone * count, (count, 1)), rtol=1e-9, atol=1e-6)


def copies_of_a_sphere(count, refinements):
    """Stiffness and mass of ``count`` equal disjoint spheres, and every eigenvalue of the whole, by a dense solver."""
    mesh = trimesh.creation.icosphere(refinements)
    stiffness, mass = stiffness_and_mass(unit_area(mesh.vertices, mesh.faces), mesh.faces)
    one = scipy.linalg.eigh(stiffness.toarray(), np.diag(mass), eigvals_only=True)
    return sp.block_diag([stiffness] * count).tocsc(), np.tile(mass, count), np.sort(np.tile(one, count))


@pytest.mark.parametrize(("count", "refinements", "limit"), [(9, 3, 30), (12, 2, 20), (12, 2, 30), (40, 2, 20)])
def test_more_copies_of_an_eigenvalue_than_the_block_has_columns_are_all_found(count, refinements, limit):
    # Handed in as one component, so that 0 has ``count`` copies, and the first triple eigenvalue three times as many.
    stiffness, mass, every = copies_of_a_sphere(count, refinements)
    found = SpectrumSolver(stiffness, mass, np.zeros(len(mass), dtype=int)).up_to(limit).eigenvalues[0]
    np.testing.assert_allclose(found, every[every <= limit], rtol=1e-9, atol=1e-9)


def nearly_copies(count, refinements):
    """The same, of spheres that differ by a thousandth from one to the next: no two eigenvalues are equal."""
    mesh = trimesh.creation.icosphere(refinements)
    stiffness, mass = stiffness_and_mass(unit_area(mesh.vertices, mesh.faces), mesh.faces)
    one = scipy.linalg.eigh(stiffness.toarray(), np.diag(mass), eigvals_only=True)
    scale = 1 + 0.001 * np.arange(count)
    return (
        sp.block_diag([s * stiffness for s in scale]).tocsc(),
        np.tile(mass, count),
        np.sort(np.outer(scale, one).ravel()),
    )


@pytest.mark.parametrize(("count", "refinements", "limit"), [(9, 3, 30), (12, 2, 20), (40, 2, 20)])
def test_crowds_of_eigenvalues_that_are_nearly_copies_are_all_found(count, refinements, limit):
    stiffness, mass, every = nearly_copies(count, refinements)
    found = SpectrumSolver(stiffness, mass, np.zeros(len(mass), dtype=int)).up_to(limit).eigenvalues[0]
    np.testing.assert_allclose(found, every[every <= limit], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("crowd", [copies_of_a_sphere, nearly_copies])
@pytest.mark.parametrize(("count", "refinements", "limit"), [(9, 3, 30), (12, 2, 30), (40, 2, 20)])
def test_the_probe_that_spares_a_repetition_finds_what_is_missing(crowd, count, refinements, limit, monkeypatch):
    monkeypatch.setattr(spectrum_module, "MANY_PAIRS", 0)
    stiffness, mass, every = crowd(count, refinements)
    found = SpectrumSolver(stiffness, mass, np.zeros(len(mass), dtype=int)).up_to(limit).eigenvalues[0]
    np.testing.assert_allclose(found, every[every <= limit], rtol=1e-9, atol=1e-9)


def test_hundreds_of_eigenvalues_that_are_close_by_chance_are_found_in_one_iteration(monkeypatch):
    # Spikes that are longer than the body: each has small eigenvalues of its own, of about the same size.
    mesh = trimesh.creation.icosphere(4)
    rng = np.random.default_rng(4)
    spikes = rng.choice(len(mesh.vertices), 300, replace=False)
    vertices = np.array(mesh.vertices)
    vertices[spikes] *= rng.uniform(2.5, 3, size=(300, 1))
    once, repeated = (solver(vertices, mesh.faces) for _ in range(2))
    found = once.up_to(600).eigenvalues
    monkeypatch.setattr(spectrum_module, "MANY_PAIRS", found.size + 1)
    np.testing.assert_allclose(found, repeated.up_to(600).eigenvalues, rtol=1e-9)
    assert once._parts[0].width < repeated._parts[0].width
    assert found.size > 200


def test_without_wider_blocks_copies_would_be_missed(monkeypatch):
    stiffness, mass, every = copies_of_a_sphere(12, 2)
    monkeypatch.setattr(spectrum_module, "COPY_TOLERANCE", -1)  # nothing is ever that near
    monkeypatch.setattr(spectrum_module, "CLUSTER_TOLERANCE", -1)
    unprobed = SpectrumSolver(stiffness, mass, np.zeros(len(mass), dtype=int)).up_to(20).eigenvalues[0]
    assert len(unprobed) == 1 + spectrum_module.BLOCK_WIDTH < np.searchsorted(every, 20)


def test_a_matrix_that_is_not_semi_definite_is_an_error():
    mesh = bundled("bunny")
    stiffness, mass = stiffness_and_mass(unit_area(mesh.vertices, mesh.faces), mesh.faces)
    with pytest.raises(SpectrumError, match=r"cannot be factorised: .* remesh or clean"):
        SpectrumSolver(-stiffness, mass, np.zeros(len(mass), dtype=int))
