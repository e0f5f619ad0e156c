import colorsys
import functools
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

import perturb
from heatwalk.io import label_colours
from studies.datasets.bundled import Bundled
from studies.experiments.change import Reference, Variant
from studies.figures import surfaces as render
from studies.figures.surfaces import STYLES, added_faces, framed, named_as, pictures, surface, view_of
from studies.segmenters.heat_walk import HeatWalk


@pytest.fixture(scope="module")
def cow():
    """The bundled cow and its labels, as a trial's reference."""
    loaded = Bundled(["cow"]).models()[0].load()
    mesh = trimesh.Trimesh(loaded.vertices, loaded.faces, process=False)
    return Reference(mesh, HeatWalk()(loaded.vertices, loaded.faces))


@pytest.fixture(scope="module")
def view(cow):
    return view_of(np.asarray(cow.mesh.vertices))


def ink(image):
    return (image < 255).any(axis=2)


def extent(image):
    rows, columns = np.flatnonzero(ink(image).any(axis=1)), np.flatnonzero(ink(image).any(axis=0))
    return np.ptp(rows) / image.shape[0], np.ptp(columns) / image.shape[1]


def has_hue(image, colour):
    """Whether some pixels have a colour's hue and saturation, however brightly lit."""
    hue, saturation, _ = colorsys.rgb_to_hsv(*(colour / 255))
    pixels = np.unique(image.reshape(-1, 3)[::7], axis=0)
    seen = np.array([colorsys.rgb_to_hsv(*pixel) for pixel in pixels / 255])
    return ((np.abs(seen[:, 0] - hue) < 0.01) & (np.abs(seen[:, 1] - saturation) < 0.02)).sum() > 10


@pytest.mark.parametrize("size", [(720, 600), (300, 500), (600, 200)])
def test_the_shape_fills_the_picture_in_one_direction_and_leaves_its_border_white(cow, view, size):
    image = surface(cow.mesh, view, labels=cow.labels, size=size)
    assert image.shape == (size[1], size[0], 3)
    border = np.concatenate([image[0], image[-1], image[:, 0], image[:, -1]])
    assert (border == 255).all()
    assert max(extent(image)) == pytest.approx(1 - 2 * render.MARGIN, abs=0.02)


def test_it_is_drawn_again_with_the_same_bytes(cow, view):
    draw = functools.partial(surface, cow.mesh, view, labels=cow.labels, opacity=0.5, edges=True)
    assert np.array_equal(draw(), draw())


def test_a_model_in_another_unit_and_place_is_drawn_the_same_to_rounding(cow, view):
    moved = trimesh.Trimesh(1e-3 * cow.mesh.vertices + [5.0, -7.0, 2.0], cow.mesh.faces, process=False)
    other = surface(moved, framed(np.asarray(moved.vertices), view.axes), labels=cow.labels)
    differ = np.abs(surface(cow.mesh, view, labels=cow.labels).astype(int) - other) > 8
    assert differ.any(axis=2).mean() < 0.002


def test_every_segment_that_is_in_sight_has_its_own_colour_and_the_background_is_grey(cow, view):
    image = surface(cow.mesh, view, labels=cow.labels)
    # The foremost vertex of a segment whose normal faces the camera is in sight if it is the foremost of all.
    depth = np.asarray(cow.mesh.vertices) @ view.axes[2]
    foremost = cow.labels[depth.argmax()]
    assert has_hue(image, label_colours(np.array([foremost]))[0, :3])
    largest = np.bincount(cow.labels[cow.labels >= 0]).argmax()
    assert has_hue(image, label_colours(np.array([largest]))[0, :3])
    grey = surface(cow.mesh, view, labels=np.full(len(cow.labels), -1))
    assert (np.ptp(grey, axis=2) == 0).all()
    assert np.array_equal(grey, surface(cow.mesh, view))


