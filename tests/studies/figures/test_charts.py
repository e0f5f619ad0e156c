import dataclasses
import json

import numpy as np
import pandas as pd
import pytest

from studies.columns import Column, Published, Table
from studies.figures.charts import (
    MOST_MODEL_LINES,
    level_curve,
    method_means,
    method_scores,
    pair_matrices,
    part_panels,
    segment_counts,
)
from tests.studies.figures.samples import CHARTS, INTERVALS, MANY, level_table, rows_of_levels, rows_of_times


@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
def test_a_chart_is_plain_data_that_strict_json_can_represent(chart):
    assert json.loads(json.dumps(dataclasses.asdict(chart), allow_nan=False))["title"] == chart.title
    plain = (str, int, float, bool, type(None))

    def check(value):
        if dataclasses.is_dataclass(value):
            value = tuple(vars(value).values())
        if isinstance(value, tuple):
            for item in value:
                check(item)
        else:
            assert type(value) in plain

    check(chart)


@pytest.mark.parametrize(("n_models", "lines", "bands"), [(MOST_MODEL_LINES, 10, 0), (MOST_MODEL_LINES + 1, 0, 1)])
def test_few_models_have_a_line_each_and_many_a_band_between_their_quartiles(n_models, lines, bands):
    rows = rows_of_levels([1.0, 2.0, 4.0], n_models)
    (panel,) = level_curve(level_table("holes", [1.0, 2.0, 4.0]), rows, "holes", "Holes").panels
    models = [series for series in panel.series if series.role == "model"]
    assert (len(models), len(panel.bands)) == (lines, bands)
    means = rows.pivot_table(index="model", columns="level", values="change_percentage")
    for series in models:
        assert series.y == tuple(means.loc[series.name])
    for band in panel.bands:
        np.testing.assert_array_equal([band.low, band.high], means.quantile([0.25, 0.75]))


def test_the_mean_of_each_segmenter_is_a_series_with_its_interval_and_its_number():
    table = level_table("holes", [1.0, 2.0], segmenters=("walk", "cuts"))
    rows = rows_of_levels([1.0, 2.0], 3, segmenters=("walk", "cuts"))
    chart = level_curve(table, rows, "holes", "Holes")
    (panel,) = chart.panels
    assert chart.legend_title == "mean, 95 % interval (3 models)"
    assert [(series.label, series.group, series.role) for series in panel.series] == [
        ("walk", 0, "mean"),
        ("cuts", 1, "mean"),
    ]
    for series in panel.series:
        own = table.frame[table.frame["segmenter"] == series.label]
        assert (series.x, series.y) == (tuple(own["level"]), tuple(own["mean"]))
        assert (series.low, series.high) == (tuple(own["ci_low"]), tuple(own["ci_high"]))
    assert not panel.bands


def test_published_values_are_shown_under_their_label_only_where_the_table_names_their_column():
    levels = [1.0, 2.0, 4.0]
    table = level_table("holes", levels, published=[2.0, np.nan, 3.0])
    rows = rows_of_levels(levels, 3)
    (panel,) = level_curve(table, rows, "holes", "Holes").panels
    (published,) = [series for series in panel.series if series.role == "published"]
    assert (published.label, published.y) == ("Smith 2011", (2.0, None, 3.0))
    (panel,) = level_curve(table.replace(published=None), rows, "holes", "Holes").panels
    assert not [series for series in panel.series if series.role == "published"]
    nothing = level_table("holes", levels, published=[np.nan] * 3)
    (panel,) = level_curve(nothing, rows, "holes", "Holes").panels
    assert not [series for series in panel.series if series.role == "published"]


@pytest.mark.parametrize(
    ("second", "labels"), [([2.0, 3.0], ["Smith 2011"]), ([5.0, 6.0], ["Smith 2011: walk", "Smith 2011: cuts"])]
)
def test_published_values_are_one_series_unless_those_of_the_segmenters_differ(second, labels):
    table = level_table("holes", [1.0, 2.0], published=[2.0, 3.0], segmenters=("walk", "cuts"))
    table.frame.loc[table.frame["segmenter"] == "cuts", "published"] = second
    (panel,) = level_curve(table, rows_of_levels([1.0, 2.0], 3), "holes", "Holes").panels
    assert [series.label for series in panel.series if series.role == "published"] == labels


