"""Nodal domains of eigenfunctions."""

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from studies.segmenters._persistence import edge_graph
from studies.segmenters._spectrum import Surface, first_eigenpairs
from studies.segmenters.nodal_domains import NodalDomains
from tests.helpers.parts import agreement, chain, star


@pytest.fixture(scope="module")
def shape():
    vertices, faces, _ = star(3)
    return vertices, faces


def n_pieces(graph, members):
    return connected_components(graph[members][:, members], directed=False)[0]


def test_two_balls_are_the_two_domains_of_the_first_function():
    vertices, faces, ball = chain((1.0, 0.9))
    assert agreement(NodalDomains()(vertices, faces, n_segments=2), ball) > 0.95


def test_two_segments_are_where_the_first_function_has_either_sign(shape):
    fiedler = first_eigenpairs(Surface.of(*shape), 1).eigenvectors[:, 1]
    labels = NodalDomains()(*shape, n_segments=2)
    assert len(np.unique(np.column_stack([labels, fiedler > 0]), axis=0)) == 2


@pytest.mark.parametrize("n_segments", [1, 2, 3, 5, 8])
def test_there_are_as_many_segments_as_told_and_each_is_connected(shape, n_segments):
    labels = NodalDomains()(*shape, n_segments=n_segments)
    graph = edge_graph(len(labels), shape[1])
    assert np.array_equal(np.unique(labels), range(n_segments))
    assert [n_pieces(graph, np.flatnonzero(labels == label)) for label in range(n_segments)] == [1] * n_segments


def test_eigenfunctions_up_to_a_number_have_no_more_domains_than_courant_allows(shape):
    for number in (1, 2, 4):
        labels = NodalDomains(least_share=0.0, max_eigenfunctions=number)(*shape, n_segments=50)
        assert 2 <= len(np.unique(labels)) <= number + 1
