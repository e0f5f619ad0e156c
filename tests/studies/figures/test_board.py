"""The charts of leaderboards of every size: nothing is cropped, covered or left out."""

import functools
import itertools

import pytest
from matplotlib.text import Text

from studies.experiments.change import Part
from studies.experiments.leaderboard.scores import Options, Scores
from studies.figures import board
from studies.figures.board_drawing import draw
from studies.figures.drawing import draw as draw_any
from tests.studies.experiments.leaderboard.boards import drawn, rows_of

METHODS = (
    "HeatWalk", "Normalized cuts", "Spectral clustering", "Shape diameter function", "HKS persistence", "GPS k-means",
    "K-means", "Random walks", "Fitting primitives", "Core extraction", "Randomized cuts", "Convex decomposition",
    "OneSegment", "Voronoi", "Felzenszwalb on normals", "Nodal domains", "Eigenfunction persistence",
    "Diffusion distance",
)  # fmt: skip
PARTS = ("holes", "rotation", "normal_noise", "shot_noise", "self_intersections", "scaling", "view", "welding")
TITLE = "Leaderboard on synthetic"
LARGE, SMALL = (METHODS, PARTS), (METHODS[:3], ("holes", "rotation"))


@functools.cache
def scores_of(methods, parts):
    return Scores(drawn(methods, parts, 3), Options(controls=("rotation", "scaling")))


def charts_of(methods, parts):
    named = {name: Part(title=name.replace("_", " ").capitalize()) for name in parts}
    return board.charts(scores_of(methods, parts), named, TITLE)


CHARTS = {
    f"{name} of {size}": chart
    for size, options in (("many", LARGE), ("few", SMALL))
    for name, chart in charts_of(*options).items()
}


@pytest.mark.parametrize("name", CHARTS)
def test_every_text_is_inside_the_figure_and_touches_no_other(name):
    figure = draw_any(CHARTS[name])
    figure.draw_without_rendering()
    hidden = set()
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):
            low, high = sorted(axis.get_view_interval())
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                hidden |= set() if low <= tick.get_loc() <= high else {tick.label1, tick.label2}
    texts = [each for each in set(figure.findobj(Text)) - hidden if each.get_visible() and each.get_text().strip()]
    boxes = [text.get_window_extent() for text in texts]
    for text, box in zip(texts, boxes, strict=True):
        assert min(box.x0, box.y0) >= -1, text
        assert box.x1 <= figure.bbox.width + 1, text
        assert box.y1 <= figure.bbox.height + 1, text
    for (one, a), (other, b) in itertools.combinations(zip(texts, boxes, strict=True), 2):
        across, up = min(a.x1, b.x1) - max(a.x0, b.x0), min(a.y1, b.y1) - max(a.y0, b.y0)
        assert not (across > 1 and up > 2), (one.get_text(), other.get_text())


def test_the_matrix_has_the_numbers_and_marks_of_the_scores():
    scores = scores_of(*LARGE)
    (matrix,) = CHARTS["heat_map of many"].panels
    order = scores.board["segmenter"].tolist()
    assert matrix.columns == tuple(scores.cards[name].label for name in order)
    assert matrix.first_apart == len(PARTS) - 2
    for i, part in enumerate(scores.parts):
        for j, name in enumerate(order):
            failed, value = scores.failures.loc[name, part], matrix.values[i][j]
            assert ((i, j) in matrix.marked) == bool(failed)
            assert value == pytest.approx(scores.mean_change.loc[name, part], nan_ok=True) or value is None
    assert sum(value is None for row in matrix.values for value in row) == 1  # the part that the last method lacks


def test_every_complete_method_is_a_point_by_its_kind_and_the_line_is_the_front():
    scores = scores_of(*LARGE)
    (panel,) = CHARTS["scatter of many"].panels
    kinds = {points.role: set(points.names) for points in panel.points}
    assert kinds["baseline"] == {"One segment", "Voronoi cells"}
    assert sum(map(len, kinds.values())) == len(scores.complete) == len(METHODS) - 1
    on_front = scores.board[scores.board["pareto"] == "yes"]
    assert sorted(panel.front) == sorted(zip(on_front["rand_original"], on_front["mce"], strict=True))


def test_lines_of_methods_all_look_different_and_go_through_the_means():
    scores = scores_of(*LARGE)
    chart = CHARTS["curves of many"]
    figure = draw(chart)
    lines = figure.axes[0].lines
    looks = {(line.get_color(), line.get_linestyle(), str(line._dash_pattern), line.get_marker()) for line in lines}
    assert len(looks) == len(METHODS)
    for panel, part in zip(chart.panels, scores.parts, strict=True):
        for series in panel.series:
            mean = [value for value in series.y if value is not None]
            name = next(each for each in METHODS if scores.cards[each].label == series.label)
            if mean:
                assert sum(mean) / len(mean) == pytest.approx(scores.mean_change.loc[name, part])


def test_strengths_are_in_the_order_of_the_study_whatever_the_order_of_the_rows():
    rows = rows_of({"HeatWalk": {"decimation": [[9.0], [1.0], [5.0]]}})
    rows["level"] = rows["level"].map({0.0: 0.1, 1.0: 0.9, 2.0: 0.5})
    part = Part(title="Decimation", levels=[0.9, 0.5, 0.1])
    (panel,) = board.charts(Scores(rows, Options()), {"decimation": part}, TITLE)["curves"].panels
    assert panel.series[0].y == (1.0, 5.0, 9.0)


def test_without_ground_truth_or_reference_the_charts_that_need_them_are_left_out():
    rows = rows_of({"HeatWalk": {"holes": [[1, 2]]}, "cuts": {"holes": [[2, 3]]}})
    named = {"holes": Part(title="Holes")}
    assert set(board.charts(Scores(rows, Options()), named, TITLE)) == {"curves", "heat_map", "ranks"}
    without = Scores(rows, Options(relative_to="nobody"))
    assert set(board.charts(without, named, TITLE)) == {"curves", "heat_map"}
