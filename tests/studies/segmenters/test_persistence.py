"""Mountains and branches of a function on a graph."""

import numpy as np
import pytest

from studies.segmenters._persistence import branches, edge_graph, mountains
from tests.helpers.parts import star


def path(n):
    return edge_graph(n, np.array([[i, i + 1, i] for i in range(n - 1)]))


def persistences(values, graph):
    """The persistence of every peak but the highest, from the number of pieces above each level."""
    found = []
    order = np.argsort(-values, kind="stable")
    pieces = []
    for v in order:
        touching = [piece for piece in pieces if piece & set(graph.indices[graph.indptr[v] : graph.indptr[v + 1]])]
        peaks = sorted((max(values[list(piece)]) for piece in touching), reverse=True)
        found += [peak - values[v] for peak in peaks[1:]]
        pieces = [piece for piece in pieces if piece not in touching] + [set().union({int(v)}, *touching)]
    return sorted(found)


@pytest.fixture(scope="module")
def bumpy():
    """A function with many peaks on a sphere."""
    vertices, faces, _ = star(2)
    return np.random.default_rng(0).normal(size=len(vertices)), edge_graph(len(vertices), faces)


def test_persistences_are_those_of_the_pieces_above_every_level(bumpy):
    values, graph = bumpy
    assert sorted(mountains(values, graph, np.inf)[1]) == pytest.approx(persistences(values, graph))


def test_mountains_are_one_more_than_the_persistences_above_the_threshold(bumpy):
    values, graph = bumpy
    heights = np.array(persistences(values, graph))
    for least in (0.1, 0.5, 1, 2):
        assert len(np.unique(mountains(values, graph, least)[0])) == 1 + (heights >= least).sum()


def test_without_a_threshold_each_vertex_climbs_to_its_steepest_peak(bumpy):
    values, graph = bumpy
    peaks, _ = mountains(values, graph, 0.0)
    for v in range(len(values)):
        end = v
        while True:
            around = graph.indices[graph.indptr[end] : graph.indptr[end + 1]]
            if values[around].max() <= values[end]:
                break
            end = around[values[around].argmax()]
        assert peaks[v] == end


def test_adding_a_constant_changes_nothing(bumpy):
    values, graph = bumpy
    assert np.array_equal(mountains(values, graph, 0.7)[0], mountains(values + 4, graph, 0.7)[0])
    assert np.array_equal(branches(values, graph, 0.7), branches(values + 4, graph, 0.7))


def test_components_never_share_a_mountain():
    graph = edge_graph(6, np.array([[0, 1, 2], [3, 4, 5]]))
    peaks, heights = mountains(np.arange(6.0), graph, np.inf)
    assert peaks.tolist() == [2, 2, 2, 5, 5, 5]
    assert not len(heights)


def test_branches_end_where_they_meet_another_high_one():
    values = np.array([6.0, 4, 2, 5, 1, 8, 7.5, 7.8, 0.5])
    assert branches(values, path(9), 0.6).tolist() == [0, 0, -1, 3, -1, 5, 5, 5, -1]


def test_a_low_bump_belongs_to_the_branch_that_it_meets_first_and_otherwise_to_the_body():
    # 5 is a bump on the branch of 3; 2.2 is one on the body.
    values = np.array([9.0, 3, 8, 4.9, 5, 1, 2.2, 1.5])
    assert branches(values, path(8), 1.5).tolist() == [0, -1, 2, 2, 2, -1, -1, -1]


def test_every_branch_is_above_where_it_ends_and_holds_its_peak(bumpy):
    values, graph = bumpy
    found = branches(values, graph, 0.5)
    for peak in np.unique(found[found >= 0]):
        assert found[peak] == peak
        assert values[found == peak].max() == values[peak]


def test_a_graph_of_edges_has_no_loops_and_is_symmetric():
    graph = edge_graph(4, np.array([[0, 1, 2], [2, 1, 0], [3, 3, 1]]))
    assert (graph != graph.T).nnz == 0
    assert np.array_equal(
        np.argwhere(graph.toarray()), [[0, 1], [0, 2], [1, 0], [1, 2], [1, 3], [2, 0], [2, 1], [3, 1]]
    )
