import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import spsolve

from heatwalk.laplacian import stiffness_and_mass, unit_area
from heatwalk.numerics.solver import PositiveDefiniteSolver
from heatwalk.numerics.sparse import diagonal_block, permute_symmetric, scale_symmetric
from tests.helpers.meshes import bundled


def scaled_stiffness(name):
    mesh = bundled(name)
    stiffness, mass = stiffness_and_mass(unit_area(mesh.vertices, mesh.faces), mesh.faces)
    return scale_symmetric(stiffness, mass**-0.5)


@pytest.mark.parametrize("n_columns", [1, 2, 5])
@pytest.mark.parametrize("name", ["ant", "cow", "airplane"])
def test_solutions_in_elimination_order_equal_those_of_superlu(name, n_columns):
    matrix = scaled_stiffness(name)
    solver = PositiveDefiniteSolver(matrix, shift=-10.0)
    right = np.random.default_rng(0).standard_normal((matrix.shape[0], n_columns))
    found = np.empty_like(right)
    found[solver.order] = solver.solve(right[solver.order])
    expected = spsolve((matrix + 10 * sp.eye_array(len(right))).tocsc(), right).reshape(right.shape)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-10 * np.abs(expected).max())


def test_the_matrix_of_the_solver_is_the_original_in_elimination_order():
    matrix = scaled_stiffness("ant")
    solver = PositiveDefiniteSolver(matrix, shift=-10.0)
    assert np.array_equal(np.sort(solver.order), np.arange(matrix.shape[0]))
    assert np.array_equal(solver.matrix.toarray(), matrix.toarray()[np.ix_(solver.order, solver.order)])


@pytest.mark.parametrize("width", [1, 400])  # eliminated by the loops, and by LAPACK
def test_a_matrix_that_is_not_positive_definite_is_an_error(width):
    rng = np.random.default_rng(0)
    block = rng.standard_normal((width, width))
    matrix = sp.block_diag([block @ block.T + np.eye(width)] * 3).tocsr()
    PositiveDefiniteSolver(matrix)
    with pytest.raises(np.linalg.LinAlgError):
        PositiveDefiniteSolver(matrix, shift=1e4 * width)


def test_sparse_operations_equal_the_dense_ones():
    rng = np.random.default_rng(0)
    dense = np.triu(rng.random((30, 30)) * (rng.random((30, 30)) < 0.2))
    dense += dense.T
    scale, order = rng.random(30), rng.permutation(30)
    matrix = sp.csc_array(dense)
    np.testing.assert_allclose(scale_symmetric(matrix, scale).toarray(), dense * np.outer(scale, scale), rtol=1e-15)
    assert np.array_equal(permute_symmetric(matrix.tocsr(), order).toarray(), dense[np.ix_(order, order)])
    blocks = sp.block_diag([dense[:10, :10], dense[10:, 10:]]).tocsr()
    assert np.array_equal(diagonal_block(blocks, 10, 30).toarray(), dense[10:, 10:])
