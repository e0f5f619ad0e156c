"""Metrics are discovered: a file in studies/metrics is all that a new column needs."""

import importlib
import sys

import numpy as np
import pytest

from studies import metrics
from studies.metrics import Comparison, change_percentage, psb, rand_index_error, registry, van_dongen
from tests.helpers.meshes import bundled

SHIPPED = ["change_percentage", "van_dongen", "rand_index_error"]

PURITY = '''
"""Purity, as the recipe for a metric adds it."""

import numpy as np

from studies.columns import Column
from studies.metrics.contingency import contingency_table
from studies.metrics.metric import Metric


def purity(comparison):
    table = contingency_table(comparison.reference, comparison.labels)
    return float(table.max(axis=0).sum() / table.sum())


METRICS = (Metric(column=Column(name="purity", format=".3f", lower_is_better=False, help="Purity."), function=purity),)
'''


@pytest.fixture
def added(tmp_path, monkeypatch):
    """A function: file name, text -> the package studies.metrics finds that file too."""
    monkeypatch.setattr(metrics, "__path__", [*metrics.__path__, str(tmp_path)])
    names = []

    def add(name, text):
        (tmp_path / f"{name}.py").write_text(text)
        names.append(name)
        importlib.invalidate_caches()
        registry._discovered.cache_clear()

    yield add
    registry._discovered.cache_clear()
    for name in names:
        sys.modules.pop(f"studies.metrics.{name}", None)
        monkeypatch.delattr(metrics, name, raising=False)


def test_the_shipped_metrics_come_first_in_their_order():
    assert list(metrics.registered())[:3] == SHIPPED
    assert [(column.title, column.format) for column in metrics.columns()[:3]] == [
        ("CP %", ".2f"),
        ("van Dongen", ".2f"),
        ("Rand error", ".4f"),
    ]


def test_comparing_computes_every_metric_of_the_two_segmentations():
    rng = np.random.default_rng(0)
    a, b = rng.integers(0, 5, (2, 200))
    expected = {
        "change_percentage": change_percentage(a, b),
        "van_dongen": van_dongen(a, b),
        "rand_index_error": rand_index_error(a, b),
    }
    values = metrics.compare(Comparison(a, b))
    assert {name: values[name] for name in SHIPPED} == expected
    assert list(values) == list(metrics.registered())


def test_a_file_in_the_package_adds_a_column_after_the_shipped_ones(added):
    before = list(metrics.registered())
    added("a_purity", PURITY)
    after = list(metrics.registered())
    assert after[:3] == SHIPPED
    assert after.index("purity") > 2
    assert [name for name in after if name != "purity"] == before
    values = metrics.compare(Comparison(np.array([0, 0, 1, 1]), np.array([0, 0, 0, 1])))
    assert values["purity"] == 0.75
    assert metrics.columns()[after.index("purity")].lower_is_better is False


def test_metrics_after_the_shipped_ones_are_in_the_order_of_their_files(added):
    added("b_purity", PURITY)
    added("a_coverage", PURITY.replace("purity", "coverage"))
    names = list(metrics.registered())
    assert names.index("coverage") < names.index("purity")


def test_a_metric_that_needs_a_mesh_is_missing_without_one(added):
    added("area", PURITY.replace("function=purity", "function=lambda c: float(len(c.points)), needs_mesh=True"))
    labels, cow = np.zeros(3, int), bundled("cow")
    assert metrics.compare(Comparison(labels, labels))["purity"] is None
    assert metrics.compare(Comparison(labels, labels, cow, np.arange(3)))["purity"] == 3


def test_two_metrics_of_one_column_are_an_error_that_names_both_files(added):
    added("purity", PURITY)
    added("zzz", PURITY)
    with pytest.raises(ValueError, match=r"'purity' is defined twice, in studies/metrics/purity\.py and zzz\.py"):
        metrics.registered()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ('dtype="int64"', "dtype int64; it must be one that can hold the missing values of trials that fail: float64"),
        ('dtype="number"', "has the dtype number; it must be one"),
        ('template="{purity:.2f}"', "has a template"),
        ('unit="%", dtype="string"', "the format '.3f' cannot show 'x'"),
    ],
)
def test_a_column_that_could_not_be_stored_or_shown_is_an_error_that_names_it_and_its_file(added, change, message):
    added("purity", PURITY.replace('help="Purity."', f'help="Purity.", {change}'))
    with pytest.raises(ValueError, match=rf"the column 'purity' in studies/metrics/purity\.py.*{message}"):
        metrics.registered()


def test_a_list_of_metrics_is_an_error_that_names_the_file(added):
    added("purity", PURITY.replace("METRICS = (", "METRICS = [").replace("function=purity),)", "function=purity)]"))
    with pytest.raises(TypeError, match=r"METRICS in studies/metrics/purity\.py must be a tuple of Metric"):
        metrics.registered()


def test_the_benchmarks_columns_are_those_of_its_values_in_their_order():
    cow = bundled("cow")
    labels = np.arange(len(cow.faces)) % 3
    assert [column.name for column in psb.COLUMNS] == list(psb.evaluate(cow, labels, labels))
    headings = [column.title for column in psb.COLUMNS]
    assert headings[:3] == ["CD", "RI", "HD"]
    assert headings[5:7] == ["GCE", "LCE"]
    assert {(column.format, column.lower_is_better) for column in psb.COLUMNS} == {(".3f", True)}
