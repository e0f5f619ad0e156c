"""Short circuits: what is joined, how, and what remains unchanged."""

import numpy as np
import pytest
import trimesh
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.distance import cdist

import perturb
from perturb import PerturbationError
from perturb._proximity import search_detours
from perturb.short_circuits import _Placement
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import distances_along_edges, far_along_edges, rng


@pytest.fixture(scope="module", params=["cow", 10, 124, 184, 203])
def short_circuited(request):
    """A closed mesh, the parameters of eight tubes, and their result."""
    mesh = bundled("cow") if request.param == "cow" else request.getfixturevalue("psb_mesh")(request.param)
    circuits = perturb.ShortCircuits(8)
    parameters = circuits.sample(mesh, rng(1))
    return mesh, parameters, circuits.apply(mesh, parameters)


def test_tubes_keep_a_closed_surface_closed_and_oriented_and_each_adds_a_handle(short_circuited):
    mesh, _, result = short_circuited
    assert mesh.is_watertight
    assert result.mesh.is_watertight
    assert result.mesh.is_winding_consistent
    _, uses = np.unique(result.mesh.edges_sorted, axis=0, return_counts=True)
    assert (uses == 2).all()
    assert result.mesh.euler_number == mesh.euler_number - 2 * 8
    assert result.applied["components_after"] == result.applied["components_before"]
    assert result.applied["tubes"] == 8
    assert result.applied["tubes_between_components"] == 0


def test_a_strip_is_the_shortest_side_of_the_tube(short_circuited):
    mesh, parameters, tubes = short_circuited
    strips = perturb.ShortCircuits(8, bridge="strip").apply(mesh, parameters)
    others = len(mesh.faces) - 16
    np.testing.assert_array_equal(strips.mesh.faces[:others], tubes.mesh.faces[:others])
    assert strips.applied["triangles_added"] == 16
    sides = np.asarray(tubes.mesh.faces)[others:].reshape(8, 2, 3, 3).transpose(0, 2, 1, 3)
    strip = np.asarray(strips.mesh.faces)[others:].reshape(8, 2, 3)
    corners = np.asarray(mesh.vertices)[sides]  # tube, side, triangle, corner
    # The first triangle of a side is a, a's next, b's next; the second a, b's next, b.
    rails = np.linalg.norm(corners[:, :, 0, 1:2] - corners[:, :, 0, 2:], axis=-1) ** 2
    rails += np.linalg.norm(corners[:, :, 1, 0:1] - corners[:, :, 1, 2:], axis=-1) ** 2
    np.testing.assert_array_equal(strip, sides[np.arange(8), rails[..., 0].argmin(axis=1)])


def test_strips_keep_a_surface_edge_manifold_and_oriented_but_open_it(short_circuited):
    mesh, parameters, _ = short_circuited
    strips = perturb.ShortCircuits(8, bridge="strip").apply(mesh, parameters).mesh
    assert strips.is_winding_consistent
    _, uses = np.unique(strips.edges_sorted, axis=0, return_counts=True)
    # Around each strip: two edges of each removed triangle, and the strip's two long sides.
    assert np.bincount(uses)[1] == 8 * 6
    assert uses.max() == 2
    assert strips.euler_number == mesh.euler_number - 3 * 8


def test_tubes_leave_the_vertices_and_all_other_faces_unchanged(short_circuited):
    mesh, parameters, result = short_circuited
    ends = parameters["triangles"]
    np.testing.assert_array_equal(result.mesh.vertices, mesh.vertices)
    np.testing.assert_array_equal(result.counterpart, np.arange(len(mesh.vertices)))
    others = np.delete(mesh.faces, ends.ravel(), axis=0)
    np.testing.assert_array_equal(result.mesh.faces[: len(others)], others)
    assert result.applied["faces_after"] == len(mesh.faces) - 16 + 48
    # No two tubes share a vertex, and each joins the corners of its own two triangles.
    tubes = np.asarray(result.mesh.faces)[len(others) :].reshape(8, 18)
    corners = np.asarray(mesh.faces)[ends].reshape(8, 6)
    assert len(np.unique(corners)) == 8 * 6
    np.testing.assert_array_equal([np.unique(tube) for tube in tubes], np.sort(corners, axis=1))


def test_ends_are_near_in_space_and_far_along_the_surface(short_circuited):
    mesh, parameters, result = short_circuited
    applied = result.applied
    diagonal = np.linalg.norm(mesh.extents)
    start, end = np.asarray(mesh.vertices)[parameters["vertices"]].transpose(1, 0, 2)
    length = np.linalg.norm(start - end, axis=1)
    assert (length <= applied["near_used"] * diagonal * (1 + 1e-12)).all()
    assert applied["near"] <= applied["near_used"] <= applied["far"] / 1.5 * (1 + 1e-12)
    assert applied["longest_tube"] == pytest.approx(length.max(), rel=1e-12)
    for first, second in parameters["vertices"][:3].tolist():
        assert distances_along_edges(mesh, first)[second] > applied["far"] * diagonal
    for column in range(2):
        corners = np.asarray(mesh.faces)[parameters["triangles"][:, column]]
        assert (corners == parameters["vertices"][:, [column]]).any(axis=1).all()


