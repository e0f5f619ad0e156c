"""The leaderboard as a study: what it plans, what stays when a method is added, and what it leaves on disk."""

import itertools
import json
import re
import shutil
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import yaml
from rich.console import Console

import studies
from studies.execution.study import run_study
from studies.experiments import Leaderboard
from studies.experiments.leaderboard.scores import Options, Scores
from studies.experiments.leaderboard.variants import Variants
from studies.figures import drawing
from studies.planning.errors import StudyError
from studies.reporting.results import Results
from tests.studies.conftest import ant, configured_with, typed_command

BOARD = "+study=leaderboard"
SMALL = ("dataset=files", "dataset.glob=ant.off", "engine=serial", "parts.normal_noise.levels=[0.17,0.63]")
HALVES = "tests.helpers.segmenting.halves"


def thirds(vertices, faces):
    """Three segments, by y."""
    return np.searchsorted(np.quantile(vertices[:, 1], [1 / 3, 2 / 3]), vertices[:, 1])


THIRDS = f"{__name__}.thirds"


@pytest.fixture(scope="module", autouse=True)
def no_pictures():
    """Charts are written as text: tests/studies/figures has those about pictures."""
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setattr(drawing, "draw", lambda chart: chart)
        monkeypatch.setattr(drawing, "save", lambda chart, path, *content: path.write_text(str(chart), "utf-8"))
        yield


def run_small(methods, *words, results="results"):
    chosen = configured_with(
        BOARD, *SMALL, f"segmenters=[{methods}]", "perturbations=[normal_noise]", "relative_to=halves",
        f"results_dir={results}", *words,
    )  # fmt: skip
    return run_study(chosen, Console()).results


@pytest.fixture(scope="module")
def usual(no_pictures, tmp_path_factory):
    """A board of two methods under one perturbation, run once."""
    folder = tmp_path_factory.mktemp("usual")
    (folder / "ant.off").write_text(ant())
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.chdir(folder)
        run_small(f"{HALVES},{THIRDS}")
    return folder / "results"


@pytest.fixture
def board(here, usual):
    """The folder of a copy of this board, in the current folder."""
    shutil.copytree(usual, "results")
    return Path("results", "leaderboard", "files")


@pytest.mark.parametrize("study", ["short_circuits", "tessellation"])
def test_trials_are_those_of_the_study_of_the_perturbation(plan, study):
    part = {"tessellation": "isotropic"}.get(study, study)
    words = ("dataset.models=[ant]", "repeats=1", "gallery.models=0")
    single = {trial.trial_id: trial.seed for trial in plan(f"+study={study}", *words) if trial.part == part}
    board = plan(BOARD, "dataset=bundled", *words[:2], f"perturbations=[{part}]", "segmenters=[heat_walk,one_segment]")
    of_heat_walk = {trial.trial_id: trial.seed for trial in board if trial.segmenter_name == "HeatWalk"}
    assert single.items() <= of_heat_walk.items()
    draws = {name: [t.draw for t in board if t.segmenter_name == name] for name in ("HeatWalk", "OneSegment")}
    assert draws["HeatWalk"] == draws["OneSegment"]
    assert len(set(draws["HeatWalk"])) == 6  # five strengths, and the original


def test_every_perturbation_but_the_composite_has_five_strengths_and_works(configured):
    made = configured(BOARD)
    parts = made.experiment.named_parts()
    kinds = {part.perturbation["_target_"].rpartition(".")[2] for part in parts.values()}
    assert len(parts) == len(kinds) == 27
    for name, part in parts.items():
        assert len(part.at_levels(name)) == 5, name
        assert part.title
        assert part.axis
    assert set(made.experiment.controls) <= set(parts)


@dataclass
class Named:
    """What tells models apart."""

    name: str
    category: str


def test_fewer_models_per_category_are_a_part_of_more_and_of_every_category():
    models = [
        Named(f"{category}{i}", category) for category, n in (("ant", 5), ("cup", 1), ("fox", 7)) for i in range(n)
    ]
    chosen = [
        [model.name for model in Leaderboard(models_per_category=n).chosen_models(models)] for n in (1, 2, 4, None)
    ]
    assert list(map(len, chosen)) == [3, 5, 9, 13]
    for fewer, more in itertools.pairwise(chosen):
        assert set(fewer) < set(more)
    shuffled = Leaderboard(models_per_category=2).chosen_models(models[::-1])
    assert {model.name for model in shuffled} == set(chosen[1])
    assert chosen[-1] == [model.name for model in models]


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("perturbations=[hole]", "perturbations contains 'hole', which is none of affine"),
        ("perturbations=[]", "perturbations is empty"),
        ("perturbations=holes", "perturbations is 'holes': it must be a list"),
        ("controls=[nothing]", "controls contains 'nothing'"),
        ("models_per_category=0", "models_per_category is 0: it must be a whole number of at least 1"),
    ],
)
def test_options_that_make_no_board_are_refused(configured, word, message):
    with pytest.raises(StudyError, match=re.escape(message)):
        configured(BOARD, word)


