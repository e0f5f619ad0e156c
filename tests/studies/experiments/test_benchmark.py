import shutil

import pandas as pd
import pytest

import heatwalk
from heatwalk.io import read_mesh, read_seg
from studies.experiments import Benchmark
from studies.metrics import psb
from studies.reporting.publication import Publication
from tests.helpers.meshes import DATA


@pytest.fixture
def planned(plan, psb_zip):
    return plan("+study=table1", f"dataset.root={psb_zip}", "dataset.models=[50,209]")


def people(root, model):
    """People's segmentations, read from the benchmark's files themselves."""
    folder = root / "data" / "seg" / "Benchmark" / model
    return {path.name: read_seg(path) for path in folder.glob("*.seg")}


def test_the_row_of_a_method_is_its_mean_over_people(planned, rows_of, psb_root):
    rows = rows_of(planned, Benchmark).set_index(["model", "segmenter"])
    mesh = read_mesh(psb_root / "data" / "off" / "50.off")
    ours = heatwalk.segment(mesh.vertices, mesh.faces).face_labels
    against = pd.DataFrame(psb.evaluate(mesh, ours, labels) for labels in people(psb_root, "50").values())
    row = rows.loc[("50", "HeatWalk")]
    assert row["n_people"] == len(against)
    for metric in against:
        assert row[metric] == pytest.approx(against[metric].mean(), rel=1e-12), metric


def test_the_row_of_people_is_the_mean_over_all_that_differ(planned, rows_of, psb_root):
    row = rows_of([t for t in planned if t.model.name == "209"], Benchmark).set_index("segmenter")
    mesh = read_mesh(psb_root / "data" / "off" / "209.off")
    labels = people(psb_root, "209")
    ordered = pd.DataFrame(psb.evaluate(mesh, labels[a], labels[b]) for a in labels for b in labels if a != b)
    for metric in ("cut_discrepancy", "rand_index_error", "hamming", "gce", "lce"):
        assert row.loc["Humans", metric] == pytest.approx(ordered[metric].mean(), rel=1e-9), metric


def test_the_table_has_our_rows_and_the_papers_eight(planned, rows_of):
    rows = rows_of(planned, Benchmark)
    annotated = Publication.load("heat_walk_2011").annotate(Benchmark().tables(rows)[0], rows)
    table = annotated.frame.set_index(["source", "method"])
    for method in ("HeatWalk", "Humans"):
        for metric in ("cut_discrepancy", "rand_index_error", "hamming", "gce", "lce"):
            mean = rows.loc[rows["segmenter"] == method, metric].mean()
            assert table.loc[("computed", method), metric] == pytest.approx(mean)
            assert table.loc[("computed", method), f"{metric}_low"] <= mean
            assert table.loc[("computed", method), f"{metric}_high"] >= mean
    path = DATA.parent / "paper" / "table1.csv"
    if not path.exists():
        pytest.skip(f"the paper's tables are not at hand: no {path}")
    paper = pd.read_csv(path, index_col="method").rename(columns={"hamming_distance": "hamming"})
    pd.testing.assert_frame_equal(table.loc["paper"][list(paper.columns)], paper, check_names=False, check_dtype=False)


def test_a_model_that_nobody_segmented_is_a_row_that_says_so(plan, rows_of, psb_root, tmp_path):
    data = tmp_path / "data"
    (data / "off").mkdir(parents=True)
    for model in (41, 50):
        shutil.copy(psb_root / "data" / "off" / f"{model}.off", data / "off")
    shutil.copytree(psb_root / "data" / "seg" / "Benchmark" / "50", data / "seg" / "Benchmark" / "50")
    rows = rows_of(plan("+study=table1", f"dataset.root={tmp_path}", "dataset.categories=null"), Benchmark)
    assert rows.groupby("model")["status"].unique().map(list).to_dict() == {"41": ["failed"], "50": ["ok"]}
    assert rows["error"].dropna().str.contains("has 0 segmentations by people").all()
    table = Benchmark().tables(rows)[0].frame.set_index(["source", "method"])
    assert table.loc[("computed", "HeatWalk"), "failures"] == 1
    hamming = rows.set_index(["model", "segmenter"])["hamming"]
    assert table.loc[("computed", "HeatWalk"), "hamming"] == hamming["50", "HeatWalk"]


def test_segmentations_by_people_that_change_are_other_trials(plan, psb_root, tmp_path):
    data = tmp_path / "data"
    for part in ("off/50.off", "seg/Benchmark/50"):
        target = data / part
        target.parent.mkdir(parents=True, exist_ok=True)
        source = psb_root / "data" / part
        shutil.copytree(source, target) if source.is_dir() else shutil.copy(source, target)
    ids = [[t.trial_id for t in plan("+study=table1", f"dataset.root={tmp_path}")]]
    next((data / "seg" / "Benchmark" / "50").glob("*.seg")).unlink()
    ids.append([t.trial_id for t in plan("+study=table1", f"dataset.root={tmp_path}")])
    assert not set(ids[0]) & set(ids[1])
