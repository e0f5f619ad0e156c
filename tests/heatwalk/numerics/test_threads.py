import threading
from itertools import pairwise

import numpy as np
import pytest
import threadpoolctl
import trimesh

import heatwalk
from heatwalk.numerics import threads
from heatwalk.numerics.cholesky import Cholesky
from heatwalk.numerics.dissection import nested_dissection
from heatwalk.numerics.search import largest_inner_products
from heatwalk.numerics.subtrees import independent_ranges
from heatwalk.numerics.threads import (
    available_threads,
    one_blas_thread,
    shared,
    sharing_everything,
    spread,
    started,
    working_threads,
)
from tests.heatwalk.numerics.test_cholesky import graph_matrix, shifted
from tests.helpers.meshes import bundled

NUMBERS = (1, 2, 3)


def blas_threads():
    return {pool["num_threads"] for pool in threadpoolctl.threadpool_info() if pool["user_api"] == "blas"}


@pytest.fixture
def two_blas_threads():
    with threadpoolctl.threadpool_limits(2, "blas"):
        if blas_threads() != {2}:
            pytest.skip("the threads of this BLAS cannot be set")
        yield


def several_components():
    ant, cow = bundled("ant"), bundled("cow")
    sphere = trimesh.creation.icosphere(2)  # small enough for the dense solver
    return trimesh.util.concatenate([cow, ant.apply_translation([9, 0, 0]), sphere.apply_translation([20, 0, 0])])


MESHES = {
    "cow": lambda: bundled("cow"),
    "several components": several_components,
    "large enough to be shared by itself": lambda: bundled("bunny"),
}


def everything_in(seg):
    return [
        seg.labels, seg.relative_entropy_excess, seg.kernel.factor, seg.spectrum.eigenvalues, seg.walk.pointer,
        seg.walk.potential, seg.margin,
    ]  # fmt: skip


@pytest.mark.parametrize("name", MESHES)
def test_results_are_equal_bit_for_bit_for_any_number_of_threads(name):
    mesh = MESHES[name]()

    def results(number):
        if len(mesh.vertices) > threads.LEAST_VERTICES:
            return everything_in(heatwalk.segment(mesh.vertices, mesh.faces, threads=number))
        with sharing_everything():
            return everything_in(heatwalk.segment(mesh.vertices, mesh.faces, threads=number))

    expected = results(1)
    for number in (*NUMBERS[1:], 2):  # the last: run after run
        for ours, theirs in zip(results(number), expected, strict=True):
            assert np.array_equal(ours, theirs)


def test_results_of_the_robust_variant_are_equal_bit_for_bit_for_any_number_of_threads():
    mesh = bundled("ant")
    with sharing_everything():
        one, two = (heatwalk.segment_robust(mesh.vertices, mesh.faces, threads=number) for number in (1, 2))
    for ours, theirs in zip(everything_in(two), everything_in(one), strict=True):
        assert np.array_equal(ours, theirs)


@pytest.mark.parametrize(
    ("n", "edges"),
    [
        pytest.param(400, [(0, i) for i in range(1, 400)], id="star"),
        pytest.param(400, [(i, i + 1) for i in range(399)], id="path"),
        pytest.param(400, [(0, 1)], id="isolated vertices"),
        pytest.param(60, [(i, j) for i in range(60) for j in range(i)], id="everything with everything"),
        pytest.param(400, [(i, (i * 7 + 1) % 400) for i in range(400) if i != (i * 7 + 1) % 400], id="no surface"),
    ],
)
def test_orders_and_solutions_on_any_graph_are_equal_for_any_number_of_threads(n, edges):
    matrix = graph_matrix(n, edges)
    right = np.random.default_rng(0).standard_normal((n, 3))
    found = []
    for number in NUMBERS:
        with sharing_everything(), working_threads(number):
            order, pieces = nested_dissection(matrix)
            found.append([order, pieces, Cholesky(matrix[order][:, order], pieces).solve(right)])
    for others in found[1:]:
        for ours, theirs in zip(others, found[0], strict=True):
            assert np.array_equal(ours, theirs)


def test_a_matrix_that_is_not_positive_definite_is_an_error_with_threads_too():
    matrix = shifted(bundled("cow"))
    order, pieces = nested_dissection(matrix)
    for number in NUMBERS:
        with sharing_everything(), working_threads(number), pytest.raises(np.linalg.LinAlgError):
            Cholesky(matrix[order][:, order], pieces, shift=1.0)


def test_the_search_finds_the_same_for_any_number_of_threads():
    rows = np.random.default_rng(0).standard_normal((3_000, 6)) * 0.5 ** np.arange(6)
    expected = largest_inner_products(rows, 1e-10)
    for number in NUMBERS[1:]:
        with sharing_everything(), working_threads(number):
            argmax, maximum, _ = largest_inner_products(rows, 1e-10)
        assert np.array_equal(argmax, expected[0])
        assert np.array_equal(maximum, expected[1])


