import numpy as np
import pytest

from heatwalk.kernel import largest_eigenvalue
from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.meshes import mesh_edges
from heatwalk.robust import scale
from heatwalk.robust.averaging import averaged_kernel
from heatwalk.robust.options import Options
from heatwalk.robust.scale import count_regions, stable_time
from heatwalk.segmentation import PAPER_TIME
from heatwalk.spectrum import SpectrumSolver
from tests.helpers.blobs import beads


def on_a_string(radii):
    """Spectrum and edges of beads on a string."""
    vertices, faces = beads(radii)
    stiffness, mass = stiffness_and_mass(unit_area(vertices, faces), faces)
    solver = SpectrumSolver(stiffness, mass, vertex_components(len(vertices), faces))
    return solver.up_to(largest_eigenvalue(PAPER_TIME / 16, scale.MIN_DECAY)), mesh_edges(faces)[0]


@pytest.fixture(scope="module")
def chain():
    return on_a_string([1.0, 0.8, 0.9])


def counts(spectrum, edges, steps, options):
    times = PAPER_TIME * 2 ** (steps / scale.PER_OCTAVE)
    kernels = [averaged_kernel(spectrum, options.averaged(time), scale.MIN_DECAY) for time in times]
    return np.array([count_regions(kernel, edges, options) for kernel in kernels])


def test_beads_on_a_string_are_regions_until_the_heat_of_the_inner_one_has_left_it(chain):
    steps = np.arange(-8, 33)
    numbers = counts(*chain, steps, Options())
    assert (numbers[steps <= 0] == 3).all()
    assert (np.diff(numbers) <= 0).all()
    assert set(numbers) == {1, 2, 3}


@pytest.mark.parametrize("given", [0.6, 1.0, 4.0, 30.0])
@pytest.mark.parametrize("options", [Options(), Options(average=False, octaves_before=0.5, octaves_after=4)])
def test_the_time_is_one_of_the_most_frequent_number(chain, given, options):
    time = stable_time(*chain, given * PAPER_TIME, options)
    near = round(np.log2(given) * scale.PER_OCTAVE)
    first, last = (round(octaves * scale.PER_OCTAVE) for octaves in (options.octaves_before, options.octaves_after))
    steps = np.arange(near - first, near + last + 1)
    numbers = counts(*chain, steps, options)  # at every step, without the shortcut
    frequency = np.bincount(numbers)
    frequency[:2] = 0
    expected = np.flatnonzero(frequency == frequency.max())[-1] if frequency.any() else 1
    step = round(np.log2(time / PAPER_TIME) * scale.PER_OCTAVE)
    assert time == pytest.approx(PAPER_TIME * 2 ** (step / scale.PER_OCTAVE))
    assert counts(*chain, np.array([step]), options).tolist() == [expected]


def test_a_stable_time_stays_as_it_is():
    assert stable_time(*on_a_string([1.0, 0.8]), PAPER_TIME, Options()) == pytest.approx(PAPER_TIME)


def test_the_time_keeps_half_an_octave_from_the_last_with_its_number(chain):
    options = Options(octaves_before=1, octaves_after=0)
    steps = np.arange(-8, 60)
    last = steps[counts(*chain, steps, options) == 3].max()
    time = stable_time(*chain, PAPER_TIME * 2 ** (last / scale.PER_OCTAVE), options)
    assert time == pytest.approx(PAPER_TIME * 2 ** (last / scale.PER_OCTAVE - scale.DISTANCE))
