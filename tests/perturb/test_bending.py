"""Bending: free-form deformation reproduces affine maps, and a bent rod is an arc."""

import numpy as np
import pytest
import trimesh

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

COW = bundled("cow")


@pytest.mark.parametrize("points", [2, 4, 5])
def test_control_points_displaced_by_an_affine_map_displace_everything_by_it(points):
    matrix, shift = rng(5).uniform(-0.3, 0.3, (3, 3)), rng(6).uniform(-1, 1, 3)
    grid = np.stack(np.meshgrid(*[np.linspace(0, 1, points)] * 3, indexing="ij"), axis=-1)
    bending = perturb.Bending(0.2, control_points=points)
    result = bending.apply(COW, {"offsets": grid @ matrix.T + shift})
    side, diagonal = np.ptp(COW.vertices, axis=0).max(), np.linalg.norm(np.ptp(COW.vertices, axis=0))
    place = (COW.vertices - COW.bounds.mean(axis=0)) / side + 0.5
    expected = COW.vertices + 0.2 * diagonal * (place @ matrix.T + shift)
    np.testing.assert_allclose(result.mesh.vertices, expected, atol=1e-12 * diagonal)
    jacobian = np.eye(3) + 0.2 * diagonal / side * matrix
    assert result.applied["smallest_volume_ratio"] == pytest.approx(np.linalg.det(jacobian), rel=1e-9)


def test_one_control_point_moves_what_is_near_it_most_by_its_bernstein_polynomial():
    box = trimesh.creation.box(extents=[1, 1, 1])  # its corners are the outer control points
    offsets = np.zeros((4, 4, 4, 3))
    offsets[3, 3, 3] = [0.1, 0, 0]
    result = perturb.Bending(1.0).apply(box.subdivide(), {"offsets": offsets})
    moved = result.mesh.vertices - box.subdivide().vertices
    place = box.subdivide().vertices + 0.5
    np.testing.assert_allclose(moved[:, 0], 0.1 * np.sqrt(3) * np.prod(place, axis=1) ** 3, atol=1e-15)
    np.testing.assert_array_equal(moved[:, 1:], 0)


def test_the_volume_ratio_is_that_of_small_tetrahedra():
    vertices = rng(1).uniform(-0.5, 0.5, (40, 3))
    corners = np.concatenate([vertices[:, None], vertices[:, None] + 1e-5 * np.eye(3)], axis=1)
    frame = trimesh.creation.box(extents=[1.01] * 3)
    mesh = trimesh.Trimesh(
        np.concatenate([frame.vertices, corners.reshape(-1, 3)]),
        np.concatenate([frame.faces, [[8 + 4 * i, 9 + 4 * i, 10 + 4 * i] for i in range(40)]]),
        process=False,
    )
    bending = perturb.Bending(0.1)
    result = bending(mesh, rng())
    after = result.mesh.vertices[8:].reshape(-1, 4, 3)
    ratio = np.linalg.det((after[:, 1:] - after[:, :1]) / 1e-5)
    at_corners = bending._deform_freely(mesh, bending.sample(mesh, rng())["offsets"])[1]
    np.testing.assert_allclose(at_corners[8::4], ratio, rtol=1e-3)


def test_space_that_would_fold_is_refused_and_otherwise_drawn_again():
    mesh = bundled("ant")
    with pytest.raises(PerturbationError, match="space would fold"):
        perturb.Bending(5.0)(mesh, rng())
    strong = perturb.Bending(0.5)
    first = [rng(seed).uniform(-1, 1, (4, 4, 4, 3)) for seed in range(5)]
    folded = [strong._deform_freely(mesh, offsets)[1].min() <= 0 for offsets in first]
    assert 0 < sum(folded) < 5
    for seed in range(5):
        drawn = strong.sample(mesh, rng(seed))["offsets"]
        assert strong.apply(mesh, {"offsets": drawn}).applied["smallest_volume_ratio"] > 0
        assert folded[seed] == (drawn != first[seed]).any()


@pytest.fixture(scope="module")
def rod():
    """A rod of length 12 along z."""
    return trimesh.creation.box(extents=[1, 1, 12]).subdivide().subdivide().subdivide().subdivide()


@pytest.mark.parametrize("degrees", [30, 180, 330])
def test_a_bent_rod_is_an_arc_whose_middle_line_keeps_its_length(degrees, rod):
    bend = perturb.Bending(degrees, "degrees", "bend")
    bent = bend.apply(rod, {"direction": np.array([3.0, 0.0, 7.0])}).mesh  # only the part across the rod counts
    radius = 12 / np.radians(degrees)
    distance = np.linalg.norm(bent.vertices[:, [0, 2]] - [radius, 0], axis=1)
    np.testing.assert_allclose(distance, radius - rod.vertices[:, 0], atol=1e-9)
    angle = np.arctan2(bent.vertices[:, 2], radius - bent.vertices[:, 0])
    np.testing.assert_allclose(angle, rod.vertices[:, 2] / radius, atol=1e-9)
    # What one side gains, the other loses; 16 pieces of the arc are straight.
    piece = np.radians(degrees) / 16
    assert bent.volume == pytest.approx(rod.volume * np.sin(piece) / piece, rel=1e-9)


def test_a_rod_bent_so_far_that_its_inner_side_is_folded_is_refused(rod):
    with pytest.raises(PerturbationError, match="space would fold"):
        perturb.Bending(3000, "degrees", "bend")(rod, rng())


def test_a_unit_that_does_not_fit_the_method_is_refused():
    with pytest.raises(PerturbationError, match="method=bend needs unit=degrees"):
        perturb.Bending(30, method="bend")
    with pytest.raises(PerturbationError, match="control_points is 1; it must be at least 2"):
        perturb.Bending(control_points=1)
