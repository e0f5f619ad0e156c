import dataclasses
import os
import subprocess
import sys

import numpy as np
import pandas as pd
import pytest
from matplotlib.text import Text
from PIL import Image

from studies.columns import Column, Table
from studies.figures.charts import (
    Axis,
    Chart,
    Panel,
    Series,
    level_curve,
    method_scores,
    pair_matrices,
    segment_counts,
)
from studies.figures.drawing import NO_CHANGE, NOTHING, draw, save
from studies.figures.style import PUBLISHED_MARKERS, SUBTITLE, TITLE, TWO_COLUMNS
from tests.studies.figures.samples import CHARTS, INTERVALS, level_table, rows_of_levels, rows_of_times


@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
def test_a_chart_is_a_pdf_and_a_png_of_300_dpi_with_the_same_bytes_again(chart, tmp_path):
    save(draw(chart), tmp_path / "first.png")
    save(draw(chart), tmp_path / "second.png")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["first.pdf", "first.png", "second.pdf", "second.png"]
    for suffix in ("pdf", "png"):
        assert (tmp_path / f"first.{suffix}").read_bytes() == (tmp_path / f"second.{suffix}").read_bytes()
    with Image.open(tmp_path / "first.png") as image:
        assert round(image.info["dpi"][0]) == 300
        assert image.width <= 300 * TWO_COLUMNS


@pytest.fixture(scope="module", params=CHARTS.values(), ids=CHARTS)
def chart_and_figure(request):
    """A chart, and its figure with everything in its place."""
    figure = draw(request.param)
    figure.draw_without_rendering()
    return request.param, figure


def test_every_text_of_a_chart_is_inside_the_figure_and_touches_no_other(chart_and_figure):
    chart, figure = chart_and_figure
    texts = set(figure.findobj(Text))
    for axes in figure.axes:
        for axis in (axes.xaxis, axes.yaxis):  # which have ticks beyond their ends as well, and do not draw them
            low, high = sorted(axis.get_view_interval())
            for tick in (*axis.get_major_ticks(), *axis.get_minor_ticks()):
                texts -= set() if low <= tick.get_loc() <= high else {tick.label1, tick.label2}
    shown = [text for text in texts if text.get_visible() and text.get_text().strip()]
    boxes = [text.get_window_extent() for text in shown if text.get_rotation() in (0, 90)]
    assert chart.title in [text.get_text() for text in shown]
    for i, box in enumerate(boxes):
        assert box.x0 >= -1
        assert box.y0 >= -1
        assert box.x1 <= figure.bbox.width + 1
        assert box.y1 <= figure.bbox.height + 1
        assert not any(_overlap(box, other) for other in boxes[:i])


def _overlap(box, other):
    """Whether boxes have more than the rounding of a pixel in common."""
    width = min(box.x1, other.x1) - max(box.x0, other.x0)
    height = min(box.y1, other.y1) - max(box.y0, other.y0)
    return width > 1 and height > 1


@pytest.mark.parametrize("levels", [[0.1, 0.25, 0.5, 0.75], [0.75, 0.5, 0.25, 0.1]])
def test_every_level_that_has_room_has_its_number(levels):
    rows = rows_of_levels(levels, 1)
    (axes,) = draw(level_curve(level_table("decimation", levels), rows, "kept", "Decimation")).axes
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0.1", "0.25", "0.5", "0.75"]
    assert {text.get_rotation() for text in axes.get_xticklabels()} == {0}


def test_numbers_of_levels_that_would_touch_are_slanted():
    levels = [0.0588, 0.1765, 0.2941, 0.4706, 0.5294]
    (axes,) = draw(level_curve(level_table("shots", levels), rows_of_levels(levels, 1), "spikes", "Shots")).axes
    assert [text.get_text() for text in axes.get_xticklabels()] == [f"{level:g}" for level in levels]
    assert {text.get_rotation() for text in axes.get_xticklabels()} == {45}


def test_a_number_that_would_touch_even_when_slanted_is_left_out_with_its_tick():
    levels = [0.5, 0.501, 1.0]
    (axes,) = draw(level_curve(level_table("shots", levels), rows_of_levels(levels, 1), "spikes", "Shots")).axes
    assert axes.get_xticks().tolist() == [0.5, 1.0]
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0.5", "1"]


