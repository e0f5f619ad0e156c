import numpy as np
import pandas as pd
import pytest

import heatwalk
from studies.experiments import Times
from studies.metrics import change_percentage
from studies.planning.errors import StudyError
from studies.reporting.publication import Publication


def test_a_row_is_what_segmenting_at_that_time_gives(plan, rows_of):
    planned = plan("+study=time", "dataset.models=[cow]", "times.count=4")
    rows = rows_of(planned, Times).set_index("level")
    mesh = planned[0].model.load()
    usual = heatwalk.segment(mesh.vertices, mesh.faces).labels
    assert {0.13, 0.6, 0.85, 1, 1.9, 2.7, 12} <= set(rows.index)
    for time in (0.13, 1, 2.7, 12):
        labels = heatwalk.segment(mesh.vertices, mesh.faces, time).labels
        sizes = np.unique(labels, return_counts=True)[1]
        assert rows.loc[time, "n_segments"] == len(sizes)
        assert rows.loc[time, "n_large_segments"] == (100 * sizes >= len(labels)).sum()
        assert rows.loc[time, "change_percentage"] == change_percentage(usual, labels)


def test_times_are_spaced_evenly_in_their_logarithm(plan):
    times = [t.level for t in plan("+study=time", "dataset.models=[cow]", "times.count=26", "intervals=[]")]
    assert times[0] == 0.13
    assert times[-1] == 12
    ratios = np.diff(np.log(sorted(set(times) - {1.0})))
    np.testing.assert_allclose(ratios, np.log(12 / 0.13) / 25, rtol=1e-4)


def test_models_are_drawn_with_a_seed(plan, psb_zip):
    def drawn(*words):
        trials = plan("+study=time", "dataset=psb", f"dataset.root={psb_zip}", "models_drawn=5", *words)
        return {t.model.name for t in trials}

    assert len(drawn()) == 5
    assert drawn() == drawn()
    assert drawn() != drawn("seed=1")


def test_a_model_is_unchanged_where_its_number_is_the_same_at_every_time_of_the_interval():
    numbers = {"steady": [9, 3, 3, 3, 3], "ends": [3, 3, 4, 3, 3], "moves": [5, 3, 4, 6, 6]}
    rows = pd.DataFrame(
        {
            "part": "time", "segmenter": "HeatWalk", "perturbation": "time", "model": model,
            "level": level, "unit": "paper", "status": "ok", "n_segments": n,
            "n_large_segments": 2, "n_segments_reference": n, "change_percentage": 0.0, "van_dongen": 0.0,
            "rand_index_error": 0.0,
        }
        for model, values in numbers.items()
        for level, n in zip([0.5, 0.6, 0.8, 1.0, 2.7], values, strict=True)
    )  # fmt: skip
    experiment = Times(times={"first": 0.5, "last": 2.7, "count": 2}, intervals=[[0.6, 2.7]])
    annotated = Publication.load("heat_walk_2011").annotate(experiment.tables(rows)[0], rows)
    table = annotated.frame.set_index("counted")
    assert table["unchanged"].to_dict() == pytest.approx(
        {"all": 100 / 3, "all, coarse": 200 / 3, "large": 100, "large, coarse": 100}
    )
    assert table.loc["all", "within_one"] == pytest.approx(200 / 3)
    assert table.loc["all", "times"] == 4
    assert (table["paper"] == 71).all()


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["times.first=0"], "times.first=0"),
        (["times.count=0"], "times.count is 0"),
        (["intervals=[[2,1]]"], "each must be two times"),
        (["segmenter=custom", "segmenter._target_=numpy.zeros"], "does not have"),
    ],
)
def test_what_is_no_study_of_times_is_an_error(plan, words, message):
    with pytest.raises((StudyError, ValueError), match=message):
        plan("+study=time", *words)
