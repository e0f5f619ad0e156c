"""Perturbations of meshes as they are found in the wild: right, or refused with the reason; never a silent no-op."""

import re
from functools import cache

import numpy as np
import pytest
import trimesh

import perturb
from heatwalk.laplacian import vertex_components
from perturb import PerturbationError
from perturb._odd_meshes import TETRAHEDRON, ellipsoid, sheets
from perturb.testing import odd_meshes
from tests.helpers.meshes import DATA, bundled
from tests.helpers.perturbing import normals, rng

CASES = DATA.parent / "cases"

PERTURBATIONS = [
    perturb.NormalNoise(0.34),
    perturb.ShotNoise(0.06),
    perturb.Holes(58),
    perturb.ShortCircuits(3),
    perturb.ShortCircuits(3, bridge="strip"),
    perturb.Decimation(0.4),
    perturb.Decimation(0.4, backend="pymeshlab"),
    perturb.Scaling(3.0),
    perturb.MissingParts(0.1),
    perturb.Tessellation(2.0),
    perturb.LocalScale(0.5),
    perturb.Affine(2.0),
    perturb.Bending(0.15),
    perturb.Smoothing(3),
    perturb.Sampling(4.0),
    perturb.SelfIntersections(2, radius=0.1, thickness=0.5),
    perturb.Rotation(45),
    perturb.Translation(10),
    perturb.Renumbering(0.5),
    perturb.Composite(),
    perturb.Duplicates(),
    perturb.Flipped(),
    perturb.Floaters(),
    perturb.MicroHoles(),
    perturb.Quantisation(7),
    perturb.Rasterisation(0.08),
    perturb.Slivers(),
    perturb.Slivers(0.1, "share_of_faces"),
    perturb.Unwelded(),
    perturb.View(),
    perturb.Welding(0.35, "bounding_box_diagonal", far=0.53),
]

FEW_TUBES = ("short_circuits", "3 tubes were requested, but only 0 were found")
NO_BUMPS = ("self_intersections", "2 bumps were requested, but only [01] were found")
NO_PAIRS = ("welding", "1 or more pairs of vertices were requested, but only 0 are within")
NO_AREA = ("quantisation", "with 7 bits no face has an area any more, possibly because of a vertex far away")
NO_DETAILS = ("view", "so a scanner sees no details, possibly because of a vertex far away; remove it")
FAR_AWAY = [FEW_TUBES, NO_BUMPS, NO_PAIRS, NO_AREA, NO_DETAILS]
REFUSED = {
    "two-sided": [NO_BUMPS],
    "two-sided and mixed": [NO_BUMPS],
    "duplicate faces": [NO_BUMPS],
    "soup": [
        ("short_circuits", "only 0 were found .* a strip .* vertex without a face"),
        ("unwelded", "none of the faces that were drawn shares a vertex with another one: they are loose already"),
    ],
    "far speck": FAR_AWAY,
    "far spike": [
        *FAR_AWAY,
        ("tessellation", "vertex far away; remove it"),
        ("sampling", "vertex far away; remove it"),
        ("local_scale", "lost in the rounding of coordinates"),
    ],
    "map coordinates and a speck at the origin": FAR_AWAY,
    "many degenerate vertices": [
        ("normal_noise", "64 of 706 vertices with faces have no normal"),
        ("composite", "normal_noise: 64 of 706 vertices with faces have no normal"),
    ],
    "fin": [FEW_TUBES, NO_BUMPS, NO_PAIRS, ("decimation", "pymeshlab cannot collapse any edge")],
    "two sheets": [
        NO_BUMPS,
        ("tessellation", "2 times the faces were requested, but 2.31 times reached"),
        ("sampling", "a ratio of densities of 4 was requested, but 1.84 reached"),
    ],
    "Möbius strip": [FEW_TUBES, NO_BUMPS, NO_PAIRS],
}
"""The perturbations that are impossible on a mesh, and why."""

SAME_SURFACE = [
    "two-sided",
    "two-sided and mixed",
    "half two-sided",
    "half flipped",
    "a third flipped",
    "duplicate faces",
    "repeated corners",
    "size 1e-6",
    "size 1e6",
    "size 1e-200",
    "size 1e200",
]
"""Meshes with the vertices of the ellipsoid, and other faces for the same surface."""


@cache
def odd():
    return odd_meshes()


@cache
def result_or_refusal(perturbation, mesh):
    """The perturbed mesh with the seed 0, or the message of the PerturbationError."""
    try:
        return perturbation(mesh, rng())
    except PerturbationError as error:
        return str(error)


