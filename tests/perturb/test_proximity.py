"""The search for vertices near in space and far along the surface, compared with all shortest paths."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.distance import cdist

import perturb
from perturb._proximity import search_near_but_far
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import far_along_edges, rng


def stretched(mesh):
    """The mesh with edges of very different lengths, and paths along them far longer than those on the surface."""
    return trimesh.Trimesh(mesh.vertices * [1, 1, 30], mesh.faces, process=False)


def with_unreferenced_vertices(mesh):
    """The mesh with as many vertices without faces, at the same positions."""
    return trimesh.Trimesh(np.repeat(mesh.vertices, 2, axis=0), 2 * mesh.faces, process=False)


@pytest.mark.parametrize(
    ("model", "change"),
    [
        ("cow", None),
        ("ant", None),
        ("ant", with_unreferenced_vertices),
        ("cow", stretched),
        (124, None),
        (203, None),
    ],
)
def test_the_search_finds_exactly_the_vertices_that_all_shortest_paths_give(model, change, request):
    mesh = bundled(model) if isinstance(model, str) else request.getfixturevalue("psb_mesh")(model)
    mesh = mesh if change is None else change(mesh)
    diagonal = np.linalg.norm(mesh.extents)
    far, in_space = far_along_edges(mesh, 0.2 * diagonal), cdist(mesh.vertices, mesh.vertices)
    graph = perturb.edge_graph(mesh).tocsr()
    sources = rng().permutation(np.unique(mesh.faces))
    for near in (0.01, 0.05, 0.09, 0.2 / 1.5):
        expected = far & (in_space <= near * diagonal)
        found = dict(search_near_but_far(mesh.vertices, graph, sources, near * diagonal, 0.2 * diagonal))
        assert list(found) == np.flatnonzero(expected[sources].any(axis=1)).tolist()
        for i, ends in found.items():
            np.testing.assert_array_equal(ends, np.flatnonzero(expected[sources[i]]))
    assert len(found) > 0
