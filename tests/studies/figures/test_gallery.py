import pickle
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import perturb
from studies.experiments.change import Reference, Variant
from studies.figures import gallery, surfaces
from studies.figures.gallery import (
    DETAIL_EDGES,
    GONE,
    OPACITY,
    ROWS,
    RULER,
    STYLES,
    GalleryPicture,
    Strip,
    choose_trials,
    choose_view,
    detail_view,
    draw_line,
    find_added_faces,
)
from studies.figures.surfaces import surface
from studies.figures.views import view_of
from studies.segmenters.heat_walk import HeatWalk
from tests.studies.figures.samples import ink


def trial(model, level, part="holes", segmenter="walk", repeat=0):
    """A trial as far as choosing and captioning is concerned."""
    return SimpleNamespace(
        trial_id=f"{segmenter}-{model}-{part}-{level}-{repeat}", model=SimpleNamespace(name=model, category="Ant"),
        part=part, level=level, segmenter_name=segmenter,
    )  # fmt: skip


def plan(models, levels, parts=("holes",), segmenters=("walk",)):
    return [
        trial(model, level, part, segmenter, repeat)
        for model in models
        for segmenter in segmenters
        for part in parts
        for level in levels
        for repeat in range(2)
    ]


def ids(lines):
    return [[trial.trial_id for trial in line] for line in lines]


def test_the_first_successful_repeat_of_evenly_chosen_levels_is_shown_for_evenly_chosen_models():
    planned = plan("abcde", [1, 2, 3, 4, 5])
    good = {trial.trial_id for trial in planned} - {"walk-c-holes-3-0"}
    assert ids(choose_trials(planned, good, 3, 3)) == [
        ["walk-a-holes-1-0", "walk-a-holes-3-0", "walk-a-holes-5-0"],
        ["walk-c-holes-1-0", "walk-c-holes-3-1", "walk-c-holes-5-0"],
        ["walk-e-holes-1-0", "walk-e-holes-3-0", "walk-e-holes-5-0"],
    ]


def test_a_level_of_which_every_repeat_failed_and_a_model_without_a_successful_trial_are_left_out():
    planned = plan("ab", [1, 2])
    good = {"walk-a-holes-1-0", "walk-a-holes-1-1"}
    assert ids(choose_trials(planned, good, 3, 6)) == [["walk-a-holes-1-0"]]


def test_every_trial_is_assumed_to_succeed_before_the_study_runs():
    planned = plan("ab", [1, 2])
    assert ids(choose_trials(planned, None, 3, 6)) == ids(choose_trials(planned, {t.trial_id for t in planned}, 3, 6))


def test_named_models_are_shown_in_their_order_and_three_others_if_the_study_has_none_of_them():
    planned = plan("abcdefg", [1])
    assert ids(choose_trials(planned, None, ["e", "x", "b"], 6)) == [["walk-e-holes-1-0"], ["walk-b-holes-1-0"]]
    assert [line[0].model.name for line in choose_trials(planned, None, ["x"], 6)] == ["a", "d", "g"]


def test_a_model_may_be_named_by_a_number():
    assert [line[0].model.name for line in choose_trials(plan(["81", "82"], [1]), None, [82], 6)] == ["82"]


def test_a_study_of_several_parts_shows_the_last_level_of_each():
    planned = plan("a", [1, 2], parts=("holes", "noise"))
    assert ids(choose_trials(planned, None, 1, 1)) == [["walk-a-holes-2-0", "walk-a-noise-2-0"]]


def test_each_segmenter_has_a_line_of_its_own_below_that_of_the_same_model():
    planned = plan("ab", [1, 2], segmenters=("walk", "cuts"))
    assert [(line[0].model.name, line[0].segmenter_name) for line in choose_trials(planned, None, 2, 1)] == [
        ("a", "walk"), ("a", "cuts"), ("b", "walk"), ("b", "cuts"),
    ]  # fmt: skip


@pytest.mark.parametrize(("models", "n_columns"), [(0, 6), ([], 0)])
def test_no_model_and_no_column_are_possible(models, n_columns):
    assert not any(choose_trials(plan("ab", [1]), None, models, n_columns))