def test_levels_that_a_linear_axis_would_crowd_together_have_a_logarithmic_one():
    levels = [0.001, 0.01, 0.1, 1.0]
    (axes,) = draw(level_curve(level_table("shots", levels), rows_of_levels(levels, 1), "spikes", "Shots")).axes
    assert axes.get_xscale() == "log"
    assert [text.get_text() for text in axes.get_xticklabels()] == ["0.001", "0.01", "0.1", "1"]


@pytest.mark.parametrize("times", [(0.5, 1.0, 4.0), (0.9, 0.95, 1.0), (0.61, 0.64), (1.0,), (0.013, 1.0, 80.0)])
@pytest.mark.parametrize("counts", [(3, 4), (7, 7), (2, 900)])
def test_every_tick_of_a_logarithmic_axis_has_its_number_and_there_are_at_least_two_on_an_axis_of_any_length(
    times, counts
):
    rows = pd.DataFrame(
        {"model": str(i), "level": time, "unit": "paper", "n_segments": count + i}
        for i, count in enumerate(counts)
        for time in times
    )
    figure = draw(segment_counts(rows, [], "Times"))
    figure.draw_without_rendering()
    axes = figure.axes[0]
    for axis, values in ((axes.xaxis, times), (axes.yaxis, counts)):
        low, high = axis.get_view_interval()
        ticks = [tick for tick in axis.get_major_ticks() if low <= tick.get_loc() <= high]
        assert all(float(tick.label1.get_text().replace(",", "")) == tick.get_loc() for tick in ticks)
        assert len(ticks) >= min(2, len(set(values)))
        assert not [tick for tick in axis.get_minor_ticks() if low <= tick.get_loc() <= high and tick.get_visible()]


def test_a_tick_that_is_drawn_has_a_label(chart_and_figure):
    _, figure = chart_and_figure
    panels = [axes for axes in figure.axes if axes.get_label() != "<colorbar>"]
    for axis in (axis for axes in panels for axis in (axes.xaxis, axes.yaxis)):
        low, high = sorted(axis.get_view_interval())
        for tick in axis.get_major_ticks():
            if low <= tick.get_loc() <= high and tick.tick1line.get_visible():
                assert tick.label1.get_text()


@pytest.mark.filterwarnings("error")
def test_a_study_of_which_every_trial_failed_has_room_for_published_values(tmp_path):
    levels = [0.1, 0.5]
    rows = pd.DataFrame([{"model": "m", "level": level, "change_percentage": np.nan} for level in levels])
    table = level_table("holes", levels, published=[2.0, 7.0])
    nothing = table.replace(frame=table.frame.assign(mean=np.nan, ci_low=np.nan, ci_high=np.nan))
    figure = draw(level_curve(nothing, rows, "holes", "Holes"))
    save(figure, tmp_path / "failed.png")
    (axes,) = figure.axes
    assert axes.get_ylim()[1] >= 7
    assert NOTHING in [text.get_text() for text in axes.texts]
    (legend,) = figure.legends
    assert "mean, 95 % interval (0 models)" in [text.get_text() for text in legend.get_texts()]


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(
    "chart",
    [
        pair_matrices({"cat": pd.DataFrame()}, "Poses"),
        segment_counts(rows_of_times().iloc[:0], INTERVALS, "Times"),
        Chart("Nothing", ()),
    ],
    ids=["matrices", "times", "nothing"],
)
def test_a_chart_without_data_can_be_drawn(chart, tmp_path):
    save(draw(chart), tmp_path / "empty.png")
    assert (tmp_path / "empty.png").stat().st_size > 0


@pytest.mark.parametrize("segmenters", [("walk",), ("walk", "cuts", "spectral")])
def test_every_mean_and_the_whole_of_every_interval_are_within_the_axes(segmenters):
    table = level_table("holes", [1.0, 2.0, 4.0], segmenters=segmenters)
    (axes,) = draw(level_curve(table, rows_of_levels([1.0, 2.0], 1, segmenters), "holes", "Holes")).axes
    assert axes.get_ylim()[0] == 0
    assert axes.get_ylim()[1] > table.frame["ci_high"].max()