@pytest.mark.parametrize("model", ["cow", 124, 203])
def test_the_sample_equals_that_of_an_exhaustive_search(model, request):
    mesh = bundled(model) if isinstance(model, str) else request.getfixturevalue("psb_mesh")(model)
    circuits = perturb.ShortCircuits(8)
    diagonal = np.linalg.norm(mesh.extents)
    far = far_along_edges(mesh, circuits.far * diagonal)
    in_space = cdist(mesh.vertices, mesh.vertices) / diagonal
    for seed in range(3):
        generator, placement = rng(seed), _Placement(mesh)
        remaining = generator.permutation(np.unique(mesh.faces)).tolist()
        limits = np.geomspace(circuits.near, circuits.far / circuits.MIN_DETOUR, circuits.WIDENING_STEPS + 1)
        for near in limits:
            for start in remaining[: 500 if near < limits[-1] else 2000]:
                ends = np.flatnonzero(far[start] & (in_space[start] <= near))
                if len(placement.ends) < 8 and len(ends) > 0:
                    remaining.remove(start)
                    if placement.try_add(start, generator.choice(ends)):
                        near_used = near
        sample = circuits.sample(mesh, rng(seed))
        np.testing.assert_array_equal(sample["vertices"], placement.ends)
        np.testing.assert_array_equal(sample["triangles"], placement.triangles)
        assert sample["near"] == near_used


def test_near_is_widened_only_if_necessary(psb_mesh):
    # The two sides of the cup's wall are close; no part of the pliers is both thin and long.
    for model, widened in ((23, False), (203, True)):
        applied = perturb.ShortCircuits(8)(psb_mesh(model), rng()).applied
        assert (applied["near_used"] > applied["near"]) == widened


def test_two_components_are_far_apart_and_joined():
    ball = trimesh.creation.icosphere(subdivisions=3)
    other = ball.copy()
    other.apply_translation([2.1, 0, 0])
    pair = trimesh.util.concatenate(ball, other)
    result = perturb.ShortCircuits(1)(pair, rng())
    assert result.applied["tubes_between_components"] == 1
    assert result.applied["components_before"] == 2
    assert result.applied["components_after"] == 1
    assert result.mesh.is_watertight
    assert result.mesh.is_winding_consistent
    assert result.mesh.euler_number == pair.euler_number - 2


def test_a_shape_without_suitable_ends_is_refused_with_the_number_found():
    sphere = trimesh.creation.icosphere(subdivisions=4)
    with pytest.raises(PerturbationError, match=r"3 tubes were requested, but only 0 were found .*lower amount or far"):
        perturb.ShortCircuits(3)(sphere, rng())


MAJOR, MINOR = 1.0, 0.3


@pytest.fixture(scope="module")
def ring():
    """A torus: across its tube lines run inside, across its hole outside."""
    return trimesh.creation.torus(MAJOR, MINOR, major_sections=48, minor_sections=16)


def inside_torus(points):
    """Whether points are inside the torus, by its formula."""
    return (np.hypot(points[:, 0], points[:, 1]) - MAJOR) ** 2 + points[:, 2] ** 2 < MINOR**2


def near_the_ends(mesh, parameters):
    """Points on the straight lines between ends, close to each of their two ends."""
    start, end = np.asarray(mesh.vertices)[parameters["vertices"]].transpose(1, 0, 2)
    return 0.98 * start + 0.02 * end, 0.02 * start + 0.98 * end


@pytest.mark.parametrize("inside_out", [False, True])
@pytest.mark.parametrize(("where", "near"), [("internal", 0.17), ("external", 0.45)])
def test_internal_ones_enter_the_body_at_both_ends_and_external_ones_leave_it(ring, where, near, inside_out):
    circuits = perturb.ShortCircuits(6, near=near, ratio=1.4, where=where)
    parameters = circuits.sample(ring, rng(2))
    for points in near_the_ends(ring, parameters):
        assert (inside_torus(points) == (where == "internal")).all()
    if inside_out:
        turned = trimesh.Trimesh(ring.vertices, np.asarray(ring.faces)[:, ::-1], process=False)
        np.testing.assert_array_equal(circuits.sample(turned, rng(2))["vertices"], parameters["vertices"])


def test_a_shape_without_gaps_has_no_external_ones():
    with pytest.raises(PerturbationError, match=r"2 external tubes were requested, but only 0 .*or raise near"):
        perturb.ShortCircuits(2, near=0.1, ratio=1.4, where="external")(trimesh.creation.icosphere(3), rng())