def rows_of(lines):
    return pd.DataFrame(
        {
            "trial_id": t.trial_id, "segmenter": t.segmenter_name, "change_percentage": 2.345,
            "unit": "share_of_faces", "part": t.part, "level": t.level,
        }
        for line in lines
        for t in line
    )  # fmt: skip


def drawn(lines, axes, style="variant", rows=None):
    """The texts of a gallery of grey tiles: its title and subtitle, then of each row the label and the captions."""
    picture = GalleryPicture(lines, rows_of(lines) if rows is None else rows, axes, style, "Holes on psb")
    n_strips = len(ROWS.get(style, ("",)))
    tile = np.zeros((60, 80, 3), np.uint8)
    strips = [[Strip([tile] * (1 + len(line)), [0.0] * (1 + len(line)))] * n_strips for line in lines]
    title, subtitle, *texts = [text.get_text() for text in picture.figure(strips).texts]
    return title, subtitle.replace("\n", " "), [text for text in texts if text]


def test_variants_are_captioned_by_level_and_change_percentage_under_a_subtitle_that_names_the_axis():
    title, subtitle, texts = drawn(choose_trials(plan("a", [0.5, 2]), None, 1, 2), {"holes": "removed"})
    assert (title, subtitle) == ("Holes on psb", "removed (share of faces); CP: Change Percentage")
    assert texts == ["a", "original", "0.5: CP 2.3 %", "2: CP 2.3 %"]


def test_a_model_whose_name_is_a_number_is_labelled_with_its_category():
    _, _, texts = drawn(choose_trials(plan(["81"], [2]), None, 1, 1), {"holes": "removed"})
    assert texts[0] == "Ant 81"


def test_variants_of_several_parts_are_captioned_by_part_and_rows_of_several_segmenters_by_segmenter():
    lines = choose_trials(plan("a", [2], ("big_holes", "noise"), ("walk", "cuts")), None, 1, 1)
    _, subtitle, texts = drawn(lines, {"big_holes": "removed", "noise": "noise"})
    assert subtitle == "the last level of each part; CP: Change Percentage"
    captions = ["original", "big holes 2:\nCP 2.3 %", "noise 2:\nCP 2.3 %"]
    assert texts == ["a, walk", *captions, "a, cuts", *captions]


def test_the_levels_of_all_models_are_below_each_other_and_one_without_a_result_says_so():
    planned = plan("ab", [3, 2, 1])
    good = {t.trial_id for t in planned} - {
        "walk-a-holes-2-0",
        "walk-a-holes-2-1",
        "walk-b-holes-3-0",
        "walk-b-holes-3-1",
    }
    lines = choose_trials(planned, good, 2, 3)
    _, _, texts = drawn(lines, {"holes": "removed"}, rows=rows_of([planned]))
    assert texts[:5] == ["a", "original", "3: CP 2.3 %", "2: failed", "1: CP 2.3 %"]
    assert texts[5:] == ["b", "original", "3: failed", "2: CP 2.3 %", "1: CP 2.3 %"]


@pytest.mark.parametrize("style", STYLES)
def test_every_level_is_shown_in_every_style_and_every_row_has_a_label(style):
    _, _, texts = drawn(choose_trials(plan("a", [0.5, 3.0, 10.0]), None, 1, 3), {"holes": "scale"}, style)
    assert texts[:5] == ["a" + ROWS.get(style, ("",))[0], "original", "0.5: CP 2.3 %", "3: CP 2.3 %", "10: CP 2.3 %"]
    assert texts[5:] == ["a" + label for label in ROWS.get(style, ("",))[1:]]


def test_the_content_of_a_gallery_is_its_title_its_style_and_the_ids_of_its_trials():
    lines = choose_trials(plan("ab", [1, 2]), None, 2, 2)
    picture = GalleryPicture(lines, rows_of(lines), {"holes": "removed"}, "edges", "Holes")
    assert picture.content == "Holes edges " + " ".join(trial.trial_id for line in lines for trial in line)
    assert picture.stem == "gallery"


def test_an_unknown_style_is_refused_with_the_known_ones():
    with pytest.raises(ValueError, match=r"gallery\.style is 'oil': choose one of variant, on_original"):
        GalleryPicture([], rows_of([]), {}, "oil", "Holes")


