from itertools import combinations
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest

import heatwalk
from heatwalk import read_mesh
from studies.experiments import Poses
from studies.experiments.poses import _of_each_shape, pair_matrices
from studies.metrics import change_percentage
from studies.planning.errors import StudyError
from studies.statistics.bootstrap import interval_over_pairs


def test_a_row_is_the_change_at_the_points_that_two_poses_have_in_common(plan, rows_of, tosca_zip, tosca_root):
    trials = plan("+study=pose", f"dataset.root={tosca_zip}", "dataset.models=[cat0,cat1,cat6]")
    rows = rows_of(trials, Poses)
    labels = {}
    for name in ("cat0", "cat1", "cat6"):
        mesh = read_mesh(tosca_root / f"{name}.off")
        points = np.loadtxt(tosca_root / "corres" / f"{name}.vts", dtype=int) - 1
        labels[name] = heatwalk.segment(mesh.vertices, mesh.faces).labels[points]
    assert list(zip(rows["model"], rows["other"], strict=True)) == list(combinations(labels, 2))
    for row in rows.itertuples():
        assert row.change_percentage == change_percentage(labels[row.model], labels[row.other])
        assert row.n_compared == len(labels[row.model])


def no_labels(trial_id):
    return None


def frame(pairs, shape="cat"):
    return pd.DataFrame(
        {
            "part": shape, "segmenter": "HeatWalk", "model": a, "other": b,
            "status": "failed" if value is None else "ok",
            "change_percentage": value, "van_dongen": value, "n_segments": 3, "n_segments_reference": 4,
        }
        for (a, b), value in pairs.items()
    )  # fmt: skip


def test_the_matrix_of_a_shape_is_symmetric_and_has_a_gap_where_a_pair_failed():
    matrix = pair_matrices(frame({("a", "b"): 1.0, ("a", "c"): 2.0, ("b", "c"): None}))["cat"]
    np.testing.assert_array_equal(matrix.to_numpy(), [[0, 1, 2], [1, 0, np.nan], [2, np.nan, 0]])


def test_the_table_has_each_shape_and_all_of_them():
    rows = pd.concat(
        [frame({("a", "b"): 1.0, ("a", "c"): 3.0, ("b", "c"): None}), frame({("x", "y"): 10.0}, shape="dog")]
    )
    table = Poses().tables(rows)[0].frame.set_index("shape")
    assert table.loc["cat", ["poses", "pairs", "mean", "largest", "failures"]].tolist() == [3, 2, 2.0, 3.0, 1]
    assert table.loc["all", ["poses", "pairs", "failures"]].tolist() == [5, 3, 1]
    assert table.loc["all", "mean"] == pytest.approx(14 / 3)
    assert table.loc["dog", ["ci_low", "ci_high"]].isna().all()  # two poses: nothing to resample


def test_the_interval_covers_the_true_mean_about_as_often_as_it_says():
    """Pairs of a pose share what that pose adds, so that an interval over pairs alone would be far too narrow."""
    rng = np.random.default_rng(1)
    hits = 0
    for _ in range(200):
        own = rng.normal(5, 2, 15)
        values = own[:, None] + own + rng.normal(0, 0.5, (15, 15))
        values = np.triu(values, 1) + np.triu(values, 1).T
        low, high = interval_over_pairs([values])
        hits += low <= 10 <= high
    assert 0.85 <= hits / 200 <= 0.98


def test_a_pose_that_cannot_be_segmented_costs_its_own_pairs(plan, rows_of, tosca_root, tmp_path):
    (tmp_path / "corres").mkdir()
    for name in ("cat0", "cat1", "cat2"):
        for part in (f"{name}.off", f"corres/{name}.vts"):
            (tmp_path / part).write_bytes((tosca_root / part).read_bytes())
    (tmp_path / "cat2.off").write_text("OFF\n3 1 0\n0 0 0\n")
    rows = rows_of(plan("+study=pose", f"dataset.root={tmp_path}"), Poses)
    assert rows.set_index(["model", "other"])["status"].to_dict() == {
        ("cat0", "cat1"): "ok", ("cat0", "cat2"): "failed", ("cat1", "cat2"): "failed",
    }  # fmt: skip
    assert rows["error"].dropna().str.contains("pose cat2").all()


def test_shapes_of_one_pose_each_are_no_study(plan, tosca_zip):
    with pytest.raises(StudyError, match="no shape has two poses"):
        plan("+study=pose", f"dataset.root={tosca_zip}", "dataset.models=[cat0,dog1]")


def test_the_picture_of_poses_gives_a_part_the_colour_that_it_has_in_the_first(configured, rows_of, tosca_zip):
    study = configured("+study=pose", f"dataset.root={tosca_zip}", "dataset.models=[cat0,cat1,cat3]")
    trials = study.plan()
    rows = rows_of(trials, Poses)
    (picture,) = study.experiment.pictures("pose", trials, rows, "", no_labels)
    assert picture.stem == "figure6"
    assert [word for word in picture.content.split() if word.startswith("cat")] == ["cat0", "cat1", "cat3"]
    figure = picture.figure([picture.function(task) for task in picture.tasks()])
    pictures = [axes.get_images()[0].get_array() for axes in figure.axes]
    # As many segments, and the same hues of which a part keeps its own: the tail is violet in all three.
    violet = [int(((image[..., 0] > 90) & (image[..., 1] < 60) & (image[..., 2] > 110)).sum()) for image in pictures]
    assert min(violet) > 500


def test_the_picture_of_poses_shows_the_same_poses_by_the_first_methods(configured, rows_of, tosca_zip):
    methods = "segmenters=[heat_walk,heat_walk_robust,one_segment]"
    study = configured("+study=pose", f"dataset.root={tosca_zip}", "dataset.models=[cat0,cat1]", methods)
    trials = study.plan()
    (picture,) = study.experiment.pictures("pose", trials, rows_of(trials, Poses), "", no_labels)
    shown = [(trial.segmenter_name, name) for trial, name in picture.shown]
    assert shown == [(method, name) for name in ("cat0", "cat1") for method in ("HeatWalk", "HeatWalkRobust")]


def test_means_take_the_place_of_matrices_of_many_methods():
    rows = pd.concat([frame({("a", "b"): float(i)}).assign(segmenter=f"method {i}") for i in range(5)])
    experiment = Poses()
    tables = {table.name: table for table in experiment.tables(rows)}
    (panel,) = experiment.charts("pose", tables, rows, "Poses")["pose"].panels
    assert panel.dots[0].categories == tuple(f"method {i}" for i in range(5))
    assert panel.dots[0].values == (0.0, 1.0, 2.0, 3.0, 4.0)


def test_a_picture_of_many_shapes_shows_two_poses_of_each_of_the_first():
    poses = {f"{shape}{i}": SimpleNamespace(part=shape) for shape in ("ant", "bird", "cat", "dog") for i in range(3)}
    assert _of_each_shape(poses, 6) == ["ant0", "ant1", "bird0", "bird1", "cat0", "cat1"]
    assert _of_each_shape(poses, 2) == ["ant0", "ant1"]


def test_several_segmenters_have_rows_and_matrices_of_their_own():
    rows = pd.concat([frame({("a", "b"): 1.0}), frame({("a", "b"): 5.0}).assign(segmenter="other")])
    experiment = Poses()
    (table,) = experiment.tables(rows)
    assert table.frame[["segmenter", "mean"]].to_numpy().tolist() == [["HeatWalk", 1.0], ["other", 5.0]]