def test_intervals_of_several_segmenters_at_one_level_are_next_to_each_other():
    table = level_table("holes", [1.0, 2.0], segmenters=("walk", "cuts"))
    figure = draw(level_curve(table, rows_of_levels([1.0, 2.0], 1), "holes", "Holes"))
    figure.draw_without_rendering()
    first, second = (bars.lines[0] for bars in figure.axes[0].containers)
    x = [line.get_transform().transform(np.column_stack(line.get_data()))[:, 0] for line in (first, second)]
    assert (x[1] - x[0] > 2 * figure.dpi / 72).all()
    assert first.get_color() != second.get_color()
    assert first.get_marker() != second.get_marker()
    assert first.get_linestyle() != second.get_linestyle()


def test_the_legend_names_what_is_there_once_in_the_order_of_the_data():
    (legend,) = draw(CHARTS["panels"]).legends
    assert [text.get_text() for text in legend.get_texts()] == ["mean, 95 % interval", "median", "Smith 2011"]
    (legend,) = draw(CHARTS["curves of two segmenters"]).legends
    assert [text.get_text() for text in legend.get_texts()] == ["walk", "cuts", "Smith 2011"]
    assert legend.get_title().get_text() == "mean, 95 % interval (12 models)"


def test_a_figure_does_not_depend_on_the_settings_of_the_user(tmp_path):
    import matplotlib

    chart = CHARTS["panels"]
    save(draw(chart), tmp_path / "first.png")
    with matplotlib.rc_context({"font.size": 20, "lines.linewidth": 9, "figure.facecolor": "red"}):
        save(draw(chart), tmp_path / "second.png")
    assert (tmp_path / "first.png").read_bytes() == (tmp_path / "second.png").read_bytes()


CHILD = """
import sys
from pathlib import Path
from studies.figures import charts, gallery, method_figures, pictures, style
heavy = {{"matplotlib", "pyvista", "PIL", "vtkmodules"}} & set(sys.modules)
assert not heavy, heavy
from studies.figures.charts import Axis, Chart, Panel, Series
chart = Chart("Title", (Panel(Axis("x"), Axis("y"), series=(Series("mean", (1.0, 2.0), (1.0, 3.0)),)),))
from studies.figures.drawing import draw, save
save(draw(chart), Path({path!r}))
assert "matplotlib.pyplot" not in sys.modules
import numpy, trimesh
from studies.figures.layout import Tile, lay_out
from studies.figures.surfaces import surface
from studies.figures.views import view_of
box = trimesh.creation.box()
picture = surface(box, view_of(box.vertices), field=numpy.arange(8.0), size=(120, 100))
save(lay_out([[Tile(picture, "box")]]), Path({path!r}).with_name("box.png"), "box")
import matplotlib
assert matplotlib.rcParams._get("backend") == {backend!r}, matplotlib.rcParams._get("backend")
"""