def test_a_method_that_is_added_runs_alone_and_has_its_place_among_all(board):
    stored = (board / "trials.jsonl").read_bytes()
    results = run_small("one_segment")
    assert results.folder == board
    assert not [path for path in board.iterdir() if path.is_dir()]
    added = (board / "trials.jsonl").read_bytes().removeprefix(stored).splitlines()
    assert {json.loads(line)["segmenter"] for line in added} == {"OneSegment"}
    assert results.rows.groupby("segmenter").size().to_dict() == {"halves": 3, "thirds": 3, "OneSegment": 3}
    table = results.tables["table"]
    assert table["mce"].notna().all()
    assert pd.read_csv(board / "table.csv")["segmenter"].tolist() == table["segmenter"].tolist()
    assert yaml.safe_load((board / "config.yaml").read_text())["segmenters"] == [HALVES, THIRDS, "one_segment"]
    again = run_small(HALVES)
    pd.testing.assert_frame_equal(again.tables["table"], table)
    pd.testing.assert_frame_equal(studies.rank(board), table)
    pd.testing.assert_frame_equal(studies.rank("results"), table)


def test_other_perturbations_and_models_add_to_the_same_folder(board):
    shutil.copy("ant.off", "bee.off")
    more = run_small(f"{HALVES},{THIRDS}", "perturbations=[scaling]", "dataset.glob=*.off")
    assert more.folder == board
    assert list(more.tables["by_perturbation"].filter(like="_ce").columns) == ["normal_noise_ce"]
    assert list(more.tables["controls"].filter(like="_cp").columns) == ["scaling_cp"]
    assert more.rows.groupby(["model", "part"]).size().to_dict() == {
        ("ant", "normal_noise"): 4, ("ant", "original"): 2, ("ant", "scaling"): 10,
        ("bee", "original"): 2, ("bee", "scaling"): 10,
    }  # fmt: skip
    assert more.tables["table"]["rank"].notna().all()


def test_rows_of_changed_code_replace_those_of_the_method_and_no_others(board, own_modules):
    code = "def mine(vertices, faces):\n    return (vertices[:, {}] > 0).astype(int)\n"
    (own_modules / "own_board_method.py").write_text(code.format(0))
    before = run_small("own_board_method.mine").rows.set_index("trial_id")
    (own_modules / "own_board_method.py").write_text(code.format(1))
    after = run_small("own_board_method.mine").rows.set_index("trial_id")
    assert after.groupby("segmenter").size().to_dict() == {"halves": 3, "thirds": 3, "mine": 3}
    kept = before.index.intersection(after.index)
    assert set(before.loc[kept, "segmenter"]) == {"halves", "thirds"}
    assert set(after.loc[after.index.difference(kept), "segmenter"]) == {"mine"}


def test_rows_of_other_variants_do_not_count_beside_those_of_new_ones(board):
    lines = Path("ant.off").read_text().splitlines()
    Path("ant.off").write_text("\n".join([*lines[:-1], lines[-2]]))  # the last but one face twice
    changed = run_small(HALVES)
    assert changed.folder == board
    assert changed.rows.groupby("segmenter").size().to_dict() == {"halves": 3}


def test_published_rows_of_other_methods_are_on_the_board_of_a_fresh_clone(board):
    for name in ("trials.jsonl", "planned.txt"):
        (board / name).unlink()
    Path("results", "PUBLISHED.md").write_text("Published.")
    before = {path: path.read_bytes() for path in board.iterdir() if path.is_file()}
    words = (f"segmenters=[{HALVES},one_segment]", "perturbations=[normal_noise,scaling]", "relative_to=halves")
    results = run_study(configured_with(BOARD, *SMALL, *words), Console()).results
    assert results.folder.parts[0] == "runs"
    assert results.rows.groupby("segmenter").size().to_dict() == {"halves": 8, "thirds": 3, "OneSegment": 8}
    assert {path: path.read_bytes() for path in board.iterdir() if path.is_file()} == before
    pd.testing.assert_frame_equal(Results.load(results.folder).tables["table"], results.tables["table"])


MY_PACKAGE = """
import numpy as np

def my_method(vertices, faces):
    return (vertices[:, 0] > 0).astype(int)

def with_k(vertices, faces, n_segments):
    return np.arange(len(vertices)) * n_segments // len(vertices)
"""


