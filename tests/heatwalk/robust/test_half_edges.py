from collections import Counter

import numpy as np
import pytest

from heatwalk.robust.half_edges import BOUNDARY, NON_MANIFOLD, adjacency, partners
from perturb.testing import odd_meshes

MESHES = {name: np.asarray(mesh.faces, np.int64) for name, mesh in odd_meshes().items() if name != "repeated corners"}
MESHES = {name: faces[(faces != np.roll(faces, 1, axis=1)).all(axis=1)] for name, faces in MESHES.items()}


def sides_of(faces):
    return [tuple(sorted((face[i], face[(i + 1) % 3]))) for face in faces.tolist() for i in range(3)]


@pytest.mark.parametrize("name", MESHES)
def test_a_side_has_a_partner_exactly_if_one_other_side_joins_the_same_vertices(name):
    faces = MESHES[name]
    partner, sides = partners(faces, int(faces.max()) + 1), sides_of(faces)
    count = Counter(sides)
    for side, other in enumerate(partner.tolist()):
        if count[sides[side]] == 2:
            assert other != side
            assert sides[other] == sides[side]
        else:
            assert other == (BOUNDARY if count[sides[side]] == 1 else NON_MANIFOLD)


@pytest.mark.parametrize("name", MESHES)
def test_the_neighbours_of_a_vertex_are_the_other_ends_of_its_edges_each_once_and_ascending(name):
    faces = MESHES[name]
    n = int(faces.max()) + 2  # the last one has no face
    starts, neighbours = adjacency(faces, n)
    expected = [set() for _ in range(n)]
    for a, b in sides_of(faces):
        expected[a].add(b)
        expected[b].add(a)
    assert [neighbours[starts[v] : starts[v + 1]].tolist() for v in range(n)] == [sorted(e) for e in expected]
