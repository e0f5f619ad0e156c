"""The scripts in examples/ run as they are, in a folder of the user's, and write what they say."""

import pandas as pd
import pytest

from heatwalk import read_mesh
from tests.helpers.documents import ROOT


@pytest.fixture
def run_example(tmp_path, interpreter):
    """A function: name of a script and its arguments -> what it prints."""

    def run(name, *arguments):
        done = interpreter.run([ROOT / "examples" / name, *arguments], tmp_path)
        assert done.returncode == 0, done.stderr
        return done.stdout

    return run


def test_segmenting_a_mesh_prints_every_region_and_saves_the_mesh(run_example, tmp_path):
    printed = run_example("segment_a_mesh.py")
    sizes = [
        int(line.split(":")[1].split()[0].replace(",", "")) for line in printed.splitlines() if "region" in line[:12]
    ]
    saved = read_mesh(tmp_path / "segments.ply")
    assert len(saved.vertices) == 2904
    assert f"{len(sizes)} accumulator regions" in printed
    dissipators = int(printed.split("dissipator region: ")[1].split()[0].replace(",", ""))
    assert sum(sizes) + dissipators == 2904


def test_a_study_from_python_prints_its_table_and_its_worst_trial(run_example, tmp_path):
    printed = run_example("robustness_study.py", "out")
    rows = pd.read_parquet(tmp_path / "out" / "shot_noise" / "bundled" / "trials.parquet")
    assert rows["status"].tolist() == ["ok"] * 4
    worst = rows.loc[rows["change_percentage"].idxmax()]
    assert f"seed {worst['seed']}" in printed
    assert f"{rows[rows['level'] == 0.05]['change_percentage'].mean():.6f}" in printed


def test_segmenters_are_compared_under_the_same_draws(run_example, tmp_path):
    printed = run_example("compare_segmenters.py", "out")
    rows = pd.read_parquet(tmp_path / "out" / "shot_noise" / "bundled" / "trials.parquet")
    assert rows["status"].tolist() == ["ok"] * 8
    by_segmenter = {str(name): group for name, group in rows.groupby("segmenter")}
    assert set(by_segmenter) == {"HeatWalk", "slabs"}
    ours, theirs = (set(zip(g["level"], g["repeat"], g["seed"], strict=True)) for g in by_segmenter.values())
    assert ours == theirs
    assert "HeatWalk" in printed
    assert "slabs" in printed
