import pickle
import re
import shutil

import pandas as pd
import pytest

import heatwalk
from heatwalk import MeshError
from heatwalk.io import read_mesh, read_seg
from studies.datasets.in_memory import embed_models
from studies.experiments import Benchmark
from studies.metrics import psb
from studies.reporting.publication import Publication
from tests.helpers.meshes import DATA
from tests.studies.conftest import configured_with, frame_of_rows


@pytest.fixture(scope="module")
def planned(psb_zip):
    return configured_with("+study=table1", f"dataset.root={psb_zip}", "dataset.models=[50,209]").plan()


@pytest.fixture(scope="module")
def rows_of_planned(planned):
    return frame_of_rows(planned, Benchmark)


def people(root, model):
    """People's segmentations, read from the benchmark's files themselves."""
    folder = root / "data" / "seg" / "Benchmark" / model
    return {path.name: read_seg(path) for path in folder.glob("*.seg")}


def test_the_row_of_a_method_is_its_mean_over_people(rows_of_planned, psb_root):
    rows = rows_of_planned.set_index(["model", "segmenter"])
    mesh = read_mesh(psb_root / "data" / "off" / "50.off")
    ours = heatwalk.segment(mesh.vertices, mesh.faces).face_labels
    against = pd.DataFrame(psb.evaluate(mesh, ours, labels) for labels in people(psb_root, "50").values())
    row = rows.loc[("50", "HeatWalk")]
    assert row["n_people"] == len(against)
    for metric in against:
        assert row[metric] == pytest.approx(against[metric].mean(), rel=1e-12), metric


def test_the_row_of_people_is_the_mean_over_all_that_differ(rows_of_planned, psb_root):
    row = rows_of_planned[rows_of_planned["model"] == "209"].set_index("segmenter")
    mesh = read_mesh(psb_root / "data" / "off" / "209.off")
    labels = people(psb_root, "209")
    ordered = pd.DataFrame(psb.evaluate(mesh, labels[a], labels[b]) for a in labels for b in labels if a != b)
    for metric in ("cut_discrepancy", "rand_index_error", "hamming", "gce", "lce"):
        assert row.loc["Humans", metric] == pytest.approx(ordered[metric].mean(), rel=1e-9), metric


def test_the_table_has_our_rows_and_the_papers_eight(rows_of_planned):
    rows = rows_of_planned
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


METRICS = ("cut_discrepancy", "rand_index_error", "hamming", "missing_rate", "false_alarm_rate", "gce", "lce")


@pytest.fixture(scope="module")
def with_methods(psb_root, tmp_path_factory):
    """Two models with people's segmentations and with some by methods, which are those by the first two people.

    RandCuts has a file, and NormCuts a folder per model; CoreExtra lacks a model; of KMeans and FitPrim, the file of
    model 50 is damaged or of another mesh.
    """
    root = tmp_path_factory.mktemp("methods")
    data, source = root / "data", psb_root / "data"
    (data / "off").mkdir(parents=True)
    for model in ("50", "209"):
        shutil.copy(source / "off" / f"{model}.off", data / "off")
        shutil.copytree(source / "seg" / "Benchmark" / model, data / "seg" / "Benchmark" / model)
        first, second = sorted((source / "seg" / "Benchmark" / model).glob("*.seg"))[:2]
        texts = {"RandCuts": first.read_text(), "NormCuts": second.read_text(), "KMeans": first.read_text()}
        texts["FitPrim"] = first.read_text()
        if model == "50":
            texts |= {"CoreExtra": first.read_text(), "KMeans": "0\nhead\n1\n", "FitPrim": "0\n1\n0\n"}
        for method, text in texts.items():
            inside = f"{model}/{model}_0.seg" if method == "NormCuts" else f"{model}.seg"
            file = data / "seg" / method / inside
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_text(text)
    return root


@pytest.fixture(scope="module")
def rows_with_methods(with_methods):
    options = ["+study=table1", f"dataset.root={with_methods}", "segmenters=[one_segment,voronoi]"]
    return frame_of_rows(configured_with(*options).plan(), Benchmark)