def test_charts_load_no_drawing_library_and_no_backend_is_used_or_changed(tmp_path):
    """In a child process, with the backend of a notebook whose module is not installed."""
    backend = "module://no_such_module.backend_inline"
    code = CHILD.format(path=str(tmp_path / "chart.png"), backend=backend)
    done = subprocess.run(
        [sys.executable, "-c", code], env=os.environ | {"MPLBACKEND": backend}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert {path.name for path in tmp_path.iterdir()} == {"chart.png", "chart.pdf", "box.png"}


@pytest.mark.parametrize("chart", CHARTS.values(), ids=CHARTS)
def test_every_chart_has_its_title_in_the_same_form(chart):
    figure = draw(dataclasses.replace(chart, title="Other", subtitle="how to read it"))
    title, subtitle = figure.texts
    assert [title.get_text(), subtitle.get_text()] == ["Other", "how to read it"]
    assert (title.get_fontsize(), subtitle.get_fontsize()) == (TITLE, SUBTITLE)
    figure.draw_without_rendering()
    highest = max(axes.get_tightbbox().y1 for axes in figure.axes)
    assert highest <= subtitle.get_window_extent().y0 <= title.get_window_extent().y0


def test_values_that_equal_the_published_ones_are_not_hidden_by_them():
    levels = [0.5, 1.5, 10.0]
    table = level_table("scaling", levels, published=[0.0, 0.0, 0.0])
    nothing = table.replace(frame=table.frame.assign(mean=0.0, ci_low=0.0, ci_high=0.0))
    rows = rows_of_levels(levels, 2).assign(change_percentage=0.0)
    (axes,) = draw(level_curve(nothing, rows, "scale", "Scaling")).axes
    published = next(line for line in axes.lines if line.get_marker() == PUBLISHED_MARKERS[0])
    mean = axes.containers[0].lines[0]
    assert published.get_markerfacecolor() == "white"
    assert published.get_markersize() > mean.get_markersize()
    assert published.get_zorder() < mean.get_zorder()
    assert not mean.get_clip_on()
    assert NO_CHANGE in [text.get_text() for text in axes.texts]


LONG = "my_great_new_method_with_many_options_and_a_longer_name_than_there_is_room_for_0"
NAMES = {
    "long": [f"{LONG}{i}" for i in range(4)],
    "Chinese": [f"象的分割方法{i}" * 9 for i in range(4)],
    "odd": ["$a$", "a\tb", "Küche", "🐈"],
}


@pytest.mark.parametrize("names", NAMES.values(), ids=NAMES)
@pytest.mark.filterwarnings("error")
def test_names_of_any_length_and_script_leave_the_figure_whole(names, tmp_path):
    change = pd.DataFrame(1.0, index=names, columns=names)
    scores = pd.DataFrame({"method": names, "source": "computed", "gce": 0.2, "gce_low": 0.1, "gce_high": 0.3})
    levels = [1.0, 2.0]
    charts = [
        pair_matrices(dict.fromkeys(names, change), names[0]),
        method_scores(Table("table", scores), [Column(name="gce", heading="GCE")], names[1]),
        level_curve(
            level_table("holes", levels, segmenters=names), rows_of_levels(levels, 2, names), names[2], names[3]
        ),
    ]
    for chart in charts:
        figure = draw(chart)
        figure.draw_without_rendering()
        legends = [text for legend in figure.legends for text in legend.get_texts()]
        ticks = [text for axes in figure.axes for text in axes.get_yticklabels()]
        for text in [*figure.texts, *legends, *ticks]:
            box = text.get_window_extent()
            assert box.x0 >= -1
            assert box.x1 <= figure.bbox.width + 1
        assert min(axes.get_window_extent().width for axes in figure.axes) > 5
        save(figure, tmp_path / "names.png")


def logarithmic(x, ticks=(), y=None):
    line = Series("mean", x=tuple(x), y=tuple(y or range(1, len(x) + 1)))
    return draw(Chart("Times", (Panel(Axis("time", ticks, logarithmic=True), Axis("n"), series=(line,)),))).axes[0]


@pytest.mark.parametrize(
    ("x", "labels"),
    [
        ([0.6, 0.75, 0.9], ["0.6", "0.75", "0.9"]),
        ([12.0, 17.0], ["12", "17"]),
        ([3.0], ["3"]),
        ([0.5, 3.0, 30.0], ["0.5", "1", "2", "5", "10", "20"]),
    ],
)
def test_a_logarithmic_axis_labels_every_level_unless_round_numbers_suffice(x, labels):
    axes = logarithmic(x)
    assert axes.get_xscale() == "log"
    assert [text.get_text() for text in axes.get_xticklabels()] == labels
    assert [text.get_text() for text in logarithmic(x, tuple(x)).get_xticklabels()] == [f"{each:g}" for each in x]


def test_levels_of_a_logarithmic_axis_that_are_crowded_are_labelled_where_there_is_room():
    axes = logarithmic([1 + i / 50 for i in range(50)], tuple(1 + i / 50 for i in range(50)))
    labels = [text.get_text() for text in axes.get_xticklabels()]
    assert all(labels)
    assert 3 < len(labels) < 30