def test_more_curves_than_can_be_told_apart_are_numbers_in_a_matrix():
    levels = [1.0, 2.0, 4.0]
    table = level_table("holes", levels, [2.0, np.nan, 3.0], MANY)
    (matrix,) = level_curve(table, rows_of_levels(levels, 2, MANY), "holes", "Holes").panels
    assert (matrix.rows, matrix.columns) == (("1", "2", "4"), (*MANY, "Smith 2011"))
    for j, name in enumerate(MANY):
        means = table.frame.loc[table.frame["segmenter"] == name, "mean"]
        assert [row[j] for row in matrix.values] == means.tolist()
    assert [row[-1] for row in matrix.values] == [2.0, None, 3.0]
    fewer = level_table("holes", levels, segmenters=MANY[1:])
    (panel,) = level_curve(fewer, rows_of_levels(levels, 2, MANY[1:]), "holes", "Holes").panels
    assert len(panel.series) == len(MANY) - 1


def test_parts_of_many_segmenters_are_named_in_the_rows_of_the_matrix():
    (matrix,) = CHARTS["parts of many segmenters"].panels
    assert matrix.rows == ("Short circuits 10", "Holes 58", "Holes 250")
    assert matrix.values[1][:2] == (1.0, 4.0)


def test_each_part_is_a_panel_whose_width_depends_on_its_number_of_levels():
    parts = [level_table("short_circuits", [10.0]).frame, level_table("holes", [58.0, 250.0]).frame]
    named = {"short_circuits": ("Short circuits", "tubes"), "holes": ("Holes", "removed")}
    chart = part_panels(Table("table", pd.concat(parts)), named, "Table 2")
    assert [(panel.title, panel.x.ticks) for panel in chart.panels] == [
        ("Short circuits", (10.0,)),
        ("Holes", (58.0, 250.0)),
    ]
    assert chart.panels[0].width < chart.panels[1].width == 1
    assert [series.role for series in chart.panels[0].series] == ["mean", "median"]


def test_a_segmenter_keeps_its_number_in_a_part_in_which_another_has_no_values():
    both = level_table("holes", [58.0], segmenters=("walk", "cuts")).frame
    second = level_table("noise", [0.1], segmenters=("walk", "cuts")).frame
    table = Table("table", pd.concat([both, second[second["segmenter"] == "cuts"]]))
    chart = part_panels(table, {"holes": ("Holes", "removed"), "noise": ("Noise", "noise")}, "Table 2")
    assert [(series.label, series.group) for series in chart.panels[1].series] == [("cuts", 1)]


def test_the_shares_of_models_by_different_numbers_of_segments_are_those_counted_one_by_one():
    rows = rows_of_times()
    bars = segment_counts(rows, INTERVALS, "Times").panels[1].bars
    for (first, last), of_interval in zip(INTERVALS, bars, strict=True):
        within = rows[rows["level"].between(first, last)]
        different = [group["n_segments"].nunique() for _, group in within.groupby("model")]
        expected = [100 * different.count(int(name)) / len(different) for name in of_interval.categories]
        assert list(of_interval.values) == expected
        assert sum(of_interval.values) == 100
        assert f"{expected[0]:.1f} % unchanged" in of_interval.label


def test_counts_of_several_segmenters_have_a_median_each_and_a_panel_of_bars_per_interval():
    rows = pd.concat([rows_of_times().assign(segmenter=name) for name in ("walk", "cuts")])
    left, *right = segment_counts(rows, INTERVALS, "Times").panels
    assert [series.label for series in left.series] == ["walk", "cuts"]
    assert not left.bands
    assert [[bars.group for bars in panel.bars] for panel in right] == [[0, 1]] * len(INTERVALS)
    single = segment_counts(rows_of_times(), INTERVALS, "Times")
    assert right[0].bars[1].values[: len(single.panels[1].bars[0].values)] == single.panels[1].bars[0].values


def test_a_study_without_successful_trials_gives_empty_counts():
    left, right = segment_counts(rows_of_times().iloc[:0], INTERVALS, "Times").panels
    assert left.title == "Segments of 0 models"
    assert [series.y for series in left.series] == [()]
    assert {bars.values for bars in right.bars} == {(0.0,)}