def test_ranges_of_panels_need_nothing_from_outside_them():
    rng = np.random.default_rng(0)
    for _ in range(200):
        n = rng.integers(1, 60)
        # Some parents are far away, so that many trees are not contiguous; some panels are roots.
        parents = np.minimum(np.arange(n) + 1 + rng.geometric(0.3, n), n)
        parents[(parents >= n) | (rng.random(n) < 0.1)] = -1
        ranges = independent_ranges(parents, rng.integers(1, 50, n), int(rng.integers(2, 5)))
        for first, last in ranges:
            assert not ((parents[:first] >= first) & (parents[:first] < last)).any()
        assert all(stop <= start for (_, stop), (start, _) in pairwise(ranges))


def test_of_a_balanced_tree_half_is_for_each_thread_but_for_the_root():
    leaves = 2**7  # in postorder: each subtree is a range
    parents, at = [], 0

    def grow(depth):
        nonlocal at
        children = [grow(depth - 1) for _ in range(2)] if depth else []
        for child in children:
            parents[child] = at
        parents.append(-1)
        at += 1
        return at - 1

    grow(7)
    ranges = independent_ranges(np.array(parents), np.ones(len(parents), dtype=np.int64), 2)
    assert ranges == [(0, leaves - 1), (leaves - 1, 2 * leaves - 2)]


def test_as_many_threads_work_as_are_asked_for():
    barrier = threading.Barrier(3, timeout=20)  # breaks unless three tasks are at it at the same time
    with working_threads(3):
        assert sorted(shared(lambda i: barrier.wait() * 0 + i, range(3))) == [0, 1, 2]
        assert len(set(shared(lambda _: threading.get_ident(), range(6)))) <= 3
    assert shared(lambda _: threading.get_ident(), range(2)) == [threading.get_ident()] * 2


def test_tasks_that_share_in_turn_do_so_by_themselves():
    with working_threads(2):
        for inner, outer in shared(
            lambda _: (shared(lambda _: threading.get_ident(), range(3)), threading.get_ident()), "ab"
        ):
            assert inner == [outer] * 3


def test_a_task_may_wait_for_those_before_it():
    def sum_up_to(i):
        return i + (futures[i - 1].result() if i else 0)

    for number in NUMBERS:
        futures = []
        with working_threads(number):
            started(sum_up_to, range(40), into=futures)
            assert futures[-1].result() == sum(range(40))


def test_the_error_of_a_task_is_raised_and_the_threads_end():
    before = threading.active_count()
    for number in NUMBERS:
        with pytest.raises(ZeroDivisionError), working_threads(number):
            shared(lambda i: 1 // i, [1, 0, 2])
        with pytest.raises(ZeroDivisionError), working_threads(number):
            spread(lambda i: [(i - 1,)] if 1 // i else [], 1)
    assert threading.active_count() == before


def test_blas_has_one_thread_meanwhile_and_as_many_as_before_afterwards(two_blas_threads):
    mesh = bundled("ant")
    heatwalk.segment(mesh.vertices, mesh.faces)
    assert blas_threads() == {2}
    with one_blas_thread():
        with working_threads(2):
            assert blas_threads() == {1}
            assert shared(lambda _: blas_threads(), range(2)) == [{1}] * 2
        assert blas_threads() == {1}
    assert blas_threads() == {2}


def test_blas_threads_are_set_back_after_an_error_and_between_results(two_blas_threads):
    with pytest.raises(heatwalk.MeshError):
        heatwalk.segment(np.zeros((4, 3)), [[0, 1, 2]])
    assert blas_threads() == {2}
    mesh = bundled("ant")
    for seg in heatwalk.segment_at_times(mesh.vertices, mesh.faces, [1, 2]):
        assert blas_threads() == {2}
        assert seg.margin.min() >= 0
    assert blas_threads() == {2}


def test_blas_threads_are_set_back_when_the_last_of_calls_that_overlap_has_ended(two_blas_threads):
    first_is_in, second_is_out = threading.Event(), threading.Event()

    def first():
        with one_blas_thread():
            first_is_in.set()
            assert second_is_out.wait(20)

    other = threading.Thread(target=first)
    other.start()
    assert first_is_in.wait(20)
    with one_blas_thread():
        assert blas_threads() == {1}
    assert blas_threads() == {1}
    second_is_out.set()
    other.join()
    assert blas_threads() == {2}


@pytest.mark.parametrize("function", [heatwalk.segment, heatwalk.segment_robust])
@pytest.mark.parametrize("number", [0, -1, 1.5, "2"])
def test_threads_that_are_no_positive_integer_are_rejected(function, number):
    mesh = trimesh.creation.icosphere(1)
    with pytest.raises(ValueError, match=f"threads must be a positive integer, or None for all .*, got {number!r}"):
        function(mesh.vertices, mesh.faces, threads=number)


@pytest.mark.parametrize(("value", "expected"), [("3", 3), ("2,4", 2), (" 5 ", 5)])
def test_the_default_number_of_threads_is_that_of_the_environment(value, expected, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", value)
    assert available_threads() == expected


@pytest.mark.parametrize("value", ["", "0", "many"])
def test_without_a_number_in_the_environment_all_processors_are_used(value, monkeypatch):
    import loky

    monkeypatch.setenv("OMP_NUM_THREADS", value)
    assert available_threads() == loky.cpu_count()
