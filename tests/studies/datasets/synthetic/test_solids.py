"""Distances from round solids, against the least over many balls and against finite differences."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from studies.datasets.synthetic.fields import Field
from studies.datasets.synthetic.shapes import SHAPES
from studies.datasets.synthetic.solids import Cones, Lathed, nearest_on_cone, nearest_on_triangle
from studies.datasets.synthetic.surface import extracted, field_of


def least_over_balls(points, centres, radii):
    return (np.linalg.norm(points[:, None] - centres, axis=2) - radii).min(axis=1)


def cones(starts, ends, radii):
    pieces = len(starts)
    return Cones(
        parts=np.arange(pieces), origins=starts, rotations=np.repeat(np.eye(3)[None], pieces, axis=0),
        starts=starts, ends=ends, radii=radii,
    )  # fmt: skip


@pytest.fixture
def rng():
    return np.random.default_rng(7)


@pytest.mark.parametrize("radii", [(0.3, 0.3), (0.1, 0.6), (0.9, 0.2)])
def test_the_distance_from_a_cone_is_the_least_over_the_balls_between_its_ends(rng, radii):
    start, end = np.array([0.2, -0.1, 0.3]), np.array([1.1, 0.4, -0.2])
    points = rng.normal(0, 1, (300, 3))
    share = np.linspace(0, 1, 5001)[:, None]
    wanted = least_over_balls(points, start + share * (end - start), (radii[0] + share * (radii[1] - radii[0])).ravel())
    distance, centre = nearest_on_cone(points, start, end, *map(np.array, radii))
    assert np.all(distance <= wanted + 1e-12)
    assert np.all(wanted - distance < 1e-6)
    assert np.allclose(np.linalg.norm(np.cross(centre - start, end - start), axis=1), 0)


def test_the_hull_of_two_equal_balls_in_one_place_is_that_ball(rng):
    points, centre = rng.normal(0, 1, (50, 3)), np.array([0.1, 0.2, 0.3])
    distance, nearest = nearest_on_cone(points, centre, centre, np.array(0.4), np.array(0.4))
    assert np.allclose(distance, np.linalg.norm(points - centre, axis=1) - 0.4)
    assert np.all(nearest == centre)


@pytest.mark.parametrize("radii", [(0.2, 0.2, 0.2), (0.1, 0.3, 0.45), (0.5, 0.1, 0.2)])
def test_the_distance_from_a_triangle_is_the_least_over_the_balls_between_its_corners(rng, radii):
    corners = np.array([[0.0, 0.1, 0.0], [1.0, 0.0, 0.2], [0.3, 0.9, -0.1]])
    points = rng.normal(0.4, 0.8, (200, 3))
    u, v = np.meshgrid(np.linspace(0, 1, 151), np.linspace(0, 1, 151))
    shares = np.column_stack([1 - u[u + v <= 1] - v[u + v <= 1], u[u + v <= 1], v[u + v <= 1]])
    wanted = least_over_balls(points, shares @ corners, shares @ radii)
    distance, centre = nearest_on_triangle(points, corners, np.array(radii))
    assert np.all(distance <= wanted + 1e-12)
    assert np.all(wanted - distance < 1e-3)
    assert np.allclose((centre - corners[0]) @ np.cross(corners[1] - corners[0], corners[2] - corners[0]), 0)


def test_a_lathed_solid_is_the_union_of_its_profile_turned_about_the_axis(rng):
    starts, ends = np.array([[0.0, -0.3, 0.0], [0.4, 0.0, 0.0]]), np.array([[0.4, 0.0, 0.0], [0.5, 0.6, 0.0]])
    profile = cones(starts, ends, np.array([[0.1, 0.1], [0.1, 0.05]]))
    frame, centre = Rotation.from_rotvec([0.3, -0.5, 0.8]).as_matrix(), np.array([0.1, 0.2, -0.3])
    lathed = Lathed(
        parts=profile.parts, origins=starts, rotations=profile.rotations, centre=centre, frame=frame, profile=profile
    )
    points = rng.normal(0, 0.6, (60, 3))
    turns = Rotation.from_euler("y", np.linspace(0, 360, 721)[:, None], degrees=True).as_matrix()
    for piece in range(2):
        wanted = np.full(len(points), np.inf)
        for turn in turns:
            place = frame @ turn
            one, other = (centre + place @ end[piece] for end in (starts, ends))
            wanted = np.minimum(wanted, nearest_on_cone(points, one, other, *profile.radii[piece])[0])
        distance, nearest = lathed.nearest(points, np.array(piece))
        assert np.all(distance <= wanted + 1e-12)
        assert np.all(wanted - distance < 1e-3)
        low, high = (corner[piece] for corner in lathed.boxes())
        assert np.all((nearest >= low) & (nearest <= high))


@pytest.mark.parametrize("name", ["fish", "cup", "biped"])
def test_the_gradient_of_a_field_is_that_of_finite_differences(name):
    field = field_of(SHAPES[name], 2)
    points = field.projected(extracted(field, 0.1)[0])
    value, gradient = field.value_and_gradient(points)
    assert np.abs(value).max() < 1e-12
    for axis, step in enumerate(np.eye(3) * 1e-6):
        difference = field.value_and_gradient(points + step)[0] - field.value_and_gradient(points - step)[0]
        assert np.abs(difference / 2e-6 - gradient[:, axis]).max() < 1e-4


def test_a_field_on_a_grid_is_the_field_at_its_points():
    field = field_of(SHAPES["pliers"], 1)
    low, high = field.bounds()
    spacing = 0.06
    counts = np.ceil((high - low) / spacing).astype(int) + 2
    on_grid = field.on_grid(low, spacing, counts)
    points = low + spacing * np.stack(np.meshgrid(*map(np.arange, counts), indexing="ij"), axis=-1)
    near = np.abs(on_grid) < spacing
    value, _ = field.value_and_gradient(points[near])
    assert near.sum() > 500
    assert np.abs(on_grid[near] - value).max() < 0.02 * field.blend


def test_points_out_of_reach_are_an_error_and_not_a_value():
    with pytest.raises(ValueError, match=r"a point is more than 0\.3 outside the box of every limb"):
        field_of(SHAPES["pliers"], 1).value_and_gradient(np.array([[0.0, 0.0, 0.0], [0.0, 2.0, 0.0]]))


def test_two_limbs_in_one_place_are_thicker_by_the_blend_times_the_logarithm_of_two():
    ball = cones(np.zeros((1, 3)), np.array([[0.0, 0.0, 1e-3]]), np.array([[0.5, 0.5]]))
    once, twice = Field([ball], 0.03, 1), Field([ball, ball], 0.03, 1)
    points = np.array([[0.5, 0.1, 0.0], [0.0, 0.6, 0.0]])
    assert np.allclose(once.value_and_gradient(points)[0] - twice.value_and_gradient(points)[0], 0.03 * np.log(2))
