import numpy as np
import pandas as pd
import pytest

import heatwalk
from studies.experiments import Anatomy
from studies.plan import StudyError, plan


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
