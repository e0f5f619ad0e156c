"""The controls, rotation, translation and renumbering: the surface remains, and the Heat Walk's labels with it."""

from pathlib import Path

import numpy as np
import pytest
import trimesh
import yaml
from scipy.spatial.transform import Rotation

import conf
import heatwalk
import perturb
from perturb import PerturbationError
from perturb._odd_meshes import ellipsoid
from studies.metrics import change_percentage
from tests.helpers.meshes import bundled
from tests.helpers.perturbing import rng

CONTROLS = ["renumbering", "rotation", "translation"]
LEVELS = {
    name: yaml.safe_load((Path(conf.__file__).parent / "study" / f"{name}.yaml").read_text(encoding="utf-8"))["levels"]
    for name in CONTROLS
}


@pytest.fixture(scope="module", params=["cow", 124])
def mesh(request):
    """An animal, and a model of the benchmark."""
    if request.param == "cow":
        return bundled("cow")
    return request.getfixturevalue("psb_mesh")(request.param)


@pytest.fixture(scope="module")
def labels(mesh):
    return heatwalk.segment(mesh.vertices, mesh.faces).labels


@pytest.mark.parametrize(("name", "level"), [(name, level) for name in CONTROLS for level in LEVELS[name]])
def test_no_vertex_changes_its_segment(name, level, mesh, labels):
    variant = perturb.get(name)(amount=level)(mesh, rng())
    found = heatwalk.segment(variant.mesh.vertices, variant.mesh.faces).labels[variant.counterpart]
    assert change_percentage(labels, found) == 0.0


def test_a_rotation_is_that_of_scipy_about_the_centre_of_the_bounding_box():
    mesh = bundled("ant")
    axis = perturb.random_direction(rng(3))
    turned = perturb.Rotation(50).apply(mesh, {"axis": axis}).mesh.vertices
    centre = (mesh.vertices.min(axis=0) + mesh.vertices.max(axis=0)) / 2
    expected = centre + Rotation.from_rotvec(np.radians(50) * axis).apply(mesh.vertices - centre)
    np.testing.assert_allclose(turned, expected, atol=1e-13 * mesh.scale)


def test_two_half_turns_about_the_same_axis_come_back():
    mesh = bundled("ant")
    half = perturb.Rotation(180)
    twice = half(half(mesh, rng()).mesh, rng()).mesh
    # The centre of the bounding box changes, so that a shift remains.
    shift = twice.vertices - mesh.vertices
    np.testing.assert_allclose(shift, np.tile(shift[0], (len(shift), 1)), atol=1e-12 * mesh.scale)


def test_more_than_half_a_turn_is_refused():
    with pytest.raises(PerturbationError, match="at most 180"):
        perturb.Rotation(181)


@pytest.mark.parametrize(
    ("unit", "length"), [("bounding_box_diagonal", 1.0), ("mean_edge_length", None)], ids=["diagonal", "edge"]
)
def test_a_translation_moves_every_vertex_alike(unit, length):
    mesh = bundled("ant")
    length = np.linalg.norm(np.ptp(mesh.vertices, axis=0)) if length else mesh.edges_unique_length.mean()
    result = perturb.Translation(3, unit)(mesh, rng())
    moved = result.mesh.vertices - mesh.vertices
    np.testing.assert_allclose(moved, np.tile(moved[0], (len(moved), 1)), atol=1e-12 * length)
    assert np.linalg.norm(moved[0]) == pytest.approx(3 * length, rel=1e-12)


def test_a_translation_reports_how_far_coordinates_are_rounded():
    mesh = bundled("ant")
    near, far = (perturb.Translation(amount)(mesh, rng()).applied["largest_rounding"] for amount in (1, 1e10))
    assert near < 1e-13
    diagonal = np.linalg.norm(np.ptp(mesh.vertices, axis=0))
    largest = np.spacing(1e10 * diagonal) / 2 / mesh.edges_unique_length.mean()
    assert largest / 4 < far <= largest


@pytest.mark.parametrize("amount", [0.1, 0.5, 1.0])
def test_renumbering_changes_numbers_only(amount):
    mesh = bundled("ant")
    result = perturb.Renumbering(amount)(mesh, rng())
    number = result.counterpart
    np.testing.assert_array_equal(result.mesh.vertices[number], mesh.vertices)
    assert np.count_nonzero(number != np.arange(486)) == round(amount * 486) == result.applied["vertices_renumbered"]
    assert oriented(number[mesh.faces]) == oriented(result.mesh.faces)
    same = (result.mesh.faces == number[mesh.faces]).all(axis=1)
    assert np.count_nonzero(~same) == round(amount * 912) == result.applied["faces_renumbered"]


def oriented(faces):
    """The faces, each from its smallest corner on, in sorted order: equal for meshes that differ in numbers only."""
    first = np.argmin(faces, axis=1)
    return sorted(np.take_along_axis(faces, (first[:, None] + np.arange(3)) % 3, axis=1).tolist())


def test_renumbering_a_single_vertex_is_refused():
    mesh = bundled("ant")
    with pytest.raises(PerturbationError, match="fewer than two of each"):
        perturb.Renumbering(0.001)(mesh, rng())


@pytest.mark.parametrize("shape", ["ellipsoid", "torus"])
def test_no_vertex_changes_its_segment_on_a_shape_with_exact_symmetries_either(shape):
    torus = trimesh.creation.torus(1, 0.3, major_sections=48, minor_sections=24)
    mesh = torus if shape == "torus" else perturb.as_trimesh(*ellipsoid())
    reference = heatwalk.segment(mesh.vertices, mesh.faces).labels
    for control in (perturb.Rotation(45), perturb.Translation(10), perturb.Renumbering(1)):
        variant = control(mesh, rng())
        found = heatwalk.segment(variant.mesh.vertices, variant.mesh.faces).labels[variant.counterpart]
        assert change_percentage(reference, found) == 0.0