def test_segmentations_by_the_authors_of_methods_are_scored_as_any_other(rows_with_methods, psb_root):
    rows = rows_with_methods.set_index(["segmenter", "model"])
    for model in ("50", "209"):
        mesh, labels = read_mesh(psb_root / "data" / "off" / f"{model}.off"), people(psb_root, model)
        for method, person in zip(("RandCuts", "NormCuts"), sorted(labels)[:2], strict=True):
            row = rows.loc[(f"{method} (authors)", model)]
            scores = pd.DataFrame(psb.evaluate(mesh, labels[person], other) for other in labels.values())
            assert row["status"] == "ok"
            assert row["n_segments"] == len(set(labels[person]))
            assert row[list(METRICS)].tolist() == pytest.approx(scores[list(METRICS)].mean().tolist(), rel=1e-12)
    assert "CoreExtra (authors)" in set(rows.loc[pd.IndexSlice[:, "50"], :].index.get_level_values(0))
    assert ("CoreExtra (authors)", "209") not in rows.index


def test_a_file_of_a_method_that_is_damaged_or_of_another_mesh_fails_that_trial_alone(rows_with_methods):
    failed = rows_with_methods[rows_with_methods["status"] != "ok"].set_index(["segmenter", "model"])["error"]
    assert set(failed.index) == {("KMeans (authors)", "50"), ("FitPrim (authors)", "50")}
    assert re.search(r"50\.seg.*line 2.*'head'", failed["KMeans (authors)", "50"])
    assert "segmentation of model 50 by FitPrim has 3 labels, and its mesh" in failed["FitPrim (authors)", "50"]


def test_the_table_has_the_authors_rows_beside_those_published_of_the_same_method(rows_with_methods):
    (table, *_) = (
        Publication.load("heat_walk_2011").annotate(table, rows_with_methods)
        for table in Benchmark().tables(rows_with_methods)
    )
    order = table.frame[["method", "source"]].agg(" ".join, axis=1).tolist()
    assert order[:4] == ["OneSegment computed", "Voronoi computed", "Humans computed", "NormCuts authors"]
    published = ["Humans", "HeatWalk", "RandCuts", "ShapeDiam", "CoreExtra", "RandWalks", "FitPrim", "Kmeans"]
    assert [row for row in order if row.endswith("paper")] == [f"{method} paper" for method in published]
    for method in ("RandCuts", "CoreExtra", "FitPrim", "Kmeans"):
        assert order.index(f"{method} authors") == order.index(f"{method} paper") - 1
    assert "come with the dataset" in table.notes


def test_what_is_published_of_a_shipped_method_is_below_what_was_computed_of_it(rows_with_methods):
    names = {"OneSegment": "RandomizedCuts", "Voronoi": "HeatWalk"}
    table = Benchmark().tables(rows_with_methods.replace({"segmenter": names}))[0]
    annotated = Publication.load("heat_walk_2011").annotate(table, rows_with_methods)
    order = annotated.frame[["method", "source"]].agg(" ".join, axis=1).tolist()
    at = order.index("RandomizedCuts computed")
    assert order[at : at + 3] == ["RandomizedCuts computed", "RandCuts authors", "RandCuts paper"]
    assert order.index("HeatWalk paper") > order.index("Humans computed")
    assert sorted(order) == sorted(dict.fromkeys(order))


def test_the_table_says_which_methods_were_told_the_number_of_segments(rows_with_methods):
    table = Benchmark().tables(rows_with_methods)[0]
    told = table.frame.set_index(["method", "source"])["told"]
    assert told["OneSegment", "computed"] == "no"
    assert told["Voronoi", "computed"] == "yes"
    assert told.drop([("OneSegment", "computed"), ("Voronoi", "computed")]).isna().all()
    assert "told" in [column.name for column in table.visible(compact=True)]
    assert table.notes.endswith("Told how many segments to find: Voronoi.")


