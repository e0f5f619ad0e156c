import dataclasses
import functools
import pickle
from types import SimpleNamespace
from typing import ClassVar

import numpy as np
import pytest
import trimesh

import heatwalk
import perturb
from heatwalk.accumulators import blocked_maximum_inner_products
from heatwalk.io import LoadedMesh
from studies.datasets.bundled import Bundled, BundledModel
from studies.figures import method_figures
from studies.figures.drawing import save
from studies.figures.layout import lay_out
from studies.figures.method_figures import PLATES, AnatomyPlate, PosePlate, TimePlate
from studies.segmenters.heat_walk import HeatWalk
from tests.helpers.meshes import coarse


class Remembering(HeatWalk):
    """A Heat Walk that segments a mesh once for all tests."""

    found: ClassVar[dict] = {}

    def segmentation(self, vertices, faces):
        mesh = vertices.tobytes(), faces.tobytes()
        if mesh not in self.found:
            self.found[mesh] = super().segmentation(vertices, faces)
        return self.found[mesh]


@pytest.fixture(scope="module", autouse=True)
def coarse_models():
    """Bundled models with a sixth of their vertices: the plates compute the same of them."""
    load = BundledModel.load

    @functools.cache
    def load_coarse(model):
        loaded = load(model)
        mesh = coarse(perturb.as_trimesh(loaded.vertices, loaded.faces), 2500)
        return LoadedMesh(np.asarray(mesh.vertices), np.asarray(mesh.faces), loaded.notes)

    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(BundledModel, "load", load_coarse)
        yield


@pytest.fixture(scope="module")
def ant(coarse_models):
    loaded = Bundled(["ant"]).models()[0].load()
    return perturb.as_trimesh(loaded.vertices, loaded.faces)


@pytest.fixture(scope="module")
def segmented(ant):
    return heatwalk.segment(ant.vertices, ant.faces)


def test_the_settled_shares_are_those_counted_vertex_by_vertex_on_the_walk(ant, segmented):
    pointer, _ = blocked_maximum_inner_products(segmented.kernel)
    settled = []
    for vertex in range(len(pointer)):
        steps = 0
        while pointer[vertex] != vertex:
            vertex, steps = pointer[vertex], steps + 1
        settled.append(steps)
    shares = method_figures.walk(ant, segmented).numbers["settled"]
    expected = [np.mean(np.array(settled) <= step) for step in range(max(settled) + 1)]
    np.testing.assert_array_equal(shares, expected)
    assert shares[-1] == 1


def test_the_diffusion_radius_of_a_sphere_is_that_of_its_heat_by_colatitude():
    """Between the radii at which less and more than 90 % of the heat are within, from the distances known exactly."""
    sphere = trimesh.creation.icosphere(4)
    kernel = heatwalk.segment(sphere.vertices, sphere.faces, 0.5).kernel
    radius, distance = method_figures.diffusion_radius(sphere, kernel, 7)
    colatitude = np.arccos(np.clip(sphere.vertices @ sphere.vertices[7], -1, 1)) / np.sqrt(4 * np.pi)
    np.testing.assert_allclose(distance, colatitude, atol=0.02)
    heat = kernel.mass * (kernel.factor @ kernel.factor[7])
    assert heat.sum() == pytest.approx(1)
    assert heat[colatitude < radius - 0.02].sum() < 0.9 < heat[colatitude < radius + 0.02].sum()


def test_heat_stays_on_its_component():
    sphere = trimesh.creation.icosphere(3)
    both = trimesh.util.concatenate([sphere, sphere.copy().apply_translation([3, 0, 0])])
    kernel = heatwalk.segment(both.vertices, both.faces).kernel
    _, distance = method_figures.diffusion_radius(both, kernel, 0)
    assert np.array_equal(np.isfinite(distance), np.arange(len(distance)) < len(sphere.vertices))


def test_the_numbers_of_a_figure_are_those_of_the_segmentation(ant, segmented):
    later = heatwalk.segment(ant.vertices, ant.faces, 2.0)
    pipeline = method_figures.pipeline(ant, segmented).numbers
    assert pipeline["accumulator_regions"] == len(segmented.exemplars)
    assert pipeline["dissipator_share"] == np.mean(method_figures.labels_with_background(segmented) == -1)
    walk = method_figures.walk(ant, segmented).numbers
    assert walk["exemplars"] == [len(np.unique(groups)) for groups in segmented.walk.steps]
    over_time = method_figures.over_time(ant, [segmented, later], segmented).numbers
    assert over_time["segments"] == {1.0: segmented.n_segments, 2.0: later.n_segments}
    assert over_time["change"][1.0] == 0


def test_a_figure_has_the_same_bytes_again(ant, segmented, tmp_path):
    for name in ("first", "second"):
        figure = method_figures.showcase([(ant, method_figures.labels_with_background(segmented), "ant")])
        save(lay_out(figure.rows), tmp_path / f"{name}.png", "ant")
    assert (tmp_path / "first.png").read_bytes() == (tmp_path / "second.png").read_bytes()


