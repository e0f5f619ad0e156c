"""Pages of studies that were stored, that had failures, and that were cut off."""

import dataclasses
import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from studies.reporting.html import index_page, study_page, unpack
from studies.reporting.html.page import ChartBlock, Facts, TableBlock, ViewerBlock, stored_scenes
from studies.reporting.results import Results
from studies.storage import RowStore
from tests.studies.conftest import typed_command
from tests.studies.reporting.html.pages import HOSTILE, whole_page

RESULTS = Path(__file__).parents[4] / "results"


@pytest.fixture(scope="module")
def stored():
    return Results.load(RESULTS / "shot_noise" / "bundled")


def block(page, heading):
    [found] = [each for each in page.blocks if each.heading == heading]
    return found


def facts(page):
    return dict(next(each for each in page.blocks if isinstance(each, Facts)).facts)


@pytest.fixture(scope="module")
def failing(stored, tmp_path_factory):
    """A study of which two trials failed, for a reason that would be markup, in a folder of its own."""
    rows = stored.rows.copy()
    rows["model"] = rows["model"].replace({"cow": HOSTILE})
    rows.loc[[3, 7], "status"] = ["failed", "timeout"]
    rows.loc[[3, 7], "error"] = [HOSTILE, "took longer than 5 s"]
    rows.loc[[3, 7], "change_percentage"] = np.nan
    return dataclasses.replace(stored, rows=rows, folder=tmp_path_factory.mktemp("failing"))


def test_the_tables_are_those_of_the_study(stored):
    page = study_page.study_page(stored)
    for name, table in stored.report_tables.items():
        heading = "Results" if name == "table" else table.title
        shown = block(page, heading)
        assert [[cell.text for cell in row] for row in shown.rows] == table.cells()
        assert [heading.text for heading in shown.headings] == [column.title for column in table.visible()]


def test_it_says_what_was_run(stored):
    page = study_page.study_page(stored)
    found = facts(page)
    assert found["trials"] == f"{len(stored.rows):,}"
    assert found["methods"] == "HeatWalk"
    assert next(each for each in page.blocks if isinstance(each, Facts)).commands == [stored.command]


def test_every_trial_is_a_point_that_tells_its_value(stored):
    page = study_page.study_page(stored)
    [chart] = [each for each in page.blocks if isinstance(each, ChartBlock)]
    tips = re.findall(r'class="mark[^>]*data-tip="([^"]*)"', chart.drawings[0].svg)
    assert sorted(tips) == sorted(
        f"{row.model}, level {row.level:g}, repeat {row.repeat}: {row.change_percentage:.2f} %"
        for row in stored.rows.itertuples()
    )


def test_of_very_many_trials_the_means_of_models_are_points(stored, monkeypatch):
    monkeypatch.setattr(study_page, "MOST_MARKS", len(stored.rows) - 1)
    [chart] = [each for each in study_page.study_page(stored).blocks if isinstance(each, ChartBlock)]
    assert chart.drawings[0].svg.count('class="mark') == len(stored.rows.groupby(["model", "level"]))
    assert "means of each model" in chart.notes


def test_the_numbers_of_many_methods_have_no_points(stored):
    rows = pd.concat([stored.rows.assign(segmenter=f"method {i}") for i in range(9)], ignore_index=True)
    page = study_page.study_page(dataclasses.replace(stored, rows=rows))
    chart = block(page, "Chart")
    assert "single trials" not in chart.notes
    assert all(f"method {i}" in chart.drawings[0].svg for i in range(9))


def test_the_worst_cases_come_first(stored):
    shown = block(study_page.study_page(stored), "Worst cases")
    values = sorted(stored.rows["change_percentage"], reverse=True)[: len(shown.rows)]
    column = [heading.text for heading in shown.headings].index("CP %")
    assert [row[column].order for row in shown.rows] == values


def test_each_model_has_its_mean_and_its_worst(stored):
    shown = block(study_page.study_page(stored), "By model")
    for row in shown.rows:
        values = stored.rows.loc[stored.rows["model"] == row[0].text, "change_percentage"]
        found = {heading.text: cell.order for heading, cell in zip(shown.headings, row, strict=True)}
        assert found["CP %"] == pytest.approx(values.mean())
        assert (found["largest"], found["trials"], found["failed"]) == (values.max(), len(values), 0)


def test_each_model_of_a_comparison_with_people_has_the_agreement_of_every_method():
    results = Results.load(RESULTS / "table1" / "psb")
    shown = block(study_page.study_page(results), "By model: Rand Index error")
    methods = [heading.text for heading in shown.headings[2:]]
    values = results.rows.set_index(["model", "segmenter"])["rand_index_error"]
    assert len(shown.rows) == results.rows["model"].nunique()
    for model, _, *cells in shown.rows:
        assert [cell.order for cell in cells] == [values[model.text, method] for method in methods]
    first = [row[2].order for row in shown.rows]
    assert first == sorted(first, reverse=True)