def test_a_table_of_methods_that_find_the_number_themselves_does_not_mention_it(rows_with_methods):
    rows = rows_with_methods[~rows_with_methods["segmenter"].str.contains("Voronoi|authors")]
    table = Benchmark().tables(rows)[0]
    assert "told" not in table.frame
    assert table.notes == Benchmark().notes


def test_the_chart_tells_computed_from_authors_and_published_values(rows_with_methods):
    tables = [
        Publication.load("heat_walk_2011").annotate(table, rows_with_methods)
        for table in Benchmark().tables(rows_with_methods)
    ]
    chart = Benchmark().charts("table1", {table.name: table for table in tables}, rows_with_methods, "")["table1"]
    for panel in chart.panels:
        assert [dots.label for dots in panel.dots] == [
            "computed", "computed from the authors' segmentations", "the paper"
        ]  # fmt: skip
        assert [len(dots.values) for dots in panel.dots] == [3, 5, 8]
        assert len({(dots.role, dots.group) for dots in panel.dots}) == 3


def test_a_file_of_a_method_that_changes_is_another_trial_and_the_others_remain(plan, with_methods, tmp_path):
    root = shutil.copytree(with_methods, tmp_path / "copy")
    options = ["+study=table1", f"dataset.root={root}", "segmenter=one_segment"]
    before = {(t.segmenter_name, t.model.name): t.trial_id for t in plan(*options)}
    file = root / "data" / "seg" / "RandCuts" / "209.seg"
    file.write_text(file.read_text().replace("0", "7"))
    after = {(t.segmenter_name, t.model.name): t.trial_id for t in plan(*options)}
    assert {key for key in before if before[key] != after[key]} == {("RandCuts (authors)", "209")}
    assert len(set(after.values())) == len(after)


def test_where_a_method_has_no_segmentations_the_ids_are_those_of_before(plan, with_methods, psb_root):
    options = ["+study=table1", "segmenter=one_segment", "dataset.models=[50]"]
    plain, richer = (
        {t.segmenter_name: t.trial_id for t in plan(*options, f"dataset.root={root}")}
        for root in (psb_root, with_methods)
    )
    assert plain == {name: richer[name] for name in ("OneSegment", "Humans")}


def test_workers_that_cannot_read_the_files_score_the_same(plan, with_methods, rows_with_methods, tmp_path):
    root = shutil.copytree(with_methods, tmp_path / "copy")
    trials = plan("+study=table1", f"dataset.root={root}", "segmenter=one_segment", "dataset.models=[50]")
    sent = pickle.dumps(embed_models(trials[0]))
    shutil.rmtree(root)
    prepared = pickle.loads(sent).prepare()
    (trial,) = (trial for trial in trials if trial.segmenter_name == "RandCuts (authors)")
    rows = rows_with_methods.set_index(["segmenter", "model"])
    assert trial.measure(prepared)["gce"] == rows.loc[("RandCuts (authors)", "50"), "gce"]
    (damaged,) = (trial for trial in trials if trial.segmenter_name == "KMeans (authors)")
    with pytest.raises(MeshError, match=r"50\.seg"):
        damaged.measure(prepared)


def test_the_table_of_costs_has_seconds_and_memory_of_what_was_run_here(rows_with_methods):
    cost = {table.name: table for table in Benchmark().tables(rows_with_methods)}["cost"].frame.set_index("segmenter")
    assert list(cost.index) == ["OneSegment", "Voronoi"]
    for name, rows in rows_with_methods.groupby("segmenter"):
        if name in cost.index:
            assert cost.loc[name, "seconds_segment"] == pytest.approx(rows["seconds_segment"].mean())
            assert cost.loc[name, "largest_seconds"] == rows["seconds_segment"].max()
            assert cost.loc[name, "peak_memory"] == rows["peak_memory"].median()
        else:
            assert rows["peak_memory"].isna().all()


def test_rows_that_are_older_than_the_measurement_of_memory_have_no_table_of_costs(rows_with_methods):
    older = rows_with_methods.assign(peak_memory=float("nan"))
    assert "cost" not in [table.name for table in Benchmark().tables(older)]