@pytest.fixture(scope="module")
def real(no_pictures, tmp_path_factory):
    """A board of three methods and two perturbations of two synthetic shapes, typed in a folder of one's own."""
    here = tmp_path_factory.mktemp("own")
    (here / "my_package.py").write_text(MY_PACKAGE)
    done = typed_command(
        here, "studies.run", BOARD, "dataset.models=[cup,hand]", "dataset.resolution=1000", "engine=serial",
        "segmenters=[heat_walk,my_package.my_method,my_package.with_k]", "perturbations=[holes,rotation]",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return here / "results" / "leaderboard" / "synthetic", done.stdout


def test_ones_own_methods_are_on_the_board(real):
    folder, printed = real
    assert "2 models, 3 methods, 2 perturbations at 5" in printed
    board = pd.read_csv(folder / "table.csv").set_index("segmenter")
    assert set(board.index) == {"HeatWalk", "my_method", "with_k"}
    assert board.loc["HeatWalk", "mce"] == 1
    assert board.loc["with_k", ["method", "k"]].tolist() == ["with k (k)", "told"]
    assert (board["failed_share"] == 0).all()
    assert (board["n"] == 22).all()
    assert board.loc["HeatWalk", "control_cp"] == pytest.approx(0, abs=1e-9)


def test_the_unperturbed_mesh_is_segmented_as_the_reference_was(real):
    rows = pd.read_parquet(real[0] / "trials.parquet")
    original = rows[rows["part"] == "original"]
    assert (original["change_percentage"] == 0).all()
    assert original.groupby("segmenter").size().tolist() == [2, 2, 2]
    np.testing.assert_allclose(original["loss_rand_index_error"].astype(float), 0, atol=1e-12)
    seconds = rows.groupby("draw")["seconds_perturb"].nunique()
    assert (seconds == 1).all()  # each variant was made once


def test_the_files_say_the_same(real):
    folder, _ = real
    board = pd.read_csv(folder / "table.csv").set_index("segmenter")
    document = json.loads((folder / "board.json").read_text("utf-8"))
    assert [method["name"] for method in document["methods"]] == board.index.tolist()
    walk = next(method for method in document["methods"] if method["name"] == "HeatWalk")
    assert walk["bibtex"].startswith("@article{benjamin2011heatwalk,")
    assert walk["options"]["time"] == 1
    for method in document["methods"]:
        assert method["scores"]["mce"] == pytest.approx(board.loc[method["name"], "mce"], rel=1e-5)
        assert method["scores"]["mce"] == method["perturbations"]["holes"]["corruption_error"]
        assert method["perturbations"]["rotation"].keys() == {"change_percentage", "failed", "missing"}  # a control
    latex = (folder / "board.tex").read_text("utf-8")
    assert latex.count(r"\\") == 1 + len(board)
    assert len({line.count("&") for line in latex.splitlines() if line.endswith(r"\\")}) == 1
    for name in ("by_perturbation", "controls", "methods"):
        assert pd.read_csv(folder / f"{name}.csv")["segmenter"].tolist() == board.index.tolist()
    assert {path.name for path in folder.glob("*.png")} == {
        f"{name}.png" for name in ("curves", "heat_map", "ranks", "scatter")
    }


def test_the_report_renders_the_same_board_from_rows_alone(real, tmp_path):
    shutil.copytree(real[0], tmp_path / "results" / "leaderboard" / "synthetic")
    folder = tmp_path / "results" / "leaderboard" / "synthetic"
    names = ("table.csv", "by_perturbation.csv", "controls.csv", "board.json", "board.tex")
    before = {name: (folder / name).read_bytes() for name in names}
    for name in names:
        (folder / name).unlink()
    done = typed_command(tmp_path, "studies.report")
    assert done.returncode == 0, done.stderr
    assert {name: (folder / name).read_bytes() for name in names} == before
    assert "2 models, 3 methods" in (tmp_path / "results" / "README.md").read_text("utf-8")


def test_rank_needs_rows_alone(real, tmp_path):
    shutil.copy(real[0] / "trials.parquet", tmp_path)
    found, expected = studies.rank(tmp_path), studies.rank(real[0])
    pd.testing.assert_frame_equal(found[["rank", "segmenter", "mce"]], expected[["rank", "segmenter", "mce"]])
    with pytest.raises(ValueError, match="no rows of a leaderboard"):
        studies.rank(tmp_path / "nothing")


def test_scores_of_stored_rows_are_those_of_the_table(real):
    rows = pd.read_parquet(real[0] / "trials.parquet")
    scores = Scores(rows, Options(controls=("rotation",)))
    change = rows[(rows["part"] == "holes")].groupby("segmenter")["change_percentage"].sum()
    board = scores.board.set_index("segmenter")
    for name in scores.methods:
        assert board.loc[name, "mce"] == pytest.approx(change[name] / change["HeatWalk"])


def test_the_least_recently_used_variants_are_dropped():
    made = []

    class Mesh:
        vertices = np.zeros(100, dtype=np.uint8)
        faces = counterpart = np.zeros(0)

    class Perturbed:
        mesh, counterpart = Mesh, Mesh.counterpart

    def make(name):
        return lambda: made.append(name) or (Perturbed, 0.0)

    variants = Variants(most_bytes=250)
    for name in "abacaab":
        variants.get(name, make(name))
    assert "".join(made) == "abcb"