@pytest.mark.parametrize("ratio", [1.3, 1.5])
def test_with_a_ratio_the_ends_are_so_many_times_as_far_along_the_edges_as_in_space(ring, ratio):
    near = 0.17 * np.linalg.norm(ring.extents)
    result = perturb.ShortCircuits(6, near=0.17, ratio=ratio)(ring, rng(1))
    assert result.applied["near_used"] == 0.17
    for start, end in perturb.ShortCircuits(6, near=0.17, ratio=ratio).sample(ring, rng(1))["vertices"].tolist():
        in_space = np.linalg.norm(ring.vertices[start] - ring.vertices[end])
        assert in_space <= near
        assert distances_along_edges(ring, start)[end] >= ratio * in_space


def test_the_search_for_detours_finds_those_that_all_shortest_paths_give(ring):
    along_edges, in_space = dijkstra(perturb.edge_graph(ring)), cdist(ring.vertices, ring.vertices)
    for near, ratio in ((0.3, 1.3), (0.65, 1.5), (1.35, 1.2)):
        expected = (in_space <= near) & (along_edges >= ratio * in_space) & (in_space > 0)
        sources = rng().permutation(len(ring.vertices))[:200]
        found = dict(search_detours(ring.vertices, perturb.edge_graph(ring).tocsr(), sources, near, ratio))
        assert list(found) == np.flatnonzero(expected[sources].any(axis=1)).tolist()
        for i, ends in found.items():
            np.testing.assert_array_equal(ends, np.flatnonzero(expected[sources[i]]))


def test_near_is_widened_up_to_four_times_with_a_ratio():
    # Across a ball the way around is pi / 2 times as long; its diameter is .577 of the diagonal of its box.
    ball = trimesh.creation.icosphere(3)
    applied = perturb.ShortCircuits(2, near=0.15, ratio=1.5)(ball, rng()).applied
    assert 0.4 < applied["near_used"] <= 0.6
    assert applied["longest_tube"] > 1.5


def test_single_triangles_keep_a_closed_surface_edge_manifold_and_oriented_but_open_it(ring):
    circuits = perturb.ShortCircuits(6, near=0.17, ratio=1.4, bridge="triangle")
    result = circuits(ring, rng(1))
    mesh = result.mesh
    assert result.applied["triangles_removed"] == result.applied["triangles_added"] == 6
    assert mesh.is_winding_consistent
    _, uses = np.unique(mesh.edges_sorted, axis=0, return_counts=True)
    # Around each: two edges of the removed triangle, and the two long sides of the new one.
    assert np.bincount(uses)[1] == 6 * 4
    assert uses.max() == 2
    assert mesh.euler_number == ring.euler_number - 2 * 6


def test_a_single_triangle_is_the_shortest_from_a_side_of_one_end_to_a_corner_of_the_other(ring):
    circuits = perturb.ShortCircuits(6, near=0.17, ratio=1.4, bridge="triangle")
    parameters = circuits.sample(ring, rng(1))
    added = np.asarray(circuits.apply(ring, parameters).mesh.faces)[-6:]
    removed = parameters["triangles"][:, 0]
    others = np.delete(np.asarray(ring.faces), removed, axis=0)
    np.testing.assert_array_equal(circuits.apply(ring, parameters).mesh.faces[:-6], others)
    for triangle, (a, b) in zip(added.tolist(), np.asarray(ring.faces)[parameters["triangles"]].tolist(), strict=True):
        of_side = [(a[i], a[(i + 1) % 3], corner) for i in range(3) for corner in b]
        lengths = [sum(np.sum((ring.vertices[x] - ring.vertices[z]) ** 2) for x in (p, q)) for p, q, z in of_side]
        assert tuple(triangle) in of_side
        assert lengths[of_side.index(tuple(triangle))] == pytest.approx(min(lengths))


@pytest.mark.parametrize("ratio", [1, 0.5, np.nan, "much"])
def test_a_ratio_that_is_not_above_one_is_refused(ratio):
    with pytest.raises(PerturbationError, match="ratio"):
        perturb.ShortCircuits(ratio=ratio)


def test_the_defaults_draw_what_they_drew_before_there_were_other_readings(ring):
    usual = perturb.ShortCircuits(3, near=0.37, far=0.58)
    same = perturb.ShortCircuits(3, near=0.37, far=0.58, where="any", ratio=None)
    assert usual == same
    np.testing.assert_array_equal(usual.sample(ring, rng(4))["vertices"], [[136, 520], [328, 712], [440, 56]])


def test_a_single_triangle_leaves_no_vertex_without_a_face(ring):
    # Where a vertex has one face alone, that face must not be removed unless the triangle uses the vertex.
    corner = trimesh.Trimesh(ring.vertices, np.asarray(ring.faces)[::2], process=False)
    for seed in range(10):
        result = perturb.ShortCircuits(3, near=0.17, ratio=1.2, bridge="triangle")(corner, rng(seed))
        assert len(np.unique(result.mesh.faces)) == len(np.unique(corner.faces))