@pytest.fixture
def trials(monkeypatch):
    """A trial of each of two bundled models, as far as plates are concerned; poses have all vertices in common."""
    monkeypatch.setattr(BundledModel, "correspondence", lambda model: np.arange(len(model.load().vertices)))
    segmenter = Segmenter(Remembering())
    return [
        SimpleNamespace(
            trial_id=f"id-{model.name}", model=model, segmenter=segmenter, segmenter_name="HeatWalk", part="shapes",
            poses=(model,), group_key=f"key-{model.name}", segmenter_of_shape=lambda: segmenter,
        )
        for model in Bundled(["ant", "cow"]).models()
    ]  # fmt: skip


class Segmenter:
    """A segmenter whose method is a Heat Walk."""

    def __init__(self, method):
        self.method = method

    def __call__(self, vertices, faces):
        return self.method(vertices, faces)


class Shuffled(Segmenter):
    """The same parts with other numbers."""

    def __call__(self, vertices, faces):
        labels = super().__call__(vertices, faces)
        return np.where(labels < 0, -1, labels.max() - labels)


def tiles(picture):
    """The rows of a picture, computed as by a worker, and its captions."""
    function = pickle.loads(pickle.dumps(picture.function))
    results = [pickle.loads(pickle.dumps(function(task))) for task in picture.tasks()]
    title, subtitle, *_ = [text.get_text() for text in picture.figure(results).texts]
    assert (title, subtitle.replace("\n", " ")) == (picture.title, picture.subtitle)
    return results[0].rows, [tile.caption for row in results[0].rows for tile in row.tiles]


@pytest.mark.parametrize("shows", PLATES)
def test_every_plate_of_the_anatomy_is_drawn_from_its_trials(trials, shows):
    plate = AnatomyPlate("figure", shows, trials, "Anatomy on bundled")
    assert plate.content == f"Anatomy on bundled {shows} id-ant id-cow"
    assert plate.subtitle.startswith("ant: ") == (shows not in ("showcase", "class"))
    _, captions = tiles(plate)
    expected = {"pipeline": 4, "diffusion": 2, "divergences": 3, "showcase": 2, "class": 2}
    assert len(captions) == expected.get(shows, len(captions))


def test_a_showcase_is_captioned_by_category_only_if_every_category_is_another(trials):
    def captions():
        plate = AnatomyPlate("figure5", "showcase", trials, "Versatility")
        return [text.split(" (")[0] for text in tiles(plate)[1]]

    assert captions() == ["ant", "cow"]
    for t, category in zip(trials, ("Ant", "FourLeg"), strict=True):
        t.model = dataclasses.replace(t.model, category=category)
    assert captions() == ["Ant", "FourLeg"]
    trials[1].model = dataclasses.replace(trials[1].model, category="Ant")
    assert captions() == ["ant", "cow"]


def test_an_unknown_plate_is_refused_with_the_known_ones(trials):
    with pytest.raises(ValueError, match=r"plates\.figure1\.shows is 'heart': choose one of pipeline, diffusion"):
        AnatomyPlate("figure1", "heart", trials)


def test_a_plate_of_poses_names_what_determines_it_and_gives_a_part_the_same_colour_in_each(trials):
    trials[1].model, trials[1].poses, trials[1].segmenter = trials[0].model, trials[0].poses, Shuffled(Remembering())
    plate = PosePlate("figure6", [(trials[0], "ant"), (trials[1], "ant")], 1, "Poses")
    assert plate.content == "Poses ant key-ant ant key-cow"
    (row,), texts = tiles(plate)
    first, second = row.tiles
    assert row.label == "shapes"
    assert np.array_equal(first.picture, second.picture)
    assert texts[0] == texts[1]


def test_poses_of_several_segmenters_have_a_row_for_each(trials):
    trials[1].segmenter_name, trials[1].poses = "cuts", trials[0].poses
    rows, _ = tiles(PosePlate("figure6", [(trials[0], "ant"), (trials[1], "ant")], 1, "Poses"))
    assert [row.label for row in rows] == ["shapes, HeatWalk", "shapes, cuts"]


@pytest.mark.parametrize(("count", "lengths"), [(3, [3]), (5, [5]), (6, [3, 3]), (7, [4, 3]), (11, [4, 4, 3])])
def test_the_rows_of_a_showcase_are_of_about_the_same_length(monkeypatch, count, lengths):
    monkeypatch.setattr(method_figures, "surface", lambda *_, **__: np.zeros((4, 4, 3), np.uint8))
    box = trimesh.creation.box()
    figure = method_figures.showcase([(box, np.zeros(8, int), str(i)) for i in range(count)], label="boxes")
    assert [len(row.tiles) for row in figure.rows] == lengths
    assert [row.label for row in figure.rows] == ["boxes", *[""] * (len(lengths) - 1)]


def test_a_plate_of_times_shows_each_time_with_its_number_of_segments(ant, trials):
    plate = TimePlate("figure15", trials[0], (0.65, 2), "Times")
    assert plate.content == "Times ant key-ant [0.65, 2]"
    _, texts = tiles(plate)
    counts = [heatwalk.segment(ant.vertices, ant.faces, time).n_segments for time in (0.65, 2)]
    assert texts == [f"t = 0.65: {counts[0]} segments", f"t = 2: {counts[1]} segments"]
