import numpy as np
import pytest

import heatwalk
from heatwalk.accumulators import heat_walk
from heatwalk.confidence import dissipator_margin, walk_margin
from heatwalk.kernel import HeatKernel
from studies.testing import example_meshes
from tests.helpers import dense


@pytest.fixture(scope="module", params=["ellipsoid", "torus", "open"])
def seg(request):
    mesh = example_meshes()[request.param]
    return heatwalk.segment(mesh.vertices, mesh.faces, 0.3)


def test_the_margin_of_the_walk_is_that_of_the_closest_choice_on_the_path(seg):
    kernel, labels = dense.whole(seg.kernel), seg.accumulator_labels
    assert labels.max() > 0
    chosen = np.unique(seg.walk.pointer)
    expected = []
    for vertex in range(len(labels)):
        margins = []
        for x in seg.walk.path(vertex):
            elsewhere = kernel[x, chosen[labels[chosen] != labels[x]]].max()
            margins.append(1 - elsewhere / kernel[x].max())
        expected.append(max(min(margins), 0))
    assert np.allclose(walk_margin(seg.kernel, seg.walk, labels), expected, rtol=0, atol=1e-9)


def test_the_margin_of_a_segmentation_is_the_smaller_of_walk_and_test(seg):
    of_walk = walk_margin(seg.kernel, seg.walk, seg.accumulator_labels)
    of_test = 1 - np.exp(-np.abs(seg.relative_entropy_excess))
    stays = ~seg.dissipates
    assert np.allclose(seg.margin[stays], np.minimum(of_walk, of_test)[stays])
    assert np.allclose(seg.margin[~stays], of_test[~stays])
    assert ((seg.margin >= 0) & (seg.margin <= 1)).all()


def test_a_vertex_between_two_equal_capacities_has_no_margin_and_one_region_has_all():
    rows = np.array([[2.0, 0.0], [0.0, 2.0], [1.0, 1.0]])
    walk = heat_walk(kernel := HeatKernel(rows, np.zeros(3, int), np.full(3, 1 / 3), 1.0))
    assert walk_margin(kernel, walk, walk.labels).tolist() == [1, 1, 0]
    assert walk_margin(kernel, walk, np.zeros(3, int)).tolist() == [1, 1, 1]


def test_regions_of_other_components_are_not_elsewhere():
    rows = np.array([[2.0, 0.0], [1.0, 0.0], [2.0, 0.0], [1.9, 0.0]])
    walk = heat_walk(kernel := HeatKernel(rows, np.array([0, 0, 1, 1]), np.full(4, 0.5), 1.0))
    assert walk_margin(kernel, walk, walk.labels).tolist() == [1, 1, 1, 1]


def test_the_margin_of_the_test_is_0_at_a_tie_and_grows_with_the_excess():
    excess = np.array([-3, -1, 0, 1, 3])
    assert dissipator_margin(excess).tolist() == pytest.approx(
        [1 - np.exp(-3), 1 - np.exp(-1), 0, 1 - np.exp(-1), 1 - np.exp(-3)]
    )
