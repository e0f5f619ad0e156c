import numpy as np
import pytest
import scipy.sparse as sp
import trimesh
from scipy.sparse.linalg import spsolve

from heatwalk.laplacian import stiffness_and_mass, unit_area
from heatwalk.numerics.cholesky import Cholesky
from heatwalk.numerics.dissection import nested_dissection
from tests.helpers.meshes import bundled


def shifted(mesh):
    """Stiffness + mass of a mesh, with the mesh scaled to area 1: symmetric positive definite."""
    stiffness, mass = stiffness_and_mass(unit_area(mesh.vertices, mesh.faces), mesh.faces)
    return (stiffness + sp.diags_array(mass)).tocsr()


def factorised(matrix):
    order, pieces = nested_dissection(matrix)
    return order, Cholesky(matrix[order][:, order], pieces)


def graph_matrix(n, edges):
    i, j = np.asarray(edges).T
    weight = sp.coo_array((np.full(len(i), -1.0), (i, j)), shape=(n, n)).tocsr()
    weight = weight + weight.T
    return (weight - sp.diags_array(weight.sum(axis=1) - 1)).tocsr()


@pytest.mark.parametrize("name", ["ant", "cow", "bunny", "airplane", "bone"])
def test_solutions_equal_those_of_superlu(name):
    matrix = shifted(bundled(name))
    order, factors = factorised(matrix)
    right = np.random.default_rng(0).standard_normal((len(order), 3))
    found = np.empty_like(right)
    found[order] = factors.solve(right[order])
    expected = spsolve(matrix.tocsc(), right)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_the_order_contains_every_vertex_once_in_non_empty_pieces():
    matrix = shifted(bundled("cow"))
    order, pieces = nested_dissection(matrix)
    assert np.array_equal(np.sort(order), np.arange(matrix.shape[0]))
    assert pieces[0] == 0
    assert pieces[-1] == matrix.shape[0]
    assert (np.diff(pieces) > 0).all()


def test_a_factor_fills_in_no_more_than_n_log_n():
    # 31/8 n log2 n is what nested dissection leaves on a square grid (George 1973).
    for level in (4, 5, 6):
        matrix = shifted(trimesh.creation.icosphere(level))
        _, factors = factorised(matrix)
        n = matrix.shape[0]
        assert factors.n_entries < 31 / 8 * n * np.log2(n)


@pytest.mark.parametrize(
    ("n", "edges"),
    [
        pytest.param(5001, [(0, i) for i in range(1, 5001)], id="star"),
        pytest.param(5001, [(0, i) for i in range(1, 5001)] + [(i, i % 5000 + 1) for i in range(1, 5001)], id="fan"),
        pytest.param(5000, [(i, i + 1) for i in range(4999)], id="path"),
        pytest.param(5000, [(0, 1)], id="isolated vertices"),
        pytest.param(300, [(i, j) for i in range(300) for j in range(i)], id="everything with everything"),
    ],
)
def test_graphs_without_thin_middles_are_solved_in_little_memory(n, edges):
    matrix = graph_matrix(n, edges)
    order, factors = factorised(matrix)
    right = np.random.default_rng(0).standard_normal((n, 2))
    found = factors.solve(right[order])
    np.testing.assert_allclose((matrix @ found[np.argsort(order)]), right, atol=1e-9)
    assert factors.n_entries < 10 * matrix.nnz


def test_the_same_matrix_gives_the_same_bits():
    matrix = shifted(bundled("bunny"))
    right = np.ones((matrix.shape[0], 2))
    assert np.array_equal(factorised(matrix)[1].solve(right), factorised(matrix)[1].solve(right))
