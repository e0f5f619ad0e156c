import dataclasses
import json

import numpy as np
import pytest

from heatwalk.io import label_colours
from studies.figures.scenes import Field, Scene, Surface, Viewport
from studies.reporting.html.packing import COLOURS, LEVELS, STEPS, PackedScenes, pack, palette, read_packed, unpack
from tests.helpers.meshes import bundled


def scene(surface, level=0.0, **shown):
    return Scene({"model": "ant", "level": level}, [Viewport(surface, **shown)], key=f"a{level:g}")


@pytest.fixture(scope="module")
def ant():
    mesh = bundled("ant")
    return Surface(np.asarray(mesh.vertices) * [1, 20, 300] + [0, 0, 1e4], np.asarray(mesh.faces))


def test_coordinates_are_kept_to_half_a_step_of_the_bounding_box_and_faces_exactly(ant):
    [again] = unpack(pack([scene(ant)]))
    shown = again.viewports[0].surface
    step = np.ptp(ant.vertices, axis=0) / STEPS
    assert (np.abs(shown.vertices - ant.vertices) <= step / 2 + 1e-9).all()
    np.testing.assert_array_equal(shown.faces, ant.faces)


def test_labels_and_changed_vertices_are_kept_exactly(ant):
    rng = np.random.default_rng(0)
    labels, changed = rng.integers(-1, 240, len(ant.vertices)), rng.random(len(ant.vertices)) < 0.5
    [again] = unpack(pack([scene(ant, labels=labels, changed=changed)]))
    np.testing.assert_array_equal(again.viewports[0].labels, labels)
    np.testing.assert_array_equal(again.viewports[0].changed, changed)


def test_any_number_of_labels_has_the_colours_of_all_pictures(ant):
    labels = np.arange(len(ant.vertices))
    [again] = unpack(pack([scene(ant, labels=labels)]))
    colours = palette()
    assert len(colours) == COLOURS + 1
    shown = [colours[label % COLOURS] for label in again.viewports[0].labels]
    assert shown == [f"#{r:02x}{g:02x}{b:02x}" for r, g, b, _ in label_colours(labels).tolist()]


def test_values_of_functions_are_kept_to_half_a_step_and_missing_ones_stay_missing(ant):
    values = np.random.default_rng(0).normal(size=len(ant.vertices))
    values[::5] = np.nan
    [again] = unpack(pack([scene(ant, fields={"f": Field(values, -2, 2, "metres")})]))
    shown = again.viewports[0].fields["f"]
    np.testing.assert_allclose(shown.values, values.clip(-2, 2), atol=4 / LEVELS / 2 + 1e-12)
    assert (shown.low, shown.high, shown.unit) == (-2, 2, "metres")


def test_everything_else_is_kept(ant):
    one = Scene(
        {"model": "ant", "level": 0.5}, [Viewport(ant, "variant", "walk", "CP 3 %")], "ant, 0.5", 3.0, np.eye(3), "a b"
    )
    [again] = unpack(pack([one]))
    assert {**vars(again), "viewports": 0, "axes": 0} == {**vars(one), "viewports": 0, "axes": 0}
    np.testing.assert_array_equal(again.axes, one.axes)
    assert [vars(again.viewports[0])[name] for name in ("title", "row", "note")] == ["variant", "walk", "CP 3 %"]


def test_a_scene_is_found_by_each_part_of_its_key(ant):
    packed = pack([scene(ant), dataclasses.replace(scene(ant, 1), key="b c")])
    assert packed.numbers == {"a0": 0, "b": 1, "c": 1}


def test_what_scenes_share_is_stored_once(ant):
    labels = np.arange(len(ant.vertices)) % 7
    moved = Surface(ant.vertices * 2, ant.faces)
    packed = pack([scene(ant, labels=labels), scene(ant, 1, labels=labels), scene(moved, 2, labels=labels)])
    assert len(packed.values["surfaces"]) == 2
    assert (
        len(packed.values["blocks"]) == 3
    )  # coordinates, of which doubling changes nothing but the box; faces; labels


def test_the_same_scenes_give_the_same_bytes(ant):
    assert pack([scene(ant)]).values == pack([scene(ant)]).values


def test_scenes_survive_json(ant):
    packed = pack([scene(ant, labels=np.zeros(len(ant.vertices), int))], content="made from this")
    again = read_packed(json.dumps(packed.values))
    assert again == PackedScenes(packed.values)
    assert again.content == "made from this"


@pytest.mark.parametrize("text", ["", "{}", "[1]", '{"version": 0, "scenes": [1], "data": "x"}', '{"version": 1}'])
def test_damaged_scenes_and_those_of_other_versions_are_not_read(text):
    assert read_packed(text) is None