class CountingTrial:
    """A trial of the cow that records which labels it was given."""

    def __init__(self, cow, changed, labels, trial_id):
        self.cow, self.changed, self.labels, self.trial_id, self.given = cow, changed, labels, trial_id, []

    level, part = 1.0, "tubes"

    def reference(self, labels=None):
        self.given.append(("reference", labels))
        return Reference(self.cow.mesh, self.cow.labels if labels is None else labels)

    def variant(self, reference, labels=None):
        self.given.append(("variant", labels))
        labels = self.labels if labels is None else labels
        return Variant(reference, self.changed.mesh, labels, self.changed.counterpart, self.changed.applied, 0, 0)


@pytest.fixture(scope="module")
def tubed(cow):
    """The cow with tubes, and its labels."""
    changed = perturb.ShortCircuits(amount=3)(cow.mesh, np.random.default_rng(1))
    return changed, HeatWalk()(np.asarray(changed.mesh.vertices), np.asarray(changed.mesh.faces))


def test_stored_labels_are_shown_and_nothing_is_segmented_where_there_are_any(cow, tubed, monkeypatch):
    monkeypatch.setattr(gallery, "surface", lambda mesh, view, labels, **_: labels)
    stored = {"1": {"labels": np.zeros_like(tubed[1]), "reference_labels": np.full_like(cow.labels, 5)}}
    line = [CountingTrial(cow, *tubed, "0"), CountingTrial(cow, *tubed, "1")]
    picture = GalleryPicture([line], rows_of([]), {}, "variant", "Tubes", stored.get)
    (task,) = picture.tasks()
    ((original, computed, reused),) = [strip.pictures for strip in picture.function(task)]
    assert line[0].given[0] == ("reference", stored["1"]["reference_labels"])
    assert line[0].given[1] == ("variant", None)
    assert line[1].given == [("variant", stored["1"]["labels"])]
    assert set(original) == {5}
    assert len(set(computed)) == len(set(tubed[1]))
    assert len(set(reused)) == 1


def test_without_stored_labels_a_line_is_segmented_once_per_mesh(cow, tubed, monkeypatch):
    monkeypatch.setattr(gallery, "surface", lambda mesh, view, labels, **_: labels)
    line = [CountingTrial(cow, *tubed, "0"), CountingTrial(cow, *tubed, "1")]
    (task,) = GalleryPicture([line], rows_of([]), {}, "variant", "Tubes").tasks()
    GalleryPicture.function(task)
    assert [given for t in line for given in t.given] == [("reference", None), ("variant", None), ("variant", None)]


def test_the_function_of_a_gallery_can_be_sent_to_a_worker():
    assert pickle.loads(pickle.dumps(GalleryPicture.function)) is GalleryPicture.function


def test_tubes_are_the_faces_that_the_original_does_not_have_and_are_seen_through_the_surface(cow, view):
    tubed = perturb.ShortCircuits(amount=4)(cow.mesh, np.random.default_rng(0))
    added = find_added_faces(cow.mesh.faces, tubed.mesh.faces, tubed.counterpart)
    assert np.array_equal(np.flatnonzero(added), np.arange(len(added) - 24, len(added)))
    mesh = tubed.mesh
    transparent = surface(mesh, view, solid=added, opacity=OPACITY)
    assert (transparent.max(axis=2) == 0).sum() > 30
    assert transparent[ink(transparent)].mean() > surface(mesh, view)[ink(transparent)].mean()


def test_no_face_is_added_by_a_perturbation_that_only_removes(cow):
    torn = perturb.Holes(amount=200)(cow.mesh, np.random.default_rng(0))
    assert not find_added_faces(cow.mesh.faces, torn.mesh.faces, torn.counterpart).any()


def drawn_line(cow, changed, labels, style):
    return draw_line([CountingTrial(cow, changed, labels, "0")], style, [None])


@pytest.mark.parametrize("style", STYLES)
def test_every_style_draws_original_and_variant_in_tiles_of_one_size(cow, tubed, style):
    strips = drawn_line(cow, *tubed, style)
    assert len(strips) == len(ROWS.get(style, ("",)))
    for strip in strips:
        assert [picture.shape for picture in strip.pictures] == [(surfaces.TILE[1], surfaces.TILE[0], 3)] * 2
        assert all(ink(picture).any() for picture in strip.pictures)


