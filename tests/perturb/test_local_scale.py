"""Local scale: how far a place reaches, by how much it scales, and that space does not fold."""

import numpy as np
import pytest
import trimesh

import perturb
from perturb import PerturbationError
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

COW = bundled("cow")
DIAGONAL = np.linalg.norm(np.ptp(COW.vertices, axis=0))


def one_place(amount, sign, radius=0.15, vertex=100):
    scale = perturb.LocalScale(amount, places=1, radius=radius)
    return scale.apply(COW, {"vertices": np.array([vertex]), "signs": np.array([sign])})


@pytest.mark.parametrize("sign", [1, -1])
def test_what_is_beyond_the_radius_stays_as_it_is(sign):
    result = one_place(1.0, sign)
    reach = 0.15 * DIAGONAL
    near = np.linalg.norm(COW.vertices - COW.vertices[100], axis=1) < reach
    centre = COW.vertices[near].mean(axis=0)
    inside = np.linalg.norm(COW.vertices - centre, axis=1) < reach
    moved = (result.mesh.vertices != COW.vertices).any(axis=1)
    np.testing.assert_array_equal(moved, inside)
    assert result.applied["vertices_moved"] == np.count_nonzero(inside)


@pytest.mark.parametrize(("sign", "factor"), [(1, 1.5), (-1, 1 / 1.5)])
def test_lengths_near_the_centre_are_multiplied_by_the_factor(sign, factor):
    # A small sphere at the centre of a ball of 50 times its size; another, far away, makes the bounding box.
    ball = trimesh.creation.icosphere(subdivisions=2)
    mesh = trimesh.util.concatenate([ball, ball.copy().apply_translation([1000, 0, 0])])
    scale = perturb.LocalScale(0.5, places=1, radius=0.05)
    swollen = scale.apply(mesh, {"vertices": np.array([0]), "signs": np.array([sign])}).mesh.vertices[
        : len(ball.vertices)
    ]
    np.testing.assert_allclose(np.linalg.norm(swollen, axis=1), factor, rtol=0.002)


@pytest.mark.parametrize("sign", [1, -1])
def test_points_keep_their_order_along_every_ray_at_the_largest_amount(sign):
    result = one_place(1.0, sign, radius=0.3)
    near = np.linalg.norm(COW.vertices - COW.vertices[100], axis=1) < 0.3 * DIAGONAL
    centre = COW.vertices[near].mean(axis=0)
    before, after = (np.linalg.norm(mesh.vertices - centre, axis=1) for mesh in (COW, result.mesh))
    order = np.argsort(before)
    assert (np.diff(after[order]) >= -1e-12).all()  # every direction is scaled alike, so this holds for all of them
    assert (after[near] > before[near]).mean() == (1.0 if sign > 0 else 0.0)


def test_half_of_the_places_swell():
    for places, swollen in ((4, 2), (5, 3)):
        assert perturb.LocalScale(places=places)(COW, rng()).applied["places_swollen"] == swollen


def test_places_do_not_depend_on_how_finely_a_part_is_divided():
    vertices, faces = trimesh.creation.icosphere(subdivisions=3).vertices, trimesh.creation.icosphere(3).faces
    upper = vertices[faces].mean(axis=1)[:, 2] > 0
    mesh = trimesh.Trimesh(*trimesh.remesh.subdivide(vertices, faces, face_index=np.flatnonzero(upper)), process=False)
    drawn = np.concatenate([perturb.LocalScale(places=50).sample(mesh, rng(seed))["vertices"] for seed in range(20)])
    # Half of the area is above, and four fifths of the vertices. Of 1000 draws, 500 ± 16 are expected.
    assert 0.45 < (mesh.vertices[drawn, 2] > 0).mean() < 0.55
    assert (mesh.vertices[:, 2] > 0).mean() > 0.75


def test_a_radius_that_reaches_no_neighbour_is_refused():
    with pytest.raises(PerturbationError, match="no vertex would move; choose a larger amount"):
        perturb.LocalScale(radius=1e-9)(COW, rng())


def test_more_places_than_vertices_are_refused():
    with pytest.raises(PerturbationError, match="9999 places were requested, but only 2903 vertices"):
        perturb.LocalScale(places=9999)(COW, rng())


def test_an_amount_above_1_which_would_fold_space_is_refused():
    with pytest.raises(PerturbationError, match="at most 1"):
        perturb.LocalScale(1.1)