def is_slow(perturbation, label):
    """Sampling takes longest; on most of the meshes it does what tessellation does."""
    different = ("split along a seam", "specks", "unreferenced vertices", "open", *REFUSED)
    return perturbation.name == "sampling" and label not in different


PAIRS = [
    pytest.param(
        perturbation,
        label,
        id=f"{perturbation!r}-{label}",
        marks=[pytest.mark.slow] if is_slow(perturbation, label) else [],
    )
    for perturbation in PERTURBATIONS
    for label in odd()
]


def ellipsoid_normals():
    return normals(trimesh.Trimesh(*ellipsoid(), process=False))


@pytest.mark.parametrize(("perturbation", "label"), PAIRS)
def test_a_perturbation_changes_an_odd_mesh_or_says_why_it_cannot(perturbation, label):
    mesh = odd()[label]
    refusals = [message for name, message in REFUSED.get(label, []) if name == perturbation.name]
    outcome = result_or_refusal(perturbation, mesh)
    if isinstance(outcome, str):
        assert any(re.search(message, outcome) for message in refusals), outcome
        assert "\n" not in outcome
        return
    result = outcome
    changed = len(result.mesh.faces) != len(mesh.faces) or len(result.mesh.vertices) != len(mesh.vertices)
    changed = changed or (result.mesh.vertices != mesh.vertices).any() or (result.mesh.faces != mesh.faces).any()
    # From a single side, nothing of these sheets is hidden, which is recorded.
    seen_completely = label in ("fin", "Möbius strip") and result.applied.get("share_of_area_seen") == 1
    assert changed or seen_completely
    assert np.isfinite(result.mesh.vertices).all()
    without_faces = np.setdiff1d(np.arange(len(result.mesh.vertices)), result.mesh.faces)
    before = np.setdiff1d(np.arange(len(mesh.vertices)), mesh.faces)
    remaining = result.counterpart[before][result.counterpart[before] >= 0]
    np.testing.assert_array_equal(without_faces, np.sort(remaining))
    if perturbation.name in ("normal_noise", "shot_noise"):
        applied = result.applied
        share = 1.0 if perturbation.name == "normal_noise" else perturbation.amount
        n_movable = len(mesh.vertices) - (applied["vertices_without_normal"] if share == 1 else 0)
        assert applied["vertices_moved"] == round(share * n_movable)
        length = applied["absolute_amount" if share == 1 else "absolute_height"]
        assert applied["rms_displacement"] == pytest.approx(length, rel=0.15 if share == 1 else 1e-6)


@pytest.mark.parametrize(("label", "name", "message"), [(k, *refusal) for k in REFUSED for refusal in REFUSED[k]])
def test_what_is_impossible_on_an_odd_mesh_is_refused(label, name, message):
    outcomes = [result_or_refusal(example, odd()[label]) for example in PERTURBATIONS if example.name == name]
    assert any(isinstance(outcome, str) and re.search(message, outcome) for outcome in outcomes)


@pytest.mark.parametrize("label", SAME_SURFACE)
def test_vertex_normals_do_not_depend_on_windings_repetitions_and_scale(label):
    found = perturb.vertex_normals(odd()[label])
    expected = ellipsoid_normals()
    side = np.sign((found * expected).sum())  # which of the two sides is outside is not determined by the faces
    np.testing.assert_allclose(found, side * expected, atol=1e-9)


@pytest.mark.parametrize("label", ["a third flipped", "half two-sided", "duplicate faces", "size 1e-200"])
def test_the_majority_of_windings_determines_the_outside(label):
    assert (perturb.vertex_normals(odd()[label]) * ellipsoid_normals()).sum(axis=1).min() > 0.99


@pytest.mark.parametrize(("label", "tolerance"), [("specks", 1e-12), ("far speck", 1e-9), ("needles", 1e-12)])
def test_what_is_far_away_or_loose_does_not_change_the_normals_of_the_rest(label, tolerance):
    n = len(ellipsoid()[0])
    found = perturb.vertex_normals(odd()[label])
    np.testing.assert_allclose(found[:n], ellipsoid_normals(), atol=tolerance)
    if label != "needles":
        np.testing.assert_allclose(np.linalg.norm(found[n:], axis=1), 1, rtol=1e-12)