def test_matrices_share_their_colours_and_those_of_a_segmenter_follow_each_other():
    change = pd.DataFrame([[0.0, 3.0], [3.0, 0.0]], index=["a", "b"], columns=["a", "b"])
    changes = {("cat", "walk"): change, ("cat", "cuts"): 2 * change, ("dog", "walk"): change, ("dog", "cuts"): change}
    chart = pair_matrices(changes, "Poses")
    assert [panel.title.splitlines()[0] for panel in chart.panels] == ["walk", "walk", "cuts", "cuts"]
    assert [panel.title.splitlines()[1] for panel in chart.panels][2] == "cat: mean 6.0 %"
    assert {(panel.low, panel.high) for panel in chart.panels} == {(0.0, 6.0)}
    assert chart.per_row == 2


def test_a_pair_that_failed_is_missing_and_a_shape_without_poses_is_left_out():
    change = pd.DataFrame([[0.0, np.nan], [np.nan, 0.0]], index=["a", "b"], columns=["a", "b"])
    chart = pair_matrices({"cat": change, "dog": pd.DataFrame()}, "Poses")
    assert [panel.title for panel in chart.panels] == ["cat"]
    assert chart.panels[0].values == ((0.0, None), (None, 0.0))


@pytest.mark.parametrize(("n_shapes", "per_row"), [(1, 1), (4, 4), (5, 3), (9, 3)])
def test_many_matrices_are_spread_over_rows_of_about_the_same_length(n_shapes, per_row):
    change = pd.DataFrame([[0.0, 3.0], [3.0, 0.0]], index=["a", "b"], columns=["a", "b"])
    assert pair_matrices({str(shape): change for shape in range(n_shapes)}, "Poses").per_row == per_row


def test_means_of_many_methods_have_a_row_each_named_by_what_tells_them_apart():
    names = ["HeatWalk", "HeatWalkRobust", "HeatWalkRobust (merge=False)", "HeatWalkRobust (fair=False)"]
    frame = pd.DataFrame({"segmenter": names, "mean": [9.0, 2.0, np.nan, 4.0], "ci_low": 1.0, "ci_high": 10.0})
    chart = method_means({"all": frame.assign(published=[7.0, np.nan, np.nan, np.nan]), "cat": frame}, "Poses", "", "A")
    assert [panel.x.label for panel in chart.panels] == ["all", "cat"]
    assert {panel.y.categories for panel in chart.panels} == {
        ("HeatWalk", "HeatWalkRobust", "merge=False", "fair=False")
    }
    (computed, published), (alone,) = (panel.dots for panel in chart.panels)
    assert computed == alone
    assert (computed.values, computed.low[0], computed.high[0]) == ((9.0, 2.0, None, 4.0), 1.0, 10.0)
    assert (published.categories, published.values, published.role) == (("HeatWalk",), (7.0,), "published")


def test_scores_of_variants_of_one_method_are_named_by_what_tells_them_apart():
    names = ["Humans", "HeatWalk", "HeatWalk (merge=True)", "HeatWalk (fair=True)"]
    scores = pd.DataFrame({"method": [*names, "HeatWalk"], "source": [*["computed"] * 4, "smith"]})
    scores = scores.assign(gce=0.2, gce_low=np.nan, gce_high=np.nan)
    (panel,) = method_scores(Table("table", scores), [Column(name="gce", heading="GCE")], "Table 1").panels
    assert panel.y.categories == ("Humans", "HeatWalk", "merge=True", "fair=True")
    assert panel.dots[0].categories == panel.y.categories


@pytest.mark.parametrize(("published", "label"), [(Published("source", "Smith 2011"), "Smith 2011"), (None, "smith")])
def test_scores_are_grouped_by_their_source_with_the_computed_ones_first(published, label):
    scores = pd.DataFrame({"method": ["Humans", "HeatWalk", "HeatWalk"], "source": ["smith", "smith", "computed"]})
    scores = scores.assign(gce=[0.1, 0.2, 0.3], gce_low=[np.nan, np.nan, 0.25], gce_high=[np.nan, np.nan, 0.35])
    metric = Column(name="gce", heading="GCE")
    (panel,) = method_scores(Table("table", scores, published=published), [metric], "Table 1").panels
    assert panel.y.categories == ("Humans", "HeatWalk")
    computed, other = panel.dots
    assert (computed.label, computed.categories, computed.values) == ("computed", ("HeatWalk",), (0.3,))
    assert (computed.low, computed.high, computed.role) == ((0.25,), (0.35,), "mean")
    assert (other.label, other.values, other.low, other.role) == (label, (0.1, 0.2), (None, None), "published")
