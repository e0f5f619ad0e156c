import numpy as np
import pytest

from studies.figures.views import view_along, view_of


@pytest.fixture
def cloud():
    """Points of a shape that is wide, less high and flat."""
    return np.random.default_rng(0).normal(size=(200, 3)) * [5.0, 2.0, 0.5] + [1.0, -7.0, 3.0]


@pytest.mark.parametrize("upright", [1, 2])
def test_a_view_is_a_rotation_and_level(cloud, upright):
    view = view_of(cloud[:, [0, 2, 1]] if upright == 2 else cloud, upright)
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view.axes) == pytest.approx(1)
    assert view.axes[0][upright] == pytest.approx(0, abs=1e-12)
    assert view.axes[1][upright] > 0


def test_a_shape_is_seen_along_its_thinnest_direction_from_above(cloud):
    view = view_of(cloud)
    assert abs(view.axes[2][2]) > 0.9
    assert view.axes[2][1] == pytest.approx(np.sin(np.deg2rad(20)), abs=0.05)


def test_the_other_axis_is_upright_if_the_given_one_points_at_the_camera(cloud):
    flat = cloud[:, [0, 2, 1]]  # thin along y, which would point at the camera
    assert view_of(flat, 1).axes[1][2] > 0.9


def test_a_frame_contains_every_vertex_and_touches_them_on_all_sides(cloud):
    view = view_along(cloud, np.eye(3)[[1, 2, 0]])
    seen = (cloud - view.centre) @ view.axes[:2].T
    np.testing.assert_allclose(seen.max(axis=0), view.extent / 2)
    np.testing.assert_allclose(seen.min(axis=0), -view.extent / 2)
