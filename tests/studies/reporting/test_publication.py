import numpy as np
import pandas as pd
import pytest

from studies.columns import Column, Table
from studies.experiments.experiment import PUBLISHED
from studies.reporting.claims import Claim
from studies.reporting.publication import Publication
from studies.reporting.results import publication_of
from studies.reporting.text import markdown_page


@pytest.fixture
def publication():
    return Publication.load("heat_walk_2011")


def table(part="holes", segmenter=None, level=58.0):
    frame = pd.DataFrame(
        {"part": [part], "level": [level], "unit": ["triangles"], "mean": [0.9], "ci_low": [0.5], "ci_high": [1.3]}
    )
    if segmenter:
        frame.insert(0, "segmenter", segmenter)
    columns = (Column(name="level", format="g"), Column(name="mean", format=".2f"), PUBLISHED)
    return Table("table", frame, columns, notes="Notes.", value="mean")


def rows(part="holes", perturbation="holes"):
    return pd.DataFrame({"part": [part], "perturbation": [perturbation]})


def test_the_published_value_of_a_level_is_in_a_column_of_its_own(publication):
    annotated = publication.annotate(table(), rows())
    assert annotated.frame["paper"].tolist() == [1.23]
    assert [column.title for column in annotated.visible()] == ["level", "mean", "paper"]
    assert annotated.cells() == [["58", "0.90", "1.23"]]
    assert annotated.published.column == "paper"
    assert "| 58 | 0.90 | 1.23 |" in markdown_page("Holes", annotated)


@pytest.mark.parametrize(
    ("shown", "of"),
    [
        (table(level=59.0), rows()),
        (table(part="mine"), rows(part="mine")),
        (table(), rows(perturbation="my_holes")),
        (table(segmenter="other"), rows()),
    ],
)
def test_another_level_part_perturbation_or_method_has_no_published_value(publication, shown, of):
    annotated = publication.annotate(shown, of)
    assert annotated.frame["paper"].isna().all()
    assert publication.claims([annotated], of) == []


def shows_published(annotated):
    column = next(column for column in annotated.columns if column.name == "paper")
    assert column.shown == annotated.frame["paper"].notna().any()
    return column.shown


@pytest.mark.parametrize(
    ("segmenters", "own"),
    [
        ([{"_target_": "studies.segmenters.HeatWalk", "time": 1.0}], True),
        ([{"_target_": "studies.segmenters.HeatWalk", "time": 1, "time_unit": "fiedler"}], True),  # another reading
        ([{"_target_": "studies.segmenters.HeatWalk"}], True),
        ([{"_target_": "studies.segmenters.HeatWalk", "time": 0.5}], False),
        ([{"_target_": "my_package.my_method", "k": 4}], False),
        ([{"_target_": "my_package.my_method"}, {"_target_": "studies.segmenters.HeatWalk"}], True),
    ],
)
def test_published_values_are_next_to_the_publications_own_method_with_its_settings_alone(publication, segmenters, own):
    annotated = publication.for_segmenters(segmenters).annotate(table(), rows())
    assert shows_published(annotated) is own
    assert annotated.notes.startswith("Notes. Paper: ") is own
    assert bool(publication.for_segmenters(segmenters).claims([annotated], rows())) is own


def test_a_study_of_another_segmenter_has_neither_published_values_nor_a_note(publication):
    of = rows().assign(segmenter="my_method")
    annotated = publication.annotate(table(), of)
    assert annotated.frame["paper"].isna().all()  # stored, so that the columns do not depend on the segmenter
    assert not shows_published(annotated)
    assert annotated.notes == "Notes."
    assert annotated.published is None
    assert publication.claims([annotated], of) == []


def test_a_table_without_a_column_for_published_values_stays_as_it_is(publication):
    own = table().replace(columns=table().columns[:2])
    assert publication.annotate(own, rows()) is own


@pytest.mark.parametrize(
    ("record", "own"),
    [
        ({"segmenter": {"_target_": "studies.segmenters.HeatWalk", "time": 1.0}}, True),
        ({"segmenter": {"_target_": "studies.segmenters.HeatWalk", "time": 2.0}}, False),
        ({"segmenter": {"_target_": "my.method"}, "segmenters": ["heat_walk", "my.other"]}, True),
        ({"segmenter": {"_target_": "studies.segmenters.HeatWalk", "time": 2}, "segmenters": ["heat_walk"]}, False),
        ({"segmenter": {"_target_": "studies.segmenters.HeatWalk"}, "segmenters": ["slabs", "my.other"]}, False),
        ({"segmenter": {}, "segmenters": [{"_target_": "studies.segmenters.HeatWalk", "time": 3}]}, False),
    ],
)
def test_a_stored_configuration_tells_whether_the_publications_method_was_run(record, own):
    found = publication_of(record | {"publication": "heat_walk_2011"})
    assert shows_published(found.annotate(table(), rows())) is own
    assert publication_of(record | {"publication": None}) is None


def test_without_a_publication_there_is_no_column():
    assert [column.title for column in table().visible()] == ["level", "mean"]


def test_a_claim_says_what_it_is_about(publication):
    (claim,) = publication.claims([publication.annotate(table(), rows())], rows())
    assert claim == Claim("Holes: 58 triangles", 1.23, 0.9, 0.5, 1.3, " %")
    assert claim.cells() == ["Holes: 58 triangles", "1.23 %", "0.90 %", "0.50 – 1.30", "same"]


def test_a_claim_in_words_has_no_verdict(publication):
    shown = table(part="decimation", level=0.25)
    of = rows("decimation", "decimation")
    (claim,) = publication.claims([publication.annotate(shown, of)], of)
    assert claim.verdict == "–"
    assert "by and large" in claim.text


def claim(published, low, high, **options):
    return Claim("x", published, (low + high) / 2, low, high, **options)


@pytest.mark.parametrize(
    ("found", "verdict"),
    [
        (claim(2.0, 1.0, 3.0), "same"),
        (claim(2.0, 1.0, 1.5), "better"),
        (claim(2.0, 2.5, 3.0), "worse"),
        (claim(2.0, 2.5, 3.0, higher_is_better=True), "better"),
        (claim(2.0, 1.0, 1.5, higher_is_better=True), "worse"),
        (claim(0.267, 0.2672, 0.3, digits=3), "same"),  # to the digits that the paper gives
        (claim(0.0, 0.0, 0.0), "same"),
        (claim(np.nan, 1.0, 2.0), "–"),
        (Claim("x", 2.0, 2.0, np.nan, np.nan), "same"),
        (Claim("x", 2.0, 2.1, np.nan, np.nan), "differs"),
    ],
)
def test_the_verdict_tells_where_the_published_value_is(found, verdict):
    assert found.verdict == verdict
