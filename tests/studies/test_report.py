"""The page of the paper's claims: every figure on it comes from the stored trials."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from studies.experiments import Change
from studies.reporting.page import LONGEST_TABLE, page, sorted_by_section, study_folders
from studies.reporting.results import Results
from tests.studies.conftest import typed_command

RESULTS = Path(__file__).parents[2] / "results"


@pytest.fixture(scope="module")
def studies():
    found = sorted_by_section(map(Results.load, study_folders(RESULTS)))
    assert found, "no study is stored"
    return found


@pytest.mark.slow  # all tables of all studies; `.ci/run` runs it
def test_the_page_is_what_the_stored_trials_give(studies):
    assert (RESULTS / "README.md").read_text() == page(studies, RESULTS)


def test_boards_of_all_methods_come_first_and_long_tables_are_folded():
    text = (RESULTS / "README.md").read_text()
    headings = re.findall(r"^## (\S+)", text, re.MULTILINE)
    assert headings[:3] == ["Leaderboard", "Leaderboard", "Parts"]
    folded = re.findall(r"<details>\n<summary>Table of (\d+) rows</summary>\n\n(.*?)\n\n</details>", text, re.DOTALL)
    assert folded
    for count, table in folded:
        assert len(table.splitlines()) - 2 == int(count) > LONGEST_TABLE
        text = text.replace(table, "")
    assert (
        max(len(table.splitlines()) for table in re.findall(r"(?:^\|.*\n)+", text, re.MULTILINE)) <= LONGEST_TABLE + 2
    )


@pytest.mark.slow  # as above
def test_tables_are_what_the_stored_trials_give(studies):
    for study in studies:
        for stem, table in study.tables.items():
            stored = (study.folder / f"{stem}.csv").read_text()
            assert table.to_csv(index=False, float_format="%.6g") == stored, study.folder


def test_every_change_percentage_on_the_page_is_a_mean_of_stored_trials(studies):
    """Independently of the tables: from the rows alone, model by model."""
    text = (RESULTS / "README.md").read_text()
    checked = 0
    for study in studies:
        if not isinstance(study.experiment, Change):
            continue
        *parents, own = study.folder.relative_to(RESULTS).parts
        # What is not a plain word in the name of a folder is replaced in its anchor, which ends with a digest then.
        anchor = "-".join([*parents, f"{own.partition('[')[0]}-" if "[" in own else f'{own}"'])
        (section,) = [each for each in text.split('<a id="') if each.startswith(anchor)]
        good = study.rows[study.rows["status"] == "ok"]
        methods = good["segmenter"].nunique()
        for (method, part, level), group in good.groupby(["segmenter", "part", "level"]):
            mean = np.mean([values.mean() for _, values in group.groupby("model")["change_percentage"]])
            named = f"{re.escape(method)} \\| " if methods > 1 else ""
            pattern = rf"^\| {named}{re.escape(part.replace('_', ' '))} \| {level:g} \| [^|]+ \| {mean:.2f} \|"
            assert re.search(pattern, section, re.MULTILINE), (study.folder, method, part, level, mean)
            checked += 1
    assert checked > 0


def test_tables_and_page_are_built_again_from_the_rows_alone(tmp_path):
    source = RESULTS / "shot_noise" / "bundled"
    folder = tmp_path / "shot_noise" / "bundled"
    folder.mkdir(parents=True)
    for name in ("trials.parquet", "config.yaml", "provenance.json"):
        (folder / name).write_bytes((source / name).read_bytes())
    assert typed_command(tmp_path, "studies.report", str(tmp_path)).returncode == 0
    for name in ("table.csv", "table.md", "shot_noise.pdf"):
        assert (folder / name).read_bytes() == (source / name).read_bytes()
    assert "Shot noise (bundled)" in (tmp_path / "README.md").read_text()


def test_no_results_are_an_error_of_one_line(tmp_path):
    done = typed_command(tmp_path, "studies.report", str(tmp_path))
    assert done.returncode == 2
    assert done.stderr.count("\n") == 1
    assert "no rows of a study" in done.stderr


def test_rows_of_the_page_name_the_command_that_makes_them(studies):
    for study in studies:
        assert study.command.startswith(f"python -m studies.run +study={study.name}")
        rows = pd.read_parquet(study.folder / "trials.parquet")
        assert (rows["study"] == study.name).all()
