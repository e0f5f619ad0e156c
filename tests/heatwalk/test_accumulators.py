import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import heatwalk
from heatwalk.accumulators import heat_walk, maximum_inner_products
from heatwalk.kernel import HeatKernel
from tests.helpers import dense
from tests.helpers.meshes import bundled


def largest_component(mesh):
    faces = max(trimesh.graph.connected_components(mesh.face_adjacency), key=len)
    return mesh.submesh([faces], append=True, repair=False)


SMALL = {
    "ant": lambda: bundled("ant"),
    "fuselage": lambda: largest_component(bundled("airplane")),
    "sphere": lambda: trimesh.creation.icosphere(3),  # many ties, multiple eigenvalues
    "torus": lambda: trimesh.creation.torus(1, 0.4, major_sections=32, minor_sections=16),
    "box": lambda: trimesh.creation.box().subdivide().subdivide().subdivide().subdivide(),  # flat, as CAD parts are
    "open cylinder": lambda: trimesh.creation.cylinder(1, 4, cap=False).subdivide().subdivide(),
}


def random_kernel(rows, component=None):
    n = len(rows)
    component = np.zeros(n, dtype=int) if component is None else component
    return HeatKernel(rows, component, np.full(n, 1 / n), 1.0)


@pytest.mark.parametrize("time", [0.3, 1.0, 4.0])
@pytest.mark.parametrize("name", SMALL)
def test_the_walk_equals_algorithm_1_step_by_step(name, time):
    mesh = SMALL[name]()
    seg = heatwalk.segment(mesh.vertices, mesh.faces, time)
    kernel = dense.whole(seg.kernel)
    expected = dense.algorithm_1(kernel)
    assert len(seg.walk.steps) == len(expected)
    for ours, theirs in zip(seg.walk.steps, expected, strict=True):
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize("name", ["ant", "airplane"])
def test_exemplars_equal_those_of_the_kernel_of_all_eigenpairs(name):
    mesh = bundled(name)
    expected = dense.algorithm_1(dense.heat_kernel(np.asarray(mesh.vertices), mesh.faces, 1 / 6))
    seg = heatwalk.segment(mesh.vertices, mesh.faces)
    assert np.array_equal(seg.exemplars[seg.accumulator_labels], expected[-1])


@settings(max_examples=200, deadline=None)
@given(
    arrays(
        np.float64,
        st.tuples(st.integers(1, 40), st.integers(1, 6)),
        elements=st.one_of(st.integers(-3, 3).map(float), st.floats(-1, 1).map(lambda x: round(x, 6))),
    )
)
def test_the_walk_over_any_positive_semi_definite_kernel_equals_algorithm_1(rows):
    rows = np.column_stack([rows, np.ones(len(rows))])  # as a heat kernel has: a constant, so that the diagonal is > 0
    walk = heat_walk(random_kernel(rows))
    assert np.array_equal(walk.exemplars[walk.labels], dense.algorithm_1(rows @ rows.T)[-1])


def test_potentials_never_fall_and_are_final_after_one_step():
    mesh = bundled("airplane")
    walk = heatwalk.segment(mesh.vertices, mesh.faces).walk
    assert (walk.potential >= walk.first_potential * (1 - 1e-12)).all()
    # The cap never binds: each exemplar's potential is at least the heat that flows to it.
    assert (walk.potential[walk.pointer] >= walk.potential * (1 - 1e-9)).all()


def test_paths_end_at_the_exemplar_of_their_region():
    mesh = bundled("airplane")
    walk = heatwalk.segment(mesh.vertices, mesh.faces).walk
    for vertex in range(0, len(mesh.vertices), 50):
        path = walk.path(vertex)
        assert path[0] == vertex
        assert path[-1] == walk.exemplars[walk.labels[vertex]]
        assert [step[vertex] for step in walk.steps][: len(path)] == path


def test_the_smallest_index_wins_a_tie():
    rows = np.array([[1.0, 0.0], [2.0, 0.0], [2.0, 0.0], [2.0 * (1 + 1e-13), 0.0]])
    argmax, _ = maximum_inner_products(random_kernel(rows))
    assert argmax.tolist() == [1, 1, 1, 1]


def test_a_ring_that_ties_close_ends_at_its_smallest_vertex(monkeypatch):
    ring = np.array([1, 2, 3, 1, 0])  # 0 → 1 → 2 → 3 → 1, and 4 → 0
    monkeypatch.setattr("heatwalk.accumulators.maximum_inner_products", lambda kernel: (ring, np.ones(5)))
    walk = heat_walk(random_kernel(np.ones((5, 1))))
    assert walk.exemplars.tolist() == [1]
    assert walk.labels.tolist() == [0] * 5
    assert np.array_equal(walk.steps[-1], [1] * 5)


def test_each_component_walks_as_if_it_were_the_whole_mesh():
    rng = np.random.default_rng(0)
    component, rows = rng.integers(0, 4, 60), rng.standard_normal((60, 3))
    walk = heat_walk(random_kernel(rows, component))
    for c in range(4):
        members = np.flatnonzero(component == c)
        alone = heat_walk(random_kernel(rows[members]))
        assert np.array_equal(walk.pointer[members], members[alone.pointer])
