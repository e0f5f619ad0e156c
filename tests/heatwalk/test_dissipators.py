import numpy as np
import pytest
import trimesh

import heatwalk
from heatwalk.dissipators import divergence_from_uniform, relative_entropy_excess
from heatwalk.kernel import HeatKernel
from tests.helpers import dense
from tests.helpers.meshes import bundled

MESHES = {
    "ant": lambda: bundled("ant"),
    "airplane": lambda: bundled("airplane"),
    "box": lambda: trimesh.creation.box().subdivide().subdivide().subdivide(),
}


@pytest.mark.parametrize("time", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("name", MESHES)
def test_divergences_and_dissipators_equal_those_of_algorithm_2(name, time):
    mesh = MESHES[name]()
    seg = heatwalk.segment(mesh.vertices, mesh.faces, time)
    kernel = dense.whole(seg.kernel)
    from_region, from_uniform = dense.algorithm_2(kernel, seg.accumulator_labels)
    np.testing.assert_allclose(seg.divergence_from_uniform, from_uniform, atol=1e-9)
    np.testing.assert_allclose(seg.divergence_from_region, from_region, atol=1e-7)
    assert np.array_equal(seg.labels == len(seg.exemplars), from_region > from_uniform)


def test_divergences_are_never_negative():
    mesh = bundled("cow")
    seg = heatwalk.segment(mesh.vertices, mesh.faces)
    assert seg.divergence_from_uniform.min() >= 0
    assert seg.divergence_from_region.min() >= -1e-12


def test_equal_area_weights_change_nothing():
    mesh = trimesh.creation.icosphere(3)
    seg = heatwalk.segment(mesh.vertices, mesh.faces)
    plain = relative_entropy_excess(seg.kernel, seg.accumulator_labels)
    weighted = relative_entropy_excess(seg.kernel, seg.accumulator_labels, np.full(len(plain), 0.37))
    np.testing.assert_allclose(weighted, plain, atol=1e-12)
    np.testing.assert_allclose(
        divergence_from_uniform(seg.kernel, np.full(len(plain), 0.37)), seg.divergence_from_uniform, atol=1e-12
    )


def test_area_weights_give_integrals_over_the_surface():
    mesh = bundled("airplane")
    seg = heatwalk.segment(mesh.vertices, mesh.faces, density="area")
    kernel = np.maximum(dense.whole(seg.kernel), 1e-300)
    mass = seg.kernel.mass / seg.kernel.mass.sum()
    for x in range(0, len(mass), 97):
        density = kernel[x] * mass / (kernel[x] @ mass)
        cluster = kernel[seg.accumulator_labels == seg.accumulator_labels[x]].sum(axis=0) * mass
        cluster /= cluster.sum()
        assert seg.divergence_from_uniform[x] == pytest.approx(density @ np.log(density / mass), abs=1e-8)
        assert seg.divergence_from_region[x] == pytest.approx(density @ np.log(density / cluster), abs=1e-7)


def test_a_region_of_a_single_vertex_never_dissipates():
    # Its mean density is its own: the divergence from it is 0, which is below any other.
    rows = np.eye(5) + 0.01
    kernel = HeatKernel(rows, np.zeros(5, dtype=int), np.full(5, 0.2), 1.0)
    assert (relative_entropy_excess(kernel, np.arange(5)) < 0).all()