def test_failed_trials_are_listed_with_their_reasons(failing):
    page = study_page.study_page(failing)
    shown = block(page, "Failed trials (2)")
    assert [row[-1].text for row in shown.rows] == [HOSTILE, "took longer than 5 s"]
    assert facts(page)["failed"] == "2"
    html = page.html()
    assert "<img src=x" not in html
    assert html.count("</script>") == 1


def test_a_study_that_failed_altogether_has_a_page(failing):
    rows = failing.rows.assign(status="failed", error="no", change_percentage=np.nan)
    page = study_page.study_page(dataclasses.replace(failing, rows=rows))
    assert len(block(page, f"Failed trials ({len(rows)})").rows) == len(rows)
    assert "Failed trials" in page.html()


def test_a_study_that_was_cut_off_says_how_much_is_there(stored, tmp_path):
    with RowStore(tmp_path, False) as store:
        store.write_plan(list(stored.rows["trial_id"]))
    part = dataclasses.replace(stored, rows=stored.rows.head(10), folder=tmp_path)
    assert facts(study_page.study_page(part))["trials"] == f"10 of {len(stored.rows)} that are planned"


def test_a_study_without_scenes_says_why(stored):
    page = study_page.study_page(stored)
    [viewer] = [each for each in page.blocks if isinstance(each, ViewerBlock)]
    assert "made where the models are" in viewer.reason
    assert viewer.reason in page.html()


def test_trials_that_the_viewer_shows_lead_to_it(stored):
    scenes = whole_page().scenes
    rows = stored.rows.sort_values("change_percentage", ascending=False)
    keys = {"id2": rows["trial_id"].iloc[0], "id4": rows["trial_id"].iloc[3]}
    for scene in scenes.values["scenes"]:
        scene["key"] = keys.get(scene["key"], "")
    page = study_page.study_page(stored, scenes)
    worst = block(page, "Worst cases")
    assert [row[0].scene for row in worst.rows[:5]] == [2, -1, -1, 4, -1]
    [chart] = [each for each in page.blocks if isinstance(each, ChartBlock)]
    assert sorted(re.findall(r'data-scene="(\d)"', chart.drawings[0].svg)) == ["2", "4"]


def test_report_keeps_the_scenes_of_a_page(stored, tmp_path):
    study_page.write_study_page(dataclasses.replace(stored, folder=tmp_path), whole_page().scenes)
    study_page.write_study_page(dataclasses.replace(stored, folder=tmp_path))
    kept = stored_scenes(tmp_path / "report.html")
    assert len(unpack(kept)) == kept.count == whole_page().scenes.count


def test_the_index_has_a_card_that_leads_to_each_page_and_every_claim_once(stored):
    page = index_page.index_page([stored], RESULTS)
    plates, cards = (each for each in page.blocks if each.kind == "cards")
    assert [card.link for card in plates.cards] == ["plates.html"]
    assert [card.link for card in cards.cards] == ["shot_noise/bundled/report.html"]
    table = next((each for each in page.blocks if isinstance(each, TableBlock)), None)
    expected = stored.claims() if stored.dataset in stored.publication.datasets else []
    assert [row[0].text for row in table.rows] if table else [claim.text for claim in expected] == []


def test_the_command_writes_a_page_for_each_study_and_an_index(stored, tmp_path):
    folder = tmp_path / "shot_noise" / "bundled"
    folder.mkdir(parents=True)
    for name in ("trials.parquet", "config.yaml", "provenance.json"):
        (folder / name).write_bytes((stored.folder / name).read_bytes())
    done = typed_command(tmp_path, "studies.report", str(tmp_path))
    assert done.returncode == 0, done.stderr
    assert 'href="shot_noise/bundled/report.html"' in (tmp_path / "index.html").read_text()
    assert 'href="../../index.html"' in (folder / "report.html").read_text()


def test_a_study_writes_its_page_with_the_scenes_of_its_gallery(study, here):
    assert study("page.models=1", "page.worst=1")
    [path] = here.glob("results/*/*/report.html")
    rows = pd.read_parquet(path.parent / "trials.parquet").set_index("trial_id")["change_percentage"]
    scenes = unpack(stored_scenes(path))
    assert len(scenes) == 2 + 1  # levels, and the worst of the other repeats
    for scene in scenes:
        for viewport in scene.viewports:
            assert 200 * viewport.changed.mean() == pytest.approx(rows[scene.key])
    written = path.read_text()
    assert study("page.models=1", "page.worst=1")  # nothing is made again
    assert stored_scenes(path).values["data"] in written
