import numpy as np
import pytest
import trimesh
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components, shortest_path

from heatwalk.robust.half_edges import partners
from heatwalk.robust.handles import (
    _angle_excess,
    _edges_around,
    _shortest_loops,
    closed_copy,
    cut_thin_handles,
    signatures,
    split_fans,
)
from heatwalk.robust.holes import fill_small_holes
from heatwalk.robust.repair import repaired
from perturb import NormalNoise, ShortCircuits, ShotNoise, as_trimesh
from tests.heatwalk.robust.meshes import arrays, blob, is_nearly, with_tube

LIMITS = {"max_length": 0.12, "min_excess": 3.2}


@pytest.fixture(scope="module")
def fine():
    return blob(5)


@pytest.fixture(scope="module")
def places(fine):
    """Two vertices on opposite sides."""
    return int(fine.vertices[:, 1].argmax()), int(fine.vertices[:, 1].argmin())


def genus(vertices, faces):
    return closed_copy(faces, len(vertices)).genus


@pytest.mark.parametrize("n_sides", [3, 4, 5, 6, 8])
def test_a_tube_is_cut_whatever_the_number_of_its_sides(fine, places, n_sides):
    tube = with_tube(fine, *places, n_sides)
    vertices, faces = arrays(tube)
    assert genus(vertices, faces) == 1
    new_vertices, new_faces, n_cut, n_parted = cut_thin_handles(vertices, faces, **LIMITS)
    assert (n_cut, n_parted) == (1, 0)
    assert np.array_equal(new_vertices[: len(vertices)], vertices)
    if n_sides <= 6:  # the shortest loop around wider ones takes a short cut beside the tube, and a sliver of it stays
        assert is_nearly(fine, new_vertices, new_faces)
    cut = as_trimesh(new_vertices, new_faces)
    assert cut.is_watertight
    assert cut.is_winding_consistent
    assert genus(new_vertices, new_faces) == 0


@pytest.mark.parametrize("bridge", ["tube", "strip", "triangle"])
def test_short_circuits_of_every_kind_are_undone(fine, bridge):
    joined = ShortCircuits(amount=5, near=0.36, far=0.56, bridge=bridge)(fine, np.random.default_rng(0)).mesh
    vertices, faces, _ = fill_small_holes(*arrays(joined), max_share=1.0)
    vertices, faces, n_cut, n_parted = cut_thin_handles(vertices, faces, **LIMITS)
    assert n_parted == 5 if bridge == "triangle" else n_cut == 5
    assert genus(vertices, faces) == 0
    assert is_nearly(fine, vertices, faces)


def test_real_handles_stay():
    for mesh in (
        trimesh.creation.torus(1, 0.4, 48, 24),
        trimesh.creation.torus(1, 0.05, 96, 8),
        trimesh.creation.annulus(0.6, 1, 0.3, sections=40),
    ):
        vertices, faces = arrays(mesh)
        assert genus(vertices, faces) == 1
        result = cut_thin_handles(vertices, faces, **LIMITS)
        assert result[2:] == (0, 0)
        assert np.array_equal(result[1], faces)


def test_a_thin_tube_with_rings_of_its_own_stays_like_the_rung_of_a_chair(fine, places):
    vertices, faces = arrays(with_tube(fine, *places, 6, rings=4))
    assert cut_thin_handles(vertices, faces, **LIMITS)[2] == 0


@pytest.mark.parametrize(
    "roughen",
    [
        ShotNoise(amount=0.06, height=0.3, height_unit="bounding_box_diagonal"),
        ShotNoise(amount=0.3),
        NormalNoise(amount=0.6),
    ],
    ids=["spikes", "shot noise", "noise"],
)
def test_noise_does_not_make_a_rung_a_bridge_nor_a_bridge_a_rung(fine, places, roughen):
    """Noise inflates the area that lengths are compared with, and turns the surface around any loop."""
    for rings, n_expected in ((16, 0), (0, 1)):
        mesh = with_tube(fine, *places, 8, rings=rings)
        rough = roughen(mesh, np.random.default_rng(1)).mesh
        assert repaired(*arrays(rough)).report["handles_cut"] == n_expected


def test_a_wide_tube_stays(places):
    coarse = blob(3)
    start, end = int(coarse.vertices[:, 1].argmax()), int(coarse.vertices[:, 1].argmin())
    vertices, faces = arrays(with_tube(coarse, start, end, 8))
    assert cut_thin_handles(vertices, faces, **LIMITS)[2] == 0


def test_the_genus_is_known_of_spheres_tori_several_components_and_surfaces_with_holes(fine, places):
    torus = trimesh.creation.torus(1, 0.4)
    several = trimesh.util.concatenate([torus, torus.copy().apply_translation([5, 0, 0]), blob(2)])
    assert genus(*arrays(blob(2))) == 0
    assert genus(*arrays(torus)) == 1
    assert genus(*arrays(several)) == 2
    assert genus(*arrays(as_trimesh(torus.vertices, torus.faces[10:]))) == 1
    assert genus(*arrays(with_tube(with_tube(fine, *places, 6), 100, 2000, 6))) == 2


