import numpy as np
import pytest

import heatwalk
from heatwalk.accumulators import heat_walk
from heatwalk.kernel import MIN_DECAY, HeatKernel
from heatwalk.robust.averaging import averaged_kernel, times_around
from studies.testing import example_meshes
from tests.helpers import dense


@pytest.fixture(scope="module", params=["ellipsoid", "torus", "open"])
def spectrum(request):
    mesh = example_meshes()[request.param]
    return heatwalk.segment(mesh.vertices, mesh.faces, 0.1).spectrum


def test_it_is_the_mean_of_the_kernels_at_the_times(spectrum):
    times = times_around(1 / 6, octaves=2)
    kernels = [dense.whole(HeatKernel.from_spectrum(spectrum, time)) for time in times]
    averaged = dense.whole(averaged_kernel(spectrum, times, MIN_DECAY))
    assert np.allclose(averaged, np.mean(kernels, axis=0), rtol=0, atol=1e-9)


def test_the_mean_over_one_time_is_the_kernel_at_that_time(spectrum):
    kernel = HeatKernel.from_spectrum(spectrum, 1 / 6)
    averaged = averaged_kernel(spectrum, np.array([1 / 6]), MIN_DECAY)
    assert averaged.factor.shape == kernel.factor.shape
    assert np.allclose(averaged.factor, kernel.factor, rtol=1e-13, atol=0)


def test_it_is_positive_semi_definite_and_of_unit_mass(spectrum):
    kernel = averaged_kernel(spectrum, times_around(1 / 6, octaves=2), 1e-6)
    whole = dense.whole(kernel)
    assert np.linalg.eigvalsh(whole).min() > -1e-12 * whole.max()
    assert np.allclose(whole @ kernel.mass, 1, rtol=0, atol=1e-12)


@pytest.mark.parametrize("octaves", [1, 2, 4])
def test_its_walk_equals_algorithm_1_step_by_step(spectrum, octaves):
    kernel = averaged_kernel(spectrum, times_around(0.1, octaves), 1e-6)
    walk, expected = heat_walk(kernel), dense.algorithm_1(dense.whole(kernel))
    assert len(walk.steps) == len(expected)
    for ours, theirs in zip(walk.steps, expected, strict=True):
        assert np.array_equal(ours, theirs)


def test_a_spectrum_that_ends_too_early_is_refused(spectrum):
    with pytest.raises(ValueError, match=r"time 0\.001 requires eigenvalues up to 13815\.5"):
        averaged_kernel(spectrum, np.array([0.001, 1]), 1e-6)


def test_the_times_are_logarithmically_spaced_around_the_given_one():
    assert np.allclose(times_around(3.0, octaves=1), [3 / np.sqrt(2), 3, 3 * np.sqrt(2)])
    assert times_around(3.0, octaves=0).tolist() == [3]
