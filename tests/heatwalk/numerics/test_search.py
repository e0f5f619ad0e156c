"""The tree search compared with the exact blocked search: the same row for every query, including ties."""

import subprocess
import sys

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import heatwalk
from heatwalk.accumulators import TIE, blocked_maximum_inner_products, maximum_inner_products
from heatwalk.kernel import HeatKernel, largest_eigenvalue
from heatwalk.laplacian import stiffness_and_mass, unit_area, vertex_components
from heatwalk.numerics.compilation import compiled
from heatwalk.numerics.search import LEAF_SIZE, largest_inner_products
from heatwalk.spectrum import SpectrumSolver
from tests.helpers.meshes import bundled

TIMES = (0.3, 1.0, 4.0, 40.0)  # in the paper's units; the last leaves a kernel so flat that most vertices tie


def kernels(mesh, times):
    vertices, faces = np.asarray(mesh.vertices), np.asarray(mesh.faces)
    stiffness, mass = stiffness_and_mass(unit_area(vertices, faces), faces)
    solver = SpectrumSolver(stiffness, mass, vertex_components(len(vertices), faces))
    spectrum = solver.up_to(largest_eigenvalue(min(times) / 6))
    return [HeatKernel.from_spectrum(spectrum, time / 6) for time in times]


def kernel_of(rows, component=None):
    n = len(rows)
    component = np.zeros(n, dtype=int) if component is None else component
    return HeatKernel(rows, component, np.full(n, 1 / n), 1.0)


def assert_as_blocked(kernel):
    argmax, maximum = maximum_inner_products(kernel)
    expected, largest = blocked_maximum_inner_products(kernel)
    assert np.array_equal(argmax, expected)
    assert np.allclose(maximum, largest, rtol=1e-12, atol=0)


SHAPES = {
    "ant": lambda: bundled("ant"),
    "cow": lambda: bundled("cow"),
    "airplane of several components": lambda: bundled("airplane"),
    "icosphere": lambda: trimesh.creation.icosphere(4),
    "torus": lambda: trimesh.creation.torus(1, 0.4, major_sections=64, minor_sections=32),
    "subdivided box": lambda: trimesh.creation.box().subdivide().subdivide().subdivide().subdivide(),
    "thin plate": lambda: trimesh.creation.box((1, 1, 1e-3)).subdivide_to_size(0.04),
}


@pytest.mark.parametrize("name", SHAPES)
def test_every_vertex_finds_the_same_as_in_the_blocked_search(name):
    for kernel in kernels(SHAPES[name](), TIMES):
        assert_as_blocked(kernel)


@pytest.mark.parametrize("model", [1, 61, 130, 342, 390])
def test_every_vertex_of_the_benchmark_finds_the_same_as_in_the_blocked_search(model, psb_mesh):
    for kernel in kernels(psb_mesh(model), (0.5, 1.0)):
        assert_as_blocked(kernel)


@settings(max_examples=100, deadline=None)
@given(
    arrays(
        np.float64,
        st.tuples(st.integers(1, 60), st.integers(1, 12)),
        elements=st.one_of(st.integers(-2, 2).map(float), st.floats(-1, 1).map(lambda x: round(x, 6))),
    ),
    st.floats(0, 2),
)
def test_any_rows_find_the_same_as_in_the_blocked_search(rows, decay):
    assert_as_blocked(kernel_of(rows * np.exp(-decay * np.arange(rows.shape[1]))))


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 12), st.integers(1, 3))
def test_exact_ties_go_to_the_smallest_row(seed, columns, largest):
    rng = np.random.default_rng(seed)
    assert_as_blocked(kernel_of(rng.integers(-largest, largest + 1, (1500, columns)).astype(float)))


@pytest.mark.parametrize("width", [1e-9, 1e-10, 1e-11, 1e-13])
def test_rows_that_differ_by_about_the_tie_find_the_same_as_in_the_blocked_search(width):
    rng = np.random.default_rng(0)
    rows = np.column_stack([np.ones(2000), np.sqrt(width) * rng.standard_normal((2000, 2))])
    assert_as_blocked(kernel_of(rows))
    assert_as_blocked(kernel_of(1 + width * rng.standard_normal((2000, 1))))


@pytest.mark.parametrize("n", [1, 2, LEAF_SIZE - 1, LEAF_SIZE, LEAF_SIZE + 1, 2 * LEAF_SIZE, 3 * LEAF_SIZE + 1])
def test_any_number_of_rows_fills_the_leaves(n):
    assert_as_blocked(kernel_of(np.random.default_rng(n).standard_normal((n, 3))))


def test_rows_of_zeros_tie():
    assert_as_blocked(kernel_of(np.zeros((100, 3))))


def test_each_component_is_searched_separately():
    rng = np.random.default_rng(0)
    assert_as_blocked(kernel_of(rng.standard_normal((500, 4)), rng.integers(0, 30, 500)))


def test_rows_in_fortran_order_give_the_same_result():
    rows = np.random.default_rng(0).standard_normal((200, 5))
    for ours, theirs in zip(
        largest_inner_products(np.asfortranarray(rows), TIE), largest_inner_products(rows, TIE), strict=True
    ):
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize("distinct", [1, 7])
def test_bulk_duplicates_cost_little(distinct):
    rows = np.random.default_rng(0).standard_normal((distinct, 12))[np.arange(20_000) % distinct]
    argmax, _, n_products = largest_inner_products(rows, TIE)
    assert np.array_equal(argmax, (rows @ rows[:distinct].T).argmax(axis=1))
    assert n_products < 200 * len(rows)


def test_a_few_hundred_inner_products_per_vertex_suffice_however_fine_the_mesh():
    mesh = bundled("ant")
    for _ in range(4):
        (kernel,) = kernels(mesh, (1.0,))
        assert largest_inner_products(kernel.factor, TIE)[2] < 300 * len(mesh.vertices)
        mesh = mesh.subdivide_loop(1)


def in_a_new_process(code):
    return subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()


def test_a_second_process_compiles_nothing():
    mesh = trimesh.creation.icosphere(3)
    heatwalk.segment(mesh.vertices, mesh.faces)
    code = (
        "import heatwalk, trimesh\n"
        "mesh = trimesh.creation.icosphere(3)\n"
        "heatwalk.segment(mesh.vertices, mesh.faces)\n"
        "from heatwalk.numerics import cholesky, dissection, search\n"
        "for f in (\n"
        "    dissection._dissect, cholesky._panel_rows, cholesky._factorise,\n"
        "    cholesky._substitute_forward, cholesky._substitute_backward,\n"
        "    search._build_tree, search._measure_nodes, search._search,\n"
        "):\n"
        "    print(sum(f.stats.cache_misses.values()), sum(f.stats.cache_hits.values()))\n"
    )
    assert in_a_new_process(code) == ["0", "1"] * 8


def test_functions_compile_without_a_cache_if_no_folder_is_writable(monkeypatch):
    def nowhere(function):
        raise RuntimeError(f"cannot cache function {function.__name__!r}: no locator available for file")

    monkeypatch.setattr("heatwalk.numerics.compilation._OptionalCache", nowhere)
    assert compiled(lambda number: number + 1)(1) == 2
