"""Holes and short circuits: what was cut, what was joined, and what was not touched."""

import numpy as np
import pytest
import scipy.stats
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st
from perturb.places import near_but_far
from perturb.topology import _Tubes
from scipy.sparse.csgraph import dijkstra
from scipy.spatial.distance import cdist

import perturb
from perturb import PerturbationError
from perturb.perturbation import edge_graph
from tests.helpers.meshes import bundled
from tests.perturb.test_geometry import distances_along_edges

ANT = bundled("ant")


def rng(seed=0):
    return np.random.default_rng(seed)


def assert_exactly_these_faces_are_gone(mesh, result, removed):
    kept = np.asarray(mesh.faces)[~removed]
    there = np.flatnonzero(result.counterpart >= 0)
    np.testing.assert_array_equal(there, np.unique(kept))
    np.testing.assert_array_equal(result.counterpart[there], np.arange(len(there)))
    np.testing.assert_array_equal(result.mesh.vertices, np.asarray(mesh.vertices)[there])
    np.testing.assert_array_equal(result.mesh.faces, result.counterpart[kept])
    assert result.applied["triangles_removed"] == np.count_nonzero(removed)
    assert result.applied["vertices_removed"] == len(mesh.vertices) - len(there)


@settings(max_examples=30, deadline=None)
@given(count=st.integers(0, 900), seed=st.integers(0, 2**32))
def test_holes_remove_exactly_the_sampled_triangles(count, seed):
    holes = perturb.Holes(count)
    sampled = holes.sample(ANT, rng(seed))["triangles"]
    removed = np.isin(np.arange(len(ANT.faces)), sampled)
    assert np.count_nonzero(removed) == count
    assert_exactly_these_faces_are_gone(ANT, holes(ANT, rng(seed)), removed)


@pytest.mark.parametrize("share", [0.05, 0.1, 0.15, 0.2])
def test_a_share_of_triangles_is_that_share_at_figure_12_levels(psb_mesh, share):
    mesh = psb_mesh(10)
    applied = perturb.Holes(share, "share_of_triangles")(mesh, rng()).applied
    assert applied["triangles_removed"] == round(share * len(mesh.faces))
    assert applied["faces_after"] == len(mesh.faces) - applied["triangles_removed"]


def test_one_rings_remove_every_triangle_at_the_sampled_vertices():
    mesh = bundled("bunny")
    holes = perturb.Holes(58, "one_rings")
    centres = set(holes.sample(mesh, rng())["vertices"].tolist())
    removed = np.array([not centres.isdisjoint(face) for face in mesh.faces.tolist()])
    assert len(centres) == 58
    result = holes(mesh, rng())
    assert_exactly_these_faces_are_gone(mesh, result, removed)
    assert (result.counterpart[sorted(centres)] == -1).all()


def test_every_triangle_is_equally_likely_to_go():
    generator = rng(5)
    holes = perturb.Holes(0.1, "share_of_triangles")
    hits = np.zeros(len(ANT.faces))
    for _ in range(1000):
        hits[holes.sample(ANT, generator)["triangles"]] += 1
    # Without replacement the counts vary less than a multinomial's, by the factor 1 - share.
    statistic = scipy.stats.chisquare(hits).statistic / (1 - 91 / 912)
    assert 0.001 < scipy.stats.chi2(len(hits) - 1).cdf(statistic) < 0.999


@pytest.fixture(scope="module", params=["cow", 10, 124, 184, 203])
def short_circuited(request):
    """A closed mesh, the parameters of eight tubes, and what they give."""
    mesh = bundled("cow") if request.param == "cow" else request.getfixturevalue("psb_mesh")(request.param)
    circuits = perturb.ShortCircuits(8)
    parameters = circuits.sample(mesh, rng(1))
    return mesh, parameters, circuits.apply(mesh, parameters)


def test_tubes_keep_a_closed_surface_closed_and_oriented_and_add_a_handle_each(short_circuited):
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


