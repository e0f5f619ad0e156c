"""Branches of the level sets of eigenfunctions."""

import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from studies.segmenters._persistence import edge_graph
from studies.segmenters._spectrum import Surface, first_eigenpairs
from studies.segmenters.eigenfunction_persistence import EigenfunctionPersistence
from tests.helpers.parts import agreement, chain, star


@pytest.fixture(scope="module")
def shape():
    vertices, faces, arm = star(3)
    return vertices, faces, arm


def is_piece_above_a_level(members, values, graph):
    """Whether some vertices are all of a connected piece of what is above the highest value around them."""
    is_member = np.isin(np.arange(len(values)), members)
    around = np.unique(graph[members].indices)
    level = values[around[~is_member[around]]].max()
    above = np.flatnonzero(values > level)
    piece = connected_components(graph[above][:, above], directed=False)[1]
    mine = np.unique(piece[np.isin(above, members)])
    return len(mine) == 1 and np.array_equal(above[piece == mine[0]], members)


def test_the_segments_of_one_function_but_the_body_are_pieces_above_or_below_a_level(shape):
    vertices, faces, _ = shape
    values = first_eigenpairs(Surface.of(vertices, faces), 1).eigenvectors[:, 1]
    graph = edge_graph(len(vertices), faces)
    labels = EigenfunctionPersistence(n_eigenfunctions=1, least_persistence=0.02)(vertices, faces)
    segments = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    pieces = [
        is_piece_above_a_level(members, values, graph) or is_piece_above_a_level(members, -values, graph)
        for members in segments
    ]
    assert len(segments) >= 3
    assert sum(pieces) >= len(segments) - 1  # the body may be one too


def test_the_arms_of_a_star_end_at_saddles_of_one_of_the_functions(shape):
    vertices, faces, arm = shape
    assert agreement(EigenfunctionPersistence(n_eigenfunctions=3)(vertices, faces), arm) > 0.9


def test_a_function_that_runs_from_end_to_end_has_no_saddle_to_cut_at():
    vertices, faces, _ = chain((1.0, 0.9))
    assert not EigenfunctionPersistence(n_eigenfunctions=1)(vertices, faces).any()


def test_more_functions_refine_the_segments_of_fewer(shape):
    vertices, faces, _ = shape
    few, more = (EigenfunctionPersistence(n_eigenfunctions=number)(vertices, faces) for number in (2, 4))
    assert len(np.unique(np.column_stack([few, more]), axis=0)) == len(np.unique(more))
