import numpy as np
import pytest

from heatwalk.numerics import lanczos
from heatwalk.numerics.lanczos import Basis


def filled(n, n_blocks, width=2):
    columns = np.linalg.qr(np.random.default_rng(0).standard_normal((n, n_blocks * width)))[0]
    basis = Basis(np.asfortranarray(columns[:, :width]))
    for start in range(width, columns.shape[1], width):
        basis.append(columns[:, start : start + width])
    return basis, columns


@pytest.mark.parametrize("n_blocks", [1, 3, 4, 7, 12])
@pytest.mark.parametrize("share", [0, 0.3, 0.6, 1])
def test_combinations_in_the_memory_of_the_basis_equal_those_of_its_columns(n_blocks, share, monkeypatch):
    monkeypatch.setattr(lanczos, "STRIPE", 64)
    basis, columns = filled(501, n_blocks)
    mix = np.random.default_rng(1).standard_normal((columns.shape[1], round(share * columns.shape[1])))
    np.testing.assert_allclose(basis.combine(mix), columns @ mix, rtol=0, atol=1e-13)


def test_a_block_is_split_into_coefficients_and_an_orthonormal_rest():
    basis, columns = filled(501, 7)
    block = np.random.default_rng(1).standard_normal((501, 2))
    inner, rest, coupling = basis.split(np.asfortranarray(block))
    np.testing.assert_allclose(inner, columns.T @ block, rtol=0, atol=1e-12)
    np.testing.assert_allclose(columns @ inner + rest @ coupling, block, rtol=0, atol=1e-12)
    np.testing.assert_allclose(rest.T @ np.hstack([columns, rest]), np.eye(2, 16, 14), rtol=0, atol=1e-13)
