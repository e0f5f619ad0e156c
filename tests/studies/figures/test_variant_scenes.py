import dataclasses

import numpy as np
import pandas as pd
import pytest

from studies.execution import Serial, run_trials
from studies.figures.gallery import choose_trials
from studies.figures.scenes import MOST_FACES
from studies.figures.variant_scenes import MARGIN, MOST_SECONDS, VariantScenes, choose_draws
from studies.metrics import change_percentage, van_dongen
from studies.planning.trial import run_trial
from tests.studies.conftest import ant, configured_with


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    """Noise in a small mesh by two methods: trials, rows, and the arrays that the trials of the gallery kept."""
    folder = tmp_path_factory.mktemp("meshes")
    (folder / "ant.off").write_text(ant())
    study = configured_with(
        "+study=shot_noise", "dataset=files", f"dataset.glob='{folder}/*.off'", "levels=[0.2,0.5]", "repeats=2",
        "segmenters=[heat_walk,nodal_domains]", "gallery.models=1",
    )  # fmt: skip
    trials = study.plan()
    rows = list(run_trials(Serial(), trials))
    kept = {row["trial_id"]: row for row in rows if "labels" in row}
    return trials, pd.DataFrame(rows).drop(columns=["labels", "reference_labels", "margin"]), kept


def draws_of(study, worst=0, stored=True):
    trials, rows, kept = study
    return choose_draws(trials, rows, choose_trials(trials, None, 1, 6), worst, kept.get if stored else lambda _: None)


@pytest.fixture(scope="module")
def made(study):
    return VariantScenes.function(draws_of(study))


def test_the_gallery_s_levels_are_shown_as_every_method_segments_them(made):
    assert [scene.at for scene in made] == [{"model": "ant", "repeat": 0, "level": level} for level in (0.2, 0.5)]
    titles = [(viewport.row, viewport.title) for viewport in made[0].viewports]
    assert titles == [(row, title) for row in ("HeatWalk", "NodalDomains") for title in ("original", "variant")]


def test_the_vertices_that_changed_are_half_the_change_percentage(study, made):
    """The ant has fewer faces than are shown, so that every vertex is there."""
    changes = study[1].set_index("trial_id")["change_percentage"]
    for scene in made:
        for trial_id, original, variant in zip(
            scene.key.split(), scene.viewports[::2], scene.viewports[1::2], strict=True
        ):
            for viewport in (original, variant):  # all vertices have a counterpart
                assert 200 * viewport.changed.mean() == pytest.approx(changes[trial_id])


def test_colours_are_those_of_the_segmentation_renamed(study, made):
    kept = study[2]
    for scene in made:
        for trial_id, viewport in zip(scene.key.split(), scene.viewports[1::2], strict=True):
            assert van_dongen(viewport.labels + 1, kept[trial_id]["labels"] + 1) == 0


def test_unchanged_vertices_keep_their_colour(made):
    for scene in made:
        for original, variant in zip(scene.viewports[::2], scene.viewports[1::2], strict=True):
            same = ~original.changed
            assert change_percentage(original.labels[same] + 1, variant.labels[same] + 1) == 0


def test_noise_moves_the_shown_vertices_and_shares_their_faces(made):
    original, variant = (viewport.surface for viewport in made[0].viewports[:2])
    assert variant.faces is original.faces
    assert (variant.vertices != original.vertices).any()


def test_only_methods_that_tell_a_margin_have_the_field(made):
    for scene in made:
        with_margin = [MARGIN in viewport.fields for viewport in scene.viewports]
        assert with_margin == [True, True, False, False]
        assert all(viewport.fields[MARGIN].values.min() >= 0 for viewport in scene.viewports[:2])


def test_scenes_are_the_same_whether_labels_are_stored_or_computed_again(study, made, monkeypatch):
    again = VariantScenes.function(draws_of(study, stored=False))
    for scene, other in zip(made, again, strict=True):
        for one, two in zip(scene.viewports, other.viewports, strict=True):
            np.testing.assert_array_equal(one.labels, two.labels)
            np.testing.assert_array_equal(one.changed, two.changed)
            for name in one.fields:
                np.testing.assert_allclose(one.fields[name].values, two.fields[name].values, atol=1e-6)

    def segment(*_):
        raise AssertionError("segmented, although the labels are stored")

    [draw, _] = draws_of(study)
    told = [dataclasses.replace(trial, segmenter=_Refusing(segment, trial.segmenter)) for trial in draw.trials]
    assert len(VariantScenes.function([dataclasses.replace(draw, trials=told)])) == 1


class _Refusing:
    """A segmenter without margin that must not be called."""

    tells_margin = False

    def __init__(self, call, segmenter):
        self.labelled = self.__call__ = call
        self.name = segmenter.name

    def for_original(self, *_):
        return self


def test_the_worst_of_the_other_trials_are_added(study):
    _, rows, _ = study
    [*_, last] = sorted(
        (draw for draw in rows[rows["repeat"] == 1].groupby("level")["change_percentage"].max().items()),
        key=lambda each: each[1],
    )
    added = [draw for draw in draws_of(study, worst=1) if draw.at["repeat"] == 1]
    assert [(draw.at["level"], draw.value) for draw in added] == [last]


def test_what_would_take_long_to_segment_again_is_not_added(study):
    trials, rows, kept = study
    slow = (trials, rows.assign(seconds_segment=MOST_SECONDS), kept)
    assert [draw.at["repeat"] for draw in draws_of(slow, worst=3)] == [0, 0]


def test_trials_that_failed_are_not_shown(study):
    trials, rows, kept = study
    first = draws_of(study)[0].trials[0].trial_id
    failed = rows.assign(status=np.where(rows["trial_id"] == first, "failed", "ok"))
    assert [len(draw.trials) for draw in draws_of((trials, failed, kept))] == [1, 2]


def test_the_content_tells_whether_scenes_have_to_be_made_again(study):
    assert VariantScenes(draws_of(study)).content == VariantScenes(draws_of(study, stored=False)).content
    assert VariantScenes(draws_of(study)).content != VariantScenes(draws_of(study)[:1]).content


def test_a_kept_row_has_the_margin_of_its_labels(study):
    trials, _, kept = study
    trial = next(trial for trial in trials if trial.trial_id in kept and trial.segmenter_name == "HeatWalk")
    row = run_trial(trial, trial.prepare())
    np.testing.assert_array_equal(row["margin"], kept[trial.trial_id]["margin"])
    assert row["margin"].shape == row["labels"].shape
    assert len(trial.model.load().faces) <= MOST_FACES  # as the tests above take for granted
