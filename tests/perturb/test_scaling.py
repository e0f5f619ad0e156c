"""Scaling: coordinates are multiplied, and nothing else changes."""

import numpy as np
import pytest

import perturb
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng


@pytest.mark.parametrize("factor", [0.5, 1.5, 3, 10])
def test_scaling_multiplies_the_coordinates_and_changes_nothing_else(factor):
    mesh = bundled("bunny")
    result = perturb.Scaling(factor)(mesh, rng())
    np.testing.assert_array_equal(result.mesh.vertices, factor * mesh.vertices)
    np.testing.assert_array_equal(result.mesh.faces, mesh.faces)
    np.testing.assert_array_equal(result.counterpart, np.arange(len(mesh.vertices)))
    assert result.mesh.area == pytest.approx(factor**2 * mesh.area, rel=1e-12)
