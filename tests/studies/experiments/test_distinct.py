"""Distinct segments: which exemplars are joined, and which segments count."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.sparse.csgraph import dijkstra

import heatwalk
import perturb
from perturb._odd_meshes import ellipsoid
from studies.experiments.distinct import DistinctSegments


@pytest.fixture(scope="module")
def strip():
    """A flat strip of 2 x 41 vertices at distance 1, lower row first: vertices and faces."""
    i = np.arange(40)
    vertices = np.array([[x, y, 0.0] for y in (0, 1) for x in range(41)])
    lower, upper = np.stack([i, i + 1, i + 42], axis=1), np.stack([i, i + 42, i + 41], axis=1)
    return vertices, np.concatenate([lower, upper])


def segmented(exemplars, x_of_cuts, dissipates_from=41):
    """Regions of the strip between cuts, and dissipators from an x on, as a segmentation has them."""
    x = np.tile(np.arange(41), 2)
    labels = np.searchsorted(np.array(x_of_cuts), x, side="right")
    return SimpleNamespace(exemplars=np.array(exemplars), labels=np.where(x >= dissipates_from, len(exemplars), labels))


@pytest.mark.parametrize(
    ("exemplars", "joined_by_one", "joined_by_two"),
    [
        ((5, 20, 35), 3, 3),
        ((9, 10, 35), 2, 2),
        ((9, 11, 35), 3, 2),
        ((9, 12, 35), 3, 3),
        ((9, 10, 11), 1, 1),
        ((9, 11, 13), 3, 1),
        ((9, 51, 35), 2, 2),  # 51 is diagonally above 9, at the end of one edge
        ((10, 50, 35), 3, 2),  # no edge runs the other way
    ],
)
def test_exemplars_are_joined_in_chains_of_edges(strip, exemplars, joined_by_one, joined_by_two):
    distinct, segmentation = DistinctSegments(*strip), segmented(exemplars, (15, 25))
    assert [distinct.count(segmentation, reach) for reach in (1, 2)] == [joined_by_one, joined_by_two]


def test_dissipators_are_a_segment_that_is_joined_with_none(strip):
    distinct = DistinctSegments(*strip)
    assert distinct.count(segmented((9, 10), (15,), dissipates_from=30), 2) == 2
    assert distinct.count(segmented((9, 10), (15,), dissipates_from=0), 2) == 1


def test_a_segment_counts_from_one_percent_of_the_area_on(strip):
    vertices, faces = strip
    narrow = vertices.copy()
    # The last column has a width of w: its vertices have half of it, the last but one the rest.
    for w, counted in ((0.79, 1), (0.81, 2)):
        narrow[[40, 81], 0] = 39 + w
        share = w / 2 / (39 + w)
        assert (share >= 0.01) == (counted == 2)
        assert DistinctSegments(narrow, faces).count(segmented((5, 40), (40,)), 1) == counted


def test_small_segments_count_together_once_their_exemplars_are_joined(strip):
    vertices, faces = strip
    narrow = vertices.copy()
    narrow[:, 0] = np.where(vertices[:, 0] > 37, 37 + 0.2 * (vertices[:, 0] - 37), vertices[:, 0])
    segmentation = segmented((5, 38, 39, 40), (38, 39, 40))
    assert DistinctSegments(narrow, faces).count(segmentation, 1) == 2
    apart = segmented((5, 20, 25, 30), (38, 39, 40))
    assert DistinctSegments(narrow, faces).count(apart, 1) == 1


def test_the_count_on_a_mesh_is_that_of_all_distances_between_exemplars():
    mesh = perturb.as_trimesh(*ellipsoid())
    area = np.zeros(len(mesh.vertices))
    np.add.at(area, mesh.faces, mesh.area_faces[:, None] / 3)
    hops = dijkstra(perturb.edge_graph(mesh), unweighted=True)
    distinct = DistinctSegments(mesh.vertices, mesh.faces)
    for segmentation in heatwalk.segment_at_times(mesh.vertices, mesh.faces, [0.02, 0.1, 1.0]):
        for reach in (1, 2):
            group = list(range(len(segmentation.exemplars)))
            for i, x in enumerate(segmentation.exemplars):
                for j, y in enumerate(segmentation.exemplars):
                    if hops[x, y] <= reach:
                        group = [group[i] if each == group[j] else each for each in group]
            named = np.array([*group, -1])[np.minimum(segmentation.labels, len(group))]
            shares = [area[named == name].sum() / area.sum() for name in set(named.tolist())]
            assert distinct.count(segmentation, reach) == sum(share >= 0.01 for share in shares)