@pytest.fixture(scope="module")
def double():
    """Genus 2, coarse."""
    mesh = with_tube(blob(2), 7, 150, 6)
    return closed_copy(np.asarray(mesh.faces, np.int64), len(mesh.vertices)), mesh


def test_a_loop_separates_exactly_if_its_words_cancel_out(double):
    """Against cutting along the loop and counting the components of what is left."""
    closed, _ = double
    word = signatures(closed.faces, closed.partner, len(closed.origin))
    sides = np.arange(len(closed.partner))
    a, b = closed.faces.ravel(), np.roll(closed.faces, -1, axis=1).ravel()
    word_of = {frozenset(edge): int(w) for edge, w in zip(zip(a.tolist(), b.tolist(), strict=True), word, strict=True)}
    graph = coo_array((np.ones(len(a)), (a, b))).tocsr()
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(150):
        source = int(rng.integers(len(closed.origin)))
        weights = graph.copy()
        weights.data = rng.uniform(1, 2, len(weights.data))
        _, before = shortest_path(weights, indices=source, return_predecessors=True, directed=False)
        edge = int(rng.integers(len(a)))
        loop = {frozenset((int(a[edge]), int(b[edge])))}
        for end in (int(a[edge]), int(b[edge])):
            while end != source:
                loop ^= {frozenset((end, int(before[end])))}
                end = int(before[end])
        total = 0
        for step in loop:
            total ^= word_of[step]
        joined = np.array([frozenset((int(p), int(q))) not in loop for p, q in zip(a, b, strict=True)])
        pairs = sides[joined] // 3, closed.partner[joined] // 3
        dual = coo_array((np.ones(len(pairs[0])), pairs), shape=2 * (len(closed.faces),))
        degree = np.bincount([v for step in loop for v in step])
        if degree.max(initial=0) <= 2 and loop:  # a simple loop
            separates = connected_components(dual, directed=False)[0] > 1
            assert separates == (total == 0)
            seen.add(separates)
    assert seen == {True, False}


def test_the_words_of_the_sides_of_each_face_cancel_out(double):
    closed, _ = double
    word = signatures(closed.faces, closed.partner, len(closed.origin)).reshape(-1, 3)
    assert (word[:, 0] ^ word[:, 1] ^ word[:, 2] == 0).all()
    assert np.array_equal(word.ravel(), word.ravel()[closed.partner])


def test_the_shortest_loop_around_a_torus_is_a_ring_of_its_tube():
    mesh = trimesh.creation.torus(1, 0.3, major_sections=30, minor_sections=12)
    closed = closed_copy(np.asarray(mesh.faces, np.int64), len(mesh.vertices))
    word = signatures(closed.faces, closed.partner, len(closed.origin))
    graph = _edges_around(closed.faces, closed.partner, word, np.array(mesh.vertices), closed.origin)
    _, _, lengths, _ = _shortest_loops(*graph, 100.0)
    assert lengths.min() == pytest.approx(12 * 2 * 0.3 * np.sin(np.pi / 12))


def test_the_excess_of_angles_is_minus_the_total_curvature():
    for mesh, euler in ((blob(2), 2), (trimesh.creation.torus(1, 0.4), 0)):
        assert _angle_excess(*arrays(mesh)).sum() == pytest.approx(-2 * np.pi * euler)


def test_each_fan_of_a_vertex_gets_a_vertex_and_the_largest_keeps_its_own():
    cone = np.array([[0, 1, 2], [0, 2, 3], [0, 4, 5]])
    faces, origin = split_fans(cone, partners(cone, 6), 6, np.array([1.0, 9, 9, 1.0, 9, 9, 1.5, 9, 9]))
    assert origin.tolist() == [0, 1, 2, 3, 4, 5, 0]
    assert faces.tolist() == [[0, 1, 2], [0, 2, 3], [6, 4, 5]]


def test_two_balls_that_touch_in_a_vertex_stay_together():
    ball = trimesh.creation.icosphere(2)
    vertices, faces = arrays(trimesh.util.concatenate([ball, ball.copy().apply_scale(0.5)]))
    first, second = 0, len(ball.vertices) + 5
    vertices[len(ball.vertices) :] += vertices[first] - vertices[second]
    faces[faces == second] = first
    new_vertices, new_faces, n_cut, n_parted = cut_thin_handles(vertices, faces, **LIMITS)
    assert (n_cut, n_parted) == (0, 0)
    assert np.array_equal(new_vertices, vertices)
    assert np.array_equal(new_faces, faces)