def test_a_far_spike_has_a_normal_and_its_surroundings_keep_theirs():
    mesh = odd()["far spike"]
    found = perturb.vertex_normals(mesh)
    away = np.setdiff1d(np.arange(len(mesh.vertices)), mesh.faces[(mesh.faces == 0).any(axis=1)])
    np.testing.assert_allclose(found[away], ellipsoid_normals()[away], atol=1e-9)
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1, rtol=1e-12)


def test_a_speck_at_the_origin_does_not_change_the_normals_at_map_coordinates():
    with_speck, without = odd()["map coordinates and a speck at the origin"], odd()["map coordinates"]
    found = perturb.vertex_normals(with_speck)[:-4]
    np.testing.assert_allclose(found, perturb.vertex_normals(without), atol=1e-7)


def test_the_vertices_of_a_fin_move_perpendicularly_to_it():
    found = perturb.vertex_normals(odd()["fin"])
    np.testing.assert_allclose(np.abs(found), np.tile([0.0, 0.0, 1.0], (len(found), 1)), atol=1e-12)


def test_the_normals_of_a_one_sided_surface_are_perpendicular_to_it_everywhere():
    mesh = odd()["Möbius strip"]
    found = perturb.vertex_normals(mesh)
    at_corners = np.abs((found[mesh.faces] * mesh.face_normals[:, None]).sum(axis=2))
    assert at_corners.min() > 0.9


def test_where_two_cones_touch_tip_to_tip_the_vertex_moves():
    mesh = odd()["bow-ties"]
    np.testing.assert_allclose(np.linalg.norm(perturb.vertex_normals(mesh), axis=1), 1, rtol=1e-12)


def test_a_vertex_with_only_faces_without_area_has_the_normal_0():
    np.testing.assert_array_equal(perturb.vertex_normals(odd()["needles"])[-3:], 0)


@pytest.mark.parametrize("label", ["two-sided", "a third flipped", "half two-sided", "fin", "two-sided and mixed"])
def test_noise_moves_each_vertex_by_its_drawn_length(label):
    mesh = odd()[label]
    noise = perturb.NormalNoise(0.2)
    parameters = noise.sample(mesh, rng())
    result = noise.apply(mesh, parameters)
    distance = np.linalg.norm(result.mesh.vertices - mesh.vertices, axis=1)
    expected = 0.2 * perturb.LENGTHS["mean_edge_length"](mesh) * np.abs(parameters["lengths"])
    np.testing.assert_allclose(distance, expected, atol=1e-14)
    assert result.applied["vertices_moved"] == len(mesh.vertices)
    assert result.applied["largest_displacement"] == pytest.approx(expected.max())
    assert result.applied["rms_displacement"] == pytest.approx(np.sqrt((expected**2).mean()))


def test_noise_that_is_lost_in_the_rounding_of_coordinates_is_refused():
    vertices, faces = ellipsoid()
    mesh = perturb.as_trimesh(vertices + 1e12, faces)
    for perturbation in (perturb.NormalNoise(1e-4), perturb.ShotNoise(0.5, height=1e-4)):
        with pytest.raises(PerturbationError, match=r"lost in the rounding of coordinates of up to 1e\+12"):
            perturbation(mesh, rng())


def test_a_mesh_next_to_whose_extent_its_triangles_are_tiny_is_usable():
    vertices, faces = ellipsoid()
    together = trimesh.util.concatenate(
        trimesh.Trimesh(vertices, faces, process=False),
        trimesh.Trimesh(TETRAHEDRON[0] + 1e12, TETRAHEDRON[1], process=False),
    )
    assert perturb.NormalNoise(0.3)(together, rng()).applied["vertices_moved"] == len(vertices) + 4


def test_edges_between_repeated_corners_do_not_count_in_the_mean_edge_length():
    mean = perturb.LENGTHS["mean_edge_length"]
    mesh = perturb.as_trimesh(*ellipsoid())
    start, end = mesh.vertices[np.unique(np.r_[mesh.edges_sorted, [[0, 1], [2, 3]]], axis=0)].transpose(1, 0, 2)
    assert mean(odd()["repeated corners"]) == pytest.approx(np.linalg.norm(end - start, axis=1).mean(), rel=1e-12)