@pytest.mark.parametrize("factor", [0.2, 7.0])
def test_scaled_variants_look_alike_and_their_scale_bars_are_in_proportion(cow, factor):
    changed = perturb.Scaling(amount=factor)(cow.mesh, np.random.default_rng(1))
    (strip,) = drawn_line(cow, changed, cow.labels, "scaled")
    original, scaled = strip.pictures
    assert np.mean(np.abs(original.astype(int) - scaled) > 8) < 0.002
    assert strip.rulers[0] / strip.rulers[1] == pytest.approx(factor)
    assert max(strip.rulers) == pytest.approx(RULER * min(surfaces.TILE))


def test_the_segments_of_a_variant_are_shown_on_the_unchanged_original(cow, tubed):
    upper, lower = drawn_line(cow, *tubed, "on_original")
    # But for the outline's smoothed pixels, which are white to rounding in one colour and not in another.
    assert np.mean(ink(upper.pictures[0]) != ink(upper.pictures[1])) < 0.002
    assert not np.array_equal(upper.pictures[1], lower.pictures[1])
    assert upper.rulers == [0, 0]
    assert all(ruler > 0 for ruler in lower.rulers)


@pytest.fixture(scope="module")
def cut(cow):
    """The cow without what is on one side of a plane: a function of the side."""

    def without(normal, share):
        height = np.asarray(cow.mesh.vertices) @ normal
        kept = height < np.quantile(height, 1 - share)
        counterpart = np.where(kept, np.cumsum(kept) - 1, -1)
        faces = cow.mesh.faces[kept[cow.mesh.faces].all(axis=1)]
        mesh = perturb.as_trimesh(np.asarray(cow.mesh.vertices)[kept], counterpart[faces])
        return SimpleNamespace(mesh=mesh, counterpart=counterpart, applied={}), cow.labels[kept]

    return without


def test_a_part_that_the_usual_view_hides_is_seen_from_another_side(cow, cut):
    usual = view_of(np.asarray(cow.mesh.vertices))
    facing, _ = cut(usual.axes[2], 0.03)
    hidden, _ = cut(-usual.axes[2], 0.03)
    assert np.array_equal(choose_view(cow.mesh, [facing.counterpart]).axes, usual.axes)
    assert choose_view(cow.mesh, [hidden.counterpart]).axes[2] @ usual.axes[2] < 0.5


@pytest.mark.parametrize("counterparts", [[], [slice(None)]])
def test_the_usual_view_shows_what_is_complete(cow, counterparts):
    whole = np.arange(len(cow.mesh.vertices))
    view = choose_view(cow.mesh, [whole[each] for each in counterparts])
    assert np.array_equal(view.axes, view_of(np.asarray(cow.mesh.vertices)).axes)


def test_what_is_cut_off_is_drawn_faintly_and_the_gallery_says_so(cow, cut):
    changed, labels = cut(np.array([0.0, 1.0, 0.0]), 0.2)
    (strip,) = drawn_line(cow, changed, labels, "variant")
    original, variant = strip.pictures
    assert strip.remark == GONE
    faint = ink(original) & (variant.min(axis=2) > 180) & ink(variant)
    assert faint.sum() > 0.02 * ink(original).sum()
    assert np.mean(ink(original) != ink(variant)) < 0.002


def test_the_detail_of_a_dense_mesh_shows_its_edges_which_the_whole_would_hide(cow, tubed, monkeypatch):
    calls = []

    def record(mesh, view, labels, edges=False, **_):
        calls.append((float(view.extent.max() / mesh.edges_unique_length.mean()), bool(edges)))
        return np.zeros((4, 4, 3), np.uint8)

    monkeypatch.setattr(gallery, "surface", record)
    drawn_line(cow, *tubed, "edges")
    (_, whole), _, (across, detail), _ = calls
    assert (whole, detail) == (False, True)
    assert across <= DETAIL_EDGES + 1e-9


def test_a_detail_faces_the_camera_and_has_more_than_one_segment_in_it(cow, view):
    detail = detail_view(cow.mesh, cow.labels, view)
    seen = surfaces.visible_faces(cow.mesh, detail)
    assert (seen >= 0).mean() > 0.9
    assert len(np.unique(cow.labels[cow.mesh.faces[seen[seen >= 0], 0]])) > 1
