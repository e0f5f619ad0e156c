import numpy as np
import pytest
import trimesh

from heatwalk.kernel import HeatKernel, largest_eigenvalue
from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.spectrum import SpectrumSolver
from tests.helpers import dense
from tests.helpers.meshes import bundled

TIME = 1 / 6


def spectrum_of(mesh, time):
    stiffness, mass = stiffness_and_mass(unit_area(mesh.vertices, mesh.faces), mesh.faces)
    component = vertex_components(len(mass), mesh.faces)
    return SpectrumSolver(stiffness, mass, component).up_to(largest_eigenvalue(time))


@pytest.mark.parametrize("name", ["ant", "airplane"])
def test_the_factor_reproduces_the_kernel_of_all_eigenpairs(name):
    mesh = bundled(name)
    expected = dense.heat_kernel(np.asarray(mesh.vertices), mesh.faces, TIME)
    kernel = HeatKernel.from_spectrum(spectrum_of(mesh, TIME), TIME)
    assert kernel.factor.shape[1] < 60
    np.testing.assert_allclose(dense.whole(kernel), expected, rtol=0, atol=1e-9 * expected.max())


@pytest.mark.parametrize("name", ["cow", "bunny"])
def test_unit_heat_stays_unit_heat(name):
    kernel = HeatKernel.from_spectrum(spectrum_of(bundled(name), TIME), TIME)
    mass_of_each = kernel.factor @ (kernel.factor.T @ kernel.mass)
    np.testing.assert_allclose(mass_of_each, 1, rtol=1e-9)


def test_heat_after_two_times_is_heat_after_their_sum():
    mesh = bundled("cow")
    spectrum = spectrum_of(mesh, 0.05)
    a, b, both = (HeatKernel.from_spectrum(spectrum, time).factor for time in (0.05, 0.12, 0.17))
    mass = spectrum.mass
    rows = np.arange(0, len(mass), 7)
    convolved = (a[rows] @ (a.T @ (mass[:, None] * b))) @ b.T
    np.testing.assert_allclose(convolved, both[rows] @ both.T, rtol=0, atol=1e-9 * both[rows].max() ** 2)


def test_the_diagonal_equals_that_of_the_whole_kernel():
    kernel = HeatKernel.from_spectrum(spectrum_of(bundled("ant"), TIME), TIME)
    np.testing.assert_allclose(kernel.diagonal(), np.diag(dense.whole(kernel)), rtol=1e-12)


def test_heat_does_not_cross_between_components():
    far = bundled("ant")
    far.apply_translation([100, 0, 0])
    mesh = trimesh.util.concatenate([bundled("ant"), far])
    expected = dense.heat_kernel(np.asarray(mesh.vertices), mesh.faces, TIME)
    kernel = HeatKernel.from_spectrum(spectrum_of(mesh, TIME), TIME)
    # The dense solver's null space is off by its rounding, 1e-7 of the largest entries; ours holds exact constants.
    np.testing.assert_allclose(dense.whole(kernel), expected, rtol=0, atol=1e-6 * expected.max())


def test_row_blocks_are_bounded_and_cover_every_row_once(monkeypatch):
    monkeypatch.setattr("heatwalk.kernel.BLOCK_BYTES", 8 * 486 * 10)
    kernel = HeatKernel.from_spectrum(spectrum_of(bundled("ant"), TIME), TIME)
    for part in kernel.parts():
        blocks = list(kernel.row_blocks(part))
        assert all(block.nbytes <= 8 * 486 * 10 for _, block in blocks)
        assert np.concatenate([np.arange(len(part))[rows] for rows, _ in blocks]).tolist() == list(range(len(part)))


def test_a_spectrum_with_too_few_eigenvalues_for_the_time_is_rejected():
    spectrum = spectrum_of(bundled("ant"), 0.5)
    with pytest.raises(ValueError, match=r"time 0.1 requires eigenvalues up to"):
        HeatKernel.from_spectrum(spectrum, 0.1)
