"""View: what is seen, compared with geometry that is known."""

import numpy as np
import pytest
import trimesh

import perturb
from perturb import PerturbationError
from perturb.testing import odd_meshes
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

ANT = bundled("ant")


def scanner(view, mesh, parameters):
    """(3,) where the only scanner of a view with the amount 1 is."""
    z = 1 - 1 / view.positions
    direction = parameters["rotation"] @ [np.sqrt(1 - z**2), 0, z]
    return mesh.bounds.mean(axis=0) + view.distance * np.linalg.norm(mesh.extents) * direction


def faces_seen(mesh, result):
    """(m,) bool: which faces remain, of a mesh of which every vertex has a face."""
    counterpart = result.counterpart[mesh.faces]
    remaining = {tuple(face) for face in result.mesh.faces.tolist()}
    return np.array([tuple(face) in remaining for face in counterpart.tolist()])


def hidden_by(mesh, points, eye):
    """(k,) bool: whether a triangle is between points and eye, by the algorithm of Möller and Trumbore."""
    a, b, c = (np.asarray(mesh.vertices)[mesh.faces[:, i]] for i in range(3))
    hidden = []
    for point in points:
        ray = eye - point
        across = np.cross(ray, c - a)
        determinant = ((b - a) * across).sum(axis=1)
        inverse = 1 / np.where(np.abs(determinant) < 1e-300, np.inf, determinant)
        u = ((point - a) * across).sum(axis=1) * inverse
        q = np.cross(point - a, b - a)
        v, t = (q @ ray) * inverse, (q * (c - a)).sum(axis=1) * inverse
        hidden.append(((u >= 0) & (v >= 0) & (u + v <= 1) & (t > 1e-9) & (t < 1)).any())
    return np.array(hidden)


@pytest.mark.parametrize("max_incidence", [40, 80])
def test_of_a_convex_shape_exactly_the_faces_turned_to_the_scanner_are_seen(max_incidence):
    sphere = trimesh.creation.icosphere(subdivisions=3)
    view = perturb.View(1.0, max_incidence=max_incidence)
    for seed in range(3):
        eye = scanner(view, sphere, view.sample(sphere, rng(seed)))
        towards = eye - sphere.triangles_center
        cosine = (sphere.face_normals * towards).sum(axis=1) / np.linalg.norm(towards, axis=1)
        result = view(sphere, rng(seed))
        np.testing.assert_array_equal(faces_seen(sphere, result), cosine >= np.cos(np.radians(max_incidence)))
        seen = cosine >= np.cos(np.radians(max_incidence))
        assert result.applied["faces_removed"] == np.count_nonzero(~seen)
        assert result.applied["share_of_area_seen"] == pytest.approx(sphere.area_faces[seen].sum() / sphere.area)


def test_what_is_in_front_hides_what_is_behind():
    view = perturb.View(1.0, positions=1, distance=3)
    near = trimesh.creation.icosphere(subdivisions=3)
    behind = trimesh.creation.icosphere(subdivisions=2, radius=0.5)
    # A rotation by 90 degrees about x brings the scanner's axis, z, to -y; its only position is on the equator, at x.
    mesh = trimesh.util.concatenate(near, behind.apply_translation([-3.0, 0, 0]))
    parameters = {"rotation": np.eye(3)}
    np.testing.assert_allclose(scanner(view, mesh, parameters) - mesh.bounds.mean(axis=0), [3 * mesh.scale, 0, 0])
    result = view.apply(mesh, parameters)
    assert (result.counterpart[len(near.vertices) :] == -1).all()
    assert (result.counterpart[: len(near.vertices)] >= 0).any()
    without = perturb.View(1.0, positions=1).apply(behind, parameters)
    assert (without.counterpart >= 0).any()


def test_on_a_shape_with_limbs_it_agrees_with_rays_to_the_centres_of_faces():
    view = perturb.View(1.0)
    for seed in range(2):
        eye = scanner(view, ANT, view.sample(ANT, rng(seed)))
        seen = faces_seen(ANT, view(ANT, rng(seed)))
        towards = eye - ANT.triangles_center
        cosine = np.abs((ANT.face_normals * towards).sum(axis=1)) / np.linalg.norm(towards, axis=1)
        facing = cosine >= np.cos(np.radians(view.max_incidence))
        expected = facing & ~hidden_by(ANT, ANT.triangles_center, eye)
        assert not seen[~facing].any()
        # Few faces are hidden in part, so that their centres and the rays that meet them differ.
        assert np.count_nonzero(expected & ~seen) < 0.01 * len(ANT.faces)
        assert np.count_nonzero(seen & ~expected) < 0.08 * len(ANT.faces)


def test_more_directions_show_more():
    few, some, many = (faces_seen(ANT, perturb.View(amount)(ANT, rng())) for amount in (1.0, 0.75, 0.5))
    assert (few <= some).all()
    assert (some <= many).all()
    assert few.sum() < some.sum() < many.sum()


@pytest.mark.parametrize(("amount", "used"), [(1.0, 1), (0.97, 1), (0.92, 2), (0.5, 12), (0.001, 24)])
def test_the_share_of_directions_determines_the_number_of_positions(amount, used):
    assert perturb.View(amount)(ANT, rng()).applied["positions_used"] == used


def test_positions_are_unit_vectors_within_a_cap_of_the_remaining_share():
    directions = perturb.View(0.6, positions=500)._directions()
    np.testing.assert_allclose(np.linalg.norm(directions, axis=1), 1, rtol=1e-12)
    # A cap whose height is h diameters has the share h of the sphere.
    assert directions[:, 2].min() >= 1 - 2 * 0.4
    np.testing.assert_allclose(directions.mean(axis=0)[:2], 0, atol=0.01)


def test_both_of_two_faces_in_the_same_place_are_seen():
    two_sided, one_sided = odd_meshes()["two-sided"], perturb.as_trimesh(*perturb._odd_meshes.ellipsoid())
    both, one = (perturb.View(1.0)(mesh, rng()).applied["faces_after"] for mesh in (two_sided, one_sided))
    assert both == 2 * one


def test_a_mesh_next_to_which_its_triangles_are_tiny_is_refused():
    with pytest.raises(PerturbationError, match=r"times the median edge length, so a scanner sees no details"):
        perturb.View(1.0)(odd_meshes()["far speck"], rng())
