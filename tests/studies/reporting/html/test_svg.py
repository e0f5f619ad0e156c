import math
import re

import numpy as np
import pytest

from studies.figures.charts import Axis, Chart, Dots, HeatMap, Panel, Series
from studies.reporting.html.svg import FAR, Mark, drawings
from tests.studies.figures.samples import CHARTS


def circles(svg):
    """Places of the points in a drawing, by what they tell on hover."""
    found = re.findall(r'<circle class="[^"]*" cx="([^"]*)" cy="([^"]*)"[^>]*data-tip="([^"]*)"', svg)
    return {tip: (float(x), float(y)) for x, y, tip in found}


def line(x, y, **options):
    return Chart("t", (Panel(Axis("level"), Axis("CP", **options), series=(Series("mean", x, y),)),))


def test_points_are_where_their_values_are():
    x, y = (1.0, 2.0, 4.0, 8.0), (10.0, 0.0, 30.0, 20.0)
    [drawing] = drawings(line(x, y, from_zero=True))
    places = np.array(list(circles(drawing.svg).values()))
    across, up = np.polyfit(x, places[:, 0], 1), np.polyfit(y, places[:, 1], 1)
    np.testing.assert_allclose(np.polyval(across, x), places[:, 0], atol=0.1)
    np.testing.assert_allclose(np.polyval(up, y), places[:, 1], atol=0.1)
    assert across[0] > 0 > up[0]


def test_equal_ratios_are_equally_far_apart_on_a_logarithmic_axis():
    [drawing] = drawings(line((1.0, 2.0, 3.0), (1.0, 10.0, 100.0), logarithmic=True))
    [low, middle, high] = [y for _, y in circles(drawing.svg).values()]
    assert middle - low == pytest.approx(high - middle, abs=0.2)


def test_an_axis_is_compressed_where_single_trials_are_far_above_the_line():
    chart = line((1.0, 2.0), (1.0, 4.0), from_zero=True)
    marks = [Mark(1.0, 16.0 * FAR, "ant: 48", scene=3), Mark(2.0, 0.0, "cow: 0")]
    [drawing] = drawings(chart, {0: marks})
    assert "square-root scale" in drawing.svg
    y = {tip: place[1] for tip, place in circles(drawing.svg).items()}
    unit = y["cow: 0"] - y["mean: 1 → 1"]
    assert y["cow: 0"] - y["mean: 2 → 4"] == pytest.approx(2 * unit, abs=0.2)
    assert y["cow: 0"] - y["ant: 48"] == pytest.approx(math.sqrt(48) * unit, abs=0.5)
    assert drawing.svg.count('data-scene="3"') == 1
    assert "square-root scale" not in drawings(chart)[0].svg


def test_missing_values_are_not_drawn():
    [drawing] = drawings(line((1.0, 2.0, 3.0), (1.0, None, 3.0)))
    assert list(circles(drawing.svg)) == ["mean: 1 → 1", "mean: 3 → 3"]


def test_names_are_escaped_everywhere():
    name = '</script><img src=x onerror="alert(1)">'
    panel = Panel(
        Axis(name, from_zero=True), Axis(categories=(name,)), dots=(Dots(name, (name,), (1.0,), (0.5,), (2.0,)),)
    )
    heat_map = HeatMap(name, (name,), (name,), ((1.0,),), 0.0, 1.0, name)
    curve = Panel(Axis(name), Axis(name), name, (Series(name, (1.0,), (2.0,)),))
    for panels in ((panel,), (heat_map,), (curve,)):
        [drawing] = drawings(Chart(name, panels), {0: [Mark(1.0, 2.0, name)]})
        assert "<img" not in drawing.svg
        assert "</script" not in drawing.svg


def test_every_cell_of_a_heat_map_tells_its_value():
    heat_map = HeatMap("cat", ("a", "b"), ("c", "d"), ((0.0, 3.5), (None, 12.0)), 0.0, 12.0)
    [drawing] = drawings(Chart("t", (heat_map,)))
    tips = re.findall(r'data-row="(\d)" data-column="(\d)" data-tip="([^"]*)"', drawing.svg)
    assert tips == [("0", "0", "a, c: 0"), ("0", "1", "a, d: 3.5"), ("1", "0", "b, c: –"), ("1", "1", "b, d: 12")]


@pytest.mark.parametrize("name", CHARTS)
def test_every_kind_of_chart_is_well_formed_and_has_all_panels(name):
    from xml.etree import ElementTree

    chart = CHARTS[name]
    made = drawings(chart)
    assert len(made) == len(chart.panels)
    for drawing in made:
        root = ElementTree.fromstring(drawing.svg)
        assert len(root) > 3
        assert "nan" not in drawing.svg
