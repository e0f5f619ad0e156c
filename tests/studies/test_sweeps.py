"""What the studies of a sweep found together, and a page on which every section has a name of its own."""

import re

import pandas as pd
import pytest
from rich.console import Console

from studies.columns import Table
from studies.execution.study import run_study
from studies.figures import charts, drawing
from studies.reporting.page import page, sorted_by_section, study_folders
from studies.reporting.results import Results
from studies.reporting.sweeps import sweeps_of, write_sweep
from studies.reporting.text import markdown_of
from tests.studies.conftest import STUDY


@pytest.fixture
def swept(here, composed, configured, monkeypatch):
    """The folder of results of two sweeps, and of a study of another perturbation under the same name."""
    from studies.planning.configuration import configure

    monkeypatch.setattr(drawing, "draw", lambda chart: chart)
    monkeypatch.setattr(drawing, "save", lambda chart, path, *content: path.write_text(f"{chart} {content}"))
    words = (*STUDY[:-1], "levels=[0.2]", "repeats=1", "engine=serial", "results_dir=results")
    for seconds in ("0.001", "0", "0.01"):
        options = (*words, f"+segmenter.seconds={seconds}")
        study = configure(composed(*options), options, {"segmenter.seconds": seconds})
        run_study(study, Console(quiet=True))
    for unit in ("mean_edge_length", "bounding_box_diagonal"):
        options = (*words, f"perturbation.unit={unit}")
        run_study(configure(composed(*options), options, {"perturbation.unit": unit}), Console(quiet=True))
    return here / "results"


def test_a_sweep_has_one_table_and_one_curve(swept, capsys):
    studies = [Results.load(folder) for folder in study_folders(swept)]
    by_seconds, by_unit = sorted(sweeps_of(studies), key=lambda sweep: sweep.options, reverse=True)
    write_sweep(by_seconds, Console(width=200))
    assert "by segmenter.seconds" in capsys.readouterr().out
    folder = swept / "normal_noise" / "files"
    table = pd.read_csv(folder / "sweep_by_segmenter.seconds.csv")
    assert table["segmenter.seconds"].tolist() == [0, 0.001, 0.01]
    for study, mean in zip(by_seconds.studies, table["mean"], strict=True):
        assert study.tables["table"]["mean"].iloc[0] == pytest.approx(mean, rel=1e-5)
    text = (folder / "sweep_by_segmenter.seconds.md").read_text()
    assert text.startswith("# Normal noise on files: halves, by segmenter.seconds\n")
    assert "x=(0.0, 0.001, 0.01)" in (folder / "sweep_by_segmenter.seconds.png").read_text()
    assert by_unit.table.frame["perturbation.unit"].tolist() == ["bounding_box_diagonal", "mean_edge_length"]
    write_sweep(by_unit, Console(quiet=True))
    assert "categories=('bounding_box_diagonal', 'mean_edge_length')" in by_unit.file(".png").read_text()


def test_every_section_of_the_page_has_a_heading_and_an_anchor_of_its_own(swept):
    found = [Results.load(folder) for folder in study_folders(swept)]
    text = page(sorted_by_section(found), swept, sweeps_of(found))
    headings, anchors = (re.findall(pattern, text, re.MULTILINE) for pattern in (r"^## (.*)$", r'^<a id="(.*)">'))
    assert len(headings) == len(set(headings)) == len(anchors) == len(set(anchors)) == 7
    assert sum("(seconds=0.01)" in heading for heading in headings) == 1
    for sweep in sweeps_of(found):
        assert "\n".join(markdown_of(sweep.table)) in text
    for target in re.findall(r"\]\(#(.*?)\)", text):
        assert target in anchors
    assert "Section" not in text.split("## ", 1)[1]
    assert "Perturbation: normal noise. 1 model: ant; 1 trial." in text
    for study in found:
        assert study.command in text


def test_a_part_has_no_section_of_its_own(here, configured):
    words = (*STUDY, "engine=serial", "repeats=1")
    run_study(configured(*words), Console(quiet=True))
    run_study(configured(*words, "levels=[0.1]"), Console(quiet=True))
    found = [Results.load(folder) for folder in study_folders(here / "results")]
    assert len(found) == 2
    assert [study.folder.name for study in sorted_by_section(found)] == ["files"]


def test_a_curve_over_an_option_has_a_line_per_level_and_a_panel_per_part():
    frame = pd.DataFrame(
        [
            {"segmenter.time": time, "part": part, "level": level, "unit": "count", "mean": 1.0, "ci_low": 0.5,
             "ci_high": 2.0}
            for time in (2, 0.5, 8) for part in ("holes", "noise") for level in (1.0, 3.0)
        ]
    )  # fmt: skip
    chart = charts.swept_curve(Table("table", frame), ["segmenter.time"], "Holes")
    assert [panel.title for panel in chart.panels] == ["holes", "noise"]
    assert [series.label for series in chart.panels[0].series] == ["1 count", "3 count"]
    assert chart.panels[0].x.ticks == (0.5, 2.0, 8.0)
    assert chart.panels[0].x.logarithmic
    assert charts.swept_curve(Table("table", frame[["segmenter.time"]]), ["segmenter.time"], "Holes") is None
