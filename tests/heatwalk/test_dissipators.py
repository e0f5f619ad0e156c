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
    from_region, from_uniform = dense.algorithm_2(kernel, seg.accumulator_labels, seg.kernel.component)
    np.testing.assert_allclose(seg.divergence_from_uniform, from_uniform, atol=1e-9)
    np.testing.assert_allclose(seg.divergence_from_region, from_region, atol=1e-7)
    difference = from_region - from_uniform
    # On small components heat is uniform, and the sign of the printed difference is rounding error.
    is_body = seg.kernel.component == np.bincount(seg.kernel.component).argmax()
    is_clear = is_body | (np.abs(difference) > 1e-15)
    assert np.array_equal((seg.labels == len(seg.exemplars))[is_clear], difference[is_clear] > 0)


def test_no_vertex_dissipates_on_a_component_on_which_heat_is_uniform():
    mesh = bundled("ant")
    seg = heatwalk.segment(mesh.vertices, mesh.faces)
    uniform = [
        part for part in seg.kernel.parts() if np.ptp(seg.kernel.factor[part] @ seg.kernel.factor[part].T) < 1e-9
    ]
    assert 0 < len(uniform) < len(seg.kernel.parts())
    assert not seg.dissipates[np.concatenate(uniform)].any()


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
    for x in range(0, len(kernel), 97):
        mass = seg.kernel.mass * (seg.kernel.component == seg.kernel.component[x])
        mass /= mass.sum()
        there = mass > 0
        density = kernel[x] * mass / (kernel[x] @ mass)
        cluster = kernel[seg.accumulator_labels == seg.accumulator_labels[x]].sum(axis=0) * mass
        cluster /= cluster.sum()
        uniform, region = (density[there] @ np.log(density[there] / other[there]) for other in (mass, cluster))
        assert seg.divergence_from_uniform[x] == pytest.approx(uniform, abs=1e-8)
        assert seg.divergence_from_region[x] == pytest.approx(region, abs=1e-7)


def with_specks(mesh, count, size, seed):
    """A mesh and tetrahedra of about `size` times its extent, at random places in its bounding box."""
    rng = np.random.default_rng(seed)
    extent = np.ptp(mesh.vertices, axis=0).max()
    vertices, faces, n = [mesh.vertices], [mesh.faces], len(mesh.vertices)
    for index in range(count):
        centre = mesh.vertices.mean(axis=0) + extent * rng.uniform(-0.5, 0.5, 3)
        vertices.append(centre + extent * size * rng.standard_normal((4, 3)))
        faces.append(n + 4 * index + np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]))
    return np.vstack(vertices), np.vstack(faces)


@pytest.mark.parametrize("name", ["bunny", "cow"])
@pytest.mark.parametrize("count", [1, 300])
def test_specks_leave_the_labels_of_the_others_as_they_are(name, count):
    mesh = bundled(name)
    alone = heatwalk.segment(mesh.vertices, mesh.faces)
    seg = heatwalk.segment(*with_specks(mesh, count, 1e-5, seed=count))
    n = len(mesh.vertices)
    assert np.array_equal(seg.dissipates[:n], alone.dissipates)
    assert np.array_equal(seg.accumulator_labels[:n], alone.accumulator_labels)
    assert not seg.dissipates[n:].any()


def test_two_copies_of_a_mesh_have_the_dissipators_of_one():
    mesh = bundled("bunny")
    alone = heatwalk.segment(mesh.vertices, mesh.faces, time=1.0)
    both = heatwalk.segment(
        np.vstack((mesh.vertices, mesh.vertices + 3 * np.ptp(mesh.vertices))),
        np.vstack((mesh.faces, mesh.faces + len(mesh.vertices))),
        time=0.5,  # relative to the area of both
    )
    assert np.array_equal(both.dissipates, np.tile(alone.dissipates, 2))


def test_a_region_of_a_single_vertex_never_dissipates():
    # Its mean density is its own: the divergence from it is 0, which is below any other.
    rows = np.eye(5) + 0.01
    kernel = HeatKernel(rows, np.zeros(5, dtype=int), np.full(5, 0.2), 1.0)
    assert (relative_entropy_excess(kernel, np.arange(5)) < 0).all()


def test_weights_of_vertices_and_of_sources_count_copies_of_vertices():
    rng = np.random.default_rng(0)
    rows, copies, labels = 1 + rng.random((6, 3)), np.array([1, 3, 2, 1, 1, 4]), np.array([0, 0, 1, 1, 2, 2])
    each, component = np.repeat(np.arange(6), copies), np.zeros(copies.sum(), int)
    repeated = HeatKernel(rows[each], component, np.ones(len(each)), 1.0)
    kernel = HeatKernel(rows, np.zeros(6, int), np.ones(6), 1.0)
    weights = copies.astype(float)
    expected = relative_entropy_excess(repeated, labels[each])
    assert np.allclose(relative_entropy_excess(kernel, labels, weights, weights)[each], expected)
