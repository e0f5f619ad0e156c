"""Minimum cuts of the dual graph."""

import numpy as np
import pytest
from scipy.optimize import linprog

from studies.segmenters._border import cut_capacities, minimum_cut
from studies.segmenters._dual_graph import DualGraph
from studies.testing import example_meshes
from tests.helpers.beads import beads


def test_no_cut_is_cheaper():
    # The minimum cut as a linear programme: potentials from 0 at the sink to 1 at the source, and slacks at the edges.
    mesh = example_meshes()["open"]
    graph = DualGraph.of(mesh.vertices, mesh.faces)
    costs = np.random.default_rng(0).integers(1, 50, len(graph.pairs)).astype(float)
    source, sink = np.arange(200) < 5, np.arange(200) >= 190
    cut = minimum_cut(graph, costs, source, sink)
    p, m = len(graph.pairs), graph.n_faces
    across = np.zeros((p, m))
    across[np.arange(p), graph.pairs[:, 0]], across[np.arange(p), graph.pairs[:, 1]] = 1, -1
    least = linprog(
        np.concatenate([np.zeros(m), costs]),
        np.block([[across, -np.eye(p)], [-across, -np.eye(p)]]),
        np.zeros(2 * p),
        bounds=[(float(source[i]), float(not sink[i])) for i in range(m)] + [(0, None)] * p,
    )
    assert cut[source].all()
    assert not cut[sink].any()
    assert costs[cut[graph.pairs[:, 0]] != cut[graph.pairs[:, 1]]].sum() == pytest.approx(least.fun, rel=1e-3)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e6])
def test_beads_are_separated_at_their_neck_at_any_scale(scale):
    mesh, truth = beads((1.0, 1.3))
    graph = DualGraph.of(mesh.vertices * scale, mesh.faces)
    ends = np.argsort(graph.centres[:, 0])
    source, sink = np.isin(np.arange(graph.n_faces), ends[:24]), np.isin(np.arange(graph.n_faces), ends[-24:])
    assert np.array_equal(minimum_cut(graph, cut_capacities(graph, 0.1), source, sink), truth == 0)


def test_concave_edges_are_cheapest_to_cut():
    mesh, _ = beads((1.0, 1.0))
    graph = DualGraph.of(mesh.vertices, mesh.faces)
    per_length = cut_capacities(graph, 0.1) / graph.lengths
    sharpest = np.abs(graph.angles).max()
    assert per_length.argmin() in np.flatnonzero(graph.angles < -0.99 * sharpest)
    assert per_length.max() <= 1