def sheets_with_corners_of_one_face():
    """Two squares with a gap; at two corners of each, a vertex has a single face, which is near one of the other."""
    vertices, faces = sheets(gap=0.08, n=6)
    lower = faces[: len(faces) // 2]
    return trimesh.Trimesh(vertices, np.concatenate([lower, lower[:, ::-1] + 36]), process=False)


def test_no_strip_leaves_a_vertex_without_a_face():
    mesh = sheets_with_corners_of_one_face()
    for seed in range(40):
        result = perturb.ShortCircuits(2, bridge="strip")(mesh, rng(seed))
        assert len(np.unique(result.mesh.faces)) == len(result.mesh.vertices)


def test_strips_at_ends_drawn_for_tubes_are_refused_if_a_vertex_would_lose_its_last_face():
    mesh = sheets_with_corners_of_one_face()
    parameters = perturb.ShortCircuits(2).sample(mesh, rng(12))
    with pytest.raises(PerturbationError, match="a strip would leave a vertex without a face"):
        perturb.ShortCircuits(2, bridge="strip").apply(mesh, parameters)


@pytest.mark.parametrize("backend", ["fast_simplification", "pymeshlab"])
@pytest.mark.parametrize("label", ["repeated corners", "two-sided", "duplicate faces"])
def test_decimation_passes_over_repeated_corners_and_repeated_faces_and_counts_them(label, backend):
    decimation = perturb.Decimation(0.4, backend=backend)
    plain = decimation(perturb.as_trimesh(*ellipsoid()), rng())
    result = decimation(odd()[label], rng())
    np.testing.assert_array_equal(result.mesh.faces, plain.mesh.faces)
    np.testing.assert_array_equal(result.counterpart, plain.counterpart)
    dropped = len(odd()[label].faces) - len(ellipsoid()[1])
    degenerate = 3 if label == "repeated corners" else 0
    assert result.applied["degenerate_triangles_removed"] == degenerate
    assert result.applied["repeated_triangles_removed"] == dropped - degenerate
    assert result.applied["share_of_faces_kept"] == plain.applied["share_of_faces_kept"]


@pytest.mark.parametrize(
    "perturbation",
    [
        perturb.Decimation(0.4, backend="pymeshlab"),
        perturb.Tessellation(2.0),
        perturb.Tessellation(2.0, method="anisotropic"),
        perturb.Tessellation(2.0, method="irregular"),
    ],
    ids=repr,
)
def test_meshlab_joins_no_components_and_counterparts_are_on_the_same_one(perturbation):
    mesh = odd()["split along a seam"]
    result = perturbation(mesh, rng())
    assert (result.applied["components_before"], result.applied["components_after"]) == (2, 2)
    component = vertex_components(len(mesh.vertices), np.asarray(mesh.faces))
    after = vertex_components(len(result.mesh.vertices), np.asarray(result.mesh.faces))
    assert len({*zip(component.tolist(), after[result.counterpart].tolist(), strict=True)}) == 2
    offset = np.linalg.norm(result.mesh.vertices[result.counterpart] - mesh.vertices, axis=1)
    assert offset.max() < 3 * mesh.edges_unique_length.mean()


def test_a_triangle_soup_is_tessellated_apart_and_welded_for_decimation_which_applied_reports():
    soup = odd()["soup"]
    assert perturb.Tessellation(2.0)(soup, rng()).applied["components_after"] == 1280
    applied = perturb.Decimation(0.4, backend="pymeshlab")(soup, rng()).applied
    assert applied["welded_vertices"] == 3840 - 642
    assert applied["faces_after"] == 512
    assert perturb.Decimation(0.4, backend="pymeshlab")(bundled("cow"), rng()).applied["welded_vertices"] == 0


def shared_case(name):
    path = CASES / name
    if not path.exists():
        pytest.skip(f"the case is not at hand: no {path}")
    return trimesh.load(path, process=False)


def test_the_two_sided_case_moves_by_what_is_asked_for():
    mesh = shared_case("two_sided.off")
    applied = perturb.NormalNoise(0.3)(mesh, rng()).applied
    assert applied["vertices_moved"] == len(mesh.vertices)
    assert applied["rms_displacement"] == pytest.approx(applied["absolute_amount"], rel=0.1)


def test_the_case_with_a_speck_at_the_origin_moves_as_without_it():
    mesh = shared_case("utm_with_speck_at_origin.off")
    component = vertex_components(len(mesh.vertices), np.asarray(mesh.faces))
    main = component == np.bincount(component).argmax()
    without = trimesh.Trimesh(
        mesh.vertices[main], (np.cumsum(main) - 1)[mesh.faces[main[mesh.faces[:, 0]]]], process=False
    )
    np.testing.assert_allclose(perturb.vertex_normals(mesh)[main], perturb.vertex_normals(without), atol=1e-7)
    applied = perturb.NormalNoise(0.3)(mesh, rng()).applied
    assert applied["vertices_moved"] == len(mesh.vertices)
