"""Scenes of heat, of the walk, of functions, poses and variants."""

from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from heatwalk.io import LoadedMesh
from heatwalk.segmentation import bent_torus
from studies.experiments.named_perturbations import perturbation_named
from studies.figures.method_scenes import (
    FIRST,
    OF_ONE,
    OF_SEVERAL,
    POSITION,
    TIMES,
    AnatomyScenes,
    PoseScenes,
    Shape,
    diffusion_scenes,
    divergence_scenes,
    perturbed_scenes,
    pipeline_scenes,
    pose_scenes,
    walk_scenes,
)
from studies.reporting.html import pack, unpack
from studies.segmenters.heat_walk import HeatWalk


@pytest.fixture(scope="module")
def shape():
    mesh = trimesh.creation.icosphere(3).apply_scale([4, 1.2, 1])
    return Shape("egg", LoadedMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), ()), most_faces=600)


def test_heat_is_the_column_of_the_kernel_of_the_vertex_that_it_comes_from(shape):
    for time, seg in ((TIMES[0], shape.over_time[0]), (1.0, shape.segmentation)):
        rows = seg.kernel.factor[shape.reduced.source]
        for point in (0, 100, 250):
            found = shape.heat(seg, point).values()
            assert np.abs(found - rows @ rows[point]).max() < 1e-5 * found.max(), time


def test_heat_is_packed_with_an_error_below_a_step_of_the_colours(shape):
    [scene, *_] = diffusion_scenes(shape)
    [again] = unpack(pack([scene]))
    for before, after in zip(scene.viewports, again.viewports, strict=True):
        assert after.heat.point == before.heat.point
        values = before.heat.values()
        assert np.abs(after.heat.values(before.heat.point) - values).max() < values.max() / 254


def test_the_dissipator_holds_less_of_its_heat_than_the_accumulator_at_every_time(shape):
    for scene in diffusion_scenes(shape):
        dissipator, accumulator = (each.heat for each in scene.viewports)
        assert dissipator.values()[dissipator.point] < accumulator.values()[accumulator.point]


def test_the_walk_ends_at_the_regions_and_what_is_pale_has_not_settled(shape):
    walk = shape.segmentation.walk
    scenes = {scene.at[POSITION]: scene.viewports for scene in walk_scenes(shape)}
    assert sorted(scenes) == list(range(len(walk.steps)))
    for step, (after, regions) in scenes.items():
        unsettled = (walk.steps[step] != walk.steps[-1])[shape.reduced.source]
        assert (after.faded == unsettled).all()
        assert (after.labels[~unsettled] == regions.labels[~unsettled]).all()
    assert not scenes[len(walk.steps) - 1][0].faded.any()


def test_the_dissipator_test_is_the_difference_of_the_divergences(shape):
    for scene in divergence_scenes(shape):
        _, uniform, region, test = (each.fields[each.shows].values for each in scene.viewports)
        assert region - uniform == pytest.approx(test, abs=1e-9)


def test_the_dissipators_of_the_pipeline_are_grey_and_the_rest_is_as_before_them(shape):
    scenes = pipeline_scenes(shape)
    assert [scene.at[POSITION] for scene in scenes] == [TIMES[FIRST], *TIMES[:FIRST], *TIMES[FIRST + 1 :]]
    for scene in scenes:
        _, _, regions, final = scene.viewports
        grey = final.labels < 0
        assert (final.labels[~grey] == regions.labels[~grey]).all()


def test_nothing_changes_at_another_scale(shape):
    for scene in perturbed_scenes(shape, perturbation_named("scaling")):
        original, variant = scene.viewports
        assert (original.labels == variant.labels).all()
        assert not original.changed.any()
        assert not variant.changed.any()


def test_a_part_has_one_colour_in_all_poses_whatever_the_order_of_vertices():
    vertices, faces = bent_torus()  # without symmetry, so that nothing ties
    order = np.random.default_rng(0).permutation(len(vertices))
    place = np.argsort(order)
    first = Shape("first", LoadedMesh(vertices, faces, ()), most_faces=10_000)
    other = Shape("other", LoadedMesh(vertices[order], place[faces], ()), most_faces=10_000)
    [scene] = pose_scenes([[(first, np.arange(len(order))), (other, place)]])
    a, b = scene.viewports
    assert (a.labels == b.labels[place]).all()
    assert b.note.endswith("CP 0.0 %")


class Twisted:
    """A model that a study would have."""

    category = "torus"

    def __init__(self, name):
        self.name = name

    def load(self):
        return LoadedMesh(*bent_torus(), ())

    def correspondence(self):
        return np.arange(len(bent_torus()[0]))


class Method:
    """A segmenter that a study would have."""

    method = HeatWalk()

    def __call__(self, vertices, faces):
        return self.method(vertices, faces)


TRIAL = SimpleNamespace(
    model=Twisted("a"), segmenter=Method(), trial_id="id", group_key="key", segmenter_name="HeatWalk",
    poses=(Twisted("a"), Twisted("b")), segmenter_of_shape=Method,
)  # fmt: skip


@pytest.mark.parametrize("shows", [*OF_ONE, *OF_SEVERAL])
def test_the_viewer_of_a_study_of_the_method_has_what_its_pictures_have(shows):
    made = AnatomyScenes([("figure", shows, [TRIAL])])
    scenes = [scene for task in made.tasks() for scene in made.function(task)]
    assert len(unpack(pack(scenes, slider=made.slider))) == len(scenes)
    assert {scene.at["picture"] for scene in scenes} == {"figure"}
    # A slider of one position would be of no use.
    positions = [scene.at[POSITION] for scene in scenes if POSITION in scene.at]
    assert len({*positions}) == (len(scenes) if len(scenes) > 1 else 0)


def test_the_viewer_of_poses_has_a_row_for_each_method():
    made = PoseScenes([("torus", [(TRIAL, ["a", "b"]), (TRIAL, ["a", "b"])])])
    [scene] = [scene for task in made.tasks() for scene in made.function(task)]
    assert [viewport.title for viewport in scene.viewports] == ["a", "b"] * 2
    assert [viewport.row for viewport in scene.viewports] == ["HeatWalk"] * 4
    assert all(viewport.note.endswith("CP 0.0 %") for viewport in scene.viewports[1::2])
    assert len({viewport.labels.tobytes() for viewport in scene.viewports}) == 1