def test_strips_keep_a_surface_edge_manifold_and_oriented_and_open_it(short_circuited):
    mesh, parameters, _ = short_circuited
    strips = perturb.ShortCircuits(8, bridge="strip").apply(mesh, parameters).mesh
    assert strips.is_winding_consistent
    _, uses = np.unique(strips.edges_sorted, axis=0, return_counts=True)
    # Around each strip: two edges of either triangle that was there, and the strip's two long sides.
    assert np.bincount(uses)[1] == 8 * 6
    assert uses.max() == 2
    assert strips.euler_number == mesh.euler_number - 3 * 8


def test_tubes_leave_vertices_and_all_other_faces_alone(short_circuited):
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


def all_far(mesh, far):
    """(n, n) bool, of vertices with faces: farther along the edges than that, by all shortest paths."""
    used = np.unique(mesh.faces)
    far = np.isinf(dijkstra(edge_graph(mesh), limit=far))
    far[:, np.setdiff1d(np.arange(len(mesh.vertices)), used)] = False
    return far


def stretched(mesh):
    """Edges of very different lengths, and far longer ways along them than on the surface."""
    return trimesh.Trimesh(mesh.vertices * [1, 1, 30], mesh.faces, process=False)


def with_strays(mesh):
    """The same with as many vertices without faces, at the same places."""
    return trimesh.Trimesh(np.repeat(mesh.vertices, 2, axis=0), 2 * mesh.faces, process=False)


@pytest.mark.parametrize(
    ("model", "change"),
    [("cow", None), ("ant", None), ("ant", with_strays), ("cow", stretched), (124, None), (203, None)],
)
def test_the_places_are_those_of_all_shortest_paths(model, change, request):
    mesh = bundled(model) if isinstance(model, str) else request.getfixturevalue("psb_mesh")(model)
    mesh = mesh if change is None else change(mesh)
    diagonal = np.linalg.norm(mesh.extents)
    far, straight = all_far(mesh, 0.2 * diagonal), cdist(mesh.vertices, mesh.vertices)
    sources = rng().permutation(np.unique(mesh.faces))
    for near in (0.01, 0.05, 0.09, 0.2 / 1.5):
        there = far & (straight <= near * diagonal)
        found = dict(near_but_far(mesh.vertices, edge_graph(mesh).tocsr(), sources, near * diagonal, 0.2 * diagonal))
        assert list(found) == np.flatnonzero(there[sources].any(axis=1)).tolist()
        for i, ends in found.items():
            np.testing.assert_array_equal(ends, np.flatnonzero(there[sources[i]]))
    assert len(found) > 0


@pytest.mark.parametrize("model", ["cow", 124, 203])
def test_the_sample_is_that_of_an_exhaustive_search(model, request):
    mesh = bundled(model) if isinstance(model, str) else request.getfixturevalue("psb_mesh")(model)
    circuits = perturb.ShortCircuits(8)
    diagonal = np.linalg.norm(mesh.extents)
    far, straight = all_far(mesh, circuits.far * diagonal), cdist(mesh.vertices, mesh.vertices) / diagonal
    for seed in range(3):
        generator, placed = rng(seed), _Tubes(mesh)
        left = generator.permutation(np.unique(mesh.faces)).tolist()
        limits = np.geomspace(circuits.near, circuits.far / circuits.DETOUR, circuits.STEPS + 1)
        for near in limits:
            for start in left[: 500 if near < limits[-1] else 2000]:
                ends = np.flatnonzero(far[start] & (straight[start] <= near))
                if len(placed.ends) < 8 and len(ends) > 0:
                    left.remove(start)
                    if placed.add(start, generator.choice(ends)):
                        near_used = near
        sample = circuits.sample(mesh, rng(seed))
        np.testing.assert_array_equal(sample["vertices"], placed.ends)
        np.testing.assert_array_equal(sample["triangles"], placed.triangles)
        assert sample["near"] == near_used


def test_near_is_widened_only_where_it_has_to_be(psb_mesh):
    # The cup's two walls are close; the plier is nowhere thin and long at once.
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


def test_a_shape_without_such_places_is_refused_with_what_was_found():
    sphere = trimesh.creation.icosphere(subdivisions=4)
    with pytest.raises(PerturbationError, match=r"3 tubes are asked for and 0 found, .*lower amount or far"):
        perturb.ShortCircuits(3)(sphere, rng())
