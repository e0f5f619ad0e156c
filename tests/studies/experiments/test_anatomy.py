import numpy as np
import pandas as pd
import pytest

import heatwalk
from studies.experiments import Anatomy
from studies.planning.errors import StudyError
from studies.reporting.publication import Publication
from tests.helpers.meshes import bundled


def test_a_row_counts_the_steps_of_the_walk_and_who_has_settled_after_each(plan, rows_of):
    planned = plan("+study=anatomy", "dataset.models=[bunny]")
    row = rows_of(planned, Anatomy).iloc[0]
    mesh = planned[0].model.load()
    seg = heatwalk.segment(mesh.vertices, mesh.faces)
    walks = [seg.walk.path(vertex) for vertex in range(len(mesh.vertices))]
    lengths = np.array([len(path) - 1 for path in walks])
    assert row["n_steps"] == lengths.max()
    for step in (1, 2, 3):
        assert row[f"settled_{step}"] == pytest.approx((lengths <= step).mean())
    assert row["dissipating"] == pytest.approx((seg.labels == len(seg.exemplars)).mean())
    assert row["n_segments"] == len(np.unique(seg.labels))


def test_the_table_has_the_published_share_next_to_the_computed_one():
    rows = pd.DataFrame(
        {
            "study": "anatomy", "model": ["a", "b"], "segmenter": "HeatWalk", "status": "ok",
            "n_steps": [2, 4], "n_segments": [3, 5], "dissipating": [0.1, 0.3],
            "settled_1": [0.5, 0.7], "settled_2": [0.8, 1.0], "settled_3": [1.0, 1.0],
        }
    )  # fmt: skip
    publication = Publication.load("heat_walk_2011")
    annotated = publication.annotate(Anatomy().tables(rows)[0], rows)
    table = annotated.frame.set_index("what")
    assert table.loc["settled after step 2, %", ["mean", "paper", "lowest", "highest"]].tolist() == [90, 75, 80, 100]
    assert table.loc["segments", "mean"] == 4
    (claim,) = publication.claims([annotated], rows)
    assert (claim.published, claim.computed, claim.verdict) == (75, 90, "better")


def test_the_walk_of_another_method_is_an_error(plan):
    with pytest.raises(StudyError, match="looks inside the Heat Walk"):
        plan("+study=anatomy", "segmenter=custom", "segmenter._target_=numpy.zeros")


def no_labels(trial_id):
    return None


def test_plates_show_the_named_models_of_the_study_and_else_some_of_them(plan, rows_of, tmp_path):
    for name in ("one", "two"):
        bundled("ant").export(tmp_path / f"{name}.off")
    plates = {"steps": {"shows": "walk", "models": ["two", "three"]}, "all": {"shows": "showcase", "models": []}}
    experiment = Anatomy(plates=plates)
    trials = plan("+study=anatomy", "dataset=files", f"dataset.glob={tmp_path}")
    rows = rows_of(trials, Anatomy)
    made = {picture.stem: picture for picture in experiment.pictures("anatomy", trials, rows, "", no_labels)}
    ids = {trial.model.name: trial.trial_id for trial in trials}
    assert {stem: picture.content for stem, picture in made.items()} == {
        "steps": f"walk {ids['two']}",
        "all": f"showcase {ids['one']} {ids['two']}",
    }
    picture = made["steps"]
    figure = picture.figure([picture.function(task) for task in picture.tasks()])
    assert len(figure.axes) == rows["n_steps"][0] + 1


def test_an_unknown_plate_is_an_error():
    with pytest.raises(StudyError, match="choose one of pipeline"):
        Anatomy(plates={"figure1": {"shows": "nothing"}})
