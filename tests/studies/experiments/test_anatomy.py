import numpy as np
import pandas as pd
import pytest

import heatwalk
from studies.execution import Serial
from studies.experiments import Anatomy
from studies.planning.plan import StudyError, plan
from tests.helpers.meshes import bundled


def test_a_row_counts_the_steps_of_the_walk_and_who_has_settled_after_each(composed, run_trials):
    planned = plan(composed("+study=anatomy", "dataset.models=[bunny]"))
    row = run_trials(planned, Anatomy.columns).iloc[0]
    mesh = planned[0].model.load()
    seg = heatwalk.segment(mesh.vertices, mesh.faces)
    walks = [seg.walk.path(vertex) for vertex in range(len(mesh.vertices))]
    lengths = np.array([len(path) - 1 for path in walks])
    assert row["n_steps"] == lengths.max()
    for step in (1, 2, 3):
        assert row[f"settled_{step}"] == pytest.approx((lengths <= step).mean())
    assert row["dissipating"] == pytest.approx((seg.labels == len(seg.exemplars)).mean())
    assert row["n_segments"] == len(np.unique(seg.labels))


def test_the_table_holds_the_papers_share_beside_ours(composed):
    rows = pd.DataFrame(
        {
            "model": ["a", "b"], "status": "ok", "n_steps": [2, 4], "n_segments": [3, 5], "dissipating": [0.1, 0.3],
            "settled_1": [0.5, 0.7], "settled_2": [0.8, 1.0], "settled_3": [1.0, 1.0],
        }
    )  # fmt: skip
    cfg = composed("+study=anatomy")
    tables = Anatomy().tables(rows, cfg)
    table = tables["table"].set_index("what")
    assert table.loc["settled after step 2, %", ["mean", "paper", "lowest", "highest"]].tolist() == [90, 75, 80, 100]
    assert table.loc["segments", "mean"] == 4
    (claim,) = Anatomy().claims(tables, cfg)
    assert (claim.paper, claim.ours, claim.verdict) == (75, 90, "better")


def test_the_walk_of_another_method_is_an_error(composed):
    with pytest.raises(StudyError, match="looks inside the Heat Walk"):
        plan(composed("+study=anatomy", "segmenter=custom", "segmenter._target_=numpy.zeros"))


def test_plates_show_the_named_models_that_are_there_and_else_the_first(composed, run_trials, tmp_path):
    for name in ("one", "two"):
        bundled("ant").export(tmp_path / f"{name}.off")
    cfg = composed("+study=anatomy", "dataset=files", f"dataset.glob={tmp_path}")
    cfg.plates = {
        "steps": {"shows": "walk", "models": ["two", "three"]},
        "all": {"shows": "showcase", "models": []},
    }
    planned = plan(cfg)
    rows = run_trials(planned, Anatomy.columns)
    made = {stem: (shows, make) for stem, shows, make in Anatomy().surfaces(planned, rows, cfg, "", Serial())}
    ids = {trial.model.name: trial.trial_id for trial in planned}
    assert {stem: shows for stem, (shows, _) in made.items()} == {
        "steps": f"walk {ids['two']}",
        "all": f"showcase {ids['one']}",
    }
    figure = made["steps"][1]()
    assert len(figure.axes) == rows["n_steps"][0] + 1


def test_a_plate_that_there_is_not_is_an_error(composed, run_trials):
    cfg = composed("+study=anatomy", "dataset.models=[cow]", "plates.figure1.shows=nothing")
    planned = plan(cfg)
    rows = run_trials(planned, Anatomy.columns)
    with pytest.raises(StudyError, match="choose one of pipeline"):
        list(Anatomy().surfaces(planned, rows, cfg, "", Serial()))
