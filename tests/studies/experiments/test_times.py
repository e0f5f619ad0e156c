import numpy as np
import pandas as pd
import pytest

import heatwalk
from studies.experiments import Times
from studies.experiments.distinct import DistinctSegments
from studies.metrics import change_percentage
from studies.planning.errors import StudyError
from studies.reporting.publication import Publication


def test_a_row_is_what_segmenting_at_that_time_gives(plan, rows_of):
    planned = plan("+study=time", "dataset.models=[ant]", "times.count=4")
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
    distinct = DistinctSegments(mesh.vertices, mesh.faces)
    for time in (0.13, 2.7):
        segmentation = heatwalk.segment(mesh.vertices, mesh.faces, time)
        for reach in (1, 2):
            assert rows.loc[time, f"n_distinct_segments_{reach}"] == distinct.count(segmentation, reach)


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


def counted_rows(numbers, levels=(0.6, 1.0, 2.0, 2.7)):
    """Rows of models with these numbers of segments, and one fewer distinct ones."""
    return pd.DataFrame(
        {"part": "time", "segmenter": "HeatWalk", "model": model, "level": level, "unit": "paper", "status": "ok",
         "n_segments": n, "n_large_segments": n, "n_distinct_segments_1": n - 1, "n_distinct_segments_2": 1,
         "change_percentage": 0.0, "n_segments_reference": n}
        for model, values in numbers.items()
        for level, n in zip(levels, values, strict=True)
    )  # fmt: skip


NUMBERS = {"steady": (3, 3, 3, 3), "once": (4, 3, 3, 3), "grows": (2, 3, 4, 5), "jumps": (9, 3, 3, 9)}


def table_of(rows, **options):
    experiment = Times(times={"first": 0.5, "last": 3, "count": 2}, intervals=[[0.6, 2.7]], **options)
    return experiment.tables(rows)[0]


def test_beside_the_exact_share_are_that_within_one_and_the_share_of_times():
    frame = table_of(counted_rows(NUMBERS)).frame.set_index("counted")
    assert frame.index.tolist() == ["all", "all, coarse", "large", "large, coarse", "distinct (1)", "distinct (2)"]
    for counted in ("all", "distinct (1)"):
        assert frame.loc[counted, ["unchanged", "within_one"]].tolist() == [25, 50]
        # All four times, three, one (time 1 itself), and two.
        assert frame.loc[counted, "share_of_times"] == pytest.approx(100 * (4 + 3 + 1 + 2) / 16)
    assert frame.loc["distinct (2)", ["unchanged", "within_one", "share_of_times"]].tolist() == [100, 100, 100]
    for name in ("within_one", "share_of_times"):
        assert (frame[f"{name}_low"] <= frame[name]).all()
        assert (frame[name] <= frame[f"{name}_high"]).all()


def test_the_chart_of_many_methods_shows_their_shares_in_each_interval():
    names = ["HeatWalk", *(f"method {i}" for i in range(4))]
    rows = pd.concat([counted_rows(NUMBERS).assign(segmenter=name) for name in names])
    experiment = Times(times={"first": 0.5, "last": 3, "count": 2}, intervals=[[0.6, 2.7], [2.0, 2.7]])
    tables = {table.name: Publication.load("heat_walk_2011").annotate(table, rows) for table in experiment.tables(rows)}
    first, second = experiment.charts("time", tables, rows, "Times")["time"].panels
    assert (first.x.label, second.x.label) == ("times 0.6 to 2.7", "times 2 to 2.7")
    assert first.dots[0].categories == tuple(names)
    assert (first.dots[0].values, second.dots[0].values) == ((25,) * 5, (50,) * 5)
    assert (first.dots[1].categories, first.dots[1].values) == (("HeatWalk",), (71,))  # the paper's


@pytest.mark.parametrize(("criterion", "expected"), [("exact", 25), ("within_one", 50), ("share_of_times", 62.5)])
def test_the_criterion_says_which_share_is_compared_with_the_paper(criterion, expected):
    rows = counted_rows(NUMBERS)
    paper = Publication.load("heat_walk_2011")
    table = paper.annotate(table_of(rows, criterion=criterion), rows)
    first = table.frame.set_index("counted").loc["all"]
    assert first["unchanged"] == expected
    assert first["criterion"] == criterion
    assert first["ci_low"] <= expected <= first["ci_high"]
    assert ("criterion" in [column.name for column in table.visible()]) == (criterion != "exact")
    # What the paper says is about the same number at every time.
    assert [claim.computed for claim in paper.claims([table], rows)] == ([25] if criterion == "exact" else [])


def test_the_table_has_rows_of_what_is_to_be_counted():
    rows = counted_rows(NUMBERS)
    assert set(table_of(rows, counted="all").frame["counted"]) == {"all", "all, coarse", "large", "large, coarse"}
    assert set(table_of(rows, counted=["distinct"]).frame["counted"]) == {"distinct (1)", "distinct (2)"}


def test_the_share_of_times_is_about_time_one_even_where_that_is_not_in_the_interval():
    rows = counted_rows(NUMBERS)
    experiment = Times(times={"first": 0.5, "last": 3, "count": 2}, intervals=[[2.0, 2.7]])
    frame = experiment.tables(rows)[0].frame.set_index("counted")
    assert frame.loc["all", "share_of_times"] == pytest.approx(100 * (2 + 2 + 0 + 1) / 8)


def test_models_whose_rows_are_older_than_a_count_are_left_out_of_it():
    rows = counted_rows(NUMBERS)
    rows["n_distinct_segments_1"] = rows["n_distinct_segments_1"].astype("Int64")
    rows.loc[rows["model"] == "steady", "n_distinct_segments_1"] = pd.NA
    frame = table_of(rows).frame.set_index("counted")
    assert frame.loc["distinct (1)", ["n", "unchanged", "within_one"]].tolist() == pytest.approx([3, 0, 100 / 3])
    assert frame.loc["distinct (1)", "share_of_times"] == pytest.approx(100 * (3 + 1 + 2) / 12)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["counted=some"], "counted is 'some': it must be one of all, distinct"),
        (["criterion=near"], "criterion is 'near': choose one of exact, within_one, share_of_times"),
        (["times.first=0"], "times.first=0"),
        (["times.count=0"], "times.count is 0"),
        (["intervals=[[2,1]]"], "each must be two times"),
        (["segmenter=custom", "segmenter._target_=numpy.zeros"], "does not have"),
    ],
)
def test_what_is_no_study_of_times_is_an_error(plan, words, message):
    with pytest.raises((StudyError, ValueError), match=message):
        plan("+study=time", *words)
