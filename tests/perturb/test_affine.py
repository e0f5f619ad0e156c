"""Affine maps: their condition number, their determinant, and that they are affine."""

import numpy as np
import pytest

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

COW = bundled("cow")


def fitted(result):
    """The linear map from the original's vertices to those of the result, and the largest error of the fit."""
    before, after = (mesh.vertices - mesh.vertices.mean(axis=0) for mesh in (COW, result.mesh))
    matrix, *_ = np.linalg.lstsq(before, after, rcond=None)
    return matrix.T, np.abs(before @ matrix - after).max()


@pytest.mark.parametrize("amount", [1.25, 2, 4])
@pytest.mark.parametrize("method", ["stretch", "shear"])
@pytest.mark.parametrize("seed", range(3))
def test_the_map_is_affine_keeps_the_volume_and_has_the_requested_condition_number(amount, method, seed):
    result = perturb.Affine(amount, method=method)(COW, rng(seed))
    matrix, error = fitted(result)
    assert error < 1e-12 * COW.scale
    assert np.linalg.cond(matrix) == pytest.approx(amount, rel=1e-9)
    assert result.applied["condition_number"] == pytest.approx(amount, rel=1e-12)
    assert result.mesh.volume == pytest.approx(COW.volume, rel=1e-10)


def test_a_stretch_does_not_rotate_and_a_shear_keeps_two_of_three_directions():
    stretch, _ = fitted(perturb.Affine(3)(COW, rng()))
    np.testing.assert_allclose(stretch, stretch.T, atol=1e-12)
    shear, _ = fitted(perturb.Affine(3, method="shear")(COW, rng()))
    np.testing.assert_allclose(np.linalg.matrix_power(shear - np.eye(3), 2), 0, atol=1e-12)


def test_axes_are_random():
    first, second = (fitted(perturb.Affine(3)(COW, rng(seed)))[0] for seed in range(2))
    assert np.abs(first - second).max() > 0.1


def test_an_amount_below_1_is_refused():
    with pytest.raises(PerturbationError, match=r"amount is 0\.5; it must be at least 1"):
        perturb.Affine(0.5)