def test_a_mark_and_a_contour_are_drawn_where_they_belong(cow, view):
    depth = np.asarray(cow.mesh.vertices) @ view.axes[2]
    point = int(depth.argmax())
    height = np.asarray(cow.mesh.vertices) @ view.axes[1]
    level = np.median(height)
    plain = surface(cow.mesh, view)
    marked = surface(cow.mesh, view, points=[point], contour=(height, level))
    unit = max(view.extent / render.TILE) / (1 - 2 * render.MARGIN)
    right, up = (np.asarray(cow.mesh.vertices)[point] - view.centre) @ view.axes[:2].T / unit
    column, row = round(render.TILE[0] / 2 + right), round(render.TILE[1] / 2 - up)
    red = marked[row, column].astype(int)
    assert red[0] > 100 > 4 * red[1:].max() / 2
    line = np.flatnonzero((marked.max(axis=2) == 0).sum(axis=1) > 50)
    assert np.abs(line - (render.TILE[1] / 2 - (level - view.centre @ view.axes[1]) / unit)).max() < 8
    assert not (plain.max(axis=2) == 0).any()


def test_tubes_are_the_faces_that_the_original_does_not_have_and_are_seen_through_the_surface(cow, view):
    tubed = perturb.ShortCircuits(amount=4)(cow.mesh, np.random.default_rng(0))
    added = added_faces(cow.mesh.faces, tubed.mesh.faces, tubed.counterpart)
    assert np.array_equal(np.flatnonzero(added), np.arange(len(added) - 24, len(added)))
    mesh = tubed.mesh
    transparent = surface(mesh, view, solid=added, opacity=render.TRANSPARENT)
    assert (transparent.max(axis=2) == 0).sum() > 30
    assert transparent[ink(transparent)].mean() > surface(mesh, view)[ink(transparent)].mean()


def test_no_face_is_added_by_a_perturbation_that_only_removes(cow):
    torn = perturb.Holes(amount=200)(cow.mesh, np.random.default_rng(0))
    assert not added_faces(cow.mesh.faces, torn.mesh.faces, torn.counterpart).any()


def test_parts_keep_their_names_whatever_their_new_numbers(cow):
    n_parts = cow.labels.max() + 1
    shuffled = np.random.default_rng(0).permutation(n_parts)[cow.labels]
    shuffled[cow.labels < 0] = -1
    assert np.array_equal(named_as(cow.labels, shuffled, shuffled), cow.labels)


def test_a_part_without_a_partner_has_a_colour_that_the_reference_does_not_have():
    before = np.array([0, 0, 0, 1, 1, -1])
    after = np.array([2, 2, 0, 1, 1, -1])
    assert named_as(before, after, after).tolist() == [0, 0, 2, 1, 1, -1]


@pytest.mark.parametrize("style", STYLES)
def test_every_style_draws_original_and_variant_in_tiles_of_one_size(cow, style):
    change = perturb.Scaling(amount=2.0) if style == "scaled" else perturb.ShortCircuits(amount=3)
    changed = change(cow.mesh, np.random.default_rng(1))
    labels = HeatWalk()(np.asarray(changed.mesh.vertices), np.asarray(changed.mesh.faces))
    trial = SimpleNamespace(
        prepare=lambda: Reference(cow.mesh, cow.labels),
        variant=lambda reference: Variant(reference, changed.mesh, labels, changed.counterpart, changed.applied, 0, 0),
    )
    original, drawn = pictures(([trial], style))
    rows = 2 if style == "on_original" else 1
    assert original.shape == drawn.shape == (rows * render.TILE[1], render.TILE[0], 3)
    if style == "scaled":
        assert np.mean(np.abs(original.astype(int) - drawn) > 8) < 0.002
    if style == "on_original":
        assert (original[render.TILE[1] :] == 255).all()
        # But for the outline's smoothed pixels, which are white to rounding in one colour and not in another.
        assert np.mean(ink(original[: render.TILE[1]]) != ink(drawn[: render.TILE[1]])) < 0.002


def test_one_of_labels_colours_and_field_is_shown(cow, view):
    with pytest.raises(ValueError, match="leave out the others"):
        surface(cow.mesh, view, labels=cow.labels, field=np.zeros(len(cow.labels)))


def test_a_view_is_a_rotation_and_level(cow, view):
    np.testing.assert_allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(view.axes) == pytest.approx(1)
    assert view.axes[0][1] == pytest.approx(0, abs=1e-12)
