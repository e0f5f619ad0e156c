from itertools import product

import numpy as np
import pytest
import trimesh

from heatwalk.laplacian import stiffness_and_mass, unit_area
from heatwalk.robust.cuts import CutGraph, level_costs, minimum_cut
from tests.helpers.parts import chain, star

MAX_CURVATURE = 2.0


def graph_of(vertices, faces, max_curvature=MAX_CURVATURE):
    mass = stiffness_and_mass(unit_area(vertices, faces), faces)[1]
    return CutGraph.of(vertices, faces, mass, max_curvature)


@pytest.fixture(scope="module")
def dumbbell():
    return chain((1.0, 1.0), neck=0.5)


@pytest.mark.parametrize("seed", range(20))
def test_no_other_cut_is_cheaper_than_the_minimum_cut(seed):
    rng = np.random.default_rng(seed)
    edges = np.array([(a, b) for a in range(8) for b in range(a + 1, 8) if rng.random() < 0.5])
    graph = CutGraph(edges, rng.integers(1, 20, len(edges)).astype(float), np.full(8, 1 / 8))
    source, sink = np.arange(8) == 0, np.arange(8) >= 6

    def cost(inside):
        return graph.costs[inside[edges[:, 0]] != inside[edges[:, 1]]].sum()

    found = minimum_cut(graph, source, sink)
    assert found[0]
    assert not found[6:].any()
    sides = [np.array([True, *middle, False, False]) for middle in product([False, True], repeat=5)]
    assert cost(found) == min(map(cost, sides))


def test_circles_of_latitude_cost_their_length():
    ball = trimesh.creation.icosphere(4)
    graph = graph_of(np.array(ball.vertices), np.array(ball.faces))
    radius = np.sqrt(1 / (4 * np.pi))
    heights = radius * np.array([0.8, 0.5, 0.01, -0.6])
    expected = 2 * np.pi * np.sqrt(radius**2 - heights**2)
    assert level_costs(graph, graph.vertices[:, 2], heights) == pytest.approx(expected, rel=0.01)


def test_a_level_set_where_the_function_is_not_defined_costs_nothing():
    ball = trimesh.creation.icosphere(2)
    graph = graph_of(np.array(ball.vertices), np.array(ball.faces))
    assert level_costs(graph, np.full(len(graph.areas), -np.inf), np.array([0.0])).tolist() == [0]


def test_a_cut_costs_less_than_its_length_only_where_the_surface_is_concave(dumbbell):
    vertices, faces, _ = dumbbell
    graph, flat = graph_of(vertices, faces), graph_of(vertices, faces, 1e12)
    x = graph.vertices[:, 0]
    levels = np.linspace(x.max(), x.min(), 42)[1:-1]
    share = level_costs(graph, x, levels) / level_costs(flat, x, levels)
    is_ball = np.abs(levels - (x.max() + x.min()) / 2) > 0.2 * np.ptp(x)
    assert share[is_ball] == pytest.approx(1, abs=1e-6)
    assert share[~is_ball].min() < 0.7


@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_units_and_the_orientation_of_faces_do_not_matter(dumbbell, scale):
    vertices, faces, _ = dumbbell
    rng = np.random.default_rng(0)
    turned = np.where(rng.random(len(faces))[:, None] < 0.5, faces, faces[:, ::-1])
    assert np.allclose(graph_of(scale * vertices, turned).costs, graph_of(vertices, faces).costs, rtol=1e-9)


def test_costs_hardly_depend_on_the_number_of_vertices():
    coarse, fine = (graph_of(*star(subdivisions)[:2]) for subdivisions in (4, 5))
    levels = np.quantile(coarse.vertices[:, 0], [0.9, 0.5])
    costs = [level_costs(graph, graph.vertices[:, 0], levels) for graph in (coarse, fine)]
    assert costs[0] == pytest.approx(costs[1], rel=0.1)


def test_a_minimum_cut_between_two_balls_is_their_neck(dumbbell):
    vertices, faces, ball = dumbbell
    x = vertices[:, 0]
    inside = minimum_cut(graph_of(vertices, faces), x < np.quantile(x, 0.1), x > np.quantile(x, 0.9))
    assert (inside == (ball == 0)).mean() > 0.95
